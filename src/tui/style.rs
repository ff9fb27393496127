//! The styles of text.

use ratatui::style::{Modifier, Style};

/// Headings, keys and other important text.
pub const BOLD: Style = Style::new().add_modifier(Modifier::BOLD);

/// Explanations.
pub const DIM: Style = Style::new().add_modifier(Modifier::DIM);

/// Selections, and text that stands out from the map.
pub const REVERSED: Style = Style::new().add_modifier(Modifier::REVERSED);
