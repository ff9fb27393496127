//! Where the joints and the gripper are, and how they move.

use glam::{DMat3, DQuat, DVec3};

use super::model::{BASE, CHAIN, GRIP, GRIPPER, JOINTS, Joints};

/// The axes of the world.
const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

/// The arm's frames in the world, by forward kinematics.
#[derive(Clone, Copy, Debug)]
pub struct Frames {
    /// Each joint's origin in metres.
    pub origins: [DVec3; JOINTS],
    /// Each joint's axis, of length 1.
    pub axes: [DVec3; JOINTS],
    /// Each link's orientation.
    pub turns: [DMat3; JOINTS],
    /// The origin of `gripper_link` in metres.
    pub gripper: DVec3,
    /// Its orientation.
    pub orientation: DQuat,
}

impl Frames {
    /// Returns the frames at these joint angles.
    pub fn new(angles: &Joints) -> Self {
        let (mut at, mut orientation, mut turn) = (BASE, DQuat::IDENTITY, DMat3::IDENTITY);
        let mut frames = Self {
            origins: [DVec3::ZERO; JOINTS],
            axes: [DVec3::ZERO; JOINTS],
            turns: [DMat3::IDENTITY; JOINTS],
            gripper: DVec3::ZERO,
            orientation,
        };
        for (i, joint) in CHAIN.iter().enumerate() {
            at += turn * joint.offset;
            frames.origins[i] = at;
            frames.axes[i] = turn.col(joint.axis);
            orientation *= DQuat::from_axis_angle(AXES[joint.axis], angles[i]);
            turn = DMat3::from_quat(orientation);
            frames.turns[i] = turn;
        }
        frames.gripper = at + turn * GRIPPER;
        frames.orientation = orientation;
        frames
    }

    /// Returns the orientation of the gripper as a matrix.
    pub fn hand(&self) -> &DMat3 {
        &self.turns[JOINTS - 1]
    }

    /// Returns the grip site in metres.
    pub fn grip(&self) -> DVec3 {
        self.gripper + *self.hand() * GRIP
    }

    /// Returns the velocity in m/s per joint velocity of a point at `at` that is fixed to link
    /// `link`.
    pub fn jacobian(&self, link: usize, at: DVec3) -> [DVec3; JOINTS] {
        std::array::from_fn(|i| {
            if i <= link { self.axes[i].cross(at - self.origins[i]) } else { DVec3::ZERO }
        })
    }

    /// Returns the velocity of the grip site in m/s.
    pub fn grip_velocity(&self, velocities: &Joints) -> DVec3 {
        self.jacobian(JOINTS - 1, self.grip())
            .iter()
            .zip(velocities)
            .map(|(column, v)| *column * *v)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The grip site after the reference's reset, in metres.
    const RESET_GRIP: DVec3 = DVec3::new(1.341_834_75, 0.749_101_03, 0.534_725_18);

    #[test]
    fn the_joints_at_reset_put_the_grip_where_the_reference_has_it() {
        let off = Frames::new(&CHAIN.each_ref().map(|joint| joint.angle)).grip() - RESET_GRIP;
        assert!(off.abs().max_element() < 1e-6, "{off}");
    }

    #[test]
    fn jacobians_are_the_derivatives_of_positions() {
        let angles: Joints = std::array::from_fn(|i| 0.4 * (i as f64 - 3.0));
        let frames = Frames::new(&angles);
        let jacobian = frames.jacobian(JOINTS - 1, frames.grip());
        for i in 0..JOINTS {
            let grip_at = |by: f64| {
                let mut moved = angles;
                moved[i] += by;
                Frames::new(&moved).grip()
            };
            let difference = (grip_at(1e-6) - grip_at(-1e-6)) / 2e-6;
            assert!(difference.abs_diff_eq(jacobian[i], 1e-9), "joint {i}: {difference}");
        }
    }
}
