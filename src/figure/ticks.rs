//! Ticks of round numbers, and how they are written.

/// Returns the multiples of 1, 2 or 5 times a power of ten from `low` to `high`: as many as
/// possible, but at most `most`.
pub fn round(low: f64, high: f64, most: usize) -> Vec<f64> {
    if !(high > low && (high - low).is_finite()) {
        return vec![low];
    }
    let first = 10f64.powf((high - low).log10().floor() - 1.0);
    let steps = (0..4).flat_map(|power| [1.0, 2.0, 5.0].map(|by| by * 10f64.powi(power)));
    let multiples = |step: f64| {
        let (from, to) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
        (from..=to).map(|i| i as f64 * step).collect::<Vec<_>>()
    };
    let all = steps.map(|step| multiples(first * step));
    all.into_iter().find(|ticks| ticks.len() <= most.max(2)).unwrap_or_else(|| vec![low, high])
}

/// Returns the powers of ten from `low` to `high`; where that is fewer than three, their multiples
/// by 2 and 5 too.
pub fn logarithmic(low: f64, high: f64) -> Vec<f64> {
    let (from, to) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let within = |factors: &'static [f64]| {
        let all =
            (from..=to).flat_map(|power| factors.iter().map(move |by| by * 10f64.powi(power)));
        all.filter(|tick| (low * 0.999..=high * 1.001).contains(tick)).collect::<Vec<_>>()
    };
    let powers = within(&[1.0]);
    if powers.len() < 3 { within(&[1.0, 2.0, 5.0]) } else { powers }
}

/// Returns `value` and its neighbour towards `up` or down among 1, 2 and 5 times powers of ten.
pub fn outwards(value: f64, up: bool) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|by| by * power);
    let found = if up {
        steps.into_iter().find(|step| *step >= value * 0.999)
    } else {
        steps.into_iter().rfind(|step| *step <= value * 1.001)
    };
    found.unwrap_or(value)
}

/// Writes the ticks of one axis, all in the same unit.
pub fn labels(ticks: &[f64]) -> Vec<String> {
    let largest = ticks.iter().fold(0.0, |most: f64, tick| most.max(tick.abs()));
    ticks.iter().map(|tick| in_unit_of(*tick, largest)).collect()
}

/// Writes a number on an axis: 40k, 0.2.
pub fn tick(value: f64) -> String {
    in_unit_of(value, value.abs())
}

fn in_unit_of(value: f64, largest: f64) -> String {
    let (unit, name) = match largest {
        largest if largest >= 1e6 => (1e6, "M"),
        largest if largest >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let short = (value / unit * 1e6).round() / 1e6;
    if short == 0.0 { "0".to_owned() } else { format!("{short}{name}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(labels(&round(0.0, 1.0, 6)), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        assert_eq!(labels(&round(0.0, 58_731.0, 4)), ["0", "20k", "40k"]);
        assert_eq!(labels(&round(3.0, 1_100.0, 6)), ["200", "400", "600", "800", "1000"]);
        assert_eq!(labels(&round(0.0, 0.031, 4)), ["0", "0.01", "0.02", "0.03"]);
        assert_eq!(round(5.0, 5.0, 4), [5.0]);
        for high in [0.007, 1.0, 9.99, 123.0, 1e7] {
            let ticks = round(0.0, high, 5);
            assert!((2..=5).contains(&ticks.len()), "{high}: {ticks:?}");
        }
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten_or_finer() {
        assert_eq!(labels(&logarithmic(0.01, 10.0)), ["0.01", "0.1", "1", "10"]);
        assert_eq!(labels(&logarithmic(0.05, 0.6)), ["0.05", "0.1", "0.2", "0.5"]);
        assert_eq!([outwards(0.037, false), outwards(0.037, true)], [0.02, 0.05]);
        assert_eq!([outwards(1.0, false), outwards(1.0, true)], [1.0, 1.0]);
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.2, 40.0, 40_000.0, 2e6].map(tick), ["0.2", "40", "40k", "2M"]);
    }
}
