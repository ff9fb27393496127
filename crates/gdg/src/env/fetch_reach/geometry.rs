//! The geometry of an arm and its surroundings, for display; where front ends may place goals and
//! arms; and the lattice of points, within the gripper's reach, at which the film of a run shows D.

use glam::DVec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::arm::Arm;
use super::constraints::{TABLE_TOP, TABLE_X, TABLE_Y};
use super::model::{ArmFrames, BASE, GOAL_CENTRE, JOINTS};
use super::{EPISODE_STEPS, FetchReach, GOAL_RADIUS, GOAL_RANGE, POSITION_RANGE, STATE};
use crate::env::Probes;

/// A box: its lowest and its highest corner in metres.
pub type Corners = [[f32; 3]; 2];

/// Gain of the proportional control that puts an arm somewhere, in actions per metre.
pub(super) const GAIN: f64 = 15.0;

/// The fingers in the frame of `gripper_link`: to the left and the right of its axis, from there to
/// their tips, in metres.
const FINGER_OFFSET: f64 = 0.0159;
const FINGER_LENGTH: f64 = 0.0385;

/// The geometry around an arm, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmScene;

/// The positions of an arm's parts, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Where the torso carries the arm.
    pub base: [f32; 3],
    /// Its joints, from the shoulder to the wrist.
    pub joints: [[f32; 3]; JOINTS],
    pub gripper: [f32; 3],
    /// The point between the fingers: the first three numbers of its state.
    pub grip: [f32; 3],
    /// Both fingers, each from its root to its tip.
    pub fingers: [[[f32; 3]; 2]; 2],
}

impl Pose {
    fn new(frames: &ArmFrames) -> Self {
        let metres = |at: DVec3| at.as_vec3().to_array();
        let finger = |side: f64| {
            let at =
                |along: f64| metres(frames.gripper + *frames.hand() * DVec3::new(along, side, 0.0));
            [at(0.0), at(FINGER_LENGTH)]
        };
        Self {
            base: metres(BASE),
            joints: frames.origins.map(metres),
            gripper: metres(frames.gripper),
            grip: metres(frames.grip()),
            fingers: [finger(FINGER_OFFSET), finger(-FINGER_OFFSET)],
        }
    }

    /// Returns the links from the base to the grip, each from end to end.
    pub fn links(&self) -> impl Iterator<Item = [[f32; 3]; 2]> {
        let ends = [&[self.base][..], &self.joints, &[self.gripper, self.grip]].concat();
        (1..ends.len()).map(move |i| [ends[i - 1], ends[i]])
    }
}

impl ArmScene {
    pub fn goals(&self) -> Corners {
        around_centre(GOAL_RANGE)
    }

    /// Returns the grip positions that states are scaled to: goals, and what exploration reaches
    /// beyond them.
    pub fn positions(&self) -> Corners {
        around_centre(POSITION_RANGE.into())
    }

    pub fn table(&self) -> Corners {
        let corner = |x: f64, y: f64| [x as f32, y as f32, TABLE_TOP as f32];
        [corner(TABLE_X.0, TABLE_Y.0), corner(TABLE_X.1, TABLE_Y.1)]
    }

    /// Returns whether the grip may be at a position: within [`Self::positions`], above the table.
    pub fn has_room(&self, at: [f32; 3]) -> bool {
        let [low, high] = self.positions();
        (0..3).all(|i| (low[i]..=high[i]).contains(&at[i])) && at[2] >= self.table()[0][2]
    }

    /// A goal is reached when the grip is closer to it than this, in metres.
    pub fn goal_radius(&self) -> f32 {
        GOAL_RADIUS
    }

    pub fn episode_steps(&self) -> u32 {
        EPISODE_STEPS
    }

    pub fn random_goal(&self, rng: &mut ChaCha8Rng) -> [f32; 3] {
        random_goal(rng).as_vec3().to_array()
    }

    pub fn nearest_goal(&self, at: [f32; 3]) -> [f32; 3] {
        let [low, high] = self.goals();
        std::array::from_fn(|i| at[i].clamp(low[i], high[i]))
    }
}

fn around_centre(range: f64) -> Corners {
    [-range, range].map(|by| (GOAL_CENTRE + DVec3::splat(by)).as_vec3().to_array())
}

pub(super) fn random_goal(rng: &mut ChaCha8Rng) -> DVec3 {
    let off = std::array::from_fn(|_| rng.random_range(-GOAL_RANGE..GOAL_RANGE));
    GOAL_CENTRE + DVec3::from_array(off)
}

impl FetchReach {
    /// Returns where an arm's parts are. For display: states, and so learning and evaluation, do
    /// not contain it.
    pub fn pose(&self, agent: usize) -> Pose {
        Pose::new(&self.arms[agent].frames())
    }

    /// Moves an arm's grip as close to `at` (in metres) as an episode of proportional control leads
    /// it from the reset state.
    pub fn put(&mut self, agent: usize, at: [f32; 3]) {
        let (mut arm, to) = (Arm::at_reset(), glam::Vec3::from_array(at).as_dvec3());
        for _ in 0..EPISODE_STEPS {
            let pull = ((to - arm.frames().grip()) * GAIN).clamp(DVec3::NEG_ONE, DVec3::ONE);
            arm.step(pull, &mut self.rows);
        }
        self.arms[agent] = arm;
        self.observe(agent);
    }
}

const ALONG: usize = 11;

/// The points of a film, a lattice along all axes.
#[derive(Clone, Copy, Debug)]
pub struct ProbeLattice {
    low: [f32; 3],
    high: [f32; 3],
    /// Distance between neighbouring points along each axis, in metres.
    apart: [f32; 3],
}

impl ProbeLattice {
    /// Returns the lattice over the grip positions of `scene`.
    pub fn new(scene: &ArmScene) -> Self {
        let [low, high] = scene.positions();
        Self { low, high, apart: std::array::from_fn(|i| (high[i] - low[i]) / (ALONG - 1) as f32) }
    }

    pub fn places(&self) -> usize {
        ALONG.pow(3)
    }

    pub fn point(&self, place: usize) -> [f32; 3] {
        let at = [place % ALONG, place / ALONG % ALONG, place / ALONG.pow(2)];
        // Rounding must not leave the space.
        std::array::from_fn(|i| (self.low[i] + at[i] as f32 * self.apart[i]).min(self.high[i]))
    }

    /// Returns the points around `at` and their weights, which sum up to 1; `None` outside the
    /// lattice.
    pub fn around(&self, at: [f32; 3]) -> Option<[(usize, f32); 8]> {
        let along: [f32; 3] = std::array::from_fn(|i| (at[i] - self.low[i]) / self.apart[i]);
        if !along.iter().all(|along| (0.0..=(ALONG - 1) as f32).contains(along)) {
            return None;
        }
        let first = along.map(|along| (along as usize).min(ALONG - 2));
        Some(std::array::from_fn(|corner| {
            let (mut place, mut weight) = (0, 1.0);
            for i in (0..3).rev() {
                let (up, share) = (corner >> i & 1, along[i] - first[i] as f32);
                place = place * ALONG + first[i] + up;
                weight *= if up == 1 { share } else { 1.0 - share };
            }
            (place, weight)
        }))
    }
}

/// Returns the probes of a film, with the centre of the goal region as the goal.
pub(super) fn film_probes() -> Probes {
    let lattice = ProbeLattice::new(&ArmScene);
    let [low, high] = ArmScene.goals();
    let middle: [f32; 3] = std::array::from_fn(|i| f32::midpoint(low[i], high[i]));
    let of_place: Vec<usize> =
        (0..lattice.places()).filter(|place| ArmScene.has_room(lattice.point(*place))).collect();
    let mut states = vec![0.0; of_place.len() * STATE];
    for (state, place) in states.chunks_exact_mut(STATE).zip(&of_place) {
        state[..3].copy_from_slice(&lattice.point(*place));
    }
    Probes {
        places: lattice.places(),
        place_of: of_place.into_iter().map(|place| place as u32).collect(),
        states,
        goal: ArmScene.nearest_goal(middle).to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::env::{Environment, MAX_PROBES};

    fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt()
    }

    #[test]
    fn the_links_are_connected_and_end_at_the_observed_grip() {
        let mut world = FetchReach::new(1);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..60 {
            let pose = world.pose(0);
            let links: Vec<_> = pose.links().collect();
            assert!(links.windows(2).all(|pair| pair[0][1] == pair[1][0]), "a chain: {links:?}");
            assert_eq!((links[0][0], links.len()), (pose.base, JOINTS + 2));
            let grip = links[links.len() - 1][1];
            let observed = std::array::from_fn(|i| world.states()[i]);
            assert!(distance(grip, observed) < 1e-3, "{grip:?} is not {observed:?}");
            let action: [f32; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            world.step(&action, &mut rng).expect("an arm");
        }
    }

    #[test]
    fn arms_are_put_where_they_are_asked_for_and_goals_stay_in_their_region() {
        let mut world = FetchReach::new(1);
        for at in [[1.3, 0.65, 0.5], [1.4, 0.85, 0.6]] {
            world.put(0, at);
            let grip = world.pose(0).grip;
            assert!(distance(grip, at) < 0.02, "{grip:?} is not {at:?}");
        }
        let [low, high] = ArmScene.goals();
        assert_eq!(ArmScene.nearest_goal([9.0, 0.85, -9.0]), [high[0], 0.85, low[2]]);
    }

    #[test]
    fn points_lie_where_the_grip_may_be() {
        let probes = film_probes();
        assert!(probes.places <= MAX_PROBES);
        assert!(probes.place_of.len() < probes.places, "none is below the table");
        assert_eq!(probes.states.len(), probes.place_of.len() * STATE);
    }

    #[test]
    fn between_points_a_linear_function_is_exact() {
        let lattice = ProbeLattice::new(&ArmScene);
        let value = |[x, y, z]: [f32; 3]| 1.0 + 2.0 * x - 3.0 * y + 0.5 * z;
        let [low, high] = ArmScene.positions();
        for share in [[0.0, 0.0, 0.0], [0.31, 0.77, 0.5], [0.99, 0.02, 0.6]] {
            let at: [f32; 3] = std::array::from_fn(|i| low[i] + share[i] * (high[i] - low[i]));
            let around = lattice.around(at).expect("inside");
            let found: f32 =
                around.iter().map(|(place, weight)| weight * value(lattice.point(*place))).sum();
            assert!((found - value(at)).abs() < 1e-4, "{at:?}: {found}");
        }
        assert!(lattice.around([low[0] - 0.01, low[1], low[2]]).is_none());
        assert!(lattice.around([f32::NAN; 3]).is_none());
    }
}
