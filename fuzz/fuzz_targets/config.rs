//! Parses arbitrary text as a settings file and as the interface's configuration.
#![no_main]

use gdg::train::{Preset, settings_from_text};
use gdg_tui::tui::parse_config;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Err(error) = settings_from_text(Preset::Default, "fuzzed", text) {
        assert!(error.to_string().len() < 2_000);
    }
    if let Err(error) = parse_config("fuzzed", text) {
        assert!(error.to_string().len() < 2_000);
    }
});
