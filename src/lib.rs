//! gdg-tui trains agents that learn *distance* instead of reward, and shows how they learn.
//!
//! # The idea
//!
//! A critic D(s,g) learns the smallest number of transitions from state s to goal g, a model f(s,a) learns what an
//! action does, and an actor follows the gradient of D(f(s, mu(s,g)), g): the *goal-distance gradient* of
//! "Reinforcement Learning with Goal-Distance Gradient". Bridge points b with D(s,b) + D(b,g) < D(s,g) split hard
//! tasks into easy ones. No reward appears anywhere.
//!
//! # The layout
//!
//! Each module depends only on modules to its left:
//!
//! ```text
//! text, printing, pulse, faults, files, store <- map <- env <- learn <- bridge <- train <- engine <- view <- headless, tui, experiment
//! ```
//!
//! * [`text`]: makes external text safe to display. [`printing`]: standard output and error, for which nobody waits.
//!   [`pulse`]: what a run is doing, and the wish that it stops. [`files`]: reads and replaces files safely. [`faults`]: collects
//!   panics. [`store`]: named arrays and texts, the form of all saved state.
//! * [`map`]: grid maps and the true distances on them. Evaluation and display read these; learning never does.
//! * [`env`](mod@env): the interface of a world ([`env::Environment`]) and the built-in worlds, a folder each.
//! * [`learn`]: the interface of a learner ([`learn::Learner`]) and the built-in learners, a file each. Submodules:
//!   `data` (replay and batches), `networks` (inputs, weights, policies), `kernels` (dense loops and products; the only
//!   unsafe code is in [`learn::kernel`]) and `update` (losses and their hand-written gradients, optimiser steps,
//!   threads; [`learn::Reference`] computes the same by candle's autograd, for tests and for other devices).
//! * [`bridge`]: candidates and the paths between them that trajectories have taken, the bridge graph, following plans through
//!   it, the published search.
//! * [`train`]: [`train::Trainer`] runs agents and updates in one fixed order; evaluation, settings, checkpoints.
//!   [`train::Registry`] lists worlds and learners.
//! * [`engine`]: [`engine::Engine`] runs a trainer on its own thread for the interface: commands in, snapshots out.
//! * [`view`]: what the screen shows of a run, computed on its own thread: distance fields, the bridge graph, an agent that
//!   walks to the goal; a folder for each kind of scene; colours, contours and pictures.
//! * [`headless`] (one run), `tui` (one run, or two side by side) and [`experiment`] (many runs in parallel, whose results
//!   are kept: benchmark suites, the paper's figures): the front ends.
//!   [`cli`], [`setup`], [`runs`], [`report`], [`signals`], [`waiting`], [`logging`] and [`facts`] serve them; [`export_policy`] writes an actor for
//!   other programs, [`film`] an animation of how distance was learned;
//!   `frames` renders frames of recordings. `tui` and `frames` need the feature `tui`, which is on by default.
//!
//! # Add a world
//!
//! One folder, `src/env/NAME/`: a type that implements [`env::Environment`] (sizes and scales, how agents move, restart
//! and are saved; where available, tasks, true distances, coverage, places to film and a scene) and its [`env::WorldKind`]. Then one line in
//! [`env::WORLDS`]. A world that needs no file is opened by its name: `gdg-tui NAME`, or `gdg-tui NAME --no-ui` if nothing
//! draws it. Settings that suit it better than the preset's are its [`env::WorldKind::defaults`]. For the interface to draw
//! it, add a variant to [`env::Scene`], what is computed of it (`src/view/NAME/`, a line in `worker_for` of `src/view.rs`)
//! and how it is drawn and reacts (`src/tui/scene/NAME/`, its lines in `src/tui/scene.rs`). [`env::fetch_reach`] is a world
//! without maps.
//!
//! # Add a learner
//!
//! One file, `src/learn/NAME.rs`: a type that implements [`learn::Learner`] (an update from the replay, a
//! [`learn::Policy`] that offers D and mu, saving and loading) and its [`learn::LearnerKind`]; a learner with a Q function
//! converts Q(s, mu(s,g), g) to steps, as `src/learn/ddpg/` does. Then one line in [`learn::LEARNERS`], and one in [`train::METHODS`] for each combination with a planner that should have its own name.
//! `examples/own_world.rs` does both in another crate.
//!
//! # Add a pane
//!
//! A variant of `tui::panes::Pane` with its name, a file in `src/tui/render/` that draws it from the screen's state, its
//! line in `src/tui/render/side.rs`, and a binding in the table of `src/tui/action.rs`, from which help and command palette
//! are built. Slow computations belong in [`view`].
//!
//! # Add a figure
//!
//! An entry in `FIGURES` in `src/experiment/reproduce/figures.rs` (map or world, methods, what it shows) and, for a new method, one in
//! `methods.rs` beside it. Another kind of chart is a variant of `Shows` with its lines in `curves.rs`, another kind of
//! picture one in `maps.rs`; files, report and terminal follow. What a figure needs of the trained networks is measured in
//! `src/experiment/measure.rs`.
//!
//! # Invariants
//!
//! Same seed, same run, bit for bit: for any number of threads, with or without a front end, with or without evaluations,
//! resumed or not. Each purpose has its own random stream; a batch is split into parts that do not depend on the number
//! of threads and are summed in order.

#[forbid(unsafe_code)]
pub mod bridge;
#[forbid(unsafe_code)]
pub mod cli;
#[forbid(unsafe_code)]
pub mod engine;
#[forbid(unsafe_code)]
pub mod env;
#[forbid(unsafe_code)]
pub mod experiment;
#[forbid(unsafe_code)]
pub mod export_policy;
#[forbid(unsafe_code)]
pub mod facts;
#[forbid(unsafe_code)]
pub mod faults;
#[forbid(unsafe_code)]
pub mod files;
#[forbid(unsafe_code)]
pub mod film;
#[cfg(feature = "tui")]
#[forbid(unsafe_code)]
pub mod frames;
#[forbid(unsafe_code)]
pub mod headless;
pub mod learn;
#[forbid(unsafe_code)]
pub mod logging;
#[forbid(unsafe_code)]
pub mod map;
#[forbid(unsafe_code)]
pub mod printing;
#[forbid(unsafe_code)]
pub mod pulse;
#[forbid(unsafe_code)]
pub mod report;
#[forbid(unsafe_code)]
pub mod runs;
#[forbid(unsafe_code)]
pub mod setup;
#[forbid(unsafe_code)]
pub mod signals;
#[forbid(unsafe_code)]
pub mod store;
#[forbid(unsafe_code)]
pub mod text;
#[forbid(unsafe_code)]
pub mod train;
#[cfg(feature = "tui")]
#[forbid(unsafe_code)]
pub mod tui;
#[forbid(unsafe_code)]
pub mod view;
#[forbid(unsafe_code)]
pub mod waiting;
