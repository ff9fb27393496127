//! The styles of text.

use ratatui::style::{Modifier, Style};

/// Headings, keys and other important text.
pub const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);

pub const DIM: Style = Style::new().add_modifier(Modifier::DIM);

pub const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);
