//! Host services: terminal, signals, files, and runs that are begun, saved and resumed.

pub mod errors;
pub mod find_maps;
pub mod logging;
pub mod outputs;
pub mod saves;
pub mod setup;
pub mod signals;
pub mod values;
pub mod waiting;

/// The exit status of a failure while running; of bad usage or input; and when `--require-success`
/// is not reached.
pub const EXIT_FAILURE: u8 = 1;
pub const EXIT_BAD_INPUT: u8 = 2;
pub const EXIT_NOT_REACHED: u8 = 3;
