//! What every command needs as a process: errors for people, the log file, signals, progress of what
//! takes long, and statuses to end with.

pub mod errors;
pub mod logging;
pub mod signals;
pub mod waiting;

/// The exit status of a failure while running; of bad usage or input; and when `--require-success`
/// is not reached.
pub const EXIT_FAILURE: u8 = 1;
pub const EXIT_BAD_INPUT: u8 = 2;
pub const EXIT_NOT_REACHED: u8 = 3;
