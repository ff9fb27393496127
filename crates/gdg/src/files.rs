//! File access: regular files only, within size limits, replaced atomically.

mod derived;
mod facts;
mod kind;
mod lock;
mod names;
mod read;
mod verified;
mod write;

pub use derived::{backup_path, named};
pub use facts::FileFacts;
pub use kind::{Format, Mismatch, Wanted};
pub use lock::{LockFile, is_in_use, mark_in_use, while_locked};
pub use names::{has_extension, is_hidden};
pub use read::{open, open_or_create, read, read_text};
pub use verified::write_verified;
pub use write::{
    check_name, check_replaceable, check_writable, unused_path, write_atomically, write_to_unused,
    write_unlinked,
};
