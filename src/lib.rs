//! gdg-tui trains agents that learn *distance* instead of reward, and shows how they learn. What
//! learns is the library [`gdg`]; this crate is the program: the command line, and three front
//! ends.
//!
//! # The layout
//!
//! * [`headless`] (one run), `tui` (one run, or two side by side) and [`experiment`] (many runs in
//!   parallel, whose results are kept: benchmark suites, the paper's figures) are the front ends.
//! * [`cli`], [`setup`], [`runs`], [`report`], [`signals`], [`waiting`], [`logging`] and [`facts`]
//!   serve them; [`export_policy`] writes an actor for other programs, [`film`] an animation of how
//!   distance was learned, and `frames` renders frames of recordings. `tui` and `frames` need the
//!   feature `tui`, which is on by default.
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
//! An entry in `FIGURES` in `src/experiment/reproduce/figures.rs` (map or world, methods, what it
//! shows), its title in `src/cli/reproduce.rs` and, for a new method, an entry in `methods.rs`.
//! Another kind of chart is a variant
//! of `Shows` with its lines in `curves.rs`, another kind of picture one in `maps.rs`; files,
//! report and terminal follow. What a figure needs of the trained networks is measured in
//! `src/experiment/measure.rs`.

#![forbid(unsafe_code)]

pub mod cli;
pub mod experiment;
pub mod export_policy;
pub mod facts;
pub mod film;
#[cfg(feature = "tui")]
pub mod frames;
pub mod headless;
pub mod logging;
mod progress_bar;
pub mod report;
pub mod runs;
pub mod setup;
pub mod signals;
#[cfg(feature = "tui")]
pub mod tui;
pub mod waiting;
