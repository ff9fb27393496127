//! Signals, and output that nobody reads: neither loses a run.
