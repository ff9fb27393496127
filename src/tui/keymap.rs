//! Key bindings.

use std::collections::BTreeMap;

use crokey::{KeyCombination, KeyCombinationFormat, OneToThree};
use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::action::{Action, Binding, Both, Mode, binding_of, bindings};
use gdg::text::did_you_mean;

/// The keys of all bindings.
#[derive(Clone, Debug)]
pub struct Keymap {
    keys: Vec<(KeyCombination, &'static Binding)>,
}

/// A binding that cannot be used.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("{binding}: {problem}")]
pub struct KeymapError {
    pub binding: String,
    pub problem: String,
    pub help: String,
}

impl Keymap {
    /// Creates a keymap from the table's keys, replaced where `changes` gives others.
    pub fn new(changes: &BTreeMap<String, Vec<String>>) -> Result<Self, KeymapError> {
        let fail = |binding: &str, problem: String, help: &str| KeymapError {
            binding: binding.to_owned(),
            problem,
            help: help.to_owned(),
        };
        if let Some(name) = changes.keys().find(|name| !bindings().any(|b| b.name == **name)) {
            let nearest = did_you_mean(name, bindings().map(|b| b.name));
            let help = format!("{nearest}--print-config-template lists all names");
            return Err(fail(name, "unknown action".to_owned(), &help));
        }
        let mut keymap = Self { keys: Vec::new() };
        // Changed bindings come last, so that they are the ones blamed for a conflict.
        let (changed, own): (Vec<_>, Vec<_>) =
            bindings().partition(|b| changes.contains_key(b.name));
        for binding in own.into_iter().chain(changed) {
            let is_beside = |other: &Binding| {
                Mode::ALL.into_iter().any(|mode| binding.is_active(mode) && other.is_active(mode))
            };
            let own = || binding.keys.iter().map(|k| (*k).to_owned()).collect();
            for key in changes.get(binding.name).cloned().unwrap_or_else(own) {
                let Some(pressed) = parse(&key).map(normalised) else {
                    let help = "keys are written \"a\", \"shift-a\", \"ctrl-a\", \"space\", \"f1\"";
                    return Err(fail(binding.name, format!("{key:?} is not a key"), help));
                };
                match keymap.keys.iter().find(|(k, b)| *k == pressed && is_beside(b)) {
                    None => keymap.keys.push((pressed, binding)),
                    Some((_, other)) if other.name == binding.name => {}
                    Some((_, other)) => {
                        let problem = format!("{key:?} is already bound to {}", other.name);
                        let help = "bind one of them to another key";
                        return Err(fail(binding.name, problem, help));
                    }
                }
            }
        }
        Ok(keymap)
    }

    pub fn action(&self, key: KeyEvent, mode: Mode) -> Option<Action> {
        self.binding(key, mode).map(|binding| binding.action)
    }

    pub fn binding(&self, key: KeyEvent, mode: Mode) -> Option<&'static Binding> {
        let key = normalised(KeyCombination::from(key));
        let of =
            |mode| self.keys.iter().find(|(k, b)| *k == key && b.is_active(mode)).map(|(_, b)| *b);
        // Its keys take precedence; the others stay active.
        let adds = matches!(mode, Mode::Touring | Mode::Elsewhere);
        of(mode).or_else(|| adds.then(|| of(Mode::Watching)).flatten())
    }

    /// Returns the first key of `action` for display; without one, how the help finds it.
    pub fn key_of(&self, action: Action) -> String {
        let first = |action| {
            bindings()
                .filter(|b| b.action == action)
                .find_map(|b| self.display_keys(b).into_iter().next())
        };
        let name = binding_of(action).map_or("", |b| b.name);
        let find = |key| format!("{key} and type {name}");
        first(action).or(first(Action::Help).map(find)).unwrap_or_else(|| "-".to_owned())
    }

    pub fn display_keys(&self, binding: &Binding) -> Vec<String> {
        self.keys
            .iter()
            .filter(|(_, b)| b.name == binding.name)
            .map(|(key, _)| display_name(*key))
            .collect()
    }
}

impl Mode {
    const ALL: [Self; 7] = [
        Self::Watching,
        Self::Editing,
        Self::Touring,
        Self::Elsewhere,
        Self::Comparing,
        Self::EditingBoth,
        Self::Listing,
    ];
}

impl Binding {
    pub fn is_active(&self, mode: Mode) -> bool {
        match (mode, self.when) {
            (Mode::Watching | Mode::Editing, None) | (Mode::EditingBoth, Some(Mode::Comparing)) => {
                true
            }
            (Mode::Listing, None) => self.is_in_lists,
            (Mode::Comparing | Mode::EditingBoth, None)
            | (Mode::Comparing, Some(Mode::Watching))
            | (Mode::EditingBoth, Some(Mode::Editing)) => !matches!(self.both, Both::Refused),
            (mode, when) => when == Some(mode),
        }
    }
}

pub fn name_of(key: KeyEvent) -> String {
    display_name(normalised(KeyCombination::from(key)))
}

fn display_name(key: KeyCombination) -> String {
    // Shift is implied for characters only: A, but Shift-Left.
    let format = match key.codes {
        OneToThree::One(KeyCode::Char(_)) => KeyCombinationFormat::default().with_implicit_shift(),
        _ => KeyCombinationFormat::default(),
    };
    short_name(&format.to_string(key))
}

fn parse(name: &str) -> Option<KeyCombination> {
    if let Some(letter) = name.chars().last().filter(|c| !c.is_ascii() && c.is_alphabetic()) {
        // The library parses only ASCII: use a placeholder letter.
        let stem = &name[..name.len() - letter.len_utf8()];
        let known = crokey::parse(&format!("{stem}a")).ok()?;
        let is_letter =
            known.codes == OneToThree::One(KeyCode::Char('a')) || stem.contains("shift");
        return is_letter.then(|| KeyCombination::new(KeyCode::Char(letter), known.modifiers));
    }
    crokey::parse(name).ok()
}

/// Normalises shift, which only some terminals report along with the shifted character: set for
/// uppercase letters, cleared for other characters.
fn normalised(key: KeyCombination) -> KeyCombination {
    let OneToThree::One(code) = key.codes else { return key };
    let (code, modifiers) = match code {
        KeyCode::Char(c) if c.is_uppercase() => (code, key.modifiers | KeyModifiers::SHIFT),
        KeyCode::Char(c) if c.is_alphabetic() && key.modifiers.contains(KeyModifiers::SHIFT) => {
            (KeyCode::Char(c.to_uppercase().next().unwrap_or(c)), key.modifiers)
        }
        KeyCode::Char(_) => (code, key.modifiers - KeyModifiers::SHIFT),
        _ => (code, key.modifiers),
    };
    KeyCombination::new(code, modifiers)
}

fn short_name(key: &str) -> String {
    let at = key.rfind('-').map_or(0, |at| at + 1);
    let name = match &key[at..] {
        "Left" => "\u{2190}",
        "Right" => "\u{2192}",
        "Up" => "\u{2191}",
        "Down" => "\u{2193}",
        "PageUp" => "PgUp",
        "PageDown" => "PgDn",
        "Hyphen" => "-",
        name => name,
    };
    format!("{}{name}", &key[..at])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tui::choices::Tool;

    fn keymap(changes: &[(&str, &[&str])]) -> Result<Keymap, KeymapError> {
        let owned = |keys: &[&str]| keys.iter().map(|k| (*k).to_owned()).collect();
        Keymap::new(&changes.iter().map(|(name, keys)| ((*name).to_owned(), owned(keys))).collect())
    }

    fn action(keymap: &Keymap, key: &str, mode: Mode) -> Option<Action> {
        let (modifiers, key) = match key.split_once('-') {
            Some(("ctrl", key)) => (KeyModifiers::CONTROL, key),
            Some(("shift", key)) => (KeyModifiers::SHIFT, key),
            _ => (KeyModifiers::NONE, key),
        };
        let code = KeyCode::Char(key.chars().next().expect("a key"));
        keymap.action(KeyEvent::new(code, modifiers), mode)
    }

    #[test]
    fn every_default_key_is_valid_and_means_what_its_mode_says() {
        let keymap = keymap(&[]).expect("the table's own keys");
        assert_eq!(keymap.keys.len(), bindings().map(|b| b.keys.len()).sum::<usize>());
        for (key, mode, expected) in [
            ("?", Mode::Watching, Some(Action::Help)),
            ("shift-?", Mode::Watching, Some(Action::Help)),
            ("R", Mode::Watching, Some(Action::NewSeed)),
            ("shift-R", Mode::Watching, Some(Action::NewSeed)),
            ("1", Mode::Editing, Some(Action::Tool(Tool::Pencil))),
            ("1", Mode::EditingBoth, Some(Action::Tool(Tool::Pencil))),
            // There is nothing to set in a comparison, and there are no panes.
            ("o", Mode::Comparing, None),
            ("3", Mode::Comparing, None),
        ] {
            assert_eq!(action(&keymap, key, mode), expected, "{key}");
        }
    }

    #[test]
    fn keys_can_be_changed_and_invalid_keys_are_reported() {
        let own = keymap(&[("quit", &["\u{e9}", "\u{e9}", "ctrl-\u{f6}"])]).expect("keys");
        for (key, expected) in
            [("\u{e9}", Some(Action::Quit)), ("ctrl-\u{f6}", Some(Action::Quit)), ("q", None)]
        {
            assert_eq!(action(&own, key, Mode::Watching), expected, "{key}");
        }
        for (name, key, said) in [
            ("puase", "a", "pause"),
            ("pause", "superkey", "superkey"),
            ("pause", "foo-\u{e9}", "foo"),
            ("pause", "q", "quit"),
            ("pause", "1", "training"),
            // Both are used in comparisons.
            ("axis", "v", "next-field"),
        ] {
            let error = keymap(&[(name, &[key])]).expect_err("a mistake");
            assert!(error.problem.contains(said) || error.help.contains(said), "{error:?}");
        }
    }
}
