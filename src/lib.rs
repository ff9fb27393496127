//! gdg-tui trains agents that learn *distance* instead of reward, and shows how they learn. The
//! learning is done by the library [`gdg`]; this crate is the program: the command line, and three
//! front ends.
//!
//! # The layout
//!
//! * [`host`]: what the program needs of the machine: terminal, signals, files, saved runs.
//! * `figure`: curves and maps at the size of print, as SVG, PNG and PDF.
//! * [`headless`] (one run), [`tui`] (one run, or two side by side) and `experiment` (many runs in
//!   parallel, whose results are kept: benchmark suites, the paper's figures) are the front ends.
//! * [`cli`] parses the command line into what they need; [`commands`] has a file for each command.
//!
//! # Add a pane
//!
//! A variant of `tui::panes::Pane` with its name, a file in `src/tui/render/` that draws it from
//! the screen's state, its line in `src/tui/render/side.rs`, and a binding in
//! `src/tui/action/table.rs`, from which help and command palette are built. Slow computations
//! belong in [`gdg::viewer`].
//!
//! # Add a figure
//!
//! An entry in `FIGURES` in `src/experiment/figures/catalogue.rs`: map or world, methods, what it
//! shows. Another kind of chart is a variant of `Shows` with its lines in `curves.rs`, another kind
//! of picture one in `maps.rs`; files, report and terminal follow. What a figure needs of the
//! trained networks is measured in `src/experiment/measure.rs`.

#![forbid(unsafe_code)]
#![allow(clippy::missing_errors_doc, reason = "errors are reports, which say what is wrong")]

pub mod cli;
pub mod commands;
pub(crate) mod experiment;
pub(crate) mod figure;
pub mod headless;
pub mod host;
pub mod tui;
