//! The rows of the constraint problem: weld, joint limits and table, as MuJoCo forms them
//! ("Constraint model" and "Solver parameters" in its documentation), and its solution.

use glam::{DQuat, DVec3};

use super::dynamics::Dynamics;
use super::model::ArmFrames;
use super::model::{CHAIN, JOINTS, Joints, Matrix, add_outer, add_scaled, dot, product, solve};

const WELD_ROWS: usize = 6;

const LIMITED: usize = 4;

/// Lower corners of both fingers, and rows per contact: a pyramid of friction in three directions.
const CORNERS: usize = 8;
const PYRAMID: usize = 6;

/// Most rows at a time.
pub const MAX_ROWS: usize = WELD_ROWS + LIMITED + CORNERS * PYRAMID;

/// One row: it pulls the acceleration `a` of the joints towards `jacobian · a = target`.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintRow {
    pub jacobian: Joints,
    pub target: f64,
    /// 1 / R, the inverse of the regularisation.
    pub weight: f64,
}

/// The active rows: the weld's, which always count, then those that count only where `jacobian · a
/// < target`.
pub struct ConstraintRows {
    rows: [ConstraintRow; MAX_ROWS],
    length: usize,
}

impl ConstraintRows {
    pub fn new() -> Self {
        Self {
            rows: [ConstraintRow { jacobian: [0.0; JOINTS], target: 0.0, weight: 0.0 }; MAX_ROWS],
            length: 0,
        }
    }

    pub fn clear(&mut self) {
        self.length = 0;
    }

    pub fn equalities(&self) -> &[ConstraintRow] {
        &self.rows[..WELD_ROWS.min(self.length)]
    }

    /// Returns the rows that count on one side only.
    pub fn inequalities(&self) -> &[ConstraintRow] {
        &self.rows[WELD_ROWS.min(self.length)..self.length]
    }

    fn push(&mut self, row: ConstraintRow) {
        self.rows[self.length] = row;
        self.length += 1;
    }
}

/// How stiffly a constraint holds.
struct Stiffness {
    /// Time constant of the return to the constraint in seconds, critically damped.
    time: f64,
    /// Impedance at residual 0, and from `width` (in metres or rad) on.
    impedance: (f64, f64),
    width: f64,
}

/// Weld and joint limits.
const FIRM: Stiffness = Stiffness { time: 0.02, impedance: (0.9, 0.95), width: 0.001 };

const CONTACT: Stiffness = Stiffness { time: 0.015, impedance: (0.945, 0.97), width: 0.0055 };

impl Stiffness {
    /// Returns the impedance of a constraint that is off by `residual`.
    fn impedance(&self, residual: f64) -> f64 {
        let u = (residual.abs() / self.width).min(1.0);
        let y = if u <= 0.5 { 2.0 * u * u } else { 1.0 - 2.0 * (1.0 - u) * (1.0 - u) };
        self.impedance.0 + y * (self.impedance.1 - self.impedance.0)
    }

    /// Returns the reference acceleration at this `residual` and `velocity` of the row.
    fn target(&self, impedance: f64, residual: f64, velocity: f64) -> f64 {
        let most = self.impedance.1;
        let stiffness = 1.0 / (most * most * self.time * self.time);
        let damping = 2.0 / (most * self.time);
        -damping * velocity - stiffness * impedance * residual
    }

    /// Returns the row of a constraint with one residual.
    fn row(
        &self,
        jacobian: Joints,
        residual: f64,
        velocities: &Joints,
        inverse_inertia: f64,
    ) -> ConstraintRow {
        let impedance = self.impedance(residual);
        ConstraintRow {
            target: self.target(impedance, residual, dot(&jacobian, velocities)),
            weight: weight(impedance, inverse_inertia),
            jacobian,
        }
    }
}

fn weight(impedance: f64, inverse_inertia: f64) -> f64 {
    impedance / ((1.0 - impedance) * inverse_inertia)
}

/// Scales of the weld's regularisation: position rows and rotation rows.
const WELD_INVERSE_INERTIA: [f64; 2] = [0.045_878_977_758_153_27, 0.758_535_899_154_90];

/// Scale of a contact's regularisation, for a row of the pyramid.
const PYRAMID_INVERSE_INERTIA: f64 = 4.0 * 0.05675;

/// The pose that the gripper is welded to during a step.
#[derive(Clone, Copy, Debug)]
pub struct Mocap {
    /// Metres.
    pub position: DVec3,
    pub orientation: DQuat,
}

/// Adds the weld of `gripper_link` to `mocap`.
pub fn weld(rows: &mut ConstraintRows, frames: &ArmFrames, velocities: &Joints, mocap: &Mocap) {
    // vec(q^-1 mocap) is half the rotation vector between both.
    let turn = frames.orientation.conjugate() * mocap.orientation;
    let axis = DVec3::new(turn.x, turn.y, turn.z);
    let (off, to_local) = (mocap.position - frames.gripper, frames.hand().transpose());
    let residual = [off.x, off.y, off.z, axis.x, axis.y, axis.z];
    let mut jacobian = [[0.0; JOINTS]; WELD_ROWS];
    for (i, moved) in frames.jacobian(JOINTS - 1, frames.gripper).iter().enumerate() {
        let local = to_local * -frames.axes[i];
        let turned = (local * turn.w + local.cross(axis)) * 0.5;
        let column = [-moved.x, -moved.y, -moved.z, turned.x, turned.y, turned.z];
        for (row, value) in jacobian.iter_mut().zip(column) {
            row[i] = value;
        }
    }
    let norm = residual.iter().map(|r| r * r).sum::<f64>().sqrt();
    let impedance = FIRM.impedance(norm);
    for (i, (jacobian, residual)) in jacobian.into_iter().zip(residual).enumerate() {
        rows.push(ConstraintRow {
            target: FIRM.target(impedance, residual, dot(&jacobian, velocities)),
            weight: weight(impedance, WELD_INVERSE_INERTIA[i / 3]),
            jacobian,
        });
    }
}

/// Adds the limits of joints that are beyond them.
pub fn limits(rows: &mut ConstraintRows, angles: &Joints, velocities: &Joints) {
    for (i, joint) in CHAIN.iter().enumerate() {
        let Some(limits) = joint.limits else { continue };
        let (low, high) = (angles[i] - limits.low, limits.high - angles[i]);
        let (residual, sign) = if low < high { (low, 1.0) } else { (high, -1.0) };
        if residual < 0.0 {
            let mut jacobian = [0.0; JOINTS];
            jacobian[i] = sign;
            rows.push(FIRM.row(jacobian, residual, velocities, limits.inverse_inertia));
        }
    }
}

/// The table's top in metres: height, and its range of x and y.
pub const TABLE_TOP: f64 = 0.4;
pub const TABLE_X: (f64, f64) = (1.05, 1.55);
pub const TABLE_Y: (f64, f64) = (0.4, 1.1);

/// Contacts act from this distance in metres.
const MARGIN: f64 = 0.001;

/// No corner is farther than this from `gripper_link`, in metres.
const FINGER_REACH: f64 = 0.045;

/// Friction coefficients: sliding along x and y, and turning about z (in metres).
const SLIDING: f64 = 1.0;
const TURNING: f64 = 0.05;

/// Adds the contacts of the fingers' lower corners with the table.
pub fn table(rows: &mut ConstraintRows, frames: &ArmFrames, velocities: &Joints) {
    if frames.gripper.z - FINGER_REACH > TABLE_TOP + MARGIN {
        return;
    }
    for corner in 0..CORNERS {
        let sign = |bit: usize| if corner >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let local = DVec3::new(0.0385, sign(0) * 0.0079 + sign(1) * 0.007, sign(2) * 0.0135);
        let at = frames.gripper + *frames.hand() * local;
        let height = at.z - TABLE_TOP;
        // MuJoCo 3.3.7 reports half the depth of a box inside a box, but the whole distance between
        // two boxes.
        let residual = if height < 0.0 { height / 2.0 } else { height } - MARGIN;
        let above =
            (TABLE_X.0..=TABLE_X.1).contains(&at.x) && (TABLE_Y.0..=TABLE_Y.1).contains(&at.y);
        if residual >= 0.0 || !above {
            continue;
        }
        let moved = frames.jacobian(JOINTS - 1, at);
        for (component, friction) in [(0, SLIDING), (1, SLIDING), (2, TURNING)] {
            for side in [friction, -friction] {
                let jacobian = std::array::from_fn(|i| {
                    let sideways = [moved[i].x, moved[i].y, frames.axes[i].z][component];
                    moved[i].z + side * sideways
                });
                rows.push(CONTACT.row(jacobian, residual, velocities, PYRAMID_INVERSE_INERTIA));
            }
        }
    }
}

/// Most iterations. With an exact line search it takes 1 or 2; every iteration improves, so
/// stopping early is safe.
const MAX_ITERATIONS: usize = 50;

/// Adds a row's quadratic term to the Hessian's lower triangle and the right-hand side.
fn add_row(hessian: &mut Matrix, rhs: &mut Joints, row: &ConstraintRow) {
    add_outer(hessian, &row.jacobian, row.weight);
    add_scaled(rhs, row.weight * row.target, &row.jacobian);
}

/// Returns the acceleration `a` that minimises `1/2 aᵀMa - aᵀf + 1/2 sum of w (J a - target)²` over
/// all rows, where an inequality row counts only if `J a < target`; begins at `start`. Gauss's
/// principle: without rows, `M a = f`.
pub fn accelerations(dynamics: &Dynamics, rows: &ConstraintRows, start: &Joints) -> Joints {
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
    rows: &[ConstraintRow],
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
