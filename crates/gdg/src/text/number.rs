//! Numbers as people write them: `60000`, `60_000`, `60,000`, `6e4`.

/// Characters that separate groups of three digits in some language.
const GROUP_SEPARATORS: [char; 6] = [',', '\'', '\u{2019}', ' ', '\u{a0}', '\u{202f}'];

/// Maximum number of digits of a 64-bit number.
const MAX_DIGITS: usize = 20;

/// Why a text is not the number that is expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NumberError {
    /// It has a fraction.
    #[error("needs a whole number")]
    Fraction,
    /// A point may separate the fraction or thousands.
    #[error("could mean {0} or {1}: write it without the point")]
    Ambiguous(String, String),
    /// It is larger than numbers can be.
    #[error("is too large a number")]
    TooLarge,
    /// It is no number.
    #[error("expected a whole number, such as 60000, 60_000 or 6e4")]
    NoNumber,
}

/// Parses a whole number, 0 or more: digits, underscores between them, groups of three, an
/// exponent, or a fraction of zeros.
///
/// # Errors
/// The text is no such number, or could be two of them (`60.000`).
pub fn parse_count(text: &str) -> Result<u64, NumberError> {
    let written =
        Written::parse(text).filter(|written| !written.is_negative).ok_or(NumberError::NoNumber)?;
    written.refuse_thousands(|_| true)?;
    shifted(&written.whole, &written.fraction, written.exponent.unwrap_or(0))
}

/// Parses a number with or without a fraction, written as [`parse_count`] takes it.
///
/// # Errors
/// The text is no number, is too large a one, or could be two of them. `60.000` could; `60.125` has
/// a fraction.
pub fn parse_real(text: &str) -> Result<f64, NumberError> {
    let written = Written::parse(text).ok_or(NumberError::NoNumber)?;
    written.refuse_thousands(|fraction| fraction == "000")?;
    let Written { is_negative, whole, fraction, exponent } = written;
    let sign = if is_negative { "-" } else { "" };
    let plain = format!("{sign}0{whole}.{fraction}0e{}", exponent.unwrap_or(0));
    plain.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(NumberError::TooLarge)
}

/// The parts of a number, without digit separators.
struct Written {
    is_negative: bool,
    whole: String,
    fraction: String,
    exponent: Option<i64>,
}

impl Written {
    /// Splits a number into its parts; `None` if it is not a number.
    fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let (is_negative, unsigned) = match text.strip_prefix('-') {
            Some(unsigned) => (true, unsigned),
            None => (false, text.strip_prefix('+').unwrap_or(text)),
        };
        let (mantissa, exponent) = match unsigned.split_once(['e', 'E']) {
            Some((mantissa, exponent)) => (mantissa, Some(parse_exponent(exponent)?)),
            None => (unsigned, None),
        };
        let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
        // Either side of the point may be empty: .5 and 5. are numbers.
        let whole = if whole.is_empty() && !fraction.is_empty() {
            String::new()
        } else {
            without_separators(whole)?
        };
        let is_fraction = fraction.is_empty() || fraction.split('_').all(is_digits);
        is_fraction.then(|| Self {
            is_negative,
            whole,
            fraction: fraction.replace('_', ""),
            exponent,
        })
    }

    /// Returns an error if a point may separate thousands and the fraction is one that
    /// `is_doubtful`.
    fn refuse_thousands(&self, is_doubtful: impl Fn(&str) -> bool) -> Result<(), NumberError> {
        let Self { whole, fraction, exponent, .. } = self;
        let is_first_group = (1..=3).contains(&whole.len()) && !whole.starts_with('0');
        if !is_first_group || fraction.len() != 3 || exponent.is_some() || !is_doubtful(fraction) {
            return Ok(());
        }
        let as_fraction =
            format!("{whole}.{fraction}").trim_end_matches('0').trim_end_matches('.').to_owned();
        Err(NumberError::Ambiguous(as_fraction, format!("{whole}{fraction}")))
    }
}

/// Parses an exponent; one too large for an `i64` is clamped.
fn parse_exponent(text: &str) -> Option<i64> {
    let digits = text.strip_prefix(['+', '-']).unwrap_or(text);
    let size = is_digits(digits).then(|| digits.parse().unwrap_or(i64::MAX))?;
    Some(if text.starts_with('-') { -size } else { size })
}

/// Whether `text` is not empty and consists of digits.
fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Returns the digits of a whole number without separators; `None` if these are misplaced.
fn without_separators(whole: &str) -> Option<String> {
    if whole.contains('_') {
        return whole.split('_').all(is_digits).then(|| whole.replace('_', ""));
    }
    let Some(separator) = whole.chars().find(|c| GROUP_SEPARATORS.contains(c)) else {
        return is_digits(whole).then(|| whole.to_owned());
    };
    let groups: Vec<&str> = whole.split(separator).collect();
    let (first, rest) = groups.split_first()?;
    // 0,500 is a half in many languages.
    let is_grouped =
        first.len() <= 3 && !first.starts_with('0') && rest.iter().all(|group| group.len() == 3);
    (is_grouped && groups.iter().all(|group| is_digits(group))).then(|| groups.concat())
}

/// Returns `whole.fraction` times a power of ten, if that is a whole number.
fn shifted(whole: &str, fraction: &str, exponent: i64) -> Result<u64, NumberError> {
    let digits = format!("{whole}{fraction}");
    let significant = digits.trim_end_matches('0');
    if significant.trim_start_matches('0').is_empty() {
        return Ok(0);
    }
    // Zeros to add after the significant digits.
    let zeros = exponent
        .saturating_add((digits.len() - significant.len()) as i64)
        .saturating_sub(fraction.len() as i64);
    let zeros = usize::try_from(zeros).map_err(|_| NumberError::Fraction)?;
    let significant = significant.trim_start_matches('0');
    if significant.len().saturating_add(zeros) > MAX_DIGITS {
        return Err(NumberError::TooLarge);
    }
    format!("{significant}{}", "0".repeat(zeros)).parse().map_err(|_| NumberError::TooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_as_people_write_them() {
        for text in [
            "60000", "60_000", "60,000", "60'000", "60 000", "6e4", "6E+4", "60000.0", " 60000 ",
            "0.6e5", "6_0_000", "+60000", "60000.",
        ] {
            assert_eq!(parse_count(text), Ok(60_000), "{text}");
        }
        for (text, count) in [("1,234,567", 1_234_567), ("5000e-3", 5), ("0e999", 0), ("000", 0)] {
            assert_eq!(parse_count(text), Ok(count), "{text}");
        }
        assert_eq!(parse_count(&u64::MAX.to_string()), Ok(u64::MAX));
    }

    #[test]
    fn what_is_no_count_or_could_be_two_is_refused() {
        for text in ["100.5", "1e-1", "1.25e1", "0.5", ".5", "1e-99999999999999999999"] {
            assert_eq!(parse_count(text), Err(NumberError::Fraction), "{text}");
        }
        let two = |a: &str, b: &str| Err(NumberError::Ambiguous(a.to_owned(), b.to_owned()));
        assert_eq!(parse_count("60.000"), two("60", "60000"));
        assert_eq!(parse_count("1.250"), two("1.25", "1250"));
        let none = "e6 -3 60,00 6,0000 0,500 1,000_000 _1 1_ 1__0 1k 0x10 . + --1 1.0.0 1e 1e+";
        for text in none.split(' ').chain([""]) {
            assert_eq!(parse_count(text), Err(NumberError::NoNumber), "{text}");
        }
        for text in ["18446744073709551616", "1e20", "1e2147483647", "1e99999999999999999999"] {
            assert_eq!(parse_count(text), Err(NumberError::TooLarge), "{text}");
        }
    }

    #[test]
    fn reals_are_written_like_counts() {
        for (text, number) in [
            ("1_000.5", 1000.5),
            ("1e6", 1e6),
            (".5", 0.5),
            ("5.", 5.0),
            ("+300", 300.0),
            ("-0.25", -0.25),
            ("60,000", 60_000.0),
            ("60 000.5", 60_000.5),
            ("12.345", 12.345),
            ("0.000", 0.0),
            ("1e-99999999999999999999", 0.0),
        ] {
            assert_eq!(parse_real(text), Ok(number), "{text}");
        }
        for text in ["_1", "1_", "1_.5", "1__0", "0,5", "60,00", "x", ".", "", "inf", "nan"] {
            assert_eq!(parse_real(text), Err(NumberError::NoNumber), "{text}");
        }
        let two = NumberError::Ambiguous("60".to_owned(), "60000".to_owned());
        assert_eq!(parse_real("60.000"), Err(two));
        assert_eq!(parse_real("-1e999"), Err(NumberError::TooLarge));
    }
}
