//! What people type: numbers, names, options of a resumed run.

use std::path::Path;

use super::{checkpoint, events, folder};
use crate::ran::words;
use crate::support::{headless, isolated_command, outcome};
use gdg::train;

/// Runs the program with what is typed; returns exit status, output and errors.
pub fn typed(folder: &Path, args: &[&str]) -> (i32, String, String) {
    outcome(isolated_command(folder).args(args))
}

/// Returns an error as it was before its lines were broken.
pub fn one_line(error: &str) -> String {
    error.replace('│', "").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns a table without what depends on the machine's speed.
fn without_times(table: &Path) -> Vec<Vec<String>> {
    let rows = csv::Reader::from_path(table).unwrap().into_records().map(Result::unwrap);
    let cut = |row: csv::StringRecord| {
        row.iter()
            .enumerate()
            .filter(|(i, _)| ![1, 5].contains(i))
            .map(|(_, cell)| cell.to_owned())
            .collect()
    };
    rows.map(cut).collect()
}

#[test]
fn counts_are_accepted_as_people_write_them_or_it_is_said_how() {
    let folder = folder();
    for (count, written) in
        [(100, "1e2"), (100, "100.0"), (1000, "1_000"), (1000, "1,000"), (1000, "1e3")]
    {
        let (status, output, errors) =
            typed(folder.path(), &["--print-config", "--set", &format!("batch_size={written}")]);
        assert!(
            status == 0 && output.contains(&format!("\"batch_size\": {count},")),
            "{written}: {errors}"
        );
        let settings = folder.path().join("settings.json");
        std::fs::write(&settings, format!("{{\"batch_size\": \"{written}\"}}")).unwrap();
        let (status, output, errors) =
            typed(folder.path(), &["--print-config", "--config", "settings.json"]);
        assert!(
            status == 0 && output.contains(&format!("\"batch_size\": {count},")),
            "{written}: {errors}"
        );
        let line = format!(
            "--no-ui trap --max-updates 0 --threads 1 --eval-tasks 1 --seed \
            {written}"
        );
        let args = words(&line);
        let (status, output, errors) = typed(folder.path(), &args);
        assert!(status == 0 && events(&output)[0]["seed"] == count, "{written}: {errors}");
    }
    for (args, parts) in [
        (
            &["--no-ui", "--max-updates", "1k"][..],
            &["expected a whole number, such as 60000, 60_000 or 6e4"][..],
        ),
        (&["--no-ui", "--max-updates", "60.000"], &["could mean 60 or 60000"]),
        (&["--no-ui", "--edit-at", "1.5:x"], &["is not a number of updates", "whole number"]),
        (&["suite", "trap", "--budget", "1e20"], &["too large"]),
        (&["suite", "trap", "--jobs", "1e3"], &["from 1 to 256"]),
        (&["--no-ui", "trap", "--threads", "0"], &["from 1 to 256, or auto"]),
        (&["--no-ui", "trap", "--threads", "all"], &["whole number", "or auto"]),
        (
            &["--print-config", "--set", "batch_size=100.5"],
            &["batch_size needs a whole number, not 100.5"],
        ),
        (&["--print-config", "--set", "buffer_size=60.000"], &["could mean 60 or 60000"]),
        (&["--print-config", "--set", "learning_rate=0,001"], &["a point separates"]),
    ] {
        let (status, _, errors) = typed(folder.path(), args);
        let errors = one_line(&errors);
        assert!(
            status == 2 && parts.iter().all(|part| errors.contains(part)),
            "{args:?}: {errors}"
        );
    }
}

#[test]
fn no_output_is_written_to_a_file_called_minus() {
    let folder = folder();
    for args in [
        &["--no-ui", "trap", "--csv", "-"][..],
        &["--no-ui", "trap", "--save", "-"],
        &["export-data", "x", "--out", "-"],
        &["export-policy", "x", "--out", "-"],
        &["suite", "trap", "--out", "-"],
    ] {
        let (status, _, errors) = typed(folder.path(), args);
        assert!(
            status == 2 && errors.contains("standard output is not for this"),
            "{args:?}: {errors}"
        );
    }
    assert!(!folder.path().join("-").exists());
}

#[test]
fn input_that_is_not_in_a_file_is_refused_with_what_to_do() {
    let folder = folder();
    nix::unistd::mkfifo(&folder.path().join("fifo"), nix::sys::stat::Mode::S_IRWXU).unwrap();
    for (file, why) in [("-", "standard input is not read"), ("fifo", "is a FIFO")] {
        for args in [
            &["check", file][..],
            &["--no-ui", file],
            &["--no-ui", "--config", file],
            &["--no-ui", "trap", "--scen", file],
            &["--no-ui", "--resume", file],
            &["export-data", file],
        ] {
            let (status, _, errors) = typed(folder.path(), args);
            let errors = one_line(&errors);
            assert!(status == 2 && errors.contains(why), "{args:?}: {errors}");
            assert!(
                errors.contains("write what is to be read to a file first"),
                "{args:?}: {errors}"
            );
        }
    }
}

#[test]
#[allow(clippy::too_many_lines, reason = "one table goes through all of it")]
fn a_resumed_run_goes_on_in_its_own_table() {
    let folder = folder();
    let run = |args: &[&str]| {
        let (status, _, errors) = outcome(&mut headless(folder.path(), args));
        assert_eq!(status, 0, "{errors}");
        errors
    };
    let common = ["--eval-tasks", "1", "--eval-every-updates", "300", "--threads", "1"];
    let with = |args: &[&'static str]| [args, &common].concat();
    run(&with(&["trap", "--max-updates", "1300", "--csv", "whole.csv"]));
    run(&with(&words("trap --max-updates 1000 --csv part.csv --save run.safetensors")));
    let part = folder.path().join("part.csv");
    let rows = without_times(&part);
    // A run that has ended is only evaluated again.
    let ended = ["--resume", "run.safetensors", "--save", "run.safetensors", "--csv", "part.csv"];
    let evaluations = || {
        let history = train::read_history(&folder.path().join("run.safetensors")).unwrap().1;
        history.evaluations().len()
    };
    assert_eq!(evaluations(), 4);
    run(&with(&[&ended[..], &["--max-updates", "1000"]].concat()));
    assert_eq!((without_times(&part), evaluations()), (rows, 4));
    let (whole, saved) = (
        std::fs::read_to_string(folder.path().join("whole.csv")).unwrap(),
        std::fs::read_to_string(&part).unwrap(),
    );
    // As if the first session had gone on after its last save, and had been killed while it wrote a
    // row.
    let beyond = whole
        .lines()
        .filter(|line| line.contains(",1200,"))
        .map(|line| format!("{line}\n"))
        .collect::<String>();
    assert!(!beyond.is_empty());
    for (more, overwrite) in
        [("", false), (beyond.as_str(), false), ("progress,9", false), (&beyond, true)]
    {
        std::fs::write(&part, format!("{saved}{more}")).unwrap();
        let mut args =
            with(&["--resume", "run.safetensors", "--max-updates", "1300", "--csv", "part.csv"]);
        args.extend(overwrite.then_some("--overwrite"));
        let said = run(&args);
        assert!(!said.contains("has no rows"), "{more}");
        // Rows beyond the checkpoint are kept in a copy.
        let (copy, is_beyond) = (folder.path().join("part-2.csv"), more == beyond);
        let removed = "part.csv: removed 1 row beyond update 1,000: all are in part-2.csv";
        assert_eq!((said.contains(removed), copy.exists()), (is_beyond, is_beyond), "{said}");
        if is_beyond {
            assert_eq!(std::fs::read_to_string(&copy).unwrap(), format!("{saved}{more}"));
            std::fs::remove_file(copy).unwrap();
        }
        let mut rows = without_times(&part);
        // The first session's last evaluation, which the other run did not make.
        rows.retain(|row| row[0] != "evaluation" || row[1] != "1000");
        assert_eq!(rows, without_times(&folder.path().join("whole.csv")), "{more}, {overwrite}");
    }
    // What no table has is said.
    std::fs::write(&part, saved.as_str()).unwrap();
    let late = ["--resume", "run.safetensors", "--save", "late.safetensors"];
    run(&with(&[&late[..], &["--max-updates", "2000"]].concat()));
    let late = ["--resume", "late.safetensors", "--max-updates", "2001", "--csv", "part.csv"];
    let said = run(&with(&late));
    assert!(said.contains("part.csv: has no rows of updates 1,000 to 2,000"), "{said}");
    // Neither another run's table nor anything else is continued.
    run(&with(&["trap", "--seed", "2", "--max-updates", "1000", "--csv", "other.csv"]));
    std::fs::write(folder.path().join("notes.txt"), "mine\n").unwrap();
    let head = saved.lines().next().unwrap();
    std::fs::write(folder.path().join("later.csv"), format!("{head}\n{beyond}")).unwrap();
    for (file, why) in [
        ("other.csv", "is of another run"),
        ("notes.txt", "it is not a table of metrics"),
        ("later.csv", "all of its rows are later"),
    ] {
        let before = std::fs::read(folder.path().join(file)).unwrap();
        let line = format!(
            "--no-ui --resume run.safetensors --max-updates 1001 --eval-tasks 1 \
            --csv {file}"
        );
        let args = words(&line);
        let (status, output, errors) = typed(folder.path(), &args);
        let errors = one_line(&errors);
        assert!(
            (status, output.as_str()) == (2, "") && errors.contains(why),
            "{file}: {status} {errors}"
        );
        assert_eq!(std::fs::read(folder.path().join(file)).unwrap(), before);
    }
    let args = with(&words(
        "--resume run.safetensors --max-updates 1200 --csv other.csv \
        --overwrite",
    ));
    run(&args);
    assert!(without_times(&folder.path().join("other.csv")).iter().all(|row| row[1] == "1200"));
}

#[test]
fn options_for_maps_are_refused_before_a_run_of_another_world_is_loaded() {
    let folder = folder();
    let file = folder.path().join("arm.safetensors");
    let args = ["fetch-reach", "--method", "gdg", "--max-updates", "0", "--eval-tasks", "1"];
    let args = [&args[..], &["--set", "hidden=16", "--save", "arm.safetensors"]].concat();
    let (status, _, errors) = outcome(&mut headless(folder.path(), &args));
    assert_eq!(status, 0, "{errors}");
    // Loading it would say that it is damaged.
    let mut bytes = std::fs::read(&file).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&file, bytes).unwrap();
    for (option, value) in [("--edit-at", "5:other.map"), ("--scen", "own.scen")] {
        let args = ["--resume", "arm.safetensors", option, value];
        let (status, _, errors) = outcome(&mut headless(folder.path(), &args));
        let wanted = format!("{option} applies only to maps");
        assert!(status == 2 && one_line(&errors).contains(&wanted), "{errors}");
    }
}

#[test]
fn a_resumed_run_trains_for_max_seconds_more() {
    let folder = folder();
    checkpoint(folder.path());
    let train = |args: &[&str]| {
        let args = [
            &["--no-ui", "--resume", "small.safetensors", "--eval-tasks", "1", "--threads", "1"],
            args,
        ]
        .concat();
        let (status, output, errors) = typed(folder.path(), &args);
        assert_eq!(status, 0, "{errors}");
        (events(&output), errors)
    };
    let (records, _) = train(&["--max-seconds", "0"]);
    let begun = records.last().unwrap()["seconds"].as_f64().unwrap();
    // Less than the run has been trained for already.
    let seconds = begun / 2.0;
    let (records, errors) = train(&["--max-seconds", &seconds.to_string()]);
    let end = records.last().unwrap();
    assert_eq!(end["reason"], "max-seconds");
    assert!(errors.starts_with("not saved: ") && errors.lines().count() == 2, "{errors}");
    assert!(end["seconds"].as_f64().unwrap() >= begun + seconds - 0.01, "{end}, begun {begun}");
    assert!(end["updates"].as_u64().unwrap() > 350, "{end}");
    // The others count from the start, which is said.
    for limit in [["--max-updates", "350"], ["--max-episodes", "1"]] {
        let (records, errors) = train(&limit);
        assert!(errors.contains("nothing to train") && errors.contains(limit[0]), "{errors}");
        assert_eq!(records.last().unwrap()["updates"], 350);
    }
}

#[test]
fn a_table_that_another_run_is_writing_is_left_alone() {
    let folder = folder();
    let table = folder.path().join("table.csv");
    std::fs::write(&table, "somebody's rows\n").unwrap();
    let other = std::fs::OpenOptions::new().write(true).open(&table).unwrap();
    other.try_lock().unwrap();
    let args = ["--no-ui", "trap", "--max-updates", "0", "--csv", "table.csv", "--overwrite"];
    let (status, _, errors) = typed(folder.path(), &args);
    assert!(status != 0 && errors.contains("another run is writing"), "{status}: {errors}");
    assert_eq!(std::fs::read_to_string(&table).unwrap(), "somebody's rows\n");
    drop(other);
    assert_eq!(typed(folder.path(), &args).0, 0);
}
