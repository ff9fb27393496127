//! The film of how distance was learned.

use super::*;

#[test]
fn the_film_shows_distances_growing_with_what_is_learned() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 700);
    let frames = run.film().frames();
    assert_eq!(frames.iter().map(|frame| frame.updates).collect::<Vec<_>>(), [1, 250, 500]);
    assert!(frames.windows(2).all(|pair| pair[0].env_steps < pair[1].env_steps));
    let map = map_of(&run);
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
}

#[test]
fn a_film_goes_on_in_an_edited_world_and_begins_anew_in_a_new_run() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 300);
    let map = map_of(&run).clone();
    let walled = map.free_cells().nth(3).unwrap();
    let edited = Arc::new(map.with_cells([(walled, false)]).unwrap());
    run.change_world(&PointMaze::new(edited.clone(), 0)).unwrap();
    train_to(&mut run, 500);
    let frames = run.film().frames();
    assert_eq!(frames.len(), 3);
    let place = edited.index(walled);
    assert!(frames[1].distance(place).is_finite() && frames[2].distance(place).is_nan());
    assert_eq!(frames[1].goal, frames[2].goal);
}
