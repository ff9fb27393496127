//! Contour lines of a field of distances.

/// Contour lines are this many steps apart, or a multiple of it to limit their number.
const CONTOUR_STEPS: f32 = 10.0;
const MAX_CONTOURS: f32 = 14.0;

/// Returns the distance between contours, in steps, on a field whose farthest value is `farthest`.
pub fn contour_interval(farthest: f32) -> f32 {
    (farthest / MAX_CONTOURS / CONTOUR_STEPS).ceil().max(1.0) * CONTOUR_STEPS
}

/// Returns the distance of the contour line that passes between pixel `i` of `field` (rows of `columns` pixels) and the
/// pixel to its right or below, if one does; lines are `interval` apart. NaN pixels have no lines.
pub fn contour_at(field: &[f32], columns: usize, interval: f32, i: usize) -> Option<f32> {
    let band = |i: usize| (field[i] / interval).floor();
    let neighbours = [(i + 1, !(i + 1).is_multiple_of(columns)), (i + columns, true)];
    let mut neighbours = neighbours.into_iter().filter(|(n, same_row)| *same_row && *n < field.len()).map(|(n, _)| n);
    let other = neighbours.find(|n| field[*n].is_finite() && band(*n) != band(i))?;
    field[i].is_finite().then(|| interval * band(i).max(band(other)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contours_pass_where_the_field_crosses_a_multiple_of_the_interval() {
        // Two rows of three pixels.
        let field = [4.0, 9.0, 12.0, 4.0, f32::NAN, 21.0];
        let at = |i| contour_at(&field, 3, 10.0, i);
        assert_eq!([at(0), at(1), at(2), at(3), at(4), at(5)], [None, Some(10.0), Some(20.0), None, None, None]);
        assert_eq!((contour_interval(30.0), contour_interval(150.0)), (10.0, 20.0));
    }
}
