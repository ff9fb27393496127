//! Parses arbitrary bytes as a scenario of the trap.
#![no_main]

use std::sync::LazyLock;

use gdg::map::{Grid, Scenario, builtin};
use libfuzzer_sys::fuzz_target;

static TRAP: LazyLock<Grid> = LazyLock::new(|| builtin("trap").expect("built in"));

fuzz_target!(|bytes: &[u8]| {
    let tasks = Scenario::parse("fuzzed", bytes).and_then(|scenario| {
        let _ = (scenario.map_name(), scenario.other_map(&TRAP));
        let tasks = scenario.tasks(&TRAP)?;
        scenario.check_paths(&tasks, &TRAP)?;
        Ok(tasks)
    });
    match tasks {
        Ok(tasks) => {
            assert!(tasks.iter().all(|task| TRAP.is_free(task.start) && TRAP.is_free(task.goal)))
        }
        Err(error) => assert!(!error.to_string().is_empty() && !error.help.is_empty()),
    }
});
