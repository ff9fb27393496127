//! gdg-tui trains agents that learn *distance* instead of reward, and shows how they do it.
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
//! Modules know those to their left and none to their right:
//!
//! ```text
//! text, faults, files, store <- map <- env <- learn <- bridge <- train <- view <- headless, tui, ablate
//! ```
//!
//! * [`text`]: what comes from outside, made safe to show. [`files`]: how files are read and replaced.
//!   [`faults`]: what becomes of threads that panic. [`store`]: named arrays and texts, what runs are saved as.
//! * [`map`]: files to grids, and the true distances on them. Evaluation and display read these; learning never does.
//! * [`env`](mod@env): a world of many agents behind an interface that says how states, goals and actions are sized
//!   and scaled; the point maze.
//! * [`learn`]: networks, losses, replay. [`learn::product`] multiplies by weights that are packed once a step,
//!   [`learn::kernel`] holds the other dense loops and the only unsafe code, `learn::mlp` a perceptron on flat
//!   parameters ([`learn::fused_mlp`] is the same as one operation on candle's tape), `learn::losses` the three losses
//!   and their gradients by hand; [`learn::Reference`] computes the same by candle's autograd: what the tests hold them
//!   against, and what updates on other devices (`learn::tape`) are made of.
//! * [`bridge`]: candidates, what experience shows between them, the graph, the planner, the published search.
//! * [`train`]: [`train::Trainer`] runs agents and updates in one fixed order, with bridge graphs built beside it and
//!   taken up at fixed updates; evaluation, settings, checkpoints; and [`train::Engine`], which runs a trainer on a
//!   thread of its own for a front end.
//! * [`view`]: what there is to see of a run, computed on a thread of its own: fields of distances, the bridge graph,
//!   an agent that walks to the goal.
//! * [`headless`], [`tui`] and [`ablate`]: the front ends. [`cli`], [`setup`], [`signals`], [`logging`] and [`facts`] serve them;
//!   [`bench`](mod@bench) measures; [`frames`] draws moments of recordings.
//!
//! # Add a world
//!
//! One folder, `src/env/NAME/`: a type that implements [`env::Environment`] (sizes and scales, how agents move, restart
//! and are saved; tasks, truth, coverage and a picture where there are any) and its [`env::WorldKind`]. Then one line in
//! [`env::WORLDS`]. A world that needs no file is opened by its name: `gdg-tui NAME --no-ui`. For the interface to draw
//! it, add a variant to [`env::Scene`].
//!
//! # Add a learner
//!
//! One file, `src/learn/NAME.rs`: a type that implements [`learn::Learner`] (an update from the replay, a
//! [`learn::Policy`] that offers D and mu, saving and loading) and its [`learn::LearnerKind`]; a learner with a Q function
//! offers D(s,g) = -Q(s, mu(s,g), g). Then one line in [`learn::LEARNERS`], and one in [`train::METHODS`] for each
//! combination with a planner that deserves a name of its own. `examples/own_world.rs` does both from outside.
//!
//! # Add a pane
//!
//! A variant of `tui::panes::Pane` with its name, a file in `src/tui/render/` that draws it from the screen's state, its
//! line in `src/tui/render/side.rs`, and a binding in the table of `src/tui/action.rs`, which the help and the list of
//! everything read. What takes long to compute belongs to [`view`].
//!
//! # What is held to
//!
//! Same seed, same run, bit for bit: whatever the number of threads, with or without a front end, evaluated or not,
//! resumed or not. Each purpose has its own random stream; a batch is split into parts that do not depend on the number
//! of threads and are summed in their order.

#[forbid(unsafe_code)]
pub mod ablate;
#[forbid(unsafe_code)]
pub mod bench;
#[forbid(unsafe_code)]
pub mod bridge;
#[forbid(unsafe_code)]
pub mod cli;
#[forbid(unsafe_code)]
pub mod env;
#[forbid(unsafe_code)]
pub mod facts;
#[forbid(unsafe_code)]
pub mod faults;
#[forbid(unsafe_code)]
pub mod files;
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
pub mod report;
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
#[forbid(unsafe_code)]
pub mod tui;
#[forbid(unsafe_code)]
pub mod view;
