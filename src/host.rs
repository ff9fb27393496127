//! Host services: terminal, signals, files, and runs that are begun, saved and resumed.

pub mod logging;
pub mod maps;
pub mod outputs;
pub mod progress_bar;
pub mod report;
pub mod runs;
pub mod setup;
pub mod signals;
pub mod status;
pub mod waiting;
