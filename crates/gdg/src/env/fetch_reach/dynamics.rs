//! Mass matrix and bias forces, by spatial vectors about the world's origin (Featherstone 2008,
//! chapters 5 and 6).

use glam::{DMat3, DVec3};

use super::model::ArmFrames;
use super::model::Matrix;
use super::model::{BODIES, CHAIN, JOINTS, Joints, point_inertia};

/// Gravity in m/s².
pub const GRAVITY: f64 = 9.81;

/// An angular and a linear part: of a motion, or of a force.
#[derive(Clone, Copy)]
struct Spatial {
    angular: DVec3,
    linear: DVec3,
}

impl Spatial {
    const ZERO: Self = Self { angular: DVec3::ZERO, linear: DVec3::ZERO };

    fn plus(self, other: Self, scale: f64) -> Self {
        Self {
            angular: self.angular + other.angular * scale,
            linear: self.linear + other.linear * scale,
        }
    }

    fn dot(self, other: Self) -> f64 {
        self.angular.dot(other.angular) + self.linear.dot(other.linear)
    }

    /// Returns the rate of change of the motion `of` that is carried along by this motion.
    fn cross_motion(self, of: Self) -> Self {
        Self {
            angular: self.angular.cross(of.angular),
            linear: self.angular.cross(of.linear) + self.linear.cross(of.angular),
        }
    }

    /// The same for the force `of`.
    fn cross_force(self, of: Self) -> Self {
        Self {
            angular: self.angular.cross(of.angular) + self.linear.cross(of.linear),
            linear: self.angular.cross(of.linear),
        }
    }
}

/// The inertia of one or more links, about the world's origin.
#[derive(Clone, Copy)]
struct Inertia {
    mass: f64,
    /// Mass times centre of mass.
    moment: DVec3,
    rotational: DMat3,
}

impl Inertia {
    fn plus(self, other: Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            moment: self.moment + other.moment,
            rotational: self.rotational + other.rotational,
        }
    }

    fn momentum(&self, Spatial { angular, linear }: Spatial) -> Spatial {
        Spatial {
            angular: self.rotational * angular + self.moment.cross(linear),
            linear: linear * self.mass + angular.cross(self.moment),
        }
    }
}

/// Returns each link's inertia.
fn inertias(frames: &ArmFrames) -> [Inertia; JOINTS] {
    let bodies = &*BODIES;
    std::array::from_fn(|i| {
        let (body, turn) = (&bodies[i], &frames.turns[i]);
        let centre = frames.origins[i] + *turn * body.centre;
        let about_centre = *turn * body.inertia * turn.transpose();
        Inertia {
            mass: body.mass,
            moment: centre * body.mass,
            rotational: about_centre + point_inertia(body.mass, centre),
        }
    })
}

/// What accelerates the joints: `mass * acceleration = force`, without constraints.
pub struct Dynamics {
    /// Mass matrix in kg m², armature included.
    pub mass: Matrix,
    /// Force of gravity, motion, damping and springs on each joint, in N m.
    pub force: Joints,
}

impl Dynamics {
    /// Computes the mass matrix by composite inertias and the forces by recursive Newton-Euler.
    pub fn new(frames: &ArmFrames, angles: &Joints, velocities: &Joints) -> Self {
        let mut inertias = inertias(frames);
        let motions: [Spatial; JOINTS] = std::array::from_fn(|i| Spatial {
            angular: frames.axes[i],
            linear: frames.origins[i].cross(frames.axes[i]),
        });
        // A base that accelerates upwards acts like gravity.
        let mut acceleration = Spatial { angular: DVec3::ZERO, linear: DVec3::Z * GRAVITY };
        let mut velocity = Spatial::ZERO;
        let mut forces = [Spatial::ZERO; JOINTS];
        for i in 0..JOINTS {
            velocity = velocity.plus(motions[i], velocities[i]);
            acceleration = acceleration.plus(velocity.cross_motion(motions[i]), velocities[i]);
            let carried = velocity.cross_force(inertias[i].momentum(velocity));
            forces[i] = inertias[i].momentum(acceleration).plus(carried, 1.0);
        }
        let (mut mass, mut force) = ([[0.0; JOINTS]; JOINTS], [0.0; JOINTS]);
        for i in (0..JOINTS).rev() {
            if i + 1 < JOINTS {
                inertias[i] = inertias[i].plus(inertias[i + 1]);
                forces[i] = forces[i].plus(forces[i + 1], 1.0);
            }
            let joint = &CHAIN[i];
            force[i] = -motions[i].dot(forces[i])
                - joint.damping * velocities[i]
                - joint.stiffness * angles[i];
            let momentum = inertias[i].momentum(motions[i]);
            for j in 0..=i {
                mass[i][j] = motions[j].dot(momentum);
                mass[j][i] = mass[i][j];
            }
            mass[i][i] += joint.armature;
        }
        Self { mass, force }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::env::fetch_reach::model::{dot, product};

    const ANGLES: Joints = [0.3, -0.8, 0.4, 1.3, -0.6, 0.9, 1.1];
    const VELOCITIES: Joints = [0.5, -0.3, 0.8, 0.2, -0.9, 0.4, -0.7];

    /// The mass matrix as the sum over the links of m JvᵀJv + JwᵀIJw.
    fn mass_by_jacobians(frames: &ArmFrames) -> Matrix {
        let mut mass = [[0.0; JOINTS]; JOINTS];
        for (link, body) in BODIES.iter().enumerate() {
            let turn = frames.turns[link];
            let columns = frames.jacobian(link, frames.origins[link] + turn * body.centre);
            let inertia = turn * body.inertia * turn.transpose();
            for i in 0..=link {
                for j in 0..=link {
                    mass[i][j] += body.mass * columns[i].dot(columns[j])
                        + frames.axes[i].dot(inertia * frames.axes[j]);
                }
            }
        }
        for (i, joint) in CHAIN.iter().enumerate() {
            mass[i][i] += joint.armature;
        }
        mass
    }

    /// Potential energy of gravity in J.
    fn potential(angles: &Joints) -> f64 {
        let frames = ArmFrames::new(angles);
        let height = |i: usize| (frames.origins[i] + frames.turns[i] * BODIES[i].centre).z;
        (0..JOINTS).map(|i| GRAVITY * BODIES[i].mass * height(i)).sum()
    }

    /// Kinetic energy in J.
    fn kinetic(angles: &Joints) -> f64 {
        dot(&VELOCITIES, &product(&mass_by_jacobians(&ArmFrames::new(angles)), &VELOCITIES)) / 2.0
    }

    fn moved(i: usize, by: f64) -> Joints {
        let mut moved = ANGLES;
        moved[i] += by;
        moved
    }

    #[test]
    fn composite_inertias_and_jacobians_give_the_same_mass_matrix() {
        let frames = ArmFrames::new(&ANGLES);
        let own = Dynamics::new(&frames, &ANGLES, &VELOCITIES).mass;
        for (own, other) in own.iter().flatten().zip(mass_by_jacobians(&frames).iter().flatten()) {
            assert!((own - other).abs() < 1e-12, "{own}, not {other}");
        }
    }

    #[test]
    fn forces_follow_lagranges_equations() {
        let own = Dynamics::new(&ArmFrames::new(&ANGLES), &ANGLES, &VELOCITIES).force;
        let eps = 1e-5;
        // d/dt (M v) at constant v, by the change of M along v.
        let along = |sign: f64| -> Joints {
            let angles = std::array::from_fn(|k| ANGLES[k] + sign * eps * VELOCITIES[k]);
            product(&mass_by_jacobians(&ArmFrames::new(&angles)), &VELOCITIES)
        };
        let (ahead, behind) = (along(1.0), along(-1.0));
        for i in 0..JOINTS {
            let slope =
                |of: fn(&Joints) -> f64| (of(&moved(i, eps)) - of(&moved(i, -eps))) / (2.0 * eps);
            let bias = (ahead[i] - behind[i]) / (2.0 * eps) - slope(kinetic) + slope(potential);
            let expected =
                -bias - CHAIN[i].damping * VELOCITIES[i] - CHAIN[i].stiffness * ANGLES[i];
            assert!((own[i] - expected).abs() < 1e-6, "joint {i}: {}, not {expected}", own[i]);
        }
    }
}
