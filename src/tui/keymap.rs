//! Which key does what.

use std::collections::BTreeMap;

use crokey::{KeyCombination, KeyCombinationFormat, OneToThree};
use crossterm::event::{KeyCode, KeyEvent, KeyModifiers};

use super::action::{Action, Binding, When, bindings};

/// Keys of all bindings.
#[derive(Clone, Debug)]
pub struct Keymap {
    keys: Vec<(KeyCombination, &'static Binding)>,
}

impl Keymap {
    /// The table's own keys, but for bindings of which `changes` tells others.
    ///
    /// # Errors
    /// An unknown binding or key, or a key that is given twice: the binding's name, what is wrong, and what would be
    /// right.
    pub fn new(changes: &BTreeMap<String, Vec<String>>) -> Result<Self, (String, String, String)> {
        let known = |name: &String| bindings().any(|b| b.name == *name);
        if let Some(name) = changes.keys().find(|name| !known(name)) {
            let nearest = bindings()
                .max_by(|a, b| strsim::jaro_winkler(a.name, name).total_cmp(&strsim::jaro_winkler(b.name, name)));
            let right = nearest.map_or(String::new(), |b| format!("did you mean {}?", b.name));
            let right = format!("{right} --print-config-template lists all names");
            return Err((name.clone(), "there is no such action".to_owned(), right.trim().to_owned()));
        }
        let mut keymap = Self { keys: Vec::new() };
        // Those that were changed come last: they are the ones to be told of.
        let (changed, own): (Vec<_>, Vec<_>) = bindings().partition(|b| changes.contains_key(b.name));
        for binding in own.into_iter().chain(changed) {
            let own = || binding.keys.iter().map(|k| (*k).to_owned()).collect();
            for key in changes.get(binding.name).cloned().unwrap_or_else(own) {
                let fail = |what: String, right: &str| (binding.name.to_owned(), what, right.to_owned());
                let parsed = crokey::parse(&key).map_err(|_| {
                    fail(
                        format!("{key:?} is no key"),
                        "write keys as \"a\", \"shift-a\", \"ctrl-a\", \"space\", \"f1\"",
                    )
                })?;
                let pressed = normal(parsed);
                if let Some(other) = keymap.binding(pressed, binding.when) {
                    let what = format!("{key:?} is the key of {} too", other.name);
                    return Err(fail(what, "give one of them another key"));
                }
                keymap.keys.push((pressed, binding));
            }
        }
        Ok(keymap)
    }

    /// The binding of `key` that counts at the same time as one of `when`.
    fn binding(&self, key: KeyCombination, when: When) -> Option<&'static Binding> {
        let meets = |other: When| other == when || other == When::Always || when == When::Always;
        self.keys.iter().find(|(k, b)| *k == key && meets(b.when)).map(|(_, b)| *b)
    }

    /// What `key` does, with the editor open or not.
    pub fn action(&self, key: KeyEvent, editing: bool) -> Option<Action> {
        let when = if editing { When::Editing } else { When::Watching };
        self.binding(normal(KeyCombination::from(key)), when).map(|b| b.action)
    }

    /// The first key of `action` as people read it; what to type into the list of everything where it has none.
    pub fn key_of(&self, action: Action) -> String {
        let first = |action| bindings().filter(|b| b.action == action).find_map(|b| self.shown(b).into_iter().next());
        let unbound = || first(Action::Palette).map_or("-".to_owned(), |key| format!("{key} ..."));
        first(action).unwrap_or_else(unbound)
    }

    /// The keys of `binding` as people read them.
    pub fn shown(&self, binding: &Binding) -> Vec<String> {
        let format = KeyCombinationFormat::default().with_implicit_shift();
        let own = self.keys.iter().filter(|(_, b)| b.name == binding.name);
        own.map(|(key, _)| short_name(&format.to_string(*key))).collect()
    }
}

/// Terminals differ in whether shift is told of beside a character that it made; here it is with letters, and not with
/// signs.
fn normal(key: KeyCombination) -> KeyCombination {
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

/// Arrows are shorter as arrows.
fn short_name(key: &str) -> String {
    let pairs = [
        ("Left", "\u{2190}"),
        ("Right", "\u{2192}"),
        ("Up", "\u{2191}"),
        ("Down", "\u{2193}"),
        ("PageUp", "PgUp"),
        ("PageDown", "PgDn"),
        ("Hyphen", "-"),
    ];
    // Page keys contain the names of arrows.
    let page = key.contains("Page");
    pairs
        .iter()
        .filter(|(long, _)| page == long.contains("Page"))
        .fold(key.to_owned(), |k, (long, s)| k.replace(long, s))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keymap(changes: &[(&str, &[&str])]) -> Result<Keymap, (String, String, String)> {
        let owned = |keys: &[&str]| keys.iter().map(|k| (*k).to_owned()).collect();
        Keymap::new(&changes.iter().map(|(name, keys)| ((*name).to_owned(), owned(keys))).collect())
    }

    fn press(code: KeyCode, modifiers: KeyModifiers) -> KeyEvent {
        KeyEvent::new(code, modifiers)
    }

    #[test]
    fn every_key_of_the_table_is_one_and_stands_for_one_action() {
        let keymap = keymap(&[]).expect("the table's own keys");
        assert_eq!(keymap.keys.len(), bindings().map(|b| b.keys.len()).sum::<usize>());
    }

    #[test]
    fn shift_may_be_told_of_or_not() {
        let keymap = keymap(&[]).expect("keys");
        for modifiers in [KeyModifiers::NONE, KeyModifiers::SHIFT] {
            assert_eq!(keymap.action(press(KeyCode::Char('?'), modifiers), false), Some(Action::Help));
            assert_eq!(keymap.action(press(KeyCode::Char('R'), modifiers), false), Some(Action::NewSeed));
        }
    }

    #[test]
    fn the_editor_has_keys_of_its_own() {
        let keymap = keymap(&[]).expect("keys");
        let one = press(KeyCode::Char('1'), KeyModifiers::NONE);
        assert_ne!(keymap.action(one, true), keymap.action(one, false));
    }

    #[test]
    fn keys_can_be_changed_and_mistakes_are_told() {
        let changed = keymap(&[("pause", &["ctrl-k", "f5"])]).expect("good keys");
        assert_eq!(changed.action(press(KeyCode::F(5), KeyModifiers::NONE), false), Some(Action::TogglePause));
        assert_eq!(changed.action(press(KeyCode::Char(' '), KeyModifiers::NONE), false), None);
        let wrong = |name: &str, key: &str| keymap(&[(name, &[key])]).expect_err("a mistake");
        assert!(wrong("puase", "a").2.contains("pause"));
        assert!(wrong("pause", "superkey").1.contains("superkey"));
        assert!(wrong("pause", "q").1.contains("quit"));
    }
}
