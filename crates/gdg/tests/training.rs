//! Training: runs are reproducible, and learning works.

use std::path::Path;
use std::sync::Arc;

use crate::runs::train_to;
use gdg::bridge::{BridgeSettings, Planner};
use gdg::env::{Goals, PointMaze, Restart};
use gdg::learn::{LearnSettings, Scratch, Threads};
use gdg::map::{Cell, Grid, RandomMapKind, builtin, parse_map, random};
use gdg::pulse::{Cancelled, Wanted};
use gdg::settings::{Auto, Effect};
use gdg::store::{Array, Store};
use gdg::train::{
    self, Evaluation, Method, Moment, Preset, Registry, Run, SaveTo, Settings, Tick, Trainer,
};

/// Two rooms joined by a door: most straight lines between them hit the wall.
const TWO_ROOMS: &str = "\
..........#..........
..........#..........
..........#..........
..........#..........
..........#..........
..........#..........
..........#..........
.....................
.....................
..........#..........
..........#..........
";

/// Returns settings with small networks and a small graph: fast, and enough for two rooms.
fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.learn.hidden = 64;
    settings.learn.buffer_size = 100_000;
    settings.bridge.candidates = 80;
    settings.bridge.graph_every_updates = 200;
    settings
}

fn trainer(settings: Settings, seed: u64, threads: impl Into<Threads>) -> Trainer {
    let map = parse_map("two-rooms", TWO_ROOMS.as_bytes()).unwrap();
    let run = Run { method: Method::default(), preset: Preset::Default, seed, settings };
    Trainer::new(run, &PointMaze::new(Arc::new(map), 0), &Registry::builtin(), threads).unwrap()
}

fn map_of(trainer: &Trainer) -> &Arc<Grid> {
    PointMaze::downcast_ref(trainer.world()).unwrap().map()
}

/// Switches to the same maze on another map.
fn change_map(
    trainer: &mut Trainer,
    map: &Arc<Grid>,
) -> Result<train::WorldChange, train::TrainError> {
    let maze = PointMaze::downcast_ref(trainer.world()).unwrap().with_map(map.clone());
    trainer.change_world(&maze)
}

/// Returns all state of a run as bits, except for the elapsed time.
fn full_state(trainer: &Trainer) -> Vec<(String, Vec<u64>)> {
    let store = trainer.save().unwrap();
    let bits = |array: &Array| -> Vec<u64> {
        match array {
            Array::F32(v) => v.iter().map(|v| u64::from(v.to_bits())).collect(),
            Array::U16(v) => v.iter().map(|v| u64::from(*v)).collect(),
            Array::U32(v) => v.iter().map(|v| u64::from(*v)).collect(),
            Array::U64(v) => v.clone(),
        }
    };
    let mut all: Vec<_> =
        store.arrays().iter().map(|(name, array)| (name.clone(), bits(array))).collect();
    for (name, text) in store.texts() {
        let text = if name == "trainer" { without_time(text) } else { text.clone() };
        all.push((name.clone(), text.bytes().map(u64::from).collect()));
    }
    all
}

fn without_time(state: &str) -> String {
    let mut state: serde_json::Value = serde_json::from_str(state).unwrap();
    state.as_object_mut().unwrap().remove("seconds").unwrap();
    state.to_string()
}

fn assert_same(a: &Trainer, b: &Trainer) {
    let (a, b) = (full_state(a), full_state(b));
    assert_eq!(a.len(), b.len());
    for ((name, a), (_, b)) in a.iter().zip(&b) {
        assert!(a == b, "{name} differs");
    }
}

#[test]
fn the_same_seed_gives_the_same_run_and_another_seed_a_different_one() {
    let mut runs =
        [trainer(settings(), 1, 1), trainer(settings(), 1, 1), trainer(settings(), 2, 1)];
    runs.iter_mut().for_each(|run| train_to(run, 450));
    assert_same(&runs[0], &runs[1]);
    assert!(full_state(&runs[0]) != full_state(&runs[2]));
}

#[test]
fn the_number_of_threads_does_not_change_the_run() {
    let choices = [1, 2, 4].map(Threads::Fixed).into_iter().chain([Threads::Auto { most: 4 }]);
    let mut runs = choices.map(|threads| trainer(settings(), 3, threads)).collect::<Vec<_>>();
    runs.iter_mut().for_each(|run| train_to(run, 450));
    runs[1..].iter().for_each(|run| assert_same(&runs[0], run));
}

#[test]
fn evaluation_does_not_change_the_run() {
    let (mut watched, mut alone) = (trainer(settings(), 4, 1), trainer(settings(), 4, 1));
    for updates in [150, 300, 450] {
        train_to(&mut watched, updates);
        let tasks = watched.tasks(3).unwrap();
        watched.evaluate(&tasks).unwrap();
    }
    train_to(&mut alone, 450);
    assert_same(&watched, &alone);
}

#[test]
fn a_resumed_run_continues_bitwise() {
    continues_bitwise(settings);
}

#[test]
fn a_resumed_run_without_bounds_from_the_graph_continues_bitwise() {
    continues_bitwise_with(|learn| learn.graph_bounds = false);
}

#[test]
fn a_resumed_run_without_waypoints_for_the_actor_continues_bitwise() {
    continues_bitwise_with(|learn| learn.actor_waypoints = false);
}

#[test]
fn a_resumed_run_without_checks_of_the_model_or_ways_out_continues_bitwise() {
    continues_bitwise_with(|learn| learn.unblock_actor = false);
    continues_bitwise_with(|learn| learn.model_check = false);
}

/// Checks that runs resume exactly after a `change` of their settings, and that it makes a
/// difference.
fn continues_bitwise_with(change: impl Fn(&mut LearnSettings)) {
    let other = || {
        let mut settings = settings();
        change(&mut settings.learn);
        settings
    };
    continues_bitwise(other);
    let mut runs = [trainer(settings(), 5, 1), trainer(other(), 5, 1)];
    runs.iter_mut().for_each(|run| train_to(run, 700));
    assert!(full_state(&runs[0]) != full_state(&runs[1]), "there are far pairs");
}

fn continues_bitwise(settings: impl Fn() -> Settings) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new folder/half.safetensors");
    let mut straight = trainer(settings(), 5, 1);
    train_to(&mut straight, 700);
    let mut first = trainer(settings(), 5, 1);
    // Stop mid-cycle: between one due update and the next.
    train_to(&mut first, 333);
    train::save(&first, &SaveTo::Replace(path.clone())).unwrap();
    let mut resumed = train::load(&path, &Registry::builtin(), 2).unwrap().trainer;
    assert_same(&first, &resumed);
    assert_eq!(map_of(&resumed), map_of(&straight));
    train_to(&mut resumed, 700);
    assert_same(&straight, &resumed);
}

/// Returns the map with the door between its two rooms closed or open.
fn with_door(map: &Grid, open: bool) -> Arc<Grid> {
    Arc::new(map.with_cells([7, 8].map(|y| (Cell::new(10, y), open))).unwrap())
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
    let mut straight = edited();
    train_to(&mut straight, 700);
    // At once, while the graph's distances are not known yet, and when they are.
    for saved_at in [333, 380, 450] {
        let mut first = edited();
        train_to(&mut first, saved_at);
        let store = first.save().unwrap();
        let mut resumed = Trainer::load(&store, &Registry::builtin(), 2).unwrap();
        assert_same(&first, &resumed);
        train_to(&mut resumed, 700);
        assert_same(&straight, &resumed);
    }
}

#[test]
fn a_run_saved_by_a_version_that_checked_fewer_distances_after_an_edit_resumes() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 333);
    let map = with_door(map_of(&run), false);
    change_map(&mut run, &map).unwrap();
    train_to(&mut run, 450);
    let saved = run.save().unwrap();
    let goals = saved.u32("graph.changed.goals").unwrap();
    let places = saved.f32("graph.changed.lower").unwrap().len() / goals.len();
    let with = |goals: &[u32]| {
        let mut store = run.save().unwrap();
        for name in ["graph.changed.lower", "graph.changed.upper"] {
            let numbers = store.f32(name).unwrap()[..goals.len() * places].to_vec();
            store.put(name, numbers);
        }
        store.put("graph.changed.goals", goals.to_vec());
        Trainer::load(&store, &Registry::builtin(), 2)
    };
    for fewer in [&goals[..20], &[]] {
        let mut resumed = with(fewer).unwrap();
        train_to(&mut resumed, 460);
    }
    let others: Vec<u32> = goals.iter().rev().copied().collect();
    let error = with(&others).err().expect("these are not the graph's").to_string();
    assert!(error.contains("to other places"), "{error}");
}

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

#[test]
fn a_checkpoint_is_described_without_being_loaded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("some.safetensors");
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 120);
    let evaluation = run.evaluate(&run.tasks(2).unwrap()).unwrap();
    run.record_evaluation(Moment { updates: 100, ..run.moment() }, evaluation.clone());
    train::save(&run, &SaveTo::Replace(path.clone())).unwrap();
    let found = train::describe(&path).unwrap();
    assert_eq!(
        (found.updates, found.success, &found.run),
        (120, Some(evaluation.success(100)), run.run())
    );
    assert_eq!(found.title, map_of(&run).name());
    assert_eq!(found.bytes, std::fs::metadata(&path).unwrap().len());
    std::fs::write(&path, b"not a checkpoint at all").unwrap();
    assert!(train::describe(&path).unwrap_err().to_string().contains("safetensors"));
}

#[test]
fn a_setting_that_applies_immediately_changes_nothing_else() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 300);
    let learned = |run: &Trainer| {
        let mut store = Store::default();
        run.learner().save(&mut store).unwrap();
        store
    };
    let graphs = |run: &Trainer| -> Vec<_> {
        let (arrays, _) = run.save().unwrap().into_parts();
        arrays
            .into_iter()
            .filter(|(name, _)| name.starts_with("graph.") || name.starts_with("bridge."))
            .collect()
    };
    let (before, replay, graph) = (learned(&run), run.replay().snapshot(), graphs(&run));
    assert!(graph.iter().any(|(name, _)| name.starts_with("graph.")), "the run has a graph by now");
    let mut changed = run.run().clone();
    changed.settings.learn.learning_rate = 1e-4;
    changed.settings.train.random_actions = 0.9;
    let kept = run.change_run(changed).unwrap();
    assert!(kept.networks && kept.agents);
    assert_eq!(learned(&run), before);
    assert_eq!(run.replay().snapshot(), replay);
    assert!(graphs(&run) == graph, "plans go on");
    assert_eq!(run.counters().updates, 300);
    train_to(&mut run, 400);
}

#[test]
fn changing_any_setting_keeps_the_documented_state() {
    let mut base = settings();
    base.learn.buffer_size = 5_000;
    // So few that there are more than the limit of planners that verify nothing.
    base.bridge.candidates = 6;
    base.bridge.candidate_spacing = 0.6;
    for (name, value) in train::list_settings(&base) {
        let other = match (name.as_str(), value.as_str()) {
            ("backend", _) => "tape".to_owned(),
            ("loss", _) => "log".to_owned(),
            ("update_when", _) => "episode-end".to_owned(),
            ("restart", _) => "anywhere".to_owned(),
            ("goals", _) => "map".to_owned(),
            ("episode_steps", _) => "77".to_owned(),
            ("frontier_epsilon" | "hop_steps", _) => "0.3".to_owned(),
            ("critics", "2") => "1".to_owned(),
            ("critics", _) => "2".to_owned(),
            (_, "true") => "false".to_owned(),
            (_, "false") => "true".to_owned(),
            (_, list) if list.starts_with('[') => "[1.0,3.0]".to_owned(),
            ("buffer_size", _) => "6000".to_owned(),
            ("batch_size" | "hidden", _) => "8".to_owned(),
            (_, number) if number.parse::<u64>().is_ok() => {
                (number.parse::<u64>().unwrap() + 1).to_string()
            }
            (_, number) => (number.parse::<f64>().unwrap() * 0.5 + 0.12).to_string(),
        };
        // Two of the defaults already add up to their joint maximum.
        let Ok(settings) = train::with_setting(&base, &name, &other) else {
            panic!("{name} can be {other}")
        };
        assert_ne!(settings, base, "{name}");
        let mut run = trainer(base.clone(), 5, 1);
        if name == "goals" {
            let marked = parse_map("marked", marked_rooms().as_bytes()).unwrap();
            change_map(&mut run, &Arc::new(marked)).unwrap();
        }
        train_to(&mut run, 20);
        let stored = run.replay().len();
        assert!(
            run.candidates().len()
                > BridgeSettings { verify_edges: false, ..base.bridge.clone() }.max_candidates()
        );
        let kept = run.change_run(Run { settings, ..run.run().clone() }).unwrap();
        let effect = train::Setting::named(&name).unwrap().effect;
        assert_eq!(kept.networks, effect != Effect::NewNetworks, "{name}");
        assert_eq!(kept.agents, effect != Effect::NewAgents, "{name}");
        assert!(run.replay().len() > stored / 2, "{name} loses the replay");
        let mut resumed = Trainer::load(&run.save().unwrap(), &Registry::builtin(), 1)
            .unwrap_or_else(|error| panic!("after a change of {name}: {error}"));
        for run in [&mut run, &mut resumed] {
            train_to(run, 40);
        }
        assert_same(&run, &resumed);
    }
}

#[test]
fn a_run_with_a_full_replay_resumes_bitwise() {
    let mut small = settings();
    small.learn.buffer_size = 5_000;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("full.safetensors");
    let mut straight = trainer(small.clone(), 6, 1);
    train_to(&mut straight, 500);
    assert_eq!(straight.replay().len(), straight.replay().capacity(), "the replay is full");
    let mut first = trainer(small, 6, 1);
    train_to(&mut first, 400);
    train::save(&first, &SaveTo::Replace(path.clone())).unwrap();
    let mut resumed = train::load(&path, &Registry::builtin(), 1).unwrap().trainer;
    assert_same(&first, &resumed);
    train_to(&mut resumed, 500);
    assert_same(&straight, &resumed);
}

#[test]
fn files_that_are_not_checkpoints_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let whole = folder.path().join("whole.safetensors");
    let mut run = trainer(settings(), 7, 1);
    train_to(&mut run, 10);
    train::save(&run, &SaveTo::Replace(whole.clone())).unwrap();
    let bytes = std::fs::read(&whole).unwrap();
    let text = |path: &Path| {
        train::load(path, &Registry::builtin(), 1).err().expect("an error").to_string()
    };
    assert!(text(&folder.path().join("missing")).contains("cannot be read"));
    assert!(text(&write("text", b"hello")).contains("not a checkpoint"));
    assert!(text(&write("empty", b"")).contains("is empty"));
    assert!(
        text(&write("cut", &bytes[..bytes.len() / 2]))
            .contains("its size differs from what its header says")
    );
    let foreign =
        safetensors::serialize(Vec::<(String, safetensors::tensor::TensorView)>::new(), None)
            .unwrap();
    assert!(text(&write("foreign", &foreign)).contains("not a checkpoint"));
    // A header with other network sizes than those saved.
    let mut changed = bytes.clone();
    let at = bytes.windows(12).position(|w| w == b"\\\"hidden\\\":6").unwrap();
    changed[at + 11] = b'3';
    assert!(text(&write("changed", &changed)).contains("checksum"));
}

#[test]
fn an_evaluation_that_nobody_wants_builds_no_graph() {
    let mut run = trainer(settings(), 11, 2);
    train_to(&mut run, 50);
    let (job, tasks) = (run.evaluation().unwrap(), run.tasks(1).unwrap());
    let cancelled = Cancelled::default();
    assert!(job.graph(&cancelled).is_some());
    drop(Wanted::from(&cancelled));
    assert!(job.run_unless(&cancelled, &tasks).unwrap().is_none());
    assert_eq!(cancelled.progress().share(), Some(0.0), "not even its first row");
}

/// Trains for `updates` and returns planned and greedy success.
fn success(settings: Settings, updates: u64) -> (f64, f64) {
    let mut run = trainer(settings, 11, 2);
    train_to(&mut run, updates);
    let tasks = run.tasks(20).unwrap();
    let found = run.evaluate(&tasks).unwrap();
    let bridges = found.bridges.unwrap();
    assert_eq!(bridges.false_edges, Some(0));
    assert!(bridges.candidates > 10 && bridges.edges > bridges.candidates);
    (found.planned.unwrap().success.unwrap(), found.greedy.success.unwrap())
}

#[test]
fn two_rooms_are_learned() {
    let (planned, greedy) = success(settings(), 4_000);
    assert!(planned >= 0.9, "planned {planned}");
    assert!(greedy >= 0.6, "greedy {greedy}");
}

/// Shows that the test above detects learning: networks that hardly change stay far below its
/// thresholds.
#[test]
fn two_rooms_are_not_learned_by_frozen_networks() {
    let mut idle = settings();
    idle.learn.learning_rate = 1e-8;
    idle.learn.grid_learning_rate = 1e-8;
    let (planned, greedy) = success(idle, 4_000);
    assert!(planned < 0.6 && greedy < 0.3, "planned {planned}, greedy {greedy}");
}

#[test]
fn learned_distances_bend_around_the_wall() {
    let mut run = trainer(settings(), 12, 2);
    train_to(&mut run, 4_000);
    let policy = run.policy().unwrap();
    let distance =
        |from: [f32; 2], to: [f32; 2]| policy.distance(&from, &to, &mut Scratch::default());
    // Close to each other, with the wall between: 2 steps through it, 17 around it.
    let (through, round) = (distance([9.5, 0.5], [11.5, 0.5]), distance([9.5, 0.5], [7.5, 0.5]));
    assert!(through > 8.0, "across the wall D is {through}");
    assert!(round < 5.0, "along the wall D is {round}");
}

#[test]
fn updates_follow_steps_at_the_set_ratio_after_the_warm_up() {
    let mut run = trainer(settings(), 13, 1);
    let mut updates = 0;
    while updates < 100 {
        updates += u64::from(run.tick().unwrap() == Tick::Update);
    }
    let settings = &run.run().settings.train;
    let due = (run.counters().env_steps - settings.learning_starts) / settings.env_steps_per_update;
    assert!(due - updates <= 2, "{due} due, {updates} done");
}

#[test]
fn without_a_warm_up_the_first_update_waits_for_a_transition() {
    let mut eager = settings();
    eager.train.learning_starts = 0;
    let mut run = trainer(eager, 14, 1);
    assert_eq!(
        [run.tick().unwrap(), run.tick().unwrap(), run.tick().unwrap()],
        [Tick::Step, Tick::Step, Tick::Update]
    );
}

#[test]
fn the_paper_preset_makes_one_update_per_step_after_each_episode() {
    let map = parse_map("two-rooms", TWO_ROOMS.as_bytes()).unwrap();
    let mut settings = Preset::Paper.settings();
    settings.train.learning_starts = 0;
    let run = Run { method: Method::default(), preset: Preset::Paper, seed: 1, settings };
    let mut run =
        Trainer::new(run, &PointMaze::new(Arc::new(map), 0), &Registry::builtin(), 1).unwrap();
    let episode = u64::from(run.episode_steps());
    for tick in 0..2 * episode {
        assert_eq!(
            run.tick().unwrap(),
            if tick < episode { Tick::Step } else { Tick::Update },
            "tick {tick}"
        );
    }
    assert_eq!(run.tick().unwrap(), Tick::Step, "the next episode begins");
    assert_eq!((run.counters().updates, run.counters().episodes), (episode, 1));
}

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

/// Returns the two rooms with a start in one corner and a goal beyond the door.
fn marked_rooms() -> String {
    let mut text = format!("S{}", &TWO_ROOMS[1..]);
    let goal = text.find("\n.....................\n").unwrap() + 13;
    text.replace_range(goal..=goal, "G");
    text
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
            for (i, (agent, at)) in agents.enumerate() {
                let (last, _) = run.rollout().goal_and_waypoints(i);
                assert_eq!(agent.after_bridge.as_deref().unwrap_or(last), goal);
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

        let mut resumed = Trainer::load(&run.save().unwrap(), &Registry::builtin(), 1).unwrap();
        for run in [&mut run, &mut resumed] {
            train_to(run, 350);
        }
        assert_same(&run, &resumed);
        let mut again = one_goal(planner, &marked_rooms()).unwrap();
        train_to(&mut again, 350);
        assert_same(&run, &again);
    }
}

#[test]
fn without_a_way_from_start_to_goal_there_is_no_one_goal() {
    let refused = |map: &str| match one_goal(Planner::None, map) {
        Ok(_) => panic!("a run"),
        Err(error) => error.to_string(),
    };
    let walled: String = marked_rooms()
        .lines()
        .map(|line| {
            let cells: Vec<char> = line.chars().collect();
            cells
                .iter()
                .enumerate()
                .map(|(i, c)| if i == 10 { '#' } else { *c })
                .collect::<String>()
                + "\n"
        })
        .collect();
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

/// Returns the two rooms with the door in the first row instead.
fn door_above() -> Arc<Grid> {
    let row = |(i, line): (usize, &str)| {
        let (left, right) = (&line[..10], &line[11..]);
        format!("{left}{}{right}\n", if i == 0 { '.' } else { '#' })
    };
    let text: String = TWO_ROOMS.lines().enumerate().map(row).collect();
    Arc::new(parse_map("door-above", text.as_bytes()).unwrap())
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
    let found = run.evaluate(&run.tasks(20).unwrap()).unwrap();
    let planned = found.planned.unwrap().success.unwrap();
    assert!(
        planned >= 0.9 && found.bridges.unwrap().false_edges == Some(0),
        "planned {planned}, {:?}",
        found.bridges
    );
}

#[test]
fn distances_lengthened_by_new_walls_are_relearned_quickly() {
    let through_the_door = |run: &Trainer| {
        let policy = run.policy().unwrap();
        policy.distance(&[8.5, 7.9], &[12.5, 7.9], &mut Scratch::default())
    };
    let after = |greedy_targets: bool, expectile: f32| {
        let mut settings = settings();
        (settings.learn.greedy_targets, settings.learn.expectile) = (greedy_targets, expectile);
        let mut run = trainer(settings, 13, 2);
        train_to(&mut run, 3_000);
        let before = through_the_door(&run);
        assert!(before < 6.0, "4 steps through the open door, learned as {before}");
        change_map(&mut run, &door_above()).unwrap();
        train_to(&mut run, 4_000);
        through_the_door(&run)
    };
    let (soon, late) = (after(true, 0.5), after(false, 0.95));
    // Through the new door it takes 18 steps.
    assert!(
        soon > 9.0 && soon > 1.1 * late,
        "{soon} after a thousand updates, {late} by behaviour and an expectile"
    );
}

#[test]
fn two_walled_cells_in_one_room_leave_the_distances_of_the_other_alone() {
    let mut run = trainer(settings(), 15, 2);
    train_to(&mut run, 3_000);
    let places: Vec<[f32; 2]> =
        (0..20).map(|i| [12.5 + (i * 3 % 8) as f32, 0.5 + (i * 7 % 11) as f32]).collect();
    let distances = |run: &Trainer| -> Vec<f32> {
        let (policy, mut scratch) = (run.policy().unwrap(), Scratch::default());
        let pairs = places
            .iter()
            .flat_map(|from| places.iter().map(move |to| (from, to)))
            .filter(|(a, b)| a != b);
        pairs.map(|(from, to)| policy.distance(from, to, &mut scratch)).collect()
    };
    let before = distances(&run);
    let map =
        map_of(&run).with_cells([(Cell::new(4, 4), false), (Cell::new(5, 4), false)]).unwrap();
    change_map(&mut run, &Arc::new(map)).unwrap();
    train_to(&mut run, 4_000);
    let after = distances(&run);
    let growth: f32 = after.iter().zip(&before).map(|(after, before)| after - before).sum::<f32>();
    let growth = growth / before.iter().sum::<f32>();
    assert!(growth < 0.1, "distances in the other room have grown by a factor of {growth}");
}

#[test]
fn undoing_an_edit_restores_the_transitions_that_it_removed() {
    let mut run = trainer(settings(), 16, 2);
    train_to(&mut run, 600);
    let before = map_of(&run).clone();
    let closed = change_map(&mut run, &door_above()).unwrap();
    assert!(closed.transitions_removed > 0 && closed.transitions_restored == 0, "{closed:?}");
    let undone = change_map(&mut run, &before).unwrap();
    assert_eq!(
        (undone.transitions_removed, undone.transitions_restored),
        (0, closed.transitions_removed)
    );
}

#[test]
fn a_run_on_an_edited_map_resumes_on_that_map() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("edited.safetensors");
    let map = door_above();
    let mut run = trainer(settings(), 14, 1);
    train_to(&mut run, 450);
    change_map(&mut run, &map).unwrap();
    train_to(&mut run, 500);
    train::save(&run, &SaveTo::Replace(path.clone())).unwrap();
    let mut resumed = train::load(&path, &Registry::builtin(), 1).unwrap().trainer;
    assert_eq!(map_of(&resumed), &map);
    assert_same(&run, &resumed);
    train_to(&mut run, 700);
    train_to(&mut resumed, 700);
    assert_same(&run, &resumed);
}

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
    let text = format!("S{}", &TWO_ROOMS[1..]);
    let map = parse_map("one-start", text.as_bytes()).unwrap();
    let run =
        Run { method: Method::default(), preset: Preset::Default, seed: 2, settings: settings() };
    let mut run =
        Trainer::new(run, &PointMaze::new(Arc::new(map), 0), &Registry::builtin(), 2).unwrap();
    assert!(
        run.world().states().iter().all(|v| *v < 1.0),
        "all agents start in the corner: {:?}",
        run.world().states()
    );
    train_to(&mut run, 3_000);
    let found = run.evaluate(&run.tasks(20).unwrap()).unwrap();
    assert!(
        found.coverage.unwrap() > 0.95 && found.planned.unwrap().success > Some(0.9),
        "coverage {:?}",
        found.coverage
    );
}

/// Returns a maze with corridors and walls one cell wide, and a start in a corner.
fn perfect_maze(size: usize) -> Arc<Grid> {
    let maze = random(RandomMapKind::Perfect, Some(size), 1);
    let rows = maze
        .free()
        .chunks(maze.width())
        .map(|row| row.iter().map(|free| if *free { '.' } else { '#' }));
    let text: Vec<String> = rows.map(String::from_iter).collect();
    Arc::new(parse_map("maze", text.join("\n").replacen('.', "S", 1).as_bytes()).unwrap())
}

#[test]
fn a_maze_with_corridors_one_cell_wide_is_learned_from_one_cell() {
    let mut settings = settings();
    settings.bridge.candidates = 300;
    let run = Run { method: Method::default(), preset: Preset::Default, seed: 4, settings };
    let mut run =
        Trainer::new(run, &PointMaze::new(perfect_maze(21), 0), &Registry::builtin(), 2).unwrap();
    train_to(&mut run, 4_000);
    let found = run.evaluate(&run.tasks(20).unwrap()).unwrap();
    let planned = found.planned.unwrap().success.unwrap();
    assert!(planned >= 0.85, "planned {planned}");
}

/// Evaluates a run on `map` after `updates` with the default preset and
/// a `change`.
fn evaluated_after(
    updates: u64,
    map: &Arc<Grid>,
    seed: u64,
    change: impl Fn(&mut LearnSettings),
) -> Evaluation {
    let mut settings = Settings::default();
    change(&mut settings.learn);
    let run = Run { method: Method::default(), preset: Preset::Default, seed, settings };
    let mut run =
        Trainer::new(run, &PointMaze::new(map.clone(), 0), &Registry::builtin(), 2).unwrap();
    train_to(&mut run, updates);
    run.evaluate(&run.tasks(60).unwrap()).unwrap()
}

#[test]
fn waypoints_on_the_way_through_the_graph_lead_the_actor() {
    let map = Arc::new(builtin("fourrooms").unwrap());
    let greedy = |led| {
        let evaluation = evaluated_after(4_000, &map, 1, |learn| learn.actor_waypoints = led);
        evaluation.greedy.success.unwrap()
    };
    let (with, without) = (greedy(true), greedy(false));
    assert!(without < with - 0.1, "with waypoints {with}, without {without}");
}

/// Clutter of single cells.
const CLUTTER: &str = "
#.......##...#.....#
#.....#........#...#
..#.............#...
#..........##....#..
...........#........
#..#........#.#.....
...###..#..##.#.....
#..##.....###.#.....
........#..........#
.#...#.........##...
...#................
##............#.###.
........#........###
#.#...##..#.......#.
##.....#...#........
..#.................
.###.##.....#..#.#..
..#....#.#.......#.#
.............#...#.#
#......#............
";

#[test]
fn an_actor_that_clutter_blocks_is_shown_the_way_out() {
    let map = Arc::new(parse_map("clutter", CLUTTER.trim().as_bytes()).unwrap());
    let success = |seed, helped| {
        let evaluation = evaluated_after(4_000, &map, seed, |learn| {
            (learn.unblock_actor, learn.model_check) = (helped, helped);
            // What else helps in clutter is off.
            learn.actor_waypoints = false;
            (learn.distillation, learn.short_pairs, learn.imagined_walks) = (0.0, 0.0, 0.0);
        });
        [evaluation.planned.unwrap(), evaluation.greedy].map(|own| own.success.unwrap())
    };
    let (mut with, mut without) = (0.0, 0.0);
    for seed in [1, 2, 3] {
        let [planned, alone] = success(seed, true);
        assert!(planned > 0.9, "on plans {planned}, seed {seed}");
        (with, without) = (with + alone / 3.0, without + success(seed, false)[1] / 3.0);
    }
    assert!(without < with - 0.05, "alone, with ways out {with}, without {without}");
}

#[test]
fn a_maze_with_corridors_one_cell_wide_is_explored_from_one_cell() {
    let map = perfect_maze(25);
    let explored = |frontier: Auto<f32>| {
        let mut settings = settings();
        settings.bridge.frontier_epsilon = frontier;
        let run = Run { method: Method::default(), preset: Preset::Default, seed: 2, settings };
        let mut run =
            Trainer::new(run, &PointMaze::new(map.clone(), 0), &Registry::builtin(), 2).unwrap();
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
    let store = run.save().unwrap();
    let resumed = Trainer::load(&store, &Registry::builtin(), 1).unwrap();
    assert_eq!(goals(&resumed), pursued);
    // A checkpoint from before there were excursions.
    let (arrays, texts) = store.into_parts();
    let mut former = Store::default();
    let older = |name: &str| !name.starts_with("excursions") && !name.starts_with("places");
    arrays
        .into_iter()
        .filter(|(name, _)| older(name))
        .for_each(|(name, array)| former.put(name, array));
    texts
        .into_iter()
        .filter(|(name, _)| older(name))
        .for_each(|(name, text)| former.put_text(name, text));
    let mut resumed = Trainer::load(&former, &Registry::builtin(), 1).unwrap();
    assert!(goals(&resumed).iter().all(Option::is_none));
    train_to(&mut resumed, 20);
}

/// Returns a run's state as format 3 of checkpoints held it: pairs of edges, whole lines of tables,
/// and states instead of steps.
fn in_former_layout(run: &Trainer) -> Store {
    let (mut arrays, texts) = run.save().unwrap().into_parts();
    let mut former = Store::default();
    for graph in ["graph", "next_graph"] {
        let mut column = |part: &str| arrays.remove(&format!("{graph}.edges.{part}"));
        if let [Some(Array::U32(from)), Some(Array::U32(to))] = [column("from"), column("to")]
            && let [Some(Array::F32(distances)), Some(Array::F32(costs))] =
                [column("distance"), column("cost")]
        {
            let ends = from.iter().zip(&to).flat_map(|(from, to)| [*from, *to]);
            former.put(format!("{graph}.ends"), ends.collect::<Vec<_>>());
            let lengths = distances.iter().zip(&costs).flat_map(|(d, cost)| [*d, *cost]);
            former.put(format!("{graph}.lengths"), lengths.collect::<Vec<_>>());
        }
    }
    for network in ["actor", "critic0", "critic1", "model"] {
        let mut row = |part: &str| match arrays.remove(&format!("{network}.table{part}")) {
            Some(Array::F32(numbers)) => Some(numbers),
            _ => None,
        };
        let value = row("").expect("a grid table");
        let average = row("_average").unwrap_or_else(|| value.clone());
        let rows = [value, average, row("_m").unwrap(), row("_v").unwrap()];
        let channels = run.run().settings.learn.grid_channels;
        let corners = rows[0].len() / channels;
        let line = |i: usize| rows.iter().flat_map(move |r| &r[i * channels..(i + 1) * channels]);
        let lines: Vec<f32> = (0..corners).flat_map(line).copied().collect();
        former.put(format!("{network}.table"), lines);
        if network == "model" {
            former.put("model.table_last", vec![0_u32; corners]);
        }
    }
    arrays.retain(|name, _| !name.starts_with("replay.steps"));
    former.put("replay.states", run.replay().snapshot().states);
    arrays.into_iter().for_each(|(name, array)| former.put(name, array));
    texts.into_iter().for_each(|(name, text)| former.put_text(name, text));
    former
}

#[test]
fn runs_saved_in_the_former_layout_continue_bit_by_bit() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 350);
    let former = in_former_layout(&run);
    assert!(former.has("graph.ends") && former.has("critic0.table_last"), "{:?}", former.texts());
    let mut resumed = Trainer::load(&former, &Registry::builtin(), 1).unwrap();
    assert_same(&run, &resumed);
    train_to(&mut run, 500);
    train_to(&mut resumed, 500);
    assert_same(&run, &resumed);
}

#[test]
fn a_checkpoint_file_restores_every_bit_and_can_be_read_unpacked() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 350);
    let folder = tempfile::tempdir().unwrap();
    let path =
        train::save(&run, &SaveTo::CreateNew(folder.path().join("run.safetensors"))).unwrap();
    let bytes = std::fs::read(path).unwrap();
    let plain = train::unpacked(&bytes).unwrap();
    assert!(3 * bytes.len() < 2 * plain.len(), "{} of {} bytes", bytes.len(), plain.len());
    assert_eq!(train::unpacked(&plain).unwrap().len(), plain.len());
    for bytes in [bytes, plain] {
        assert_same(&run, &train::from_bytes(&bytes, &Registry::builtin(), 1).unwrap());
    }
}

#[test]
fn what_was_explored_stays_explored_after_an_edit() {
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 300);
    let before = run.coverage().unwrap();
    change_map(&mut run, &door_above()).unwrap();
    let after = run.coverage().unwrap();
    assert!(before > 0.3 && (before - after).abs() < 0.1, "{before} before, {after} after");
    let curve = run.history().points();
    assert!(curve.iter().all(|point| point.coverage.is_some()), "{curve:?}");
}
