//! File access: regular files only, within size limits, replaced atomically.

mod read;
mod verified;
mod write;

pub use read::{open, read, read_text};
pub use verified::{backup_of, write_verified};
pub use write::{check_target, unused, write_fresh, write_whole};
