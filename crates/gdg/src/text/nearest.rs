//! Suggestions for mistyped names.

/// Minimum similarity of a suggestion; 1 for equal names.
const LEAST_LIKENESS: f64 = 0.75;

/// Of two names, one this many times as long as the other is no form of it. Comparing long names
/// takes time that grows with the product of their lengths.
const MOST_TIMES_AS_LONG: usize = 4;

/// Returns the known name most similar to `typed`, ignoring case, if any is similar enough.
pub fn nearest<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let typed = typed.to_lowercase();
    let likeness = |name: &str| strsim::jaro_winkler(&name.to_lowercase(), &typed);
    let most = known
        .into_iter()
        .filter(|name| typed.len() <= MOST_TIMES_AS_LONG * name.len())
        .filter(|name| name.len() <= MOST_TIMES_AS_LONG * typed.len())
        .map(|name| (likeness(name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0));
    most.filter(|(likeness, _)| *likeness > LEAST_LIKENESS).map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_suggested_whatever_their_letters() {
        let known = ["trap", "city", "fourrooms"];
        assert_eq!(
            ["TRAP", "Citty", "for-rooms"].map(|typed| nearest(typed, known)),
            [Some("trap"), Some("city"), Some("fourrooms")]
        );
        assert_eq!(nearest("zzz", known), None);
        assert_eq!(nearest("foo", ["fourier_octaves"]), None, "much longer");
        assert_eq!(nearest(&"trap".repeat(10_000_000), known), None);
    }
}
