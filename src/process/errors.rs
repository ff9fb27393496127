//! Prints errors for the user.

use miette::{
    Diagnostic, IntoDiagnostic, MietteError, MietteSpanContents, Report, SourceCode, SourceSpan,
    SpanContents, WrapErr, miette,
};
use textwrap::{WordSeparator, WordSplitter};

use gdg::map::MapError;
use gdg::printing::{eprint_raw, print_text};
use gdg::text::{Excerpt, sanitized, sanitized_lines, terminal_obeys_escapes, truncated};
use gdg::train::{CheckpointError, ConfigError, TrainError};

/// Maximum number of characters of a message and of each of its causes.
const MOST: usize = 2000;

/// Sets how errors are printed: without colours where the terminal has none, and in lines that break
/// only at blanks, so that names and paths can be copied.
pub fn set_up() {
    let handler = |_: &_| -> Box<dyn miette::ReportHandler> {
        let options = miette::MietteHandlerOpts::new()
            .word_separator(WordSeparator::AsciiSpace)
            .word_splitter(WordSplitter::NoHyphenation)
            .break_words(false);
        Box::new(if terminal_obeys_escapes() {
            options.build()
        } else {
            options.color(false).terminal_links(false).build()
        })
    };
    // It is the first hook.
    let _ = miette::set_hook(Box::new(handler));
}

/// Prints to standard output, made safe to display. An early close (`| head`) is not an error.
pub fn print(text: &str) -> Result<(), Report> {
    print_text(&sanitized_lines(text)).into_diagnostic().wrap_err("standard output")
}

pub fn print_error(error: &Report) {
    let text = format!("{:?}", Report::new(ExplainedError::sanitized(error)));
    // In the words of clap, for errors in the command line.
    let text = text.trim().replacen(['\u{d7}', 'x'], "error:", 1);
    eprint_raw(&text.replacen("  help: ", "   tip: ", 1));
}

/// An error with a hint and, for a file, an excerpt of the offending part.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{message}")]
pub struct ExplainedError {
    message: String,
    #[help]
    help: Option<String>,
    #[source_code]
    excerpt: Option<QuotedExcerpt>,
    #[label("here")]
    span: Option<SourceSpan>,
    #[source]
    cause: Option<Box<Self>>,
}

/// An excerpt as miette renders it.
#[derive(Clone, Debug)]
struct QuotedExcerpt(Excerpt);

impl ExplainedError {
    pub fn report(message: String, help: String, excerpt: Option<Excerpt>) -> Report {
        let span = excerpt.as_ref().map(|excerpt| excerpt.span.into());
        let excerpt = excerpt.map(QuotedExcerpt);
        Report::new(Self { message, help: Some(help), excerpt, span, cause: None })
    }

    /// Returns an error whose texts, which may quote external input, are safe to display.
    fn sanitized(error: &Report) -> Self {
        let plain = |text: &dyn ToString, cause| {
            let message = sanitized_message(&text.to_string());
            Self { message, help: None, excerpt: None, span: None, cause }
        };
        let causes: Vec<_> = error.chain().skip(1).collect();
        let cause =
            causes.iter().rev().fold(None, |cause, text| Some(Box::new(plain(text, cause))));
        let own = error.downcast_ref::<Self>();
        Self {
            help: error.help().map(|help| sanitized_message(&help.to_string())),
            excerpt: own.and_then(|own| own.excerpt.clone()),
            span: own.and_then(|own| own.span),
            ..plain(error, cause)
        }
    }
}

pub fn from_map_error(error: Box<MapError>) -> Report {
    ExplainedError::report(error.to_string(), error.help, error.excerpt)
}

pub fn from_data_error(error: impl Into<TrainError>) -> Report {
    let help = "--data takes .npz files with observations, actions and terminals: \
                gdg-tui export-data writes them, and OGBench has some";
    miette!(help = help, "{}", sanitized(&error.into().to_string()))
}

pub fn from_config_error(error: Box<ConfigError>) -> Report {
    ExplainedError::report(error.to_string(), error.help, error.excerpt)
}

pub fn from_checkpoint_error(error: CheckpointError) -> Report {
    ExplainedError::report(error.to_string(), error.help, None)
}

impl SourceCode for QuotedExcerpt {
    fn read_span<'a>(
        &'a self,
        span: &SourceSpan,
        context_lines_before: usize,
        context_lines_after: usize,
    ) -> Result<Box<dyn SpanContents<'a> + 'a>, MietteError> {
        let Excerpt { file, line, first_column, text, .. } = &self.0;
        // If asked for no context lines, miette expects the contents to start at the span itself.
        let alone = context_lines_before == 0 && context_lines_after == 0;
        let from = if alone { span.offset().min(text.len()) } else { 0 };
        let column = first_column + text[..from].chars().count();
        let data = &text.as_bytes()[from..];
        let span = (from, data.len()).into();
        Ok(Box::new(MietteSpanContents::new_named(file.clone(), data, span, *line, column, 1)))
    }
}

fn sanitized_message(text: &str) -> String {
    if text.chars().count() > MOST { truncated(text, MOST) } else { sanitized_lines(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_show_causes_and_help_without_control_characters() {
        let cause: Result<(), _> = Err(std::io::Error::other("cause\x1b]0;x\x07"));
        let error = cause.into_diagnostic().wrap_err("outer\u{9b}31m").expect_err("an error");
        let shown = ExplainedError::sanitized(&error.wrap_err("file\x1b[2J\nname"));
        let text = format!("{:?}", Report::new(shown));
        let parts = ["file?[2J", "outer¿31m", "cause?]0;x?"];
        assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        let help = ExplainedError::sanitized(&miette!(help = "do\x07 that", "what"));
        assert_eq!(help.help.as_deref(), Some("do? that"));
        let long = ExplainedError::sanitized(&Report::msg("x".repeat(50_000_000)));
        assert!(long.message.len() <= MOST);
    }

    #[test]
    fn an_error_far_to_the_right_shows_only_its_surroundings() {
        let row = [".".repeat(1900).as_str(), "x", &".".repeat(99)].concat();
        let error = gdg::map::parse_map("wide", row.as_bytes()).expect_err("an unknown character");
        let shown = format!("{:?}", from_map_error(error));
        assert!(shown.lines().all(|l| l.chars().count() < 120), "{shown}");
        assert!(shown.contains("wide:1:1901"), "{shown}");
    }
}
