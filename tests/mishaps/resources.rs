//! Limits of memory, time and numbers.
