//! All tests of the program in one binary, as each binary would link the whole library: file by
//! file with `cargo test --release --test program faults::`. Only the tests of the layout, which
//! link nothing, have their own.

#![allow(clippy::unwrap_used, reason = "a panic fails the test")]

#[cfg(unix)]
mod attack;
mod cli;
#[cfg(unix)]
mod compare;
mod export;
#[cfg(unix)]
mod faults;
mod formats;
#[cfg(unix)]
mod gym;
mod own_world;
mod plot;
mod ran;
mod records;
mod reproduce;
mod runs;
mod suite;
#[cfg(unix)]
mod support;
#[cfg(unix)]
mod terminal;
#[cfg(unix)]
mod tour;
mod waiting;
mod wheel;
