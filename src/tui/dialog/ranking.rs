//! How well an item matches what was typed.

use nucleo_matcher::pattern::{CaseMatching, Normalization, Pattern};
use nucleo_matcher::{Config, Matcher, Utf32Str};

use super::Item;

/// Scores of a typed word that is a whole word, or begins one: in an item's name, among the other words it is found by,
/// and in its details; and of one within a word of the name.
const NAME: [u32; 2] = [100, 70];
const WORDS: [u32; 2] = [90, 60];
const DETAIL: [u32; 2] = [30, 20];
const WITHIN_NAME: u32 = 40;

/// Extra score of a name that begins with a typed word, and of a word both in the name and among the others.
const FIRST: u32 = 5;
const IN_BOTH: u32 = 10;

/// The longest text taken for an abbreviation, in characters: a longer one is a word, and names that contain its letters in
/// their order do so by chance.
const LONGEST_ABBREVIATION: usize = 4;

/// Ranks items by a search text.
pub struct Ranking {
    typed: String,
    /// Finds the letters of the text in this order, with others between them.
    letters: Pattern,
    matcher: Matcher,
    buffer: Vec<char>,
}

impl Ranking {
    /// The score of a name that contains the typed letters in their order, but not the words.
    pub const GUESS: u32 = 1;

    /// Creates a ranking for a search text.
    pub fn new(typed: &str) -> Self {
        let typed = typed.trim().to_lowercase();
        let letters = Pattern::parse(&typed, CaseMatching::Ignore, Normalization::Smart);
        Self { typed, letters, matcher: Matcher::new(Config::DEFAULT), buffer: Vec::new() }
    }

    /// Returns how well `item` matches, or `None` if it does not. Every typed word must match, or the name must contain
    /// the typed letters in their order if they are few.
    pub fn score(&mut self, item: &Item) -> Option<u32> {
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
        let of = |typed: &str| {
            let of_name = in_words(&name, typed, NAME)
                .map(|score| score + if name.starts_with(typed) { FIRST } else { 0 })
                .or(name.contains(typed).then_some(WITHIN_NAME));
            let of_detail = in_words(&detail, typed, DETAIL).max(in_words(&below, typed, DETAIL));
            let of_words = in_words(&words, typed, WORDS);
            let in_both = if of_name.is_some() && of_words.is_some() { IN_BOTH } else { 0 };
            of_name.max(of_words).max(of_detail).map(|score| score + in_both)
        };
        let all: Option<u32> = self.typed.split_whitespace().map(of).sum();
        if all.is_some() || self.typed.chars().count() > LONGEST_ABBREVIATION {
            return all;
        }
        let letters = self.letters.score(Utf32Str::new(&item.label, &mut self.buffer), &mut self.matcher);
        letters.map(|_| Self::GUESS)
    }
}

/// Returns the score of a word in a text: `[whole, begins]`.
fn in_words(text: &str, typed: &str, [whole, begins]: [u32; 2]) -> Option<u32> {
    let mut words = text.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '@').flat_map(|word| {
        // The parts of a setting's name count as words, too.
        std::iter::once(word).chain(word.split('_'))
    });
    let best = |word: &str| match word {
        _ if word == typed => Some(whole),
        _ if word.starts_with(typed) => Some(begins),
        _ => None,
    };
    words.by_ref().filter_map(best).max()
}
