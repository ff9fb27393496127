//! `gdg-tui plot`: curves of suites, checkpoints and records, and what it says where there are
//! none.

use std::path::Path;

use crate::ran::{Ran, SMALL, has_parts, in_folder, words};
use serde_json::{Value, json};

const ROOM: &str = "S.....\n......\n.....G\n";

/// Returns the records of a run evaluated every 100 updates, whose success grows to `last`.
fn records(method: &str, seed: u64, evaluations: u64, last: f64, settings: &Value) -> String {
    let start = json!({
        "event": "start", "version": "0.2.0", "world": "maze", "map": {"name": "room"},
        "method": method, "preset": "default", "settings": settings, "seed": seed,
        "threads": "auto", "updates": 0,
    });
    let score = |success: f64| json!({"success": success, "spl": success, "steps_ratio": null, "by_distance": []});
    let error = json!({"mape": 0.5, "near_mape": 0.5, "bias": 0.0, "spearman": 1.0, "graph": null});
    let evaluation = |i: u64| {
        let share = i as f64 / evaluations as f64;
        let plans = method.starts_with("gdg-bridge");
        json!({
            "event": "evaluation", "seconds": i as f64 * 1.5, "updates": 100 * i,
            "env_steps": 1600 * i, "greedy": score(0.5 * last * share),
            "planned": if plans { score(last * share) } else { Value::Null },
            "distance_error": if method == "her" { Value::Null } else { error.clone() },
            "bridges": null, "coverage": share,
        })
    };
    let all = std::iter::once(start).chain((1..=evaluations).map(evaluation));
    all.map(|record| record.to_string() + "\n").collect()
}

fn plot(folder: &Path, args: &[&str]) -> Ran {
    in_folder(folder, &[&["plot"], args].concat())
}

/// Returns the rows of a table as maps from column to text.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_path(path).unwrap();
    reader.records().map(|row| row.unwrap().iter().map(str::to_owned).collect()).collect()
}

#[test]
fn records_become_means_over_seeds_in_every_format_with_the_table_behind_them() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    let none = json!({});
    write("a.jsonl", records("gdg-bridge", 1, 4, 0.6, &none));
    write("b.jsonl", records("gdg-bridge", 2, 4, 1.0, &none));
    // The last line of a run that goes on is not complete.
    write("c.jsonl", records("her", 1, 2, 0.5, &none) + "{\"event\":\"evalu");
    let out = ["--out", "fig.pdf", "--out", "fig.svg", "--out", "fig.png"];
    let done = plot(folder.path(), &[&[".", "--width", "84mm"], &out[..]].concat());
    done.success();
    assert_eq!(done.out, "fig.pdf\nfig.svg\nfig.png\nfig.csv\n");
    has_parts(&done.err, &["mean of 1 to 2 seeds", "success rate over updates"]);
    let table = rows(&folder.path().join("fig.csv"));
    assert_eq!(table[0], ["chart", "curve", "seed", "updates", "success", "low", "high"]);
    assert!(table.contains(
        &["", "gdg-bridge, planned", "2", "400", "1", "", ""].map(str::to_owned).to_vec()
    ));
    let means: Vec<&Vec<String>> = table.iter().filter(|row| row[2] == "mean").collect();
    let of = |curve: &str| {
        let own = means.iter().filter(|row| row[1] == curve);
        own.map(|row| [3, 4, 5, 6].map(|i| row[i].parse::<f64>().unwrap())).collect::<Vec<_>>()
    };
    assert_eq!(of("gdg-bridge, planned")[..2], [[100.0, 0.2, 0.15, 0.25], [200.0, 0.4, 0.3, 0.5]]);
    assert_eq!(of("her, alone"), [[100.0, 0.125, 0.125, 0.125], [200.0, 0.25, 0.25, 0.25]]);

    let file = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let svg = String::from_utf8(file("fig.svg")).unwrap();
    for label in ["updates", "success rate", "gdg-bridge", "her", "0.2", "200", "fill-opacity"] {
        assert!(svg.contains(label), "{label}: {svg}");
    }
    assert!(!svg.contains("1000.0") && !svg.contains("NaN"), "{svg}");
    let (pdf, png) = (file("fig.pdf"), file("fig.png"));
    assert!(pdf.starts_with(b"%PDF-") && pdf.ends_with(b"%%EOF"));
    let mut png = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    assert_eq!(png.info().width, 993, "84 mm at 300 pixels an inch");
    png.finish().unwrap();
    assert!(png.info().uncompressed_latin1_text.iter().any(|text| text.keyword == "Comment"));

    // Its own figures and tables are replaced, unless somebody has edited them.
    for name in ["fig.csv", "fig.svg", "fig.png", "fig.pdf"] {
        let own = file(name);
        let mut edited = own.clone();
        edited[own.len() / 2] ^= 1;
        let added = if name == "fig.svg" { "x" } else { "an incremental update of a document" };
        for edited in [edited, [&own, added.as_bytes()].concat()] {
            std::fs::write(folder.path().join(name), edited).unwrap();
            let refused = plot(folder.path(), &[&["."], &out[..]].concat());
            assert_eq!(refused.status, Some(2), "{name}");
            has_parts(&refused.err, &[&format!("{name}: the file already exists"), "--overwrite"]);
        }
        std::fs::write(folder.path().join(name), own).unwrap();
    }
    // A run's table is replaced by none.
    std::fs::write(folder.path().join("run.csv"), "event,seconds\n").unwrap();
    let refused = plot(folder.path(), &["a.jsonl", "--out", "run.svg", "--overwrite"]);
    has_parts(&refused.refusal(), &["run.csv: is not a table of a figure"]);
    // The table is one of its own as long as a figure beside it says so.
    std::fs::remove_file(folder.path().join("fig.pdf")).unwrap();
    let alone = ["a.jsonl", "c.jsonl", "--x", "seconds", "--y", "alone"];
    let alone = plot(folder.path(), &[&alone, &out[..]].concat());
    alone.success();
    let table = rows(&folder.path().join("fig.csv"));
    assert!(
        table.contains(&["", "gdg-bridge", "1", "6", "0.3", "", ""].map(str::to_owned).to_vec())
    );
    // The table stays behind its figure, whatever else is drawn to that name.
    plot(folder.path(), &["a.jsonl", "--out", "one.png"]).success();
    plot(folder.path(), &["a.jsonl", "--out", "one.pdf"]).success();
    let refused = plot(folder.path(), &["c.jsonl", "--out", "one.svg"]);
    has_parts(&refused.refusal(), &["one.csv: the file already exists"]);
    // Where one of several cannot be written, none takes its place.
    plot(folder.path(), &["a.jsonl", "--out", "cut.svg"]).success();
    let before = ["cut.svg", "cut.csv"].map(file);
    let cut = ["c.jsonl", "--out", "cut.svg", "--out", "a.jsonl/cut.png"];
    assert_eq!(plot(folder.path(), &cut).status, Some(2));
    assert_eq!(["cut.svg", "cut.csv"].map(file), before);
    // What ends between a figure and the table, which is gone by then, leaves nothing that counts as edited.
    std::fs::remove_file(folder.path().join("cut.csv")).unwrap();
    plot(folder.path(), &cut[..3]).success();
}

#[test]
fn means_that_end_early_and_runs_that_nothing_tells_apart_are_said() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    for (name, seed, evaluations) in [("a", 1, 4), ("b", 1, 2), ("c", 2, 3)] {
        write(&format!("{name}.jsonl"), records("her", seed, evaluations, 0.5, &json!({})));
    }
    // Named twice, read once.
    let done = plot(folder.path(), &[".", "a.jsonl", "--out", "f.svg"]);
    done.success();
    let alike = "left out, as another run has the same method, map, settings and seed: ./b.jsonl\n";
    let short = "her: the mean ends after 300 of 400 updates, as seed 2 does\n";
    has_parts(&done.err, &[&alike.replace("./", ""), short]);
    let table = rows(&folder.path().join("f.csv"));
    let seeds = ["1", "2"].map(|seed| table.iter().filter(|row| row[2] == seed).count());
    assert_eq!(seeds, [4, 3]);
}

/// Two programs may append to one file, and a line that was cut off is glued to the next.
#[test]
fn records_of_another_run_are_left_out_with_what_follows() {
    let folder = tempfile::tempdir().unwrap();
    let text = records("her", 1, 4, 0.5, &json!({}));
    let own: Vec<&str> = text.lines().collect();
    let text = records("her", 2, 4, 1.0, &json!({}));
    let other: Vec<&str> = text.lines().collect();
    let end = r#"{"event":"end","reason":"max-updates","seconds":6.0,"updates":400}"#;
    let later = own[2].replace("300", "600").replace("200", "500");
    let torn = own[2][..40].to_owned() + other[0];
    let of_another = "of another run, as this one has ended or is further on";
    let early = own[2].replace("\"seconds\":3.0", "\"seconds\":1.0");
    for (lines, drawn, problem) in [
        // Both began, and wrote in turn.
        (&[own[0], other[0], other[1], own[1], other[2], own[2]][..], 1, of_another),
        (&[own[0], own[1], own[2], other[1], own[3]], 2, of_another),
        (&[own[0], own[1], &early, own[3]], 1, of_another),
        (&[own[0], own[1], own[2], end, &later], 2, of_another),
        (&[own[0], own[1], &torn, other[2], other[3]], 1, "not a record: not JSON"),
        // Without a start within, the line alone is missing, as where the disk was full for a while.
        (&[own[0], own[1], &own[2][..40], own[3]], 2, "not a record: not JSON"),
    ] {
        std::fs::write(folder.path().join("a.jsonl"), lines.join("\n") + "\n").unwrap();
        let done = plot(folder.path(), &["a.jsonl", "--out", "f.svg"]);
        done.success();
        let table = rows(&folder.path().join("f.csv"));
        assert_eq!(table.iter().filter(|row| row[2] != "mean").count(), 1 + drawn, "{lines:?}");
        has_parts(&done.err, &[problem, "left out"]);
        let rest = done.err.contains("and what follows in this run: left out");
        assert_eq!(rest, lines.iter().all(|line| line.len() != 40), "{}", done.err);
    }
    // The next start begins anew.
    let lines = [own[0], own[1], end, own[2], other[0], other[1], other[2]];
    std::fs::write(folder.path().join("a.jsonl"), lines.join("\n") + "\n").unwrap();
    let done = plot(folder.path(), &["a.jsonl", "--out", "f.svg"]);
    done.success();
    assert_eq!(done.err.matches("a.jsonl:4: of another run").count(), 1, "{}", done.err);
    assert_eq!(rows(&folder.path().join("f.csv")).iter().filter(|row| row[2] == "2").count(), 2);
}

#[test]
fn curves_differ_in_what_is_asked_for_and_charts_in_the_rest() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| std::fs::write(folder.path().join(name), text).unwrap();
    for (i, (method, hidden)) in
        [("gdg", 32), ("gdg", 64), ("her", 32), ("her", 64)].into_iter().enumerate()
    {
        let settings = json!({"hidden": hidden, "tau": 0.01});
        write(&format!("{i}.jsonl"), records(method, 1, 2, 0.5, &settings));
    }
    let named = |by: &[&str]| {
        let done = plot(folder.path(), &[&[".", "--out", "f.svg"], by].concat());
        done.success();
        let mut names: Vec<[String; 2]> = rows(&folder.path().join("f.csv"))[1..]
            .iter()
            .map(|row| [row[0].clone(), row[1].clone()])
            .collect();
        names.sort();
        names.dedup();
        names.iter().map(|[chart, curve]| format!("{chart}/{curve}")).collect::<Vec<_>>()
    };
    assert_eq!(
        named(&[]),
        ["/gdg, hidden=32", "/gdg, hidden=64", "/her, hidden=32", "/her, hidden=64"]
    );
    assert_eq!(
        named(&["--by", "setting"]),
        ["gdg/hidden=32", "gdg/hidden=64", "her/hidden=32", "her/hidden=64"]
    );
    assert_eq!(
        named(&["--by", "method"]),
        ["hidden=32/gdg", "hidden=32/her", "hidden=64/gdg", "hidden=64/her"]
    );
}

#[test]
fn what_cannot_be_drawn_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    std::fs::create_dir(folder.path().join("empty")).unwrap();
    let all = records("her", 1, 2, 0.5, &json!({}));
    write("her.jsonl", &all);
    write("begun.jsonl", all.lines().next().unwrap());
    write("bad.jsonl", &(all.lines().next().unwrap().to_owned() + "\n{\"event\": 3}\n"));
    write("late.jsonl", all.lines().nth(1).unwrap());
    write("map.txt", ROOM);
    let out = ["--out", "f.svg"];
    for (args, parts) in [
        (&["empty"][..], &["empty: no runs here", "a folder of gdg-tui suite"][..]),
        (&["missing"], &["missing: cannot be read"]),
        (&["begun.jsonl"], &["begun.jsonl: no evaluation yet", "--eval-every-updates"]),
        (&["bad.jsonl"], &["bad.jsonl:2:", "not a record"]),
        (&["late.jsonl"], &["late.jsonl:1:1: an evaluation before any start record"]),
        (&["map.txt"], &["map.txt:1:1: not a record"]),
        (&["her.jsonl", "--y", "error"], &["not known of these runs (her): error of D"]),
        (&["her.jsonl", "--y", "sucess"], &["'success'"]),
        (&["her.jsonl", "--width", "3"], &["from 40 to 1000"]),
        (&["her.jsonl", "--out", "f.jpg"], &["f.jpg: not a figure", ".svg, .png or .pdf"]),
    ] {
        let args = if args.contains(&"--out") { args.to_vec() } else { [args, &out].concat() };
        let failed = plot(folder.path(), &args);
        has_parts(&failed.refusal(), parts);
        assert!(!folder.path().join("f.svg").exists(), "{args:?}");
    }
}

#[test]
fn suites_and_checkpoints_are_drawn_over_updates_and_steps() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("room.txt"), ROOM).unwrap();
    let run = |args: &[&str]| {
        in_folder(folder.path(), &[args, &SMALL, &["--eval-tasks", "1"]].concat()).success();
    };
    run(&words("suite room.txt --budget 60 --seeds 2 --method gdg --method her --out out"));
    run(&words("--no-ui room.txt --max-updates 60 --eval-every-updates 30 --save a.safetensors"));
    let done = plot(folder.path(), &["out", "--x", "steps"]);
    assert_eq!(
        (done.status, &*done.out),
        (Some(0), "out/success.svg\nout/success.csv\n"),
        "{}",
        done.err
    );
    let table = rows(&folder.path().join("out/success.csv"));
    let steps: Vec<u64> = table[1..].iter().map(|row| row[3].parse().unwrap()).collect();
    let curves: std::collections::BTreeSet<&[String]> =
        table[1..].iter().map(|row| &row[1..3]).collect();
    let each = |method| ["1", "2", "mean"].map(|seed| [method, seed].map(str::to_owned));
    let expected = [each("gdg"), each("her")].concat();
    assert_eq!(curves, expected.iter().map(|curve| &curve[..]).collect());
    assert!(steps.iter().all(|steps| *steps > 200), "after learning_starts: {steps:?}");
    let one = plot(folder.path(), &["a.safetensors", "--y", "coverage"]);
    assert_eq!(one.out, "a-explored.svg\na-explored.csv\n", "{}", one.err);
    let table = rows(&folder.path().join("a-explored.csv"));
    assert_eq!(table[1][..4], ["", "gdg-bridge", "0", "30"].map(str::to_owned));
}

/// Writes the records of a run of `her` with seed 1, evaluated at these thousands of updates.
/// `start` also has `tasks` of evaluations, and an `edit` before them.
fn record(folder: &Path, file: &str, start: &Value, evaluated: &[u64], saved: &str) -> String {
    let mut first = json!({
        "event": "start", "world": "maze", "map": {"name": "hall"}, "method": "her",
        "preset": "default", "settings": {}, "seed": 1, "updates": 0,
    });
    let facts = start.as_object().cloned().unwrap_or_default();
    let edit = facts.get("edit").map(|to| {
        let fingerprint = format!("3 x 3, {}", to.as_str().unwrap());
        json!({"event": "edit", "updates": 500, "map": "other", "fingerprint": fingerprint})
    });
    let tasks: Vec<Value> =
        facts.get("tasks").into_iter().map(|tasks| json!({"tasks": tasks})).collect();
    first.as_object_mut().unwrap().extend(facts);
    let score = json!({"success": 0.5, "spl": null, "steps_ratio": null, "by_distance": tasks});
    let at = |thousands: &u64| {
        json!({
            "event": "evaluation", "updates": 1000 * thousands, "env_steps": 0, "seconds": 0.0,
            "greedy": score, "planned": null,
        })
    };
    let saved = json!({"event": "saved", "updates": 0, "path": saved});
    let records = [first].into_iter().chain(edit).chain(evaluated.iter().map(at)).chain([saved]);
    let text: String = records.map(|record| format!("{record}\n")).collect();
    std::fs::write(folder.join(file), text).unwrap();
    file.to_owned()
}

/// Draws runs; returns the curve, seed and updates of each row of a seed, and the notes.
fn drawn(folder: &Path, files: &[String]) -> (Vec<String>, Vec<String>) {
    let files = files.iter().map(String::as_str).chain(["--out", "fig.svg"]);
    let done = plot(folder, &files.collect::<Vec<_>>());
    done.success();
    // The caption comes last.
    let notes = done.err.trim_end().rsplit_once('\n').map_or("", |(notes, _)| notes);
    let notes = notes.lines().map(str::to_owned).collect();
    let of_seeds = rows(&folder.join("fig.csv")).into_iter().skip(1).filter(|row| row[2] != "mean");
    (of_seeds.map(|row| format!("{} {} {}", row[1], row[2], row[3])).collect(), notes)
}

#[test]
fn runs_that_learned_or_were_evaluated_on_something_else_are_different_curves() {
    let folder = tempfile::tempdir().unwrap();
    let data = |checksum: u32| json!({"data": {"file": "a.npz", "checksum": checksum, "transitions": 9, "episodes": 1}});
    let tasks = |tasks: &str| json!({"map": {"name": "hall", "scenario": tasks}});
    let tasks_of = |tasks: u32| json!({"tasks": tasks});
    let version = |version: &str| json!({"version": version});
    let edit = |to: &str| json!({"edit": to});
    let size = |size: &str| json!({"fingerprint": format!("{size}, goal radius 1, {size}")});
    for ([one, other], names) in [
        ([data(1), data(2)], ["data=00000001", "data=00000002"]),
        ([data(1), json!({})], ["data=00000001", "her"]),
        ([tasks("a"), tasks("b")], ["scenario=a", "scenario=b"]),
        ([tasks_of(5), tasks_of(50)], ["eval-tasks=5", "eval-tasks=50"]),
        ([version("0.2.0"), version("0.3.0")], ["version=0.2.0", "version=0.3.0"]),
        ([edit("a"), edit("b")], ["edit=500:a", "edit=500:b"]),
        ([edit("a"), json!({})], ["edit=500", "her"]),
        ([size("11 x 7"), size("21 x 21")], ["hall (11 x 7)", "hall (21 x 21)"]),
    ] {
        let both = [("a.jsonl", &one, 1), ("b.jsonl", &other, 2)];
        let files = both.map(|(file, of, at)| record(folder.path(), file, of, &[at], ""));
        let (rows, notes) = drawn(folder.path(), &files);
        let expected = [format!("{} 1 1000", names[0]), format!("{} 1 2000", names[1])];
        assert_eq!((rows, notes), (expected.to_vec(), Vec::new()));
        // As well in one file, where the second is no other attempt at the first.
        let read = |file: String| std::fs::read_to_string(folder.path().join(file)).unwrap();
        let text = files.map(read).concat();
        std::fs::write(folder.path().join("a.jsonl"), text).unwrap();
        assert_eq!(drawn(folder.path(), &["a.jsonl".to_owned()]).0, expected);
    }
}

#[test]
fn a_run_goes_on_in_the_records_that_resumed_it() {
    let folder = tempfile::tempdir().unwrap();
    let [first, second] = ["one.safetensors", "two.safetensors"];
    let begun = json!({"updates": 3000, "resumed": first});
    // Where the map was edited, and evaluated on other tasks, it is one run, too.
    let apart = json!({"tasks": 9, "fingerprint": "3 x 3, b"});
    let other = json!({"updates": 3000, "resumed": first, "tasks": 9, "fingerprint": "3 x 3, a"});
    let edited = json!({"edit": "a", "tasks": 5, "fingerprint": "3 x 3, b"});
    let files = [
        record(folder.path(), "b.jsonl", &other, &[4], second),
        record(folder.path(), "a.jsonl", &edited, &[1, 3], first),
        record(folder.path(), "c.jsonl", &apart, &[4], ""),
    ];
    let (rows, notes) = drawn(folder.path(), &files);
    let own = "edit=500 eval-tasks=5,9 1";
    let expected = [own, own, own, "eval-tasks=9 1"].into_iter().zip([1, 3, 4, 4]);
    assert_eq!(rows, expected.map(|(own, at)| format!("{own} {at}000")).collect::<Vec<_>>());
    assert_eq!(notes, [""; 0]);
    // What two were resumed from is part of both, of which the longer one is drawn.
    let resumed = |file: &str, at: &[u64]| record(folder.path(), file, &begun, at, "");
    let (short, long) = (resumed("b.jsonl", &[4]), resumed("c.jsonl", &[4, 5]));
    let first_part = record(folder.path(), "a.jsonl", &json!({}), &[1, 3], first);
    let (rows, notes) = drawn(folder.path(), &[short, long, first_part]);
    assert_eq!(rows, ["her 1 1000", "her 1 3000", "her 1 4000", "her 1 5000"]);
    assert!(notes.len() == 1 && notes[0].ends_with("b.jsonl"), "{notes:?}");
}
