//! Checkpoints: saved runs continue as if they had not been interrupted, and other files are refused.

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

#[test]
fn a_checkpoint_is_packed_described_without_being_loaded_and_can_be_read_unpacked() {
    let folder = tempfile::tempdir().unwrap();
    let mut run = trainer(settings(), 5, 1);
    train_to(&mut run, 120);
    let evaluation = run.evaluate(&run.tasks(2).unwrap()).unwrap();
    run.record_evaluation(Moment { updates: 100, ..run.moment() }, evaluation.clone());
    let path = folder.path().join("some.safetensors");
    train::save(&run, &SaveTo::CreateNew(path.clone())).unwrap();
    let found = train::describe(&path).unwrap();
    assert_eq!((found.updates, found.success), (120, Some(evaluation.success(100))));
    assert_eq!((&found.run, found.title.as_str()), (run.run(), map_of(&run).name()));
    let bytes = std::fs::read(path).unwrap();
    let plain = train::unpacked(&bytes).unwrap();
    assert_eq!(found.bytes, bytes.len() as u64);
    assert!(3 * bytes.len() < 2 * plain.len(), "{} of {} bytes", bytes.len(), plain.len());
    assert_same(&run, &train::from_bytes(&plain, &Registry::builtin(), 1).unwrap());
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
