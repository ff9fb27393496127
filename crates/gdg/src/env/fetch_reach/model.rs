//! The arm's geometry, inertia and kinematics: the constants of FetchReach-v4 (gymnasium-robotics 1.4.2).

use std::sync::LazyLock;

use glam::{DMat3, DQuat, DVec3};

pub const JOINTS: usize = 7;

pub type Joints = [f64; JOINTS];

pub struct Joint {
    /// Offset from the parent's frame in metres.
    pub offset: DVec3,
    /// Axis: 0 is x, 1 is y, 2 is z.
    pub axis: usize,
    /// Lowest and highest angle in rad, with the inverse inertia that the reference gives a limit's
    /// row; `None` turns freely.
    pub limits: Option<JointRange>,
    /// Viscous damping in N m s/rad.
    pub damping: f64,
    /// Inertia of the motor in kg m².
    pub armature: f64,
    /// Stiffness of the spring that pulls the joint to 0, in N m/rad.
    pub stiffness: f64,
}

#[derive(Clone, Copy)]
pub struct JointRange {
    pub low: f64,
    pub high: f64,
    /// Scale of the row's regularisation.
    pub inverse_inertia: f64,
}

const fn limits(low: f64, high: f64, inverse_inertia: f64) -> JointRange {
    JointRange { low, high, inverse_inertia }
}

/// The torso frame in the world, in metres.
pub const BASE: DVec3 = DVec3::new(
    0.2869 + 0.404_899_881_952_469_4 - 0.0869,
    0.2641 + 0.480_000_000_026_707_8,
    0.3774 + 0.001_256_316_149_437_5 + 2.99e-7,
);

/// A joint like most, with these limits.
const fn joint(offset: [f64; 3], axis: usize, limits: Option<JointRange>) -> Joint {
    let offset = DVec3::from_array(offset);
    Joint { offset, axis, limits, damping: 50.0, armature: 1.0, stiffness: 0.0 }
}

/// The joints from shoulder to wrist: shoulder pan and lift, upper arm roll, elbow flex, forearm
/// roll, wrist flex and roll. All frames are unrotated at angle 0.
pub static CHAIN: [Joint; JOINTS] = [
    joint([0.1195, 0.0, 0.3486], 2, Some(limits(-1.6056, 1.6056, 0.073_663_7))),
    joint([0.117, 0.0, 0.06], 1, Some(limits(-1.221, 1.518, 0.340_356_1))),
    joint([0.219, 0.0, 0.0], 0, None),
    joint([0.133, 0.0, 0.0], 1, Some(limits(-2.251, 2.251, 0.682_978_3))),
    Joint {
        damping: 3.5247,
        armature: 2.7538,
        stiffness: 10.0,
        ..joint([0.197, 0.0, 0.0], 0, None)
    },
    joint([0.1245, 0.0, 0.0], 1, Some(limits(-2.16, 2.16, 0.809_459_6))),
    joint([0.1385, 0.0, 0.0], 0, None),
];

/// Angle in rad and velocity in rad/s of each joint at reset.
pub const RESET: [[f64; 2]; JOINTS] = [
    [0.009_951_729_242_092_283, 0.000_744_489_074_071_289],
    [-0.825_638_558_758_470_7, 0.006_471_044_304_460_587],
    [-0.003_624_848_935_952_178, -0.001_390_179_209_535_696_2],
    [1.443_894_685_857_816_3, -0.002_199_885_113_987_556_3],
    [0.003_059_309_078_914_222, 0.001_102_948_856_307_666_1],
    [0.953_218_534_161_562_1, -0.001_160_167_755_615_268_4],
    [0.005_519_638_183_732_647_5, -0.000_928_528_151_623_920_9],
];

/// From the last joint to `gripper_link`, in metres.
pub const GRIPPER: DVec3 = DVec3::new(0.1664, 0.0, 0.0);

/// From `gripper_link` to the grip site between the fingers, in metres.
pub const GRIP: DVec3 = DVec3::new(0.02, 0.0, 0.0);

/// The middle of the goals in metres: the grip site when the reference measures it, about a
/// micrometre from where it is at reset.
pub const GOAL_CENTRE: DVec3 = DVec3::new(1.341_835, 0.749_101, 0.534_724);

/// Mass properties of one rigid link.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Mass in kg.
    pub mass: f64,
    /// Centre of mass in the joint's frame, in metres.
    pub centre: DVec3,
    /// Inertia about the centre of mass in the joint's frame, in kg m².
    pub inertia: DMat3,
}

impl Body {
    /// Returns a body with this mass and centre of mass (x, y, z), whose inertia is diagonal in a frame
    /// turned by a quaternion (w, x, y, z): the next four numbers, and the diagonal.
    fn new([mass, x, y, z, qw, qx, qy, qz, ixx, iyy, izz]: [f64; 11]) -> Self {
        let turn = DMat3::from_quat(DQuat::from_xyzw(qx, qy, qz, qw).normalize());
        let inertia = turn * DMat3::from_diagonal(DVec3::new(ixx, iyy, izz)) * turn.transpose();
        Self { mass, centre: DVec3::new(x, y, z), inertia }
    }

    fn moved(self, by: DVec3) -> Self {
        Self { centre: self.centre + by, ..self }
    }

    /// Returns both bodies as one (parallel axis theorem).
    fn joined(self, other: Self) -> Self {
        let mass = self.mass + other.mass;
        let centre = (self.mass * self.centre + other.mass * other.centre) / mass;
        let about = |body: Self| body.inertia + point_inertia(body.mass, body.centre - centre);
        Self { mass, centre, inertia: about(self) + about(other) }
    }
}

/// Returns the inertia about the origin of a point mass at `at`.
pub fn point_inertia(mass: f64, at: DVec3) -> DMat3 {
    let outer = DMat3::from_cols(at * at.x, at * at.y, at * at.z);
    (DMat3::from_diagonal(DVec3::splat(at.length_squared())) - outer) * mass
}

/// The links from shoulder pan to wrist roll, the gripper, and a finger in its middle: see [`Body::new`].
const LINKS: [[f64; 11]; JOINTS + 2] = [
    [2.5587, 0.0927, -0.0056, 0.0564, -0.1364, 0.7624, -0.1562, 0.613, 0.009, 0.0086, 0.0041],
    [2.6615, 0.1432, 0.0072, -0.0001, 0.4382, 0.4382, 0.555, 0.555, 0.0116, 0.0112, 0.0023],
    [2.3311, 0.1165, 0.0014, 0.0, -0.0136, 0.707, 0.0136, 0.707, 0.0047, 0.0045, 0.0019],
    [2.1299, 0.1279, 0.0073, 0.0, 0.4332, 0.4332, 0.5589, 0.5589, 0.0086, 0.0084, 0.002],
    [1.6563, 0.1097, -0.0266, 0.0, -0.0715, 0.7035, 0.0715, 0.7035, 0.0035, 0.0031, 0.0015],
    [1.725, 0.0882, 0.0009, -0.0001, 0.4895, 0.4895, 0.5103, 0.5103, 0.0042, 0.0042, 0.0018],
    [0.1354, 0.0095, 0.0004, -0.0002, 1.0, 0.0, 0.0, 0.0, 0.0001, 0.0001, 0.0001],
    [1.5175, -0.09, -0.0001, -0.0017, 0.0, 1.0, 0.0, 1.0, 0.0024, 0.0019, 0.0013],
    [4.0, -0.01, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.1, 0.1, 0.1],
];

/// The links, one per joint; wrist roll, gripper and fingers are one.
pub static BODIES: LazyLock<[Body; JOINTS]> = LazyLock::new(|| {
    let [mut links @ .., gripper, finger] = LINKS.map(Body::new);
    let finger = |y: f64| finger.moved(DVec3::new(0.0, y, 0.0));
    let hand = gripper.joined(finger(0.0159)).joined(finger(-0.0159)).moved(GRIPPER);
    links[JOINTS - 1] = links[JOINTS - 1].joined(hand);
    links
});

pub type Matrix = [Joints; JOINTS];

#[inline]
pub fn dot(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[inline]
pub fn product(m: &Matrix, x: &Joints) -> Joints {
    std::array::from_fn(|i| dot(&m[i], x))
}

/// Adds `weight * row rowᵀ` to the lower triangle of `m`.
#[inline]
pub fn add_outer(m: &mut Matrix, row: &Joints, weight: f64) {
    for i in 0..JOINTS {
        let scaled = weight * row[i];
        for j in 0..=i {
            m[i][j] += scaled * row[j];
        }
    }
}

#[inline]
pub fn add_scaled(to: &mut Joints, scale: f64, x: &Joints) {
    for (to, x) in to.iter_mut().zip(x) {
        *to += scale * x;
    }
}

/// Solves `m x = b` for a positive definite `m`, whose lower triangle is read, by Cholesky's
/// factorisation.
#[inline]
pub fn solve(mut m: Matrix, mut b: Joints) -> Joints {
    // m becomes L with 1 / L_ii on the diagonal.
    for i in 0..JOINTS {
        for j in 0..i {
            let sum: f64 = (0..j).map(|k| m[i][k] * m[j][k]).sum();
            m[i][j] = (m[i][j] - sum) * m[j][j];
        }
        let sum: f64 = (0..i).map(|k| m[i][k] * m[i][k]).sum();
        m[i][i] = 1.0 / (m[i][i] - sum).sqrt();
    }
    for i in 0..JOINTS {
        let sum: f64 = (0..i).map(|k| m[i][k] * b[k]).sum();
        b[i] = (b[i] - sum) * m[i][i];
    }
    for i in (0..JOINTS).rev() {
        let sum: f64 = (i + 1..JOINTS).map(|k| m[k][i] * b[k]).sum();
        b[i] = (b[i] - sum) * m[i][i];
    }
    b
}

/// The axes of the world.
const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

/// The arm's frames in the world, by forward kinematics.
#[derive(Clone, Copy, Debug)]
pub struct ArmFrames {
    /// Each joint's origin in metres.
    pub origins: [DVec3; JOINTS],
    /// Each joint's axis, of length 1.
    pub axes: [DVec3; JOINTS],
    pub turns: [DMat3; JOINTS],
    /// The origin of `gripper_link` in metres.
    pub gripper: DVec3,
    pub orientation: DQuat,
}

impl ArmFrames {
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

    pub fn hand(&self) -> &DMat3 {
        &self.turns[JOINTS - 1]
    }

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
