//! What agents explore: from one start, without restarts, and on excursions.

use super::*;

#[test]
fn without_restarts_no_agent_is_ever_moved() {
    let mut settings = settings();
    settings.train.agents = 4;
    settings.train.restart = Restart::Never;
    settings.train.episode_steps = Auto::Given(20);
    let mut run = trainer(settings, 3, 1);
    let mut before = run.world().states().to_vec();
    while run.counters().episodes < 40 {
        run.tick().unwrap();
        let jump = |(a, b): (&f32, &f32)| (a - b).abs();
        let farthest = before.iter().zip(run.world().states()).map(jump).fold(0.0, f32::max);
        assert!(farthest <= 1.001, "moved by {farthest} in one step");
        before = run.world().states().to_vec();
    }
}

#[test]
fn from_one_start_everything_is_explored() {
    let world = maze(&format!("S{}", &TWO_ROOMS[1..]));
    let mut run = crate::support::trainer(&world, "gdg-bridge", settings(), 2, 2);
    assert!(run.world().states().iter().all(|v| *v < 1.0), "all agents start in the corner");
    train_to(&mut run, 3_000);
    let ([planned, _], explored) = (success(&run, 20), run.coverage().unwrap());
    assert!(explored > 0.95 && planned > 0.9, "explored {explored}, planned {planned}");
}

#[test]
fn a_maze_with_corridors_one_cell_wide_is_explored_from_one_cell() {
    let map = random(RandomMapKind::Perfect, Some(25), 1);
    let world = PointMaze::new(Arc::new(map.with_marks(vec![Cell::new(1, 1)], Vec::new())), 0);
    let explored = |frontier: Auto<f32>| {
        let mut settings = settings();
        settings.bridge.frontier_epsilon = frontier;
        let mut run = crate::support::trainer(&world, "gdg-bridge", settings, 2, 2);
        train_to(&mut run, 2_000);
        run.coverage().unwrap()
    };
    let (with, without) = (explored(Auto::AUTO), explored(Auto::Given(0.0)));
    assert!(with > 0.95, "explored {with}");
    assert!(without < with - 0.2, "without excursions {without}");
}
