//! File access: regular files only, within size limits, replaced atomically.

mod kind;
mod names;
mod read;
mod verified;
mod write;

pub use kind::{Format, Mismatch, Wanted};
pub use names::{has_extension, is_hidden};
pub use read::{open, open_or_create, read, read_text};
pub use verified::{backup_path, write_verified};
pub use write::{check_writable, unused_path, write_atomically, write_to_unused};
