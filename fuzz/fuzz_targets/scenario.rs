//! Parses arbitrary bytes as a scenario of the trap.
#![no_main]

use std::sync::LazyLock;

use gdg_tui::map::{Grid, builtin, parse_scenario_bytes};
use libfuzzer_sys::fuzz_target;

static TRAP: LazyLock<Grid> = LazyLock::new(|| builtin("trap").expect("built in"));

fuzz_target!(|bytes: &[u8]| match parse_scenario_bytes("fuzzed", bytes, &TRAP) {
    Ok(tasks) => assert!(tasks.iter().all(|task| TRAP.is_free(task.start) && TRAP.is_free(task.goal))),
    Err(error) => assert!(!error.to_string().is_empty() && !error.right.is_empty()),
});
