//! Accelerations under constraints: a convex problem, solved by Newton's method (Todorov 2014,
//! "Convex and analytically-invertible dynamics with contacts and constraints"; MuJoCo's
//! documentation, "Computation").

use super::constraints::{MAX_ROWS, Row, Rows};
use super::dynamics::Dynamics;
use super::linear::{Matrix, add_outer, add_scaled, dot, product, solve};
use super::model::Joints;

/// Most iterations. With an exact line search it takes 1 or 2; every iteration improves, so
/// stopping early is safe.
const MAX_ITERATIONS: usize = 50;

/// Adds a row's quadratic term to the Hessian's lower triangle and the right-hand side.
fn add_row(hessian: &mut Matrix, rhs: &mut Joints, row: &Row) {
    add_outer(hessian, &row.jacobian, row.weight);
    add_scaled(rhs, row.weight * row.target, &row.jacobian);
}

/// Returns the acceleration `a` that minimises `1/2 aᵀMa - aᵀf + 1/2 sum of w (J a - target)²` over
/// all rows, where an inequality row counts only if `J a < target`; begins at `start`. Gauss's
/// principle: without rows, `M a = f`.
pub fn accelerations(dynamics: &Dynamics, rows: &Rows, start: &Joints) -> Joints {
    let (mut hessian, mut rhs) = (dynamics.mass, dynamics.force);
    for row in rows.equalities() {
        add_row(&mut hessian, &mut rhs, row);
    }
    let sided = rows.inequalities();
    if sided.is_empty() {
        return solve(hessian, rhs);
    }
    let mut a = *start;
    let (mut residuals, mut slopes) = ([0.0; MAX_ROWS], [0.0; MAX_ROWS]);
    for _ in 0..MAX_ITERATIONS {
        let (mut active_hessian, mut active_rhs) = (hessian, rhs);
        for (row, residual) in sided.iter().zip(&mut residuals) {
            *residual = dot(&row.jacobian, &a) - row.target;
            if *residual < 0.0 {
                add_row(&mut active_hessian, &mut active_rhs, row);
            }
        }
        let best = solve(active_hessian, active_rhs);
        let same = sided
            .iter()
            .zip(&residuals)
            .all(|(row, r)| (dot(&row.jacobian, &best) < row.target) == (*r < 0.0));
        if same {
            return best;
        }
        let direction = std::array::from_fn(|i| best[i] - a[i]);
        for (row, slope) in sided.iter().zip(&mut slopes) {
            *slope = dot(&row.jacobian, &direction);
        }
        // The smooth part's slope and curvature along the direction.
        let curved = product(&symmetric(&hessian), &direction);
        let slope = dot(&curved, &a) - dot(&rhs, &direction);
        let curvature = dot(&curved, &direction);
        let length = line_minimum(slope, curvature, sided, &residuals, &slopes);
        add_scaled(&mut a, length, &direction);
    }
    a
}

/// Returns the whole matrix of a lower triangle.
fn symmetric(lower: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| lower[i.max(j)][i.min(j)]))
}

/// Returns t > 0 at the minimum of the convex, piecewise quadratic cost along a line, by walking
/// its breakpoints. At 0, what always counts has this `slope` and `curvature`; row i counts where
/// `residuals[i] + t slopes[i] < 0`.
fn line_minimum(
    mut slope: f64,
    mut curvature: f64,
    rows: &[Row],
    residuals: &[f64],
    slopes: &[f64],
) -> f64 {
    for ((row, residual), along) in rows.iter().zip(residuals).zip(slopes) {
        if *residual < 0.0 {
            slope += row.weight * residual * along;
            curvature += row.weight * along * along;
        }
    }
    // Breakpoints come in order of t; each switches its rows on or off.
    let mut t = 0.0;
    loop {
        let minimum = if curvature > 0.0 { -slope / curvature } else { f64::INFINITY };
        let crossing = |i: &usize| {
            (slopes[*i] != 0.0).then(|| -residuals[*i] / slopes[*i]).filter(|at| *at > t)
        };
        let next = (0..rows.len())
            .filter_map(|i| Some((crossing(&i)?, i)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((at, i)) = next.filter(|(at, _)| *at < minimum) else {
            return minimum.min(f64::MAX);
        };
        // Rows that share the breakpoint count as well.
        for j in (0..rows.len()).filter(|j| *j == i || crossing(j) == Some(at)) {
            let sign = if slopes[j] < 0.0 { 1.0 } else { -1.0 };
            slope += sign * rows[j].weight * residuals[j] * slopes[j];
            curvature += sign * rows[j].weight * slopes[j] * slopes[j];
        }
        t = at;
    }
}
