//! Options of the interface.

use std::path::PathBuf;

use clap::Args;

use crate::host::logging::LogLevel;
use crate::tui::{InterfaceOptions, Marker};

/// Options of the interface.
#[derive(Clone, Debug, Args)]
pub struct InterfaceArgs {
    /// Configuration file for theme, keys etc., instead of the default one
    #[arg(long, value_name = "FILE")]
    pub ui_config: Option<PathBuf>,

    /// What the map is drawn with [default: auto: pixels where the terminal shows pictures, else
    /// half blocks or quadrants]
    #[arg(long, value_name = "MARKER", value_enum)]
    pub marker: Option<Marker>,
}

/// Options of commands that only show something.
#[derive(Debug, Args)]
pub struct ScreenArgs {
    /// Options of the interface.
    #[command(flatten)]
    pub interface: InterfaceArgs,

    /// Minimum severity written to the log file; the help screen (?) shows its path
    #[arg(long, value_name = "LEVEL", value_enum, default_value_t = LogLevel::Info)]
    pub log_level: LogLevel,
}

impl InterfaceArgs {
    /// Returns the options of the interface.
    pub fn options(&self) -> InterfaceOptions {
        InterfaceOptions { config: self.ui_config.clone(), marker: self.marker }
    }
}
