//! The styles of text.

use ratatui::style::{Modifier, Style};

/// Headings, keys and what else is important.
pub const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);

/// What explains something else.
pub const DIM: Style = Style::new().add_modifier(Modifier::DIM);

/// What is selected, and what stands out from the map.
pub const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);
