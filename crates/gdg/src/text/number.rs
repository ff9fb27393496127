//! Numbers as people write them: `60000`, `60_000`, `60,000`, `6e4`.

/// Why a text is not the number that is expected.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NumberError {
    #[error("needs a whole number")]
    Fraction,
    /// A point may separate the fraction or thousands.
    #[error("could mean {0} or {0}000: write it without the point")]
    Ambiguous(u16),
    /// It is larger than numbers can be.
    #[error("is too large a number")]
    TooLarge,
    #[error("expected a whole number, such as 60000, 60_000 or 6e4")]
    NoNumber,
}

/// Parses a whole number, 0 or more: digits, underscores between them, groups of three, an
/// exponent, or a fraction of zeros.
pub fn parse_count(text: &str) -> Result<u64, NumberError> {
    if let Some(Ok(count)) = plain(text).map(|plain| plain.parse()) {
        return Ok(count);
    }
    match parse_real(text)? {
        ..0.0 => Err(NumberError::NoNumber),
        number if number.fract() != 0.0 => Err(NumberError::Fraction),
        number if number >= u64::MAX as f64 => Err(NumberError::TooLarge),
        number => Ok(number as u64),
    }
}

/// Parses a number with or without a fraction, written as [`parse_count`] takes it. `60.000` could be
/// two numbers; `60.125` has a fraction.
pub fn parse_real(text: &str) -> Result<f64, NumberError> {
    let plain = plain(text).ok_or(NumberError::NoNumber)?;
    let thousands = plain.strip_suffix(".000").filter(|whole| !whole.starts_with('0'));
    if let Some(Ok(whole @ ..1000)) = thousands.map(str::parse) {
        return Err(NumberError::Ambiguous(whole));
    }
    match plain.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        Ok(_) => Err(NumberError::TooLarge),
        Err(_) => Err(NumberError::NoNumber),
    }
}

/// Returns a number without the separators of its digits, if these are in place; it may be no number
/// all the same.
fn plain(text: &str) -> Option<String> {
    let text = text.trim();
    let (sign, unsigned) = text.split_at(usize::from(text.starts_with(['+', '-'])));
    let end = unsigned.find(['.', 'e', 'E']).unwrap_or(unsigned.len());
    let (whole, rest) = unsigned.split_at(end);
    let is_grouped = whole.split_once(',').is_none_or(|(first, groups)| {
        // 0,500 is a half in many languages.
        (1..=3).contains(&first.len())
            && !first.starts_with('0')
            && groups.split(',').all(|group| group.len() == 3 && !group.contains('_'))
    });
    let is_fine = is_grouped
        && unsigned.bytes().all(|byte| byte.is_ascii_digit() || b"+-.,_eE".contains(&byte))
        && text.split('_').all(|digits| !digits.is_empty());
    let whole = whole.replace([',', '_'], "");
    is_fine.then(|| format!("{sign}{whole}{}", rest.replace('_', "")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_people_write_them_and_what_could_be_two_is_refused() {
        use NumberError::{Ambiguous, Fraction, NoNumber, TooLarge};
        for text in [
            "60000", "60_000", "60,000", "6e4", "6E+4", "60000.0", " 60000 ", "0.6e5", "6_0_000",
            "+60000", "60000.",
        ] {
            assert_eq!(parse_count(text), Ok(60_000), "{text}");
            assert_eq!(parse_real(text), Ok(60_000.0), "{text}");
        }
        for (text, count) in [
            ("1,234,567", Ok(1_234_567)),
            ("5000e-3", Ok(5)),
            ("0e999", Ok(0)),
            ("18446744073709551615", Ok(u64::MAX)),
            ("18446744073709551616", Err(TooLarge)),
            ("1e99999999999999999999", Err(TooLarge)),
            ("100.5", Err(Fraction)),
            (".5", Err(Fraction)),
            ("60.000", Err(Ambiguous(60))),
            ("-3", Err(NoNumber)),
        ] {
            assert_eq!(parse_count(text), count, "{text}");
        }
        let none =
            "e6 60,00 6,0000 0,500 1,000_000 _1 1_ 1__0 1k 0x10 . + --1 1.0.0 1e 1e+ inf nan";
        for text in none.split(' ').chain([""]) {
            assert_eq!(parse_count(text), Err(NoNumber), "{text}");
            assert_eq!(parse_real(text), Err(NoNumber), "{text}");
        }
        for (text, number) in [
            ("1_000.5", Ok(1000.5)),
            (".5", Ok(0.5)),
            ("-0.25", Ok(-0.25)),
            ("12.345", Ok(12.345)),
            ("0.000", Ok(0.0)),
            ("60.000", Err(Ambiguous(60))),
            ("-1e999", Err(TooLarge)),
        ] {
            assert_eq!(parse_real(text), number, "{text}");
        }
    }
}
