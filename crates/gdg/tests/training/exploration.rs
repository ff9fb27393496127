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
    let map = perfect_maze(25);
    let explored = |frontier: Auto<f32>| {
        let mut settings = settings();
        settings.bridge.frontier_epsilon = frontier;
        let mut run = trainer_on(&map, settings, 2, 2);
        train_to(&mut run, 2_000);
        run.coverage().unwrap()
    };
    let (with, without) = (explored(Auto::AUTO), explored(Auto::Given(0.0)));
    assert!(with > 0.95, "explored {with}");
    assert!(without < with - 0.2, "without excursions {without}");
}

#[test]
fn excursions_lead_to_the_frontier_and_go_on_after_a_resume() {
    let mut settings = settings();
    settings.bridge.frontier_epsilon = Auto::Given(1.0);
    let mut run = trainer(settings, 5, 1);
    while run.counters().env_steps < 640 {
        run.tick().unwrap();
    }
    let goals = |run: &Trainer| -> Vec<Option<Vec<f32>>> {
        (0..run.rollout().agents().len())
            .map(|i| run.rollout().excursions().destination(i))
            .collect()
    };
    let pursued = goals(&run);
    assert!(pursued.iter().any(Option::is_some), "every goal begins with an excursion");
    assert_eq!(goals(&resumed(&run, 1)), pursued);
}
