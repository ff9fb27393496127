//! Checkpoints: saved runs continue as if they had not been interrupted, and other files are refused.

use super::*;

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
    let mut straight = trainer(settings(), 5, 1);
    train_to(&mut straight, 700);
    let mut first = trainer(settings(), 5, 1);
    // Stop mid-cycle: between one due update and the next.
    train_to(&mut first, 333);
    let mut resumed = read_back(&first, 2);
    assert_eq!(map_of(&resumed), map_of(&straight));
    train_to(&mut resumed, 700);
    assert_same(&straight, &resumed);
}

#[test]
fn a_run_with_a_full_replay_resumes_bitwise() {
    let mut small = settings();
    small.learn.buffer_size = 5_000;
    let mut straight = trainer(small.clone(), 6, 1);
    train_to(&mut straight, 500);
    assert_eq!(straight.replay().len(), straight.replay().capacity(), "the replay is full");
    let mut first = trainer(small, 6, 1);
    train_to(&mut first, 400);
    let mut resumed = read_back(&first, 1);
    train_to(&mut resumed, 500);
    assert_same(&straight, &resumed);
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
