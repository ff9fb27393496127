//! Checkpoints: saved runs continue as if they had not been interrupted, and other files are refused.

use rand::RngExt;

use super::*;

#[test]
fn resumed_runs_continue_bitwise_whatever_their_settings() {
    let changes: [fn(&mut LearnSettings); 6] = [
        |_| {},
        |learn| learn.graph_bounds = false,
        |learn| learn.actor_waypoints = false,
        |learn| learn.unblock_actor = false,
        |learn| learn.model_check = false,
        // The replay is full by then.
        |learn| learn.buffer_size = 5_000,
    ];
    let mut ends = Vec::new();
    for change in changes {
        let begin = || {
            let mut settings = settings();
            change(&mut settings.learn);
            trainer(settings, 5, 1)
        };
        // Stopped between one due update and the next.
        let end = assert_resumes(begin, 333, 700);
        let mut learned = Store::default();
        end.learner().save(&mut learned).unwrap();
        assert!(!ends.contains(&learned), "each makes a difference");
        ends.push(learned);
    }
}

/// Whatever the state of a checkpoint says, it is refused or can be trained.
#[test]
fn forged_states_do_no_harm() {
    let mut run = trainer(settings(), 7, 1);
    train_to(&mut run, 60);
    let good = train::to_bytes(&run.save().unwrap(), &Job::default()).unwrap();
    let mut rng = rng(1);
    let mut taken = 0;
    for round in 0..300 {
        let bytes = train::with_changed_state(&good, |state| match round % 3 {
            0 => state.truncate(rng.random_range(0..state.len())),
            // Most bytes are weights; what is small comes last.
            kind => {
                let from = if kind == 1 { 0 } else { state.len() - state.len() / 3 };
                for _ in 0..rng.random_range(1..4) {
                    let at = rng.random_range(from..state.len());
                    state[at] = [0, 0xff, rng.random()][rng.random_range(0..3)];
                }
            }
        });
        if let Ok(mut run) = train::from_bytes(&bytes.unwrap(), &Registry::builtin(), 1) {
            taken += 1;
            (0..6).for_each(|_| drop(run.tick()));
        }
    }
    assert!((1..290).contains(&taken), "{taken} were taken");
}

#[test]
fn files_that_are_not_checkpoints_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = trainer(settings(), 7, 1);
    train_to(&mut run, 10);
    let whole = folder.path().join("whole.safetensors");
    train::save(&run, &SaveTo::Replace(whole.clone())).unwrap();
    let bytes = std::fs::read(&whole).unwrap();
    let none = Vec::<(String, safetensors::tensor::TensorView)>::new();
    let foreign = safetensors::serialize(none, None).unwrap();
    // A header with other network sizes than those saved.
    let mut changed = bytes.clone();
    let at = bytes.windows(12).position(|w| w == b"\\\"hidden\\\":6").unwrap();
    changed[at + 11] = b'3';
    for (bytes, why) in [
        (&b"hello"[..], "not a checkpoint"),
        (b"", "is empty"),
        (&bytes[..bytes.len() / 2], "its size differs from what its header says"),
        (&foreign, "not a checkpoint"),
        (&changed, "checksum"),
    ] {
        let path = folder.path().join("other.safetensors");
        std::fs::write(&path, bytes).unwrap();
        let error = train::load(&path, &Registry::builtin(), 1).err().expect(why).to_string();
        assert!(error.contains(why), "{error}");
    }
}
