//! Exit statuses.

/// Of a failure while running.
pub const EXIT_FAILURE: u8 = 1;

/// Of bad usage or input.
pub const EXIT_BAD_INPUT: u8 = 2;

/// When `--require-success` is not reached.
pub const EXIT_NOT_REACHED: u8 = 3;
