//! Positions along straight lines.

/// Returns `count` + 1 evenly spaced positions from one end to the other; `count` is at least 1.
pub fn positions_along([from, to]: [[f32; 2]; 2], count: usize) -> impl Iterator<Item = [f32; 2]> {
    (0..=count).map(move |n| {
        let share = n as f32 / count as f32;
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]
    })
}
