//! The command line: numbers, completions, and files that are not files.
