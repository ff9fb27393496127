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

#[test]
fn runs_without_a_film_can_be_resumed() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 300);
    let saved = run.save().unwrap();
    let mut old = Store::default();
    for (name, array) in saved.arrays().iter().filter(|(name, _)| !name.starts_with("film")) {
        old.put(name.as_str(), array.clone());
    }
    for (name, text) in saved.texts().iter().filter(|(name, _)| *name != "film") {
        old.put_text(name.as_str(), text.as_str());
    }
    let mut resumed = Trainer::load(&old, &Registry::builtin(), 1).unwrap();
    assert!(resumed.film().frames().is_empty());
    train_to(&mut run, 600);
    train_to(&mut resumed, 600);
    assert_eq!(resumed.film().frames().as_slice(), &run.film().frames()[2..], "the film goes on");
    // Another version may film other places.
    let text = saved.text("film").unwrap();
    let places = run.film().frames()[0].places();
    let fewer = text.replace(&format!("\"places\":{places}"), "\"places\":2");
    old.put_text("film", fewer);
    old.put("film_values", vec![1_u16; 2 * 2]);
    old.put("film_agents", saved.f32("film_agents").unwrap().to_vec());
    assert!(Trainer::load(&old, &Registry::builtin(), 1).unwrap().film().frames().is_empty());
}
