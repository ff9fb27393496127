//! Which goals agents have.

use super::*;

/// Returns the longest way along an axis from an agent's start to its goal, over many episodes.
fn farthest_goal(near_goals: f32) -> f32 {
    let mut own = settings();
    own.train.near_goals = near_goals;
    own.train.restart = Restart::Anywhere;
    own.train.episode_steps = Auto::Given(5);
    let mut run = trainer(own, 15, 1);
    let mut farthest = 0.0f32;
    for _ in 0..60 {
        run.tick().unwrap();
        let starts =
            run.rollout().agents().iter().zip(run.rollout().env().states().chunks_exact(2));
        let begins = starts.filter(|(agent, _)| agent.steps == 0 && run.counters().episodes > 0);
        for (agent, at) in begins {
            farthest =
                (agent.goal[0] - at[0]).abs().max((agent.goal[1] - at[1]).abs()).max(farthest);
        }
    }
    farthest
}

#[test]
fn near_goals_are_where_walks_of_a_few_steps_end() {
    let near = farthest_goal(1.0);
    assert!((1.0..=4.0).contains(&near), "{near}");
    assert!(farthest_goal(0.0) > 10.0);
}

/// Returns a run whose agents always go from start to goal, in episodes of 40 steps.
fn one_goal(planner: Planner, map: &str) -> Result<Trainer, train::TrainError> {
    let mut own = settings();
    own.train.goals = Goals::Map;
    own.train.agents = 8;
    own.train.episode_steps = Auto::Given(40);
    let method = Method { planner, ..Method::default() };
    let run = Run { method, preset: Preset::Default, seed: 3, settings: own };
    let world = PointMaze::new(Arc::new(parse_map("marked", map.as_bytes()).unwrap()), 0);
    Trainer::new(run, &world, &Registry::builtin(), 1)
}

#[test]
fn the_maps_goal_is_the_only_one_and_every_episode_begins_at_its_start() {
    for planner in [Planner::None, Planner::Bridges] {
        let mut run = one_goal(planner, &marked_rooms()).unwrap();
        let goal = map_of(&run).goals()[0].centre();
        let (mut begun, mut bridges) = (0, 0);
        while run.counters().updates < 300 {
            run.tick().unwrap();
            let agents = run.rollout().agents().iter().zip(run.world().states().chunks_exact(2));
            for (agent, at) in agents {
                let last = agent.after_bridge.as_deref().unwrap_or(&agent.goal);
                assert!(last == goal || planner == Planner::Bridges, "but for plans to it");
                bridges += usize::from(agent.goal != goal);
                if agent.steps == 0 {
                    assert!(at[0] < 1.0 && at[1] < 1.0, "begins at {at:?}");
                    begun += 1;
                }
            }
        }
        // More than time runs out for: those who reach the goal begin again.
        let (episodes, reached) = (run.counters().episodes, run.counters().goals_reached);
        assert!(reached > 0 && episodes > run.counters().env_steps / 40, "{episodes}, {reached}");
        assert!(begun > episodes as usize);
        assert_eq!(bridges > 0, planner == Planner::Bridges, "on the way, bridge points");

        assert_resumes(|| one_goal(planner, &marked_rooms()).unwrap(), 300, 350);
    }
}

#[test]
fn without_a_way_from_start_to_goal_there_is_no_one_goal() {
    let refused = |map: &str| match one_goal(Planner::None, map) {
        Ok(_) => panic!("a run"),
        Err(error) => error.to_string(),
    };
    let walled = marked_rooms().replace("\n...........", "\n..........#");
    for map in [TWO_ROOMS, &marked_rooms().replace('S', "."), &walled] {
        assert_eq!(
            refused(map),
            "marked has no start S from which a goal G can be reached, which goals=map requires"
        );
    }
    let mut run = one_goal(Planner::None, &marked_rooms()).unwrap();
    let walled = Arc::new(parse_map("walled", walled.as_bytes()).unwrap());
    assert!(change_map(&mut run, &walled).is_err(), "an edit that leaves no way");
    train_to(&mut run, 20);
}
