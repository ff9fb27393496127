//! Prints errors for the user.

use std::error::Error;
use std::fmt;

use miette::{Diagnostic, LabeledSpan, MietteError, MietteSpanContents, Report, SourceCode, SourceSpan, SpanContents};

use crate::map::MapError;
use crate::text::{Excerpt, plain_lines, shortened, tell};
use crate::train::{CheckpointError, ConfigError};

/// Maximum number of characters of a message and of each of its causes.
const SHOWN: usize = 2000;

/// Prints an error to standard error; ignores write errors.
pub fn show(error: Report) {
    tell(format!("{:?}", Report::new(Shown::from(error))).trim_end());
}

/// An error with a hint and, for a file, an excerpt of the offending part.
#[derive(Debug, thiserror::Error)]
#[error("{message}")]
pub struct Explained {
    message: String,
    help: String,
    excerpt: Option<Quoted>,
}

/// An excerpt as miette renders it.
#[derive(Debug)]
struct Quoted(Excerpt);

impl Explained {
    /// Creates a report of an error that quotes `excerpt`.
    pub fn report(message: String, help: String, excerpt: Option<Excerpt>) -> Report {
        Report::new(Self { message, help, excerpt: excerpt.map(Quoted) })
    }
}

/// Turns a map error into a report.
pub fn of_map(error: Box<MapError>) -> Report {
    Explained::report(error.to_string(), error.right, error.excerpt)
}

/// Turns an error in settings into a report.
pub fn of_config(error: Box<ConfigError>) -> Report {
    Explained::report(error.to_string(), error.right, error.excerpt)
}

/// Turns an error about a checkpoint into a report.
pub fn of_checkpoint(error: CheckpointError) -> Report {
    Explained::report(error.to_string(), error.right, None)
}

impl Diagnostic for Explained {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        Some(Box::new(&self.help))
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.excerpt.as_ref().map(|e| e as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let Quoted(excerpt) = self.excerpt.as_ref()?;
        Some(Box::new(std::iter::once(LabeledSpan::new_with_span(Some("here".to_owned()), excerpt.span))))
    }
}

impl SourceCode for Quoted {
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
        Ok(Box::new(MietteSpanContents::new_named(file.clone(), data, (from, data.len()).into(), *line, column, 1)))
    }
}

/// An error whose texts, which may quote external input, are safe to display.
#[derive(Debug)]
struct Shown {
    message: String,
    help: Option<String>,
    cause: Option<Cause>,
    error: Report,
}

/// A cause of an error.
#[derive(Debug)]
struct Cause {
    message: String,
    cause: Option<Box<Cause>>,
}

fn safe(text: &str) -> String {
    if text.chars().count() > SHOWN { shortened(text, SHOWN) } else { plain_lines(text) }
}

impl From<Report> for Shown {
    fn from(error: Report) -> Self {
        let causes: Vec<String> = error.chain().skip(1).map(|cause| safe(&cause.to_string())).collect();
        let chained = |cause: Option<Cause>, message| Some(Cause { message, cause: cause.map(Box::new) });
        Self {
            message: safe(&error.to_string()),
            help: error.help().map(|help| safe(&help.to_string())),
            cause: causes.into_iter().rev().fold(None, chained),
            error,
        }
    }
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl Error for Shown {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_ref().map(|cause| cause as &dyn Error)
    }
}

impl Error for Cause {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.cause.as_deref().map(|cause| cause as &dyn Error)
    }
}

impl Diagnostic for Shown {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.error.source_code()
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.error.labels()
    }
}

#[cfg(test)]
mod tests {
    use miette::{IntoDiagnostic, WrapErr};

    use super::*;

    #[test]
    fn errors_show_causes_and_help_without_control_characters() {
        let cause: Result<(), _> = Err(std::io::Error::other("cause\x1b]0;x\x07"));
        let error = cause.into_diagnostic().wrap_err("outer\u{9b}31m").expect_err("an error");
        let shown = Shown::from(error.wrap_err("file\x1b[2J\nname"));
        let text = format!("{:?}", Report::new(shown));
        assert!(["file?[2J", "outer¿31m", "cause?]0;x?"].iter().all(|part| text.contains(part)), "{text}");
        let help = Shown::from(miette::miette!(help = "do\x07 that", "what"));
        assert_eq!(help.help.as_deref(), Some("do? that"));
        assert!(Shown::from(Report::msg("x".repeat(50_000_000))).message.len() <= SHOWN);
    }
}
