//! Ranks items against the typed text.

use super::item::Item;

/// Scores of a typed word that equals a word or is its prefix, in an item's name, in its search
/// words and in its details; and of one inside a word of the name.
const NAME: [u32; 2] = [100, 70];
const WORDS: [u32; 2] = [90, 60];
const DETAIL: [u32; 2] = [30, 20];
const WITHIN_NAME: u32 = 40;

/// Bonus for a name that begins with a typed word, and for a word in both name and search words.
const FIRST: u32 = 5;
const IN_BOTH: u32 = 10;

/// Stop words.
const FILLERS: [&str; 7] = ["a", "an", "the", "of", "in", "to", "for"];

/// Ranks items by a search text.
pub struct Ranking {
    typed: String,
    /// Its words, without stop words unless there are no others.
    words: Vec<String>,
}

impl Ranking {
    /// Score of a name that the typed letters abbreviate.
    pub const GUESS: u32 = 1;

    /// Creates a ranking for a search text.
    pub fn new(typed: &str) -> Self {
        let typed = typed.trim().to_lowercase();
        let all: Vec<String> = typed.split_whitespace().map(str::to_owned).collect();
        let telling: Vec<String> =
            all.iter().filter(|word| !FILLERS.contains(&word.as_str())).cloned().collect();
        Self { typed, words: if telling.is_empty() { all } else { telling } }
    }

    /// Returns how well `item` matches, or `None` if it does not. Every typed word must match, or
    /// the typed letters must abbreviate the name.
    pub fn score(&self, item: &Item) -> Option<u32> {
        let name = item.label.to_lowercase();
        if self.typed.is_empty() {
            return Some(0);
        }
        if name == self.typed {
            return Some(u32::MAX);
        }
        // The action's own name comes first, with or without its hyphens.
        let own = item.name.replace('-', " ");
        if own == self.typed.replace('-', " ") {
            return Some(u32::MAX - 1);
        }
        let words = item.words.to_lowercase();
        let detail = item.detail.to_lowercase();
        let below = item.below.join(" ").to_lowercase();
        let of_one = |typed: &str| {
            let of_name = in_words(&name, typed, NAME)
                .map(|score| score + if name.starts_with(typed) { FIRST } else { 0 })
                .or(name.contains(typed).then_some(WITHIN_NAME));
            let of_detail = in_words(&detail, typed, DETAIL).max(in_words(&below, typed, DETAIL));
            let of_words = in_words(&words, typed, WORDS);
            let in_both = if of_name.is_some() && of_words.is_some() { IN_BOTH } else { 0 };
            of_name.max(of_words).max(of_detail).map(|score| score + in_both)
        };
        // Settings have underscores where users may type hyphens.
        let of = |typed: &String| of_one(typed).max(of_one(&typed.replace('-', "_")));
        let all: Option<u32> = self.words.iter().map(of).sum();
        all.or_else(|| abbreviates(&self.typed, &name).then_some(Self::GUESS))
    }
}

/// Returns whether `letters` abbreviates `name`: in order, each letter begins a word or directly
/// follows the letter before.
fn abbreviates(letters: &str, name: &str) -> bool {
    let (letters, name): (Vec<char>, Vec<char>) =
        (letters.chars().collect(), name.chars().collect());
    // The positions after each match of the letters so far.
    let mut ends = vec![0];
    for (n, letter) in letters.iter().enumerate() {
        let begins_word = |i: usize| i == 0 || !name[i - 1].is_alphanumeric();
        let matches =
            |i: usize| name[i] == *letter && (begins_word(i) || n > 0 && ends.contains(&i));
        let first = ends.iter().min().copied().unwrap_or(name.len());
        ends = (first..name.len()).filter(|i| matches(*i)).map(|i| i + 1).collect();
    }
    !ends.is_empty()
}

/// Returns the score of a word in a text: `[whole, begins]`.
fn in_words(text: &str, typed: &str, [whole, begins]: [u32; 2]) -> Option<u32> {
    let mut words =
        text.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '@').flat_map(|word| {
            // The parts of a setting's name count as words as well.
            std::iter::once(word).chain(word.split('_'))
        });
    let best = |word: &str| match word {
        _ if word == typed => Some(whole),
        _ if word.starts_with(typed) => Some(begins),
        _ => None,
    };
    words.by_ref().filter_map(best).max()
}
