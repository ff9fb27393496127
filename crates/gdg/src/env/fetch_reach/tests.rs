use glam::DVec3;
use rand::SeedableRng;

use super::arm::FULL_STATE;
use super::constraints::{self, Mocap, accelerations};
use super::dynamics::Dynamics;
use super::model::{JOINTS, Joints};
use super::model::{add_scaled, dot, product};
use super::scene::SPHERES;
use super::*;

fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

fn full_action(rng: &mut ChaCha8Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..=1.0)))
}

/// Gradient of the constrained problem at `a`, and a scale to judge it by.
fn gradient(dynamics: &Dynamics, rows: &Rows, a: &Joints) -> (Joints, f64) {
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
    let (mut rng, mut rows, mut most) = (rng(1), Rows::new(), 0);
    for _ in 0..300 {
        // Pressed onto the table, through the wall and beyond joint limits, from any warm start.
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
        constraints::wall(&mut rows, &frames, &arm.velocities, &WALL);
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

#[test]
fn out_of_range_full_states_give_a_finite_arm() {
    let mut rng = rng(4);
    for wall in [None, Some(WALL)] {
        let mut world = FetchReach::new(wall, 1);
        for case in 0..200 {
            let size = if case % 2 == 0 { 1e300 } else { 30.0 };
            let full: Vec<f64> =
                (0..FULL_STATE).map(|_| rng.random_range(-1.0..1.0) * size).collect();
            world.set_full_state(0, &full);
            for _ in 0..20 {
                world.step(&[1.0, -1.0, f32::MAX, 0.0], &mut rng);
                assert!(world.states().iter().all(|v| v.is_finite()), "{full:?}");
                assert!(world.full_state(0).iter().all(|v| v.is_finite()), "{full:?}");
            }
        }
    }
}

#[test]
fn a_full_state_continues_bitwise() {
    for wall in [None, Some(WALL)] {
        let (mut world, mut rng) = (FetchReach::new(wall, 3), rng(5));
        for agent in 0..3 {
            world.restart(agent, &mut rng);
        }
        for step in 0..120 {
            // Held pulls lead to limits, table and wall, where the warm start matters.
            let actions: Vec<f32> =
                (0..12).map(|i| if (i + step / 20) % 3 == 0 { 1.0 } else { -1.0 }).collect();
            let mut other = world.fork(3).expect("it never fails");
            for agent in 0..3 {
                other.set_full_state(agent, &world.full_state(agent)).expect("it never fails");
            }
            assert_eq!(world.states(), other.states());
            world.step(&actions, &mut rng);
            other.step(&actions, &mut rng).expect("it never fails");
            assert!((0..3).all(|i| world.full_state(i) == other.full_state(i)), "step {step}");
        }
    }
}

/// How deep, in metres, the arm's balls have entered the wall, and whether its centre line has.
fn penetration(arm: &Arm) -> (f64, bool) {
    let frames = arm.frames();
    let depths = SPHERES.iter().filter_map(|sphere| {
        WALL.distance(sphere.centre(&frames))
            .map(|(distance, _)| (sphere.radius - distance, distance <= 0.0))
    });
    depths.fold((0.0, false), |most, depth| (most.0.max(depth.0), most.1 || depth.1))
}

#[test]
fn the_wall_stops_every_push() {
    let (mut rng, mut rows, mut deepest) = (rng(7), Rows::new(), 0.0_f64);
    for (episode, start) in starts(Some(&WALL)).repeat(50).into_iter().enumerate() {
        let mut arm = start;
        let mut pull = DVec3::ZERO;
        for step in 0..EPISODE_STEPS {
            if step % 15 == 0 {
                // Towards the wall, and anywhere along it.
                pull = full_action(&mut rng).signum();
                pull.y = (WALL.middle() - arm.frames().grip().y).signum();
            }
            arm.step(pull, Some(&WALL), &mut rows);
            let (depth, inside) = penetration(&arm);
            deepest = deepest.max(depth);
            assert!(
                !inside,
                "the centre line is, episode {episode}, step {step}: {:?}",
                arm.angles
            );
        }
    }
    assert!(deepest < 0.012, "{deepest} m deep");
}

#[test]
fn proportional_control_fails_at_the_wall_but_a_way_over_it_leads_to_every_goal() {
    let tasks = FetchReach::new(Some(WALL), 0).tasks(40, &mut rng(8)).tasks;
    let mut reached = [0; 2];
    for task in &tasks {
        let goal = DVec3::from_array([0, 1, 2].map(|i| f64::from(task.goal[i])));
        for over in [0, 1] {
            let (mut arm, mut rows) = (Arm::from_full_state(&task.start), Rows::new());
            let top = |at: DVec3| DVec3::new(at.x, at.y, WALL.high.z + 0.06);
            let mut way = vec![top(arm.frames().grip()), top(goal), goal];
            way.drain(..2 * (1 - over));
            for _ in 0..EPISODE_STEPS {
                let off = way[0] - arm.frames().grip();
                arm.step((off * 15.0).clamp(DVec3::NEG_ONE, DVec3::ONE), Some(&WALL), &mut rows);
                let left = (way[0] - arm.frames().grip()).length();
                if left < if way.len() > 1 { 0.03 } else { 0.05 } {
                    way.remove(0);
                }
                if way.is_empty() {
                    reached[over] += 1;
                    break;
                }
            }
        }
    }
    assert_eq!(reached, [0, tasks.len()], "straight, over the top");
}
