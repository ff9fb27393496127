//! Places labels beside the ends of curves, without overlaps.

/// Returns the place of each label: as close as possible to where it is `wanted`, at least `gap`
/// from the others, and between `low` and `high` if they fit.
pub fn spread(wanted: &[f32], gap: f32, low: f32, high: f32) -> Vec<f32> {
    let mut order: Vec<usize> = (0..wanted.len()).collect();
    order.sort_by(|a, b| wanted[*a].total_cmp(&wanted[*b]));
    // Groups of labels that touch: the place of the first, and their number.
    let mut groups: Vec<(f32, usize)> = Vec::new();
    for i in &order {
        groups.push((wanted[*i].clamp(low, high.max(low)), 1));
        while let [.., (upper, above), (lower, below)] = groups[..]
            && upper + above as f32 * gap > lower
        {
            // The first label of both, where their places differ least from those wanted.
            let (a, b) = (above as f32, below as f32);
            let first = (a * upper + b * (lower - a * gap)) / (a + b);
            groups.pop();
            groups.pop();
            let end = first + (a + b - 1.0) * gap;
            let shift = (high - end).min(0.0);
            groups.push(((first + shift).max(low), above + below));
        }
    }
    let places =
        groups.iter().flat_map(|(first, count)| (0..*count).map(move |i| first + i as f32 * gap));
    let mut found = vec![0.0; wanted.len()];
    order.iter().zip(places).for_each(|(i, place)| found[*i] = place);
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_keep_apart_and_within_bounds() {
        assert_eq!(spread(&[10.0, 50.0], 8.0, 0.0, 100.0), [10.0, 50.0], "they do not touch");
        assert_eq!(spread(&[50.0, 50.0], 8.0, 0.0, 100.0), [46.0, 54.0]);
        let all = spread(&[0.0, 1.0, 0.0, 99.0, 100.0], 10.0, 0.0, 100.0);
        let mut sorted = all.clone();
        sorted.sort_by(f32::total_cmp);
        assert!(sorted.windows(2).all(|pair| pair[1] - pair[0] > 9.99), "{all:?}");
        assert!(sorted[0] >= 0.0 && sorted[4] <= 100.0, "{all:?}");
        assert!(all[0] < all[1] && all[3] < all[4], "in the order of the curves: {all:?}");
    }
}
