//! Parses arbitrary bytes as a map in any format: a grid that each format keeps as it says, or an
//! error.
#![no_main]

use std::path::Path;

use gdg::map::{FORMATS, parse_map};
use libfuzzer_sys::fuzz_target;

/// Larger maps are not written and read back: it takes too long.
const FEW_CELLS: usize = 1_000;

fuzz_target!(|bytes: &[u8]| match parse_map("fuzzed", bytes) {
    Ok(grid) if grid.free().len() > FEW_CELLS => {}
    Ok(grid) => {
        for format in &FORMATS {
            let file = Path::new("fuzzed").with_extension(format.endings[0]);
            // With an image beside it, a file cannot be read from memory.
            if let [(path, bytes)] = &format.write(&grid, &file)[..] {
                let again = parse_map(&path.to_string_lossy(), bytes).expect("what was written");
                assert_eq!(again.free(), grid.free(), "{}", format.name);
                assert!(again == grid || !format.lost(&grid).is_empty(), "{}", format.name);
            }
        }
    }
    Err(error) => assert!(!error.to_string().is_empty() && !error.help.is_empty()),
});
