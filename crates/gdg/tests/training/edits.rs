//! Edits of the map while a run trains.

use super::*;

/// Returns the map with the door between its two rooms closed or open.
fn with_door(map: &Grid, open: bool) -> Arc<Grid> {
    Arc::new(map.with_cells([7, 8].map(|y| (Cell::new(10, y), open))).unwrap())
}

/// Returns the two rooms with the door in the first row instead.
fn door_above() -> Arc<Grid> {
    let row = |(i, line): (usize, &str)| {
        let (left, right) = (&line[..10], &line[11..]);
        format!("{left}{}{right}\n", if i == 0 { '.' } else { '#' })
    };
    let text: String = TWO_ROOMS.lines().enumerate().map(row).collect();
    Arc::new(parse_map("door-above", text.as_bytes()).unwrap())
}

/// Returns the numbers of edges of the bridge graph from either room to the other, and of all.
fn edges_through_the_door(run: &Trainer) -> (usize, usize) {
    let graph = run.graph().expect("the run has a graph by now");
    let is_left = |i: usize| graph.point(i)[0] < 10.0;
    let through = graph.edges().iter().filter(|edge| is_left(edge.from) != is_left(edge.to));
    (through.count(), graph.edges().len())
}

#[test]
fn an_edit_changes_the_bridge_graph_at_once_and_only_where_it_matters() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 700);
    let map = map_of(&run).clone();
    let before = edges_through_the_door(&run);
    assert!(before.0 > 0, "{before:?}");
    change_map(&mut run, &with_door(&map, false)).unwrap();
    let closed = edges_through_the_door(&run);
    assert!(closed.0 == 0 && 2 * closed.1 > before.1, "{before:?} {closed:?}");
    train_to(&mut run, 720);
    assert_eq!(edges_through_the_door(&run).0, 0);
    change_map(&mut run, &with_door(&map, true)).unwrap();
    let opened = edges_through_the_door(&run);
    assert!(2 * opened.0 > before.0, "the replay shows ways through the door: {opened:?}");
}

#[test]
fn a_run_saved_after_an_edit_continues_as_if_it_had_not_been_interrupted() {
    let edited = || {
        let mut run = trainer(settings(), 5, 1);
        train_to(&mut run, 333);
        let map = with_door(map_of(&run), false);
        change_map(&mut run, &map).unwrap();
        run
    };
    // At once, while the graph's distances are not known yet, and when they are.
    for saved_at in [333, 380, 450] {
        assert_resumes(edited, saved_at, 700);
    }
}

#[test]
fn edits_keep_what_was_explored_and_undoing_one_restores_the_transitions_that_it_removed() {
    let mut run = trainer(settings(), 16, 2);
    train_to(&mut run, 600);
    let (before, explored) = (map_of(&run).clone(), run.coverage().unwrap());
    let closed = change_map(&mut run, &door_above()).unwrap();
    assert!(closed.transitions_removed > 0 && closed.transitions_restored == 0, "{closed:?}");
    assert!(explored > 0.3 && (explored - run.coverage().unwrap()).abs() < 0.1);
    let undone = change_map(&mut run, &before).unwrap();
    assert_eq!(undone.transitions_removed, 0);
    assert_eq!(undone.transitions_restored, closed.transitions_removed);
}

#[test]
fn the_same_networks_learn_a_moved_door() {
    let mut run = trainer(settings(), 13, 2);
    train_to(&mut run, 3_000);
    let other_size = parse_map("small", b"...\n...\n").unwrap();
    let error = change_map(&mut run, &Arc::new(other_size)).unwrap_err().to_string();
    assert!(error.contains("3 x 2") && error.contains("21 x"), "{error}");
    let map = door_above();
    let change = change_map(&mut run, &map).unwrap();
    let doors = TWO_ROOMS.lines().filter(|line| !line.contains('#')).count();
    assert_eq!((&change.facts["walled"], &change.facts["opened"]), (&doors.into(), &1.into()));
    assert!(change.transitions_removed > 100, "{change:?}");
    let again = change_map(&mut run, &map).unwrap();
    assert_eq!((&again.facts["walled"], again.transitions_removed), (&0.into(), 0));
    assert_eq!(map_of(&run), &map);
    // No remaining transition crosses the wall, and no agent is inside it.
    let mut before: Option<Vec<f32>> = None;
    run.replay().visit_episodes(|_, state| {
        if let (Some(a), Some(b)) = (&before, state) {
            let crosses = (a[0] < 10.5) != (b[0] < 10.5);
            assert!(!crosses || a[1] <= 2.1 && b[1] <= 2.1, "from {a:?} to {b:?}");
        }
        before = state.map(<[f32]>::to_vec);
    });
    assert!(run.world().states().chunks_exact(2).all(|at| map.is_free_at(at[0], at[1])));
    assert!(run.candidates().points().chunks_exact(2).all(|at| map.is_free_at(at[0], at[1])));
    train_to(&mut run, 6_000);
    let found = evaluated(&run, 20);
    let planned = found.planned.unwrap().success;
    assert!(planned >= Some(0.9), "planned {planned:?}");
    assert_eq!(found.bridges.unwrap().false_edges, Some(0));
}

#[test]
fn distances_lengthened_by_new_walls_are_relearned_quickly() {
    let through_the_door = |run: &Trainer| {
        let policy = run.policy().unwrap();
        policy.distance(&[8.5, 7.9], &[12.5, 7.9], &mut Scratch::default())
    };
    let mut run = trainer(settings(), 13, 2);
    train_to(&mut run, 3_000);
    let before = through_the_door(&run);
    assert!(before < 6.0, "4 steps through the open door, learned as {before}");
    change_map(&mut run, &door_above()).unwrap();
    train_to(&mut run, 4_000);
    // Through the new door it takes 18 steps.
    let soon = through_the_door(&run);
    assert!(soon > 9.0, "{soon} after a thousand updates");
}

#[test]
fn the_film_shows_distances_growing_with_what_is_learned_and_goes_on_in_an_edited_world() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 700);
    let frames = run.film().frames();
    assert_eq!(frames.iter().map(|frame| frame.updates).collect::<Vec<_>>(), [1, 250, 500]);
    assert!(frames.windows(2).all(|pair| pair[0].env_steps < pair[1].env_steps));
    let map = map_of(&run).clone();
    let goal = [frames[2].goal[0] as usize, frames[2].goal[1] as usize];
    for frame in frames.iter() {
        assert_eq!((frame.goal.len(), frame.agents.len()), (2, 2 * run.rollout().agents().len()));
        let known = (0..frame.places()).filter(|place| frame.distance(*place).is_finite());
        assert_eq!(known.count(), map.free_count(), "all free cells of a small map");
        assert!(frame.farthest() >= 1.0);
    }
    let at_goal = goal[1] * map.width() + goal[0];
    let [before, now] = [0, 2].map(|i| frames[i].distance(at_goal) / frames[i].farthest());
    assert!(now < before, "D is shorter near the goal: {now} after {before}");
    // An edited world.
    let walled = map.free_cells().nth(3).unwrap();
    let edited = Arc::new(map.with_cells([(walled, false)]).unwrap());
    run.change_world(&PointMaze::new(edited.clone(), 0)).unwrap();
    train_to(&mut run, 750);
    let frames = run.film().frames();
    assert_eq!(frames.len(), 4);
    let place = edited.index(walled);
    assert!(frames[2].distance(place).is_finite() && frames[3].distance(place).is_nan());
    assert_eq!(frames[2].goal, frames[3].goal);
}
