//! One arm: its state and its steps.

use glam::{DQuat, DVec3};

use super::constraints::{self, ConstraintRows, Mocap, accelerations};
use super::dynamics::Dynamics;
use super::model::{ArmFrames, CHAIN, JOINTS, Joints, RESET, add_scaled, product, solve};

const SUBSTEP_SECS: f64 = 0.002;

const SUBSTEPS: usize = 20;

pub const STEP_SECS: f64 = SUBSTEPS as f64 * SUBSTEP_SECS;

/// How far a full action moves the weld's pose, in metres.
const REACH: f64 = 0.05;

/// Numbers of a full state: angles, velocities and the solver's warm start of each joint.
pub const FULL_STATE: usize = 3 * JOINTS;

/// Bounds on numbers from files: beyond joint limits in rad, on angles of joints that turn freely
/// in rad, on velocities in rad/s, and on accelerations in rad/s². The arm stays well within them.
const BEYOND_LIMITS: f64 = 1.0;
const MOST_TURNS: f64 = 1e3;
const MOST_VELOCITY: f64 = 100.0;
const MOST_ACCELERATION: f64 = 1e6;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// In rad.
    pub angles: Joints,
    /// In rad/s.
    pub velocities: Joints,
    /// The latest acceleration in rad/s², the solver's initial guess.
    warm_start: Joints,
}

impl Arm {
    pub fn at_reset() -> Self {
        Self {
            angles: RESET.map(|[angle, _]| angle),
            velocities: RESET.map(|[_, velocity]| velocity),
            warm_start: [0.0; JOINTS],
        }
    }

    /// Returns everything that its future depends on.
    pub fn full_state(&self) -> [f64; FULL_STATE] {
        let all = [self.angles, self.velocities, self.warm_start];
        std::array::from_fn(|i| all[i / JOINTS][i % JOINTS])
    }

    /// Returns the arm in a full state, with numbers out of range clamped.
    pub fn from_full_state(full_state: &[f64]) -> Self {
        let bounded = |part: usize, most: f64| -> Joints {
            std::array::from_fn(|i| full_state[part * JOINTS + i].clamp(-most, most))
        };
        let mut angles = bounded(0, MOST_TURNS);
        for (angle, joint) in angles.iter_mut().zip(&CHAIN) {
            if let Some(limits) = joint.limits {
                *angle = angle.clamp(limits.low - BEYOND_LIMITS, limits.high + BEYOND_LIMITS);
            }
        }
        Self {
            angles,
            velocities: bounded(1, MOST_VELOCITY),
            warm_start: bounded(2, MOST_ACCELERATION),
        }
    }

    pub fn frames(&self) -> ArmFrames {
        ArmFrames::new(&self.angles)
    }

    /// Moves it by one step: a weld pulls the gripper, pointing down, to where `action` (x, y, z in
    /// [-1, 1]) points. `rows` is a buffer.
    pub fn step(&mut self, action: DVec3, rows: &mut ConstraintRows) {
        let mut frames = self.frames();
        let q = frames.orientation;
        let mocap = Mocap {
            position: frames.gripper + action * REACH,
            // Drifts towards a quarter turn about y: the gripper points down.
            orientation: DQuat::from_xyzw(q.x, q.y + 1.0, q.z, q.w + 1.0).normalize(),
        };
        for _ in 0..SUBSTEPS {
            self.substep(&frames, &mocap, rows);
            frames = self.frames();
        }
    }

    fn substep(&mut self, frames: &ArmFrames, mocap: &Mocap, rows: &mut ConstraintRows) {
        let Self { angles, velocities, warm_start } = self;
        let dynamics = Dynamics::new(frames, angles, velocities);
        rows.clear();
        constraints::weld(rows, frames, velocities, mocap);
        constraints::limits(rows, angles, velocities);
        constraints::table(rows, frames, velocities);
        *warm_start = accelerations(&dynamics, rows, warm_start);
        // Damping acts at the end of the sub-step (implicit Euler).
        let mut damped = dynamics.mass;
        for (i, joint) in CHAIN.iter().enumerate() {
            damped[i][i] += SUBSTEP_SECS * joint.damping;
        }
        let acceleration = solve(damped, product(&dynamics.mass, warm_start));
        add_scaled(velocities, SUBSTEP_SECS, &acceleration);
        add_scaled(angles, SUBSTEP_SECS, velocities);
    }
}
