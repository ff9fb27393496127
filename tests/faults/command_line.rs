//! What people type: numbers, names, options of a resumed run.

use std::path::Path;

use super::{checkpoint, events, folder};
use crate::ran::{one_line, words};
use crate::support::{headless, isolated_command, outcome};

/// Runs the program with what is typed; returns exit status, output and errors.
pub fn typed(folder: &Path, args: &[&str]) -> (i32, String, String) {
    outcome(isolated_command(folder).args(args))
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
fn a_resumed_run_replaces_its_own_table_and_no_other() {
    let folder = folder();
    let run = |args: &str| {
        let common = "--eval-tasks 1 --eval-every-updates 300 --threads 1";
        let line = format!("{args} {common}");
        let (status, _, errors) = outcome(&mut headless(folder.path(), &words(&line)));
        assert_eq!(status, 0, "{errors}");
        errors
    };
    let table = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    // Without times, and the first session's last evaluation, which the other run did not make.
    let rows = |name: &str| {
        let table = table(name);
        let cells = table.lines().map(|row| row.split(',').collect::<Vec<_>>());
        let rows = cells.filter(|row| row[0] != "evaluation" || row[2] != "1000");
        rows.map(|mut row| (row.remove(1), row.join(",")).1).collect::<Vec<_>>()
    };
    run("trap --max-updates 1300 --csv whole.csv");
    run("trap --max-updates 1000 --csv part.csv --save run.safetensors");
    let (saved, beyond) = (table("part.csv"), "progress,,1050,,.1,.1,.1\n");
    // It goes on; as a run that was killed after it was saved; and beside what is somebody else's.
    for (found, to) in [
        (saved.clone(), "part.csv"),
        (saved.clone() + beyond, "part-2.csv"),
        (saved.replace("0.", "1."), "part-3.csv"),
        ("mine\n".to_owned(), "part-4.csv"),
    ] {
        std::fs::write(folder.path().join("part.csv"), &found).unwrap();
        let said = run("--resume run.safetensors --max-updates 1300 --csv part.csv");
        assert_eq!(rows(to), rows("whole.csv"), "{to}");
        assert_eq!(to == "part.csv", table("part.csv") != found, "{to}");
        assert_eq!(to != "part.csv", said.contains(&format!("all rows are in {to}")), "{said}");
    }
    std::fs::write(folder.path().join("part.csv"), saved.replace("0.", "1.")).unwrap();
    run("--resume run.safetensors --max-updates 1300 --csv part.csv --overwrite");
    assert_eq!(rows("part.csv"), rows("whole.csv"));
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
    // The others count from the start, and the program says so.
    for limit in [["--max-updates", "350"], ["--max-episodes", "1"]] {
        let (records, errors) = train(&limit);
        assert!(errors.contains("nothing to train") && errors.contains(limit[0]), "{errors}");
        assert_eq!(records.last().unwrap()["updates"], 350);
    }
}
