//! What the program needs of the machine that it runs on: terminal, signals, files, and the runs
//! that are begun, saved and resumed there.

pub mod logging;
pub mod maps;
pub mod progress_bar;
pub mod report;
pub mod runs;
pub mod setup;
pub mod signals;
pub mod status;
pub mod waiting;
