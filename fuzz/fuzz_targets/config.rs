//! Reads arbitrary text as a settings file, and parses it as the interface's configuration.
#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use gdg::train::{Overrides, Preset, settings_from};
use gdg_tui::tui::parse_config;
use gdg_tui_fuzz::memory_file;
use libfuzzer_sys::fuzz_target;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| memory_file("json"));

fuzz_target!(|text: &str| {
    std::fs::write(&*FILE, text).expect("written");
    let overrides = Overrides { config: Some(&FILE), ..Overrides::default() };
    if let Err(error) = settings_from(Preset::Default, &overrides) {
        assert!(error.to_string().len() < 2_000);
    }
    if let Err(error) = parse_config("fuzzed", text) {
        assert!(error.to_string().len() < 2_000);
    }
});
