//! The geometry of an arm and its surroundings, for display, and where front ends may place goals
//! and arms; the wall of fetch-reach-wall.

use glam::DVec3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::arm::{Arm, Frames};
use super::constraints::{Rows, TABLE_TOP, TABLE_X, TABLE_Y};
use super::model::{BASE, GOAL_CENTRE, JOINTS};
use super::{EPISODE_STEPS, FetchReach, GOAL_RADIUS, GOAL_RANGE, POSITION_RANGE, WALL_CLEARANCE};

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
pub struct ArmScene {
    /// The wall, if there is one.
    wall: Option<Wall>,
}

/// The positions of an arm's parts, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Where the torso carries the arm.
    pub base: [f32; 3],
    /// Its joints, from the shoulder to the wrist.
    pub joints: [[f32; 3]; JOINTS],
    /// The origin of `gripper_link`.
    pub gripper: [f32; 3],
    /// The point between the fingers: the first three numbers of its state.
    pub grip: [f32; 3],
    /// Both fingers, each from its root to its tip.
    pub fingers: [[[f32; 3]; 2]; 2],
}

impl Pose {
    fn new(frames: &Frames) -> Self {
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
    /// Returns the scene with or without a wall.
    pub(super) fn new(wall: Option<Wall>) -> Self {
        Self { wall }
    }

    /// Returns a new world with `agents` arms.
    pub fn world(&self, agents: usize) -> FetchReach {
        FetchReach::new(self.wall, agents)
    }

    /// Returns the wall, if there is one.
    pub fn wall(&self) -> Option<Corners> {
        self.wall.map(|wall| [wall.low, wall.high].map(|corner| corner.as_vec3().to_array()))
    }

    /// Returns the goal region.
    pub fn goals(&self) -> Corners {
        around_centre(GOAL_RANGE)
    }

    /// Returns the grip positions that states are scaled to: goals, and what exploration reaches
    /// beyond them.
    pub fn positions(&self) -> Corners {
        around_centre(POSITION_RANGE.into())
    }

    /// Returns the corners of the table's top.
    pub fn table(&self) -> Corners {
        let corner = |x: f64, y: f64| [x as f32, y as f32, TABLE_TOP as f32];
        [corner(TABLE_X.0, TABLE_Y.0), corner(TABLE_X.1, TABLE_Y.1)]
    }

    /// Returns whether the grip may be at a position: within [`Self::positions`], above the table,
    /// outside the wall.
    pub fn has_room(&self, at: [f32; 3]) -> bool {
        let within = |[low, high]: Corners| (0..3).all(|i| (low[i]..=high[i]).contains(&at[i]));
        within(self.positions()) && at[2] >= self.table()[0][2] && !self.wall().is_some_and(within)
    }

    /// A goal is reached when the grip is closer to it than this, in metres.
    pub fn goal_radius(&self) -> f32 {
        GOAL_RADIUS
    }

    /// Returns the steps of an episode.
    pub fn episode_steps(&self) -> u32 {
        EPISODE_STEPS
    }

    /// Draws a goal.
    pub fn random_goal(&self, rng: &mut ChaCha8Rng) -> [f32; 3] {
        random_goal(self.wall.as_ref(), rng).as_vec3().to_array()
    }

    /// Returns the allowed goal nearest to `at`.
    pub fn nearest_goal(&self, at: [f32; 3]) -> [f32; 3] {
        let [low, high] = self.goals();
        let mut goal: [f32; 3] = std::array::from_fn(|i| at[i].clamp(low[i], high[i]));
        if let Some(wall) = self.wall {
            let (middle, clearance) = (wall.middle() as f32, WALL_CLEARANCE as f32);
            let off = goal[1] - middle;
            if off.abs() < clearance {
                goal[1] = middle + clearance.copysign(off);
            }
        }
        goal
    }
}

fn around_centre(range: f64) -> Corners {
    [-range, range].map(|by| (GOAL_CENTRE + DVec3::splat(by)).as_vec3().to_array())
}

/// Draws a goal, in metres.
pub(super) fn random_goal(wall: Option<&Wall>, rng: &mut ChaCha8Rng) -> DVec3 {
    loop {
        let goal = GOAL_CENTRE
            + DVec3::from_array(std::array::from_fn(|_| rng.random_range(-GOAL_RANGE..GOAL_RANGE)));
        if wall.is_none_or(|wall| (goal.y - wall.middle()).abs() > WALL_CLEARANCE) {
            return goal;
        }
    }
}

/// Moves `arm` towards `to` by proportional control, for an episode.
pub(super) fn guide(arm: &mut Arm, to: DVec3, wall: Option<&Wall>, rows: &mut Rows) {
    for _ in 0..EPISODE_STEPS {
        let action = ((to - arm.frames().grip()) * GAIN).clamp(DVec3::NEG_ONE, DVec3::ONE);
        arm.step(action, wall, rows);
    }
}

impl FetchReach {
    /// Returns where an arm's parts are. For display: states, and so learning and evaluation, do
    /// not contain it.
    pub fn pose(&self, agent: usize) -> Pose {
        Pose::new(&self.arms[agent].frames())
    }

    /// Moves an arm's grip as close to `at` (in metres) as proportional control leads it from the
    /// start on that side of the wall.
    pub fn put(&mut self, agent: usize, at: [f32; 3]) {
        let to = glam::Vec3::from_array(at).as_dvec3();
        let of_side = |arm: &&Arm| self.is_left(arm.frames().grip().y) == self.is_left(to.y);
        let mut arm = *self.starts.iter().find(of_side).unwrap_or(&self.starts[0]);
        guide(&mut arm, to, self.wall.as_ref(), &mut self.rows);
        self.set_full_state(agent, &arm.full_state());
    }
}

/// A box that the arm cannot enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Lowest corner in metres.
    pub low: DVec3,
    /// Highest corner in metres.
    pub high: DVec3,
}

/// Stands on the table between the left and the right half of the goal region: 2 cm thick, from
/// before the arm's shoulder to beyond its reach, and 5.5 cm higher than the highest goal. So no
/// straight line leads to the other half, nor does sliding along the wall towards the goal; the way
/// is over the top.
pub const WALL: Wall =
    Wall { low: DVec3::new(1.0, 0.739_101, 0.4), high: DVec3::new(1.8, 0.759_101, 0.74) };

/// A ball around the arm's centre line.
pub struct Sphere {
    /// The link that it is fixed to.
    pub link: usize,
    /// Distance of its centre from the joint along the link, in metres.
    pub along: f64,
    /// Metres.
    pub radius: f64,
}

const fn sphere(link: usize, along: f64) -> Sphere {
    Sphere { link, along, radius: RADIUS }
}

/// Radius of the arm in metres.
pub const RADIUS: f64 = 0.03;

/// The arm from the shoulder to the fingertips, by balls at most 4.5 cm apart.
pub static SPHERES: [Sphere; 22] = [
    sphere(1, 0.199),
    sphere(2, 0.02),
    sphere(2, 0.06),
    sphere(2, 0.10),
    sphere(3, 0.007),
    sphere(3, 0.03),
    sphere(3, 0.06),
    sphere(3, 0.10),
    sphere(3, 0.14),
    sphere(3, 0.18),
    sphere(4, 0.023),
    sphere(4, 0.063),
    sphere(4, 0.103),
    sphere(5, 0.015),
    sphere(5, 0.055),
    sphere(5, 0.095),
    sphere(5, 0.135),
    sphere(6, 0.0365),
    sphere(6, 0.0765),
    sphere(6, 0.1165),
    sphere(6, 0.1515),
    sphere(6, 0.1764),
];

impl Sphere {
    /// Returns its centre in metres.
    pub fn centre(&self, frames: &Frames) -> DVec3 {
        frames.origins[self.link] + frames.turns[self.link].x_axis * self.along
    }
}

impl Wall {
    /// Returns the y of its middle in metres.
    pub fn middle(&self) -> f64 {
        f64::midpoint(self.low.y, self.high.y)
    }

    /// Returns the distance in metres from `at` to the box, negative inside, and the direction away
    /// from it; `None` if it is far away.
    pub fn distance(&self, at: DVec3) -> Option<(f64, DVec3)> {
        let off = at - at.clamp(self.low, self.high);
        let squared = off.length_squared();
        if squared > 4.0 * RADIUS * RADIUS {
            None
        } else if squared > 0.0 {
            let distance = squared.sqrt();
            Some((distance, off / distance))
        } else {
            // Inside: out through the nearer of the two large faces, as the box is flat.
            let (left, right) = (at.y - self.low.y, self.high.y - at.y);
            Some(if left < right { (-left, -DVec3::Y) } else { (-right, DVec3::Y) })
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::WALL;
    use super::*;
    use crate::env::Environment;

    fn distance(a: [f32; 3], b: [f32; 3]) -> f32 {
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt()
    }

    #[test]
    fn the_links_are_connected_and_end_at_the_observed_grip() {
        let mut world = FetchReach::new(None, 1);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..60 {
            let pose = world.pose(0);
            let links: Vec<_> = pose.links().collect();
            assert!(links.windows(2).all(|pair| pair[0][1] == pair[1][0]), "a chain: {links:?}");
            assert_eq!((links[0][0], links.len()), (pose.base, JOINTS + 2));
            let grip = links[links.len() - 1][1];
            let observed = std::array::from_fn(|i| world.states()[i]);
            assert!(distance(grip, observed) < 1e-3, "{grip:?} is not {observed:?}");
            let lengths: Vec<f32> = links.iter().map(|[from, to]| distance(*from, *to)).collect();
            // From shoulder_lift on, the offsets of the chain along x.
            for (length, offset) in
                lengths[2..].iter().zip([0.219, 0.133, 0.197, 0.1245, 0.1385, 0.1664, 0.02])
            {
                assert!((length - offset).abs() < 1e-5, "{length} is not {offset}");
            }
            let action: [f32; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            world.step(&action, &mut rng);
        }
    }

    #[test]
    fn arms_are_put_on_either_side_of_the_wall() {
        let mut world = FetchReach::new(Some(WALL), 1);
        for at in [[1.3, 0.65, 0.5], [1.4, 0.85, 0.6]] {
            world.put(0, at);
            let grip = world.pose(0).grip;
            assert!(distance(grip, at) < 0.02, "{grip:?} is not {at:?}");
        }
    }

    #[test]
    fn goals_stay_in_their_region_and_off_the_wall() {
        let scene = ArmScene::new(Some(WALL));
        assert_eq!(
            scene.nearest_goal([9.0, 0.85, -9.0]),
            [scene.goals()[1][0], 0.85, scene.goals()[0][2]]
        );
        let beside = scene.nearest_goal([1.3, 0.7496, 0.5]);
        assert!((beside[1] - 0.7991).abs() < 1e-3, "{beside:?}");
        assert_eq!(scene.world(0).kind(), "fetch-reach-wall");
    }
}
