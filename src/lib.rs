//! gdg-tui trains agents that learn *distance* instead of reward, and shows how they learn. The
//! learning is done by the library [`gdg`]; this crate is the program: the command line, and three
//! front ends.
//!
//! # The layout
//!
//! * [`process`]: errors for people, the log file, signals, progress of what takes long.
//! * [`setup`]: a run from options: its map, values, trainer, and the files it is saved to.
//! * `figure`: curves and maps at the size of print, as SVG, PNG and PDF.
//! * [`headless`] (one run), [`tui`] (one run, or two side by side) and `experiment` (many runs in
//!   parallel, whose results are kept: benchmark suites, the paper's figures) are the front ends.
//! * [`cli`] parses the command line into what they need; [`commands`] has what each does.
//!
//! `docs/developing.md` says what to touch for a pane, an action, a command or a figure.

#![forbid(unsafe_code)]
#![allow(clippy::missing_errors_doc, reason = "errors are reports, which say what is wrong")]

pub mod cli;
pub mod commands;
pub(crate) mod experiment;
pub(crate) mod figure;
pub mod headless;
pub mod process;
pub mod setup;
pub mod tui;
