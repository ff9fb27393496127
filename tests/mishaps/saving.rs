//! File systems, names and other programs: what was saved is never lost.
