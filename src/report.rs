//! Prints errors for the user.

use std::error::Error;
use std::fmt;

use miette::{Diagnostic, LabeledSpan, Report, SourceCode};

use crate::text::{plain_lines, shortened, tell};

/// Maximum number of characters of a message and of each of its causes.
const SHOWN: usize = 2000;

/// Prints an error to standard error; ignores write errors.
pub fn show(error: Report) {
    tell(format!("{:?}", Report::new(Shown::from(error))).trim_end());
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
