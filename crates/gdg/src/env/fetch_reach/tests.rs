use glam::DVec3;
use rand::{RngExt, SeedableRng};

use super::constraints::{self, Mocap, accelerations};
use super::dynamics::Dynamics;
use super::model::{JOINTS, Joints};
use super::model::{add_scaled, dot, product};
use super::*;

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn full_action(rng: &mut ChaCha8Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..=1.0)))
}

/// Gradient of the constrained problem at `a`, and a scale to judge it by.
fn gradient(dynamics: &Dynamics, rows: &ConstraintRows, a: &Joints) -> (Joints, f64) {
    let mut gradient = product(&dynamics.mass, a);
    add_scaled(&mut gradient, -1.0, &dynamics.force);
    let mut scale = dot(&dynamics.force, &dynamics.force).sqrt();
    let counted = rows.inequalities().iter().filter(|row| dot(&row.jacobian, a) < row.target);
    for row in rows.equalities().iter().chain(counted) {
        add_scaled(&mut gradient, row.weight * (dot(&row.jacobian, a) - row.target), &row.jacobian);
        scale += (row.weight * row.target).abs();
    }
    (gradient, scale)
}

#[test]
fn newtons_method_finds_the_minimum_with_many_rows_active() {
    let (mut rng, mut rows, mut most) = (rng(1), ConstraintRows::new(), 0);
    for _ in 0..300 {
        // Pressed onto the table and beyond joint limits, from any warm start.
        let mut arm = Arm::at_reset();
        for (angle, velocity) in arm.angles.iter_mut().zip(&mut arm.velocities) {
            *angle += rng.random_range(-0.4..0.4);
            *velocity = rng.random_range(-2.0..2.0);
        }
        let frames = arm.frames();
        let mocap = Mocap {
            position: frames.gripper + full_action(&mut rng) * 0.05,
            orientation: frames.orientation,
        };
        rows.clear();
        constraints::weld(&mut rows, &frames, &arm.velocities, &mocap);
        constraints::limits(&mut rows, &arm.angles, &arm.velocities);
        constraints::table(&mut rows, &frames, &arm.velocities);
        most = most.max(rows.inequalities().len());
        let dynamics = Dynamics::new(&frames, &arm.angles, &arm.velocities);
        let found = |start: f64| accelerations(&dynamics, &rows, &[start; JOINTS]);
        let (a, other) = (found(0.0), found(30.0));
        let (gradient, scale) = gradient(&dynamics, &rows, &a);
        assert!(gradient.iter().all(|v| v.abs() < 1e-10 * scale), "{gradient:?} of {scale}");
        let same = |(a, b): (&f64, f64)| (a - b).abs() < 1e-6 * (1.0 + a.abs());
        assert!(a.iter().zip(other).all(same), "{a:?}, {other:?}");
    }
    assert!(most > 40, "only {most} rows at a time");
}
