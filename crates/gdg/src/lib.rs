//! Learns *distance* instead of reward, in any goal-conditioned world, without a terminal.
//!
//! # The idea
//!
//! A critic D(s,g) learns the smallest number of transitions from state s to goal g, a model f(s,a)
//! learns what an action does, and an actor follows the gradient of D(f(s, mu(s,g)), g): the
//! *goal-distance gradient* of "Reinforcement Learning with Goal-Distance Gradient". Bridge points
//! b with D(s,b) + D(b,g) < D(s,g) split hard tasks into easy ones. No reward appears anywhere.
//!
//! # The layout
//!
//! Each module depends only on modules to its left (`tests/layers` checks it):
//!
//! ```text
//! text, printing, faults, job, files, store, settings <- map <- env <- learn <- bridge <- train
//!     <- engine <- draw <- viewer
//! ```
//!
//! * [`printing`]: standard output and error, written by threads of their own. [`job`]: progress
//!   of a run, and the request to stop it. [`text`]: makes external text safe to display.
//!   [`files`]: reads and replaces files safely. [`faults`]: collects panics. [`store`]: named
//!   arrays and texts, the form of all saved state. [`settings`]: what a setting is, and the macro
//!   that defines them, one entry each.
//! * [`map`]: grid maps and the true distances on them. Evaluation and display read these; learning
//!   never does.
//! * [`env`](mod@env): the interface of a world ([`env::Environment`], with optional
//!   [`env::Abilities`]) and the built-in worlds, a folder each.
//! * [`learn`]: the interface of a learner ([`learn::Learner`]) and the built-in ones, variants of
//!   [`learn::NetworkLearner`]. Submodules, in their order: `kernels` (dense loops and products; the
//!   only unsafe code is in `learn::kernels`), `networks` (inputs, weights, what networks compute
//!   together, policies), `data` (replay, batches, known distances and what they add) and `update`
//!   (losses and their hand-written gradients, optimiser steps, threads). Tests compare these with
//!   `src/learn/reference.rs`, the same in plain arithmetic.
//! * [`bridge`]: candidates and the paths between them that trajectories have taken, the bridge
//!   graph, following plans through it, the published search.
//! * [`train`]: [`train::Trainer`] runs agents and updates in one fixed order, and
//!   [`train::TrainingLoop`] says what is due in between; evaluation, settings, checkpoints.
//!   [`train::Registry`] lists worlds and learners.
//! * [`engine`]: [`engine::Engine`] runs a trainer on its own thread: commands in, snapshots out.
//! * [`draw`]: colours, contours and pictures. [`viewer`]: what a screen shows of a run, computed
//!   on its own thread: distance fields, the bridge graph, an agent that walks to the goal.
//!
//! # A run
//!
//! ```
//! use gdg::env::PointMaze;
//! use gdg::train::{Method, Preset, Registry, Run, Trainer};
//!
//! let map = gdg::map::builtin("trap").expect("built in");
//! let mut settings = Preset::Default.settings();
//! settings.learn.hidden = 16;
//! let run = Run { method: Method::default(), preset: Preset::Default, seed: 1, settings };
//! let mut trainer = Trainer::new(run, &PointMaze::new(map.into(), 0), &Registry::builtin(), 1)?;
//! for _ in 0..100 {
//!     trainer.tick()?;
//! }
//! assert_eq!(trainer.counters().env_steps, 100 * trainer.world().agents() as u64);
//! # Ok::<(), gdg::train::TrainError>(())
//! ```
//!
//! `examples/own_world.rs` trains a world and a learner that are not part of this crate.
//!
//! # Add a world
//!
//! One folder, `src/env/NAME/`: a type that implements [`env::Environment`] (sizes and scales, goals,
//! how agents move and restart: seven methods) and its [`env::WorldKind`]. Then one line in
//! [`env::WORLDS`]. That is enough to train and evaluate: `gdg-tui NAME --no-ui`, if the world needs
//! no file. Settings that suit it better than the preset's are its [`env::WorldKind::defaults`].
//!
//! Everything else is optional: [`env::Environment::set_full_state`] puts agents back where they
//! were; the [`env::Abilities`] are traits for records, episodes, evaluation tasks and true
//! distances, coverage, edits, and display (`docs/developing.md` says how it is drawn).
//!
//! # Add a learner
//!
//! One file, `src/learn/NAME.rs`: a type that implements [`learn::Learner`] (an update from the
//! replay, a [`learn::Policy`] that offers D and mu, saving and loading) and its
//! [`learn::LearnerKind`]; a learner with a Q function converts Q(s, mu(s,g), g) to steps, as
//! `src/learn/networks/returns.rs` does. Then one line in [`learn::LEARNERS`], and one in
//! [`train::METHODS`] for each combination with a planner that should have its own name.
//!
//! # Invariants
//!
//! Same seed, same run, bit for bit: for any number of threads, with or without a front end, with
//! or without evaluations, resumed or not. Each purpose has its own random stream; a batch is split
//! into parts that do not depend on the number of threads and are summed in order.
#![allow(clippy::missing_errors_doc, reason = "errors say what is wrong")]

pub mod bridge;
pub mod draw;
pub mod engine;
pub mod env;
pub mod faults;
pub mod files;
pub mod job;
pub mod learn;
pub mod map;
pub mod printing;
pub mod settings;
pub mod store;
pub mod text;
pub mod train;
pub mod viewer;
