//! Learning from recorded transitions.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::runs::{state, train_to};
use candle_core::{DType, Device, Tensor};
use gdg::env::PointMaze;
use gdg::map::parse_map;
use gdg::pulse::Progress;
use gdg::train::{self, Dataset, Method, Preset, Registry, Run, SaveTo, Settings, Tick, Trainer};
use gdg::train::{LeftOut, TrainError, data_file};

/// A corridor that turns: most straight lines hit the wall.
const CORNER: &str = "\
............
............
..########..
..########..
..########..
";

fn settings() -> Settings {
    let mut settings = Settings::default();
    settings.learn.hidden = 32;
    settings.learn.buffer_size = 50_000;
    settings.bridge.candidates = 40;
    settings.bridge.graph_every_updates = 100;
    settings.train.agents = 4;
    settings
}

fn trainer(method: &str, settings: Settings, seed: u64) -> Trainer {
    let map = parse_map("corner", CORNER.as_bytes()).unwrap();
    let run = Run { method: method.parse().unwrap(), preset: Preset::Default, seed, settings };
    Trainer::new(run, &PointMaze::new(Arc::new(map), 0), &Registry::builtin(), 1).unwrap()
}

/// Writes what agents see that walk at random; returns the file.
fn recorded(folder: &Path) -> PathBuf {
    let mut random = trainer("random", settings(), 7);
    for _ in 0..5_000 {
        random.tick().unwrap();
    }
    let file = folder.join("walks.npz");
    std::fs::write(
        &file,
        data_file(random.replay(), random.world(), &Progress::default()).unwrap(),
    )
    .unwrap();
    file
}

fn learner(file: &Path, settings: Settings, seed: u64) -> Trainer {
    let mut trainer = trainer(&Method::default().name(), settings, seed);
    let data = Dataset::read(file, trainer.world(), &Progress::default()).unwrap();
    trainer.learn_from(&data, &Progress::default());
    trainer
}

#[test]
fn a_run_learns_from_data_alone_and_the_same_seed_gives_the_same_run() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let mut trainer = learner(&file, settings(), 1);
    let (source, first) = (trainer.data().unwrap().clone(), trainer.world().states().to_vec());
    assert!(source.transitions > 1_000 && source.episodes > 4, "{source:?}");
    let mut transitions = 0;
    trainer.replay().visit_rows(|_, _, is_last| transitions += usize::from(!is_last));
    assert_eq!(transitions, source.transitions, "long episodes are cut between transitions");
    assert!(!trainer.candidates().is_empty(), "the data's states are candidates");
    assert!(trainer.coverage().unwrap() > 0.5, "and count as visited");
    train_to(&mut trainer, 600);
    assert_eq!(trainer.counters().env_steps, 0);
    assert_eq!(trainer.world().states(), first, "agents do not act");
    let tasks = trainer.tasks(10).unwrap();
    let found = trainer.evaluate(&tasks).unwrap();
    let planned = found.planned.unwrap().success.unwrap();
    assert!(planned > 0.9, "{planned}");
    let mut again = learner(&file, settings(), 1);
    train_to(&mut again, 600);
    assert_eq!(state(&trainer), state(&again));
    let mut other = learner(&file, settings(), 2);
    train_to(&mut other, 600);
    assert_ne!(state(&trainer), state(&other));
}

#[test]
fn a_checkpoint_names_its_data_and_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let mut whole = learner(&file, settings(), 1);
    train_to(&mut whole, 250);
    let mut half = learner(&file, settings(), 1);
    train_to(&mut half, 130);
    let checkpoint = folder.path().join("half.safetensors");
    train::save(&half, &SaveTo::CreateNew(checkpoint.clone())).unwrap();
    let mut resumed = train::load(&checkpoint, &Registry::builtin(), 1).unwrap().trainer;
    train_to(&mut resumed, 250);
    assert_eq!(state(&whole), state(&resumed));
    // It does not contain the data.
    assert!(half.save().unwrap().arrays().keys().all(|name| !name.starts_with("replay")));
    let put_back = |trainer: &Trainer| {
        let mut store = state(trainer);
        store.put_text("data", String::new());
        store.put_text("history", String::new());
        store
    };
    let expected = put_back(&whole);
    // Without the file it can be looked at, but does not go on.
    let moved = folder.path().join("moved.npz");
    std::fs::rename(&file, &moved).unwrap();
    let mut lost = train::load(&checkpoint, &Registry::builtin(), 1).unwrap().trainer;
    let error = lost.tick().unwrap_err();
    assert!(matches!(error, TrainError::Data(_)), "{error:?}");
    assert!(error.to_string().contains("walks.npz: the data cannot be read"), "{error}");
    assert!(error.to_string().contains("--data FILE if they are elsewhere"), "{error}");
    assert!(lost.policy().is_ok());
    let elsewhere = Registry::builtin().with_data(Some(moved.clone()));
    let mut found = train::load(&checkpoint, &elsewhere, 1).unwrap().trainer;
    train_to(&mut found, 250);
    assert_eq!(found.data().unwrap().file, moved, "it is known from now on");
    assert!(expected == put_back(&found));
    // Other data are not taken for it.
    let mut other = trainer("random", settings(), 8);
    for _ in 0..3_000 {
        other.tick().unwrap();
    }
    std::fs::write(&file, data_file(other.replay(), other.world(), &Progress::default()).unwrap())
        .unwrap();
    let other = train::load(&checkpoint, &Registry::builtin(), 1).unwrap().trainer;
    let error = other.check_data().unwrap_err().to_string();
    assert!(error.contains("walks.npz: is not what the run has learned from"), "{error}");
    // Nor are they ignored while the run's own are there.
    let named = folder.path().join("named.npz");
    std::fs::rename(&file, &named).unwrap();
    std::fs::rename(&moved, &file).unwrap();
    let named = Registry::builtin().with_data(Some(named));
    let error = train::load(&checkpoint, &named, 1).unwrap().trainer.check_data().unwrap_err();
    assert!(error.to_string().contains("named.npz: is not what the run"), "{error}");
}

#[test]
fn agents_act_after_the_data() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let mut settings = settings();
    (settings.train.offline_updates, settings.train.env_steps_per_update) = (100, 8);
    let mut trainer = learner(&file, settings, 1);
    let source = trainer.data().unwrap().clone();
    train_to(&mut trainer, 100);
    assert_eq!((trainer.counters().env_steps, trainer.acts()), (0, false));
    train_to(&mut trainer, 200);
    assert!(trainer.acts());
    let steps = trainer.counters().env_steps;
    assert!((700..900).contains(&steps), "eight an update: {steps}");
    assert!(trainer.replay().len() as u64 >= source.transitions as u64 + steps, "both are kept");
    // From then on, a checkpoint contains all.
    let store = trainer.save().unwrap();
    let mut resumed = Trainer::load(&store, &Registry::builtin(), 1).unwrap();
    std::fs::remove_file(&file).unwrap();
    while trainer.tick().unwrap() != Tick::Update {}
    while resumed.tick().unwrap() != Tick::Update {}
    assert_eq!(state(&trainer), state(&resumed));
}

#[test]
fn any_learner_learns_from_data() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    for method in ["her", "ddpg", "gdg-distance", "her+sorb", "random"] {
        let mut trainer = trainer(method, settings(), 1);
        let data = Dataset::read(&file, trainer.world(), &Progress::default()).unwrap();
        trainer.learn_from(&data, &Progress::default());
        train_to(&mut trainer, 30);
        assert_eq!(trainer.counters().env_steps, 0, "{method}");
    }
}

/// Returns arrays of four rows: two episodes of a single transition.
fn arrays() -> Vec<(&'static str, Tensor)> {
    let table = |numbers: &[f32]| Tensor::from_slice(numbers, (4, 2), &Device::Cpu).unwrap();
    let ends = Tensor::from_slice(&[0_u8, 1, 0, 1], 4, &Device::Cpu).unwrap();
    vec![
        ("observations", table(&[0.5, 0.5, 1.5, 0.5, 1.5, 0.5, 2.5, 0.5])),
        ("actions", table(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])),
        ("terminals", ends),
    ]
}

/// Returns what is wrong with a file of these arrays.
fn problem(change: impl Fn(&mut Vec<(&'static str, Tensor)>)) -> String {
    let mut own = arrays();
    change(&mut own);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    Tensor::write_npz(&own, &file).unwrap();
    problem_of(&file)
}

fn problem_of(file: &Path) -> String {
    let trainer = trainer("random", settings(), 0);
    let error = Dataset::read(file, trainer.world(), &Progress::default()).unwrap_err().to_string();
    error.strip_prefix(&format!("{}: ", file.display())).expect("it names the file").to_owned()
}

#[test]
fn broken_files_are_refused_with_the_place_and_what_would_be_right() {
    let with = |at: usize, value: f32| {
        move |arrays: &mut Vec<(&'static str, Tensor)>| {
            let mut numbers: Vec<f32> = arrays[at].1.flatten_all().unwrap().to_vec1().unwrap();
            numbers[5] = value;
            arrays[at].1 = Tensor::from_slice(&numbers, (4, 2), &Device::Cpu).unwrap();
        }
    };
    let replaced = |at: usize, shape: &'static [usize]| {
        move |arrays: &mut Vec<(&'static str, Tensor)>| {
            arrays[at].1 = Tensor::zeros(shape, DType::F32, &Device::Cpu).unwrap();
        }
    };
    assert_eq!(
        problem(with(0, f32::NAN)),
        "observations[2, 1] is NaN: it must be finite, and at most 1e9 in size"
    );
    let unclear = |arrays: &mut Vec<(&'static str, Tensor)>| {
        arrays[2].1 = Tensor::new(&[0.0, f32::NAN, 0.0, 1.0], &Device::Cpu).unwrap();
    };
    assert_eq!(
        problem(unclear),
        "terminals[1] is NaN: it must be 1 in the last row of an episode, and else 0"
    );
    assert_eq!(problem(with(1, 1.5)), "actions[2, 1] is 1.5: it must be in [-1, 1]");
    assert_eq!(
        problem(replaced(0, &[4, 29])),
        "observations have shape [4, 29]: to fit the world and the other arrays, it must be [4, 2]"
    );
    assert_eq!(
        problem(replaced(1, &[3, 2])),
        "actions have shape [3, 2]: to fit the world and the other arrays, it must be [4, 2]"
    );
    assert!(problem(replaced(1, &[4])).starts_with("actions have shape [4]: "));
    assert!(problem(replaced(2, &[4, 2])).ends_with("other arrays, it must be [4]"));
    assert_eq!(
        problem(|arrays| drop(arrays.remove(2))),
        "has no array terminals, but actions, observations: data are observations, actions and \
         terminals"
    );
    let all = |arrays: &mut Vec<(&'static str, Tensor)>| {
        arrays[2].1 = Tensor::ones(4, DType::U8, &Device::Cpu).unwrap();
    };
    assert_eq!(problem(all), "has no transition: all 4 rows end an episode");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    assert!(problem_of(&file).starts_with("the data cannot be read: "));
    std::fs::write(&file, b"observations").unwrap();
    assert_eq!(problem_of(&file), "is a text file, not an .npz file of NumPy");
    std::fs::write(&file, b"\x93NUMPY\x01\0v\0{'descr': '<f4'}").unwrap();
    assert_eq!(problem_of(&file), "is a NumPy array (npy), not an .npz file of NumPy");
    // Cut short, or with a shape that the file cannot hold.
    Tensor::write_npz(&arrays(), &file).unwrap();
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(problem_of(&file), "is no .npz file of NumPy, or its end is missing");
    // Numbers that NumPy stores in another way.
    for (usual, other, found) in [
        (
            "'fortran_order': False",
            "'fortran_order': True ",
            "numpy.ascontiguousarray(observations)",
        ),
        ("'<f4', 'fortran", "'>f4', 'fortran", "save observations.astype('float32')"),
    ] {
        let mut changed = whole.clone();
        let at = changed.windows(usual.len()).position(|bytes| bytes == usual.as_bytes()).unwrap();
        changed[at..at + usual.len()].copy_from_slice(other.as_bytes());
        std::fs::write(&file, &changed).unwrap();
        let problem = problem_of(&file);
        assert!(problem.contains(found), "{problem}");
    }
    // A damaged byte, in a file that is not packed and in one that is.
    let packed = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/packed.npz");
    for mut damaged in [whole.clone(), std::fs::read(packed).unwrap()] {
        let names: Vec<usize> =
            (0..damaged.len()).filter(|at| damaged[*at..].starts_with(b"actions.npy")).collect();
        let end = damaged[names[0]..].windows(4).position(|at| at == b"PK\x03\x04").unwrap();
        damaged[names[0] + end - 2] ^= 1;
        std::fs::write(&file, &damaged).unwrap();
        let problem = problem_of(&file);
        assert!(
            problem.contains("actions cannot be read, as if the file were damaged"),
            "{problem}"
        );
    }
    let (mut huge, shape) = (whole.clone(), b"(999999999,2,), }");
    let at = whole.windows(6).position(|bytes| bytes == b"(4,2,)").unwrap();
    huge[at..at + shape.len()].copy_from_slice(shape);
    std::fs::write(&file, &huge).unwrap();
    let found = problem_of(&file);
    assert!(found.contains("has shape [999999999, 2]: more than the file holds"), "{found}");
}

#[test]
fn files_that_numpy_has_packed_are_read() {
    // np.savez_compressed, with states of float64, ends of bool, and another array.
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/packed.npz");
    let trainer = trainer("random", settings(), 0);
    let data = Dataset::read(&file, trainer.world(), &Progress::default()).unwrap();
    assert_eq!((data.source().transitions, data.source().episodes), (2, 2));
    assert_eq!(data.states(), [0.5, 0.5, 1.5, 0.5, 1.5, 0.5, 2.5, 0.5]);
}

#[test]
fn what_a_map_does_not_allow_is_left_out_and_never_a_goal() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    let mut own = arrays();
    // The second episode jumps to a place outside, as of another world.
    let far = [0.5_f32, 0.5, 1.5, 0.5, 1.5, 0.5, 4e8, -85.0];
    own[0].1 = Tensor::from_slice(&far, (4, 2), &Device::Cpu).unwrap();
    Tensor::write_npz(&own, &file).unwrap();
    let mut trainer = trainer("gdg-bridge", settings(), 0);
    let data = Dataset::read(&file, trainer.world(), &Progress::default()).unwrap();
    assert_eq!(
        trainer.learn_from(&data, &Progress::default()),
        LeftOut { impossible: 1, by_chance: 0 }
    );
    let mut states = Vec::new();
    trainer.replay().visit_rows(|state, _, _| states.extend_from_slice(state));
    assert_eq!(states, [0.5, 0.5, 1.5, 0.5]);
    train_to(&mut trainer, 3);
    let map = PointMaze::downcast_ref(trainer.world()).unwrap().map().clone();
    assert!(trainer.candidates().points().chunks(2).all(|at| map.is_free_at(at[0], at[1])));
}

#[test]
fn an_episode_needs_no_end_at_the_end_of_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    let mut own = arrays();
    own[2].1 = Tensor::from_slice(&[0.0_f64, 1.0, 0.0, 0.0], 4, &Device::Cpu).unwrap();
    Tensor::write_npz(&own, &file).unwrap();
    let trainer = trainer("random", settings(), 0);
    let data = Dataset::read(&file, trainer.world(), &Progress::default()).unwrap();
    assert_eq!((data.source().transitions, data.source().episodes), (2, 2));
    assert_eq!(data.state(3), [2.5, 0.5]);
}

/// Returns the states of all transitions, pair by pair, and the number of episodes, of a file of
/// [`arrays`] and these.
fn transitions(
    more: Vec<(&'static str, Tensor)>,
    change: impl Fn(&mut Vec<(&'static str, Tensor)>),
) -> (Vec<[Vec<f32>; 2]>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("d.npz");
    let mut own = arrays();
    own.extend(more);
    change(&mut own);
    Tensor::write_npz(&own, &file).unwrap();
    let trainer = trainer("random", settings(), 0);
    let data = Dataset::read(&file, trainer.world(), &Progress::default()).unwrap();
    let (mut pairs, mut before) = (Vec::new(), None);
    data.replay(1, || vec![0.0, 0.0]).visit_rows(|state, _, is_last| {
        pairs.extend(before.take().map(|before| [before, state.to_vec()]));
        before = (!is_last).then(|| state.to_vec());
    });
    assert_eq!(pairs.len(), data.source().transitions);
    (pairs, data.source().episodes)
}

#[test]
fn time_that_is_up_ends_an_episode_too() {
    let ends = |rows: [f32; 4]| Tensor::new(&rows, &Device::Cpu).unwrap();
    for name in ["timeouts", "truncations"] {
        let found = transitions(vec![(name, ends([0.0, 1.0, 0.0, 1.0]))], |arrays| {
            arrays[2].1 = ends([0.0; 4]);
        });
        let expected = [[[0.5, 0.5], [1.5, 0.5]], [[1.5, 0.5], [2.5, 0.5]]];
        assert_eq!(found, (expected.map(|pair| pair.map(Vec::from)).to_vec(), 2), "{name}");
    }
    let short = |arrays: &mut Vec<(&'static str, Tensor)>| {
        arrays.push(("timeouts", Tensor::zeros(3, DType::U8, &Device::Cpu).unwrap()));
    };
    assert!(problem(short).starts_with("timeouts have shape [3]: "));
}

#[test]
fn actions_lead_to_the_next_observations_that_a_file_has() {
    let next = |numbers: [f32; 8]| {
        let next = Tensor::from_slice(&numbers, (4, 2), &Device::Cpu).unwrap();
        vec![("next_observations", next)]
    };
    let as_they_are = |_: &mut Vec<(&'static str, Tensor)>| {};
    let single = |arrays: &mut Vec<(&'static str, Tensor)>| {
        arrays[2].1 = Tensor::zeros(4, DType::U8, &Device::Cpu).unwrap();
    };
    let pairs =
        |all: &[[[f32; 2]; 2]]| all.iter().map(|pair| pair.map(Vec::from)).collect::<Vec<_>>();
    // Single transitions in any order, of which two follow each other.
    let shuffled = next([1.5, 0.5, 1.0, 0.5, 2.5, 0.5, 3.5, 0.5]);
    let expected = pairs(&[
        [[0.5, 0.5], [1.5, 0.5]],
        [[1.5, 0.5], [1.0, 0.5]],
        [[1.5, 0.5], [2.5, 0.5]],
        [[2.5, 0.5], [3.5, 0.5]],
    ]);
    assert_eq!(transitions(shuffled.clone(), single), (expected.clone(), 2));
    // The last action of an episode leads somewhere, too.
    assert_eq!(transitions(shuffled, as_they_are), (expected, 2));
    // But not to the first state of the next episode: the states moved by a row.
    let moved = next([1.5, 0.5, 1.5, 0.5, 2.5, 0.5, 0.5, 0.5]);
    let expected = pairs(&[[[0.5, 0.5], [1.5, 0.5]], [[1.5, 0.5], [2.5, 0.5]]]);
    assert_eq!(transitions(moved, as_they_are), (expected, 2));
    let mut without_number = next([0.5; 8]);
    without_number[0].1 = Tensor::full(f32::NAN, (4, 2), &Device::Cpu).unwrap();
    let problem = problem(|arrays| arrays.extend(without_number.clone()));
    assert!(problem.starts_with("next_observations[0, 0] is NaN"), "{problem}");
}

#[test]
fn a_checkpoint_contains_the_data_once_their_file_is_another_one() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path());
    let mut trainer = learner(&file, settings(), 1);
    train_to(&mut trainer, 30);
    assert!(trainer.take_warnings().is_empty());
    for (lost, change) in [
        ("has changed", (|file| std::fs::write(file, b"other").unwrap()) as fn(&Path)),
        ("can no longer be read", |file| std::fs::remove_file(file).unwrap()),
    ] {
        change(&file);
        let warnings = trainer.take_warnings();
        assert!(warnings[0].contains(lost), "{warnings:?}");
        let store = trainer.save().unwrap();
        let mut resumed = Trainer::load(&store, &Registry::builtin(), 1).unwrap();
        let updates = trainer.counters().updates + 30;
        train_to(&mut trainer, updates);
        train_to(&mut resumed, updates);
        assert_eq!(state(&trainer), state(&resumed));
    }
}
