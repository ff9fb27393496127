//! Learning from recorded transitions.

use std::path::{Path, PathBuf};

use crate::support::{assert_same, load, maze, resumed, state, train_all, train_to};
use candle_core::{DType, Device, Tensor};
use gdg::env::PointMaze;
use gdg::job::Job;
use gdg::train::{self, Dataset, Registry, SaveTo, Settings, Trainer};
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
    crate::support::trainer(&maze(CORNER), method, settings, seed, 1)
}

/// Writes what agents see that walk at random; returns the file.
fn recorded(folder: &Path, seed: u64) -> PathBuf {
    let mut random = trainer("random", settings(), seed);
    for _ in 0..5_000 {
        random.tick().unwrap();
    }
    let file = folder.join("walks.npz");
    let bytes = data_file(random.replay(), random.world(), &Job::default()).unwrap();
    std::fs::write(&file, bytes).unwrap();
    file
}

fn read(file: &Path) -> Result<Dataset, impl std::error::Error> {
    Dataset::read(file, &maze(CORNER), &Job::default())
}

fn learner(file: &Path, settings: Settings, seed: u64) -> Trainer {
    let mut trainer = trainer("gdg-bridge", settings, seed);
    trainer.learn_from(&read(file).unwrap(), &Job::default()).unwrap();
    trainer
}

#[test]
fn a_run_learns_from_data_alone_and_the_same_seed_gives_the_same_run() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), 7);
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
    let [planned, _] = crate::support::success(&trainer, 10);
    assert!(planned > 0.9, "{planned}");
    let [mut again, mut other] = [1, 2].map(|seed| learner(&file, settings(), seed));
    train_all([&mut again, &mut other], 600);
    assert_same(&trainer, &again);
    assert!(state(&trainer) != state(&other));
}

#[test]
fn a_checkpoint_names_its_data_and_goes_on_where_it_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), 7);
    let mut whole = learner(&file, settings(), 1);
    train_to(&mut whole, 250);
    let mut half = learner(&file, settings(), 1);
    train_to(&mut half, 130);
    let checkpoint = folder.path().join("half.safetensors");
    train::save(&half, &SaveTo::CreateNew(checkpoint.clone())).unwrap();
    let mut resumed = load(&checkpoint, 1);
    train_to(&mut resumed, 250);
    assert_same(&whole, &resumed);
    // It does not contain the data.
    assert!(!state(&half).contains_key("replay"));
    let put_back = |trainer: &Trainer| {
        let mut parts = state(trainer);
        parts.remove("data").unwrap();
        parts
    };
    let expected = put_back(&whole);
    // Without the file it can be looked at, but does not go on.
    let moved = folder.path().join("moved.npz");
    std::fs::rename(&file, &moved).unwrap();
    let mut lost = load(&checkpoint, 1);
    let error = lost.tick().unwrap_err();
    assert!(matches!(error, TrainError::Data(_)) && lost.policy().is_ok(), "{error:?}");
    assert!(error.to_string().contains("--data FILE if it is elsewhere"), "{error}");
    let elsewhere = Registry::builtin().with(|own| own.data = Some(moved.clone()));
    let mut found = train::load(&checkpoint, &elsewhere, 1).unwrap();
    train_to(&mut found, 250);
    assert_eq!(found.data().unwrap().file, moved, "it is known from now on");
    assert!(expected == put_back(&found));
    // Other data are not taken for it.
    recorded(folder.path(), 8);
    let error = load(&checkpoint, 1).check_data().unwrap_err().to_string();
    assert!(error.contains("walks.npz: is not what the run has learned from"), "{error}");
    // A checkpoint of a run that had read the file before contains its data.
    assert!(state(&whole).contains_key("replay"));
    assert!(whole.take_warnings().concat().contains("walks.npz has changed or is gone"));
    assert!(whole.take_warnings().is_empty(), "said once");
    assert!(state(&whole).contains_key("replay"));
    // Nor are they ignored while the run's own are there.
    let named = folder.path().join("named.npz");
    std::fs::rename(&file, &named).unwrap();
    std::fs::rename(&moved, &file).unwrap();
    let named = Registry::builtin().with(|own| own.data = Some(named));
    let error = train::load(&checkpoint, &named, 1).unwrap().check_data().unwrap_err();
    assert!(error.to_string().contains("named.npz: is not what the run"), "{error}");
}

#[test]
fn agents_act_after_the_data() {
    let folder = tempfile::tempdir().unwrap();
    let file = recorded(folder.path(), 7);
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
    let mut again = resumed(&trainer, 1);
    std::fs::remove_file(&file).unwrap();
    train_all([&mut trainer, &mut again], 201);
    assert_same(&trainer, &again);
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

type Arrays = Vec<(&'static str, Tensor)>;
type Change<'a> = &'a dyn Fn(&mut Arrays);

/// Writes a file of these arrays after a change.
fn written(folder: &Path, change: impl Fn(&mut Arrays)) -> PathBuf {
    let (mut own, file) = (arrays(), folder.join("d.npz"));
    change(&mut own);
    Tensor::write_npz(&own, &file).unwrap();
    file
}

/// Returns what is wrong with a file.
fn problem(file: &Path) -> String {
    let error = read(file).expect_err("an error").to_string();
    error.strip_prefix(&format!("{}: ", file.display())).expect("it names the file").to_owned()
}

fn with(at: usize, value: f32) -> impl Fn(&mut Arrays) {
    move |arrays| {
        let mut numbers: Vec<f32> = arrays[at].1.flatten_all().unwrap().to_vec1().unwrap();
        numbers[5] = value;
        arrays[at].1 = Tensor::from_slice(&numbers, (4, 2), &Device::Cpu).unwrap();
    }
}

fn replaced(at: usize, shape: &'static [usize]) -> impl Fn(&mut Arrays) {
    move |arrays| arrays[at].1 = Tensor::zeros(shape, DType::F32, &Device::Cpu).unwrap()
}

#[test]
fn wrong_arrays_are_refused_with_the_place_and_what_would_be_right() {
    let folder = tempfile::tempdir().unwrap();
    let unclear = |arrays: &mut Arrays| {
        arrays[2].1 = Tensor::new(&[0.0, f32::NAN, 0.0, 1.0], &Device::Cpu).unwrap();
    };
    let all_end = |arrays: &mut Arrays| {
        arrays[2].1 = Tensor::ones(4, DType::U8, &Device::Cpu).unwrap();
    };
    let short = |arrays: &mut Arrays| {
        arrays.push(("timeouts", Tensor::zeros(3, DType::U8, &Device::Cpu).unwrap()));
    };
    let next = |arrays: &mut Arrays| {
        let next = Tensor::full(f32::NAN, (4, 2), &Device::Cpu).unwrap();
        arrays.push(("next_observations", next));
    };
    let cases: [(Change, &str); 11] = [
        (&with(0, f32::NAN), "observations[2, 1] is NaN: it must be finite"),
        (&with(1, 1.5), "actions[2, 1] is 1.5: it must be in [-1, 1]"),
        (&unclear, "terminals[1] is NaN: it must be 1 in the last row of an episode, and else 0"),
        (&next, "next_observations[0, 0] is NaN"),
        (&replaced(0, &[4, 29]), "observations have shape [4, 29]: to fit the world"),
        (&replaced(1, &[3, 2]), "actions have shape [3, 2]: to fit the world"),
        (&short, "timeouts have shape [3]: to fit the world"),
        (&replaced(1, &[4]), "actions have shape [4]: "),
        (&replaced(2, &[4, 2]), "terminals have shape [4, 2]: "),
        (&|arrays| drop(arrays.remove(2)), "has no array terminals, but actions, observations"),
        (&all_end, "has no transition: all 4 rows end an episode"),
    ];
    for (change, expected) in cases {
        let found = problem(&written(folder.path(), change));
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn other_and_damaged_files_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let whole = std::fs::read(written(folder.path(), |_| {})).unwrap();
    let changed = |usual: &[u8], other: &[u8]| {
        let mut bytes = whole.clone();
        let at = whole.windows(usual.len()).position(|bytes| bytes == usual).unwrap();
        bytes[at..at + other.len()].copy_from_slice(other);
        bytes
    };
    // A damaged byte, in a file that is not packed and in one that is.
    let damaged = |mut bytes: Vec<u8>| {
        let at = bytes.windows(11).position(|name| name == b"actions.npy").unwrap();
        let end = bytes[at..].windows(4).position(|at| at == b"PK\x03\x04").unwrap();
        bytes[at + end - 2] ^= 1;
        bytes
    };
    let is_damaged = "actions cannot be read, as if the file were damaged";
    for (bytes, expected) in [
        (b"observations".to_vec(), "is a text file, not an .npz file of NumPy"),
        (b"\x93NUMPY\x01\0v\0{'descr': '<f4'}".to_vec(), "is a NumPy array (npy), not an .npz"),
        (whole[..whole.len() / 2].to_vec(), "is no .npz file of NumPy, or its end is missing"),
        (changed(b"'fortran_order': False", b"'fortran_order': True "), "numpy.ascontiguousarray"),
        (changed(b"'<f4', 'fortran", b"'>f4', 'fortran"), "save observations.astype('float32')"),
        (changed(b"(4,2,)", b"(999999999,2,), }"), "has shape [999999999, 2]: more than the file"),
        (damaged(whole.clone()), is_damaged),
        (damaged(std::fs::read(packed()).unwrap()), is_damaged),
    ] {
        let file = folder.path().join("other.npz");
        std::fs::write(&file, bytes).unwrap();
        let found = problem(&file);
        assert!(found.contains(expected), "{found}");
    }
    assert!(problem(&folder.path().join("missing.npz")).starts_with("cannot be read: "));
}

/// Written by np.savez_compressed, with states of float64, ends of bool, and another array.
fn packed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/packed.npz")
}

#[test]
fn files_that_numpy_has_packed_are_read() {
    let data = read(&packed()).unwrap();
    assert_eq!((data.source().transitions, data.source().episodes), (2, 2));
    assert_eq!(data.states(), [0.5, 0.5, 1.5, 0.5, 1.5, 0.5, 2.5, 0.5]);
}

#[test]
fn what_a_map_does_not_allow_is_left_out_and_never_a_goal() {
    let folder = tempfile::tempdir().unwrap();
    // The second episode jumps to a place outside, as of another world.
    let file = written(folder.path(), |arrays| {
        let far = [0.5_f32, 0.5, 1.5, 0.5, 1.5, 0.5, 4e8, -85.0];
        arrays[0].1 = Tensor::from_slice(&far, (4, 2), &Device::Cpu).unwrap();
    });
    let (mut trainer, data) = (trainer("gdg-bridge", settings(), 0), read(&file).unwrap());
    assert_eq!(
        trainer.learn_from(&data, &Job::default()).unwrap(),
        LeftOut { impossible: 1, by_chance: 0 }
    );
    let mut states = Vec::new();
    trainer.replay().visit_rows(|state, _, _| states.extend_from_slice(state));
    assert_eq!(states, [0.5, 0.5, 1.5, 0.5]);
    train_to(&mut trainer, 3);
    let map = PointMaze::downcast_ref(trainer.world()).unwrap().map().clone();
    assert!(trainer.candidates().points().chunks(2).all(|at| map.is_free_at(at[0], at[1])));
}

/// Returns the states of all transitions, pair by pair, and the number of episodes, of a file of
/// [`arrays`] after a change.
fn transitions(change: impl Fn(&mut Arrays)) -> (Vec<[Vec<f32>; 2]>, usize) {
    let folder = tempfile::tempdir().unwrap();
    let data = read(&written(folder.path(), change)).unwrap();
    let mut pairs = Vec::new();
    let replay = data.replay(1, || vec![0.0, 0.0]);
    replay.visit_steps(|from, to| pairs.push([from, to].map(<[f32]>::to_vec)));
    assert_eq!(pairs.len(), data.source().transitions);
    (pairs, data.source().episodes)
}

fn pairs(all: &[[[f32; 2]; 2]]) -> Vec<[Vec<f32>; 2]> {
    all.iter().map(|pair| pair.map(Vec::from)).collect()
}

#[test]
fn time_that_is_up_and_the_end_of_the_file_end_an_episode_too() {
    let ends = |rows: [f64; 4]| Tensor::new(&rows, &Device::Cpu).unwrap();
    let expected = (pairs(&[[[0.5, 0.5], [1.5, 0.5]], [[1.5, 0.5], [2.5, 0.5]]]), 2);
    let names = ["timeouts", "truncations", "dones", "terminations", "terminated", "truncated"];
    for name in names.into_iter().chain(["done"]) {
        assert_eq!(transitions(|arrays| arrays[2].0 = name), expected, "{name} alone");
        let found = transitions(|arrays| {
            arrays[2].1 = ends([0.0; 4]);
            arrays.push((name, ends([0.0, 1.0, 0.0, 1.0])));
        });
        assert_eq!(found, expected, "{name}");
    }
    assert_eq!(transitions(|arrays| arrays[2].1 = ends([0.0, 1.0, 0.0, 0.0])), expected);
    let folder = tempfile::tempdir().unwrap();
    let is_endless = |last| {
        let file = written(folder.path(), |arrays| arrays[2].1 = ends([0.0, 0.0, 0.0, last]));
        read(&file).unwrap().doubts(&maze(CORNER)).concat().contains("no row ends an episode")
    };
    assert_eq!([0.0, 1.0].map(is_endless), [true, false], "nothing says that it is one episode");
}

#[test]
fn actions_lead_to_the_next_observations_that_a_file_has() {
    let found = |next: [f32; 8], single: bool| {
        transitions(|arrays| {
            let next = Tensor::from_slice(&next, (4, 2), &Device::Cpu).unwrap();
            arrays.push(("next_observations", next));
            if single {
                arrays[2].1 = Tensor::zeros(4, DType::U8, &Device::Cpu).unwrap();
            }
        })
    };
    // Single transitions in any order, of which two follow each other; and the last action of an
    // episode leads somewhere, too.
    let shuffled = [1.5, 0.5, 1.0, 0.5, 2.5, 0.5, 3.5, 0.5];
    let expected = pairs(&[
        [[0.5, 0.5], [1.5, 0.5]],
        [[1.5, 0.5], [1.0, 0.5]],
        [[1.5, 0.5], [2.5, 0.5]],
        [[2.5, 0.5], [3.5, 0.5]],
    ]);
    assert_eq!(
        [true, false].map(|single| found(shuffled, single)),
        [(); 2].map(|()| (expected.clone(), 2))
    );
    // But not to the first state of the next episode: the states moved by a row.
    let moved = [1.5, 0.5, 1.5, 0.5, 2.5, 0.5, 0.5, 0.5];
    let expected = pairs(&[[[0.5, 0.5], [1.5, 0.5]], [[1.5, 0.5], [2.5, 0.5]]]);
    assert_eq!(found(moved, false), (expected, 2));
}
