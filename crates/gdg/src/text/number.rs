//! Numbers as people write them: `60000`, `60_000`, `60,000`, `6e4`.

/// Characters that separate groups of three digits in some language or other.
const GROUP_SEPARATORS: [char; 6] = [',', '\'', '\u{2019}', ' ', '\u{a0}', '\u{202f}'];

/// The most digits of a number in 64 bits.
const MAX_DIGITS: usize = 20;

/// Why a text is not a count.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CountError {
    /// It has a fraction.
    #[error("needs a whole number")]
    Fraction,
    /// A point may separate the fraction or thousands.
    #[error("could mean {0} or {1}: write it without the point")]
    Ambiguous(String, String),
    /// It does not fit into 64 bits.
    #[error("is too large a number")]
    TooLarge,
    /// It is no number.
    #[error("expected a whole number, such as 60000, 60_000 or 6e4")]
    NoNumber,
}

/// Parses a whole number, 0 or more: plain digits, underscores between them, groups of three, an exponent, or a fraction
/// of zeros.
///
/// # Errors
/// The text is no such number, or could be two of them (`60.000`).
pub fn parse_count(text: &str) -> Result<u64, CountError> {
    let (mantissa, exponent) = match text.trim().split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent.parse::<i32>().map_err(|_| CountError::NoNumber)?)),
        None => (text.trim(), None),
    };
    let (whole, fraction) = match mantissa.split_once('.') {
        Some((whole, fraction)) if is_digits(fraction) => (whole, Some(fraction)),
        Some(_) => return Err(CountError::NoNumber),
        None => (mantissa, None),
    };
    let digits = without_separators(whole).ok_or(CountError::NoNumber)?;
    if let (Some(fraction), None, false) = (fraction, exponent, digits.starts_with('0'))
        && fraction.len() == 3
        && digits.len() <= 3
    {
        let as_fraction = format!("{digits}.{fraction}").trim_end_matches('0').trim_end_matches('.').to_owned();
        return Err(CountError::Ambiguous(as_fraction, digits + fraction));
    }
    shifted(&digits, fraction.unwrap_or_default(), exponent.unwrap_or(0))
}

/// Parses a number with a fraction; underscores may separate its digits.
pub fn parse_real(text: &str) -> Option<f64> {
    let text = text.trim();
    let between_digits = |i: usize| {
        let digit = |at: Option<&u8>| at.is_some_and(u8::is_ascii_digit);
        digit(i.checked_sub(1).and_then(|before| text.as_bytes().get(before))) && digit(text.as_bytes().get(i + 1))
    };
    text.match_indices('_').all(|(i, _)| between_digits(i)).then(|| text.replace('_', "").parse().ok()).flatten()
}

/// Whether `text` consists of digits, and has some.
fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit())
}

/// Returns the digits of a whole number without what separates them; `None` if they are separated in another way.
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
    let is_grouped = first.len() <= 3 && !first.starts_with('0') && rest.iter().all(|group| group.len() == 3);
    (is_grouped && groups.iter().all(|group| is_digits(group))).then(|| groups.concat())
}

/// Returns `whole.fraction` times a power of ten, if that is a whole number.
fn shifted(whole: &str, fraction: &str, exponent: i32) -> Result<u64, CountError> {
    let digits = format!("{whole}{fraction}");
    let significant = digits.trim_end_matches('0');
    if significant.trim_start_matches('0').is_empty() {
        return Ok(0);
    }
    // Zeros to add after the significant digits.
    let zeros = exponent as i64 + (digits.len() - significant.len()) as i64 - fraction.len() as i64;
    let zeros = usize::try_from(zeros).map_err(|_| CountError::Fraction)?;
    let significant = significant.trim_start_matches('0');
    if significant.len().saturating_add(zeros) > MAX_DIGITS {
        return Err(CountError::TooLarge);
    }
    format!("{significant}{}", "0".repeat(zeros)).parse().map_err(|_| CountError::TooLarge)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_read_as_people_write_them() {
        for text in
            ["60000", "60_000", "60,000", "60'000", "60 000", "6e4", "6E+4", "60000.0", " 60000 ", "0.6e5", "6_0_000"]
        {
            assert_eq!(parse_count(text), Ok(60_000), "{text}");
        }
        assert_eq!(parse_count("1.5e6"), Ok(1_500_000));
        assert_eq!(parse_count("1,234,567"), Ok(1_234_567));
        assert_eq!(parse_count("100.0"), Ok(100));
        assert_eq!(parse_count("5000e-3"), Ok(5));
        assert_eq!([parse_count("0"), parse_count("0e999"), parse_count("000")], [Ok(0), Ok(0), Ok(0)]);
        assert_eq!(parse_count(&u64::MAX.to_string()), Ok(u64::MAX));
    }

    #[test]
    fn what_is_no_count_or_could_be_two_is_refused() {
        for text in ["100.5", "1e-1", "1.25e1", "0.5"] {
            assert_eq!(parse_count(text), Err(CountError::Fraction), "{text}");
        }
        let two = |a: &str, b: &str| Err(CountError::Ambiguous(a.to_owned(), b.to_owned()));
        assert_eq!(parse_count("60.000"), two("60", "60000"));
        assert_eq!(parse_count("1.250"), two("1.25", "1250"));
        for text in
            ["", "e6", "-3", "60,00", "6,0000", "0,500", "1,000_000", "_1", "1_", "1__0", "1k", "0x10", "1.", "1.0.0"]
        {
            assert_eq!(parse_count(text), Err(CountError::NoNumber), "{text}");
        }
        for text in ["18446744073709551616", "1e20", "1e2147483647"] {
            assert_eq!(parse_count(text), Err(CountError::TooLarge), "{text}");
        }
    }

    #[test]
    fn reals_may_have_underscores_between_digits() {
        assert_eq!(parse_real("1_000.5"), Some(1000.5));
        assert_eq!(parse_real("1e6"), Some(1e6));
        for text in ["_1", "1_", "1_.5", "1__0", "0,5", "x"] {
            assert_eq!(parse_real(text), None, "{text}");
        }
    }
}
