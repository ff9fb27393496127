//! All tests of the library's interface in one binary.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

mod core_world;
mod data;
mod fetch_reach;
mod maps;
mod ogbench;
mod rivals;
mod runs;
mod support;
mod training;
