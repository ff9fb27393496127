//! Parses arbitrary bytes as a map in any format: a grid that survives printing and parsing, or an
//! error.
#![no_main]

use gdg::map::{parse_map, print_ascii};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| match parse_map("fuzzed", bytes) {
    Ok(grid) => {
        let again =
            parse_map("fuzzed", print_ascii(&grid).as_bytes()).expect("what was printed is a map");
        assert_eq!(again.free(), grid.free());
    }
    Err(error) => assert!(!error.to_string().is_empty() && !error.help.is_empty()),
});
