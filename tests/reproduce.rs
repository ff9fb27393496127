//! `gdg-tui reproduce`: figures from jobs that run anywhere, in any order, and resume.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::ran::{Ran, SMALL, has_parts, program_in, ran, words};
use serde_json::Value;
use tempfile::TempDir;

/// Figures of the paper: of the arm, then on maps.
const FIGURES: [&str; 6] = ["fig1", "fig2", "fig3", "fig4", "fig5", "fig6"];

/// A folder in which figures are reproduced.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = program_in(self.0.path());
        command.arg("reproduce").args(args).args(SMALL);
        command.args(["--eval-tasks", "1", "--seeds", "1", "--no-keep"]);
        command
    }

    fn run(&self, args: &[&str]) -> Ran {
        ran(self.command(args))
    }

    /// Returns the files in a subfolder, by name.
    fn files(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let Ok(entries) = std::fs::read_dir(self.path(folder)) else { return BTreeMap::new() };
        let paths = entries.map(|entry| entry.unwrap().path()).filter(|path| path.is_file());
        let name = |path: &Path| path.file_name().unwrap().to_string_lossy().into_owned();
        paths.map(|path| (name(&path), std::fs::read(&path).unwrap())).collect()
    }

    /// Returns the result of the job whose name begins like this.
    fn result(&self, out: &str, job: &str) -> Value {
        let files = self.files(&format!("{out}/jobs"));
        let (_, bytes) = files.iter().find(|(name, _)| name.starts_with(job)).unwrap();
        serde_json::from_slice(bytes).unwrap()
    }

    /// Returns everything that must not depend on how the jobs were run: report, data, figures, and
    /// results without their times.
    fn outcome(&self, out: &str) -> BTreeMap<String, Vec<u8>> {
        let mut all = self.files(out);
        for folder in ["data", "figures"] {
            all.extend(self.files(&format!("{out}/{folder}")));
        }
        for (name, bytes) in self.files(&format!("{out}/jobs")) {
            let mut result: Value =
                serde_json::from_slice(&bytes).unwrap_or_else(|_| panic!("{name}"));
            result.as_object_mut().unwrap().remove("seconds").unwrap();
            for evaluation in result["evaluations"].as_array_mut().unwrap() {
                evaluation.as_object_mut().unwrap().remove("seconds").unwrap();
            }
            all.insert(name, result.to_string().into_bytes());
        }
        all
    }
}

/// Compares two outcomes, naming the file that differs.
fn assert_same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>) {
    assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
    for (name, bytes) in one {
        assert!(bytes == &other[name], "{name} differs");
    }
}

#[test]
fn all_figures_are_drawn_with_data_and_a_report_that_names_its_command() {
    let place = Place::new();
    let args = ["all", "--updates", "30", "--out", "out"];
    let whole = place.run(&args);
    whole.success();
    let report = std::fs::read_to_string(place.path("out/report.md")).unwrap();
    has_parts(&report, &["gdg-tui reproduce all --budget quick"]);
    has_parts(
        &report,
        &[
            "ours: success rate | anywhere | as in training | environment steps | run |",
            "| GDG, bridges | about 0.8 | 0.",
            "| GDG | reaches the goal |",
            " | reached at the end | environment steps | run |",
            " | 0 of 1 seed | ",
            "red: the bridge point b",
        ],
    );
    assert!(report.contains(&whole.out), "{}", whole.out);

    has_parts(&report, &["| GDG, distance | converges like DDPG | "]);

    let (data, figures) = (place.files("out/data"), place.files("out/figures"));
    for figure in FIGURES {
        let ours = if figure == "fig1" { "GDG" } else { "default (ours)" };
        has_parts(&report, &[&format!("## {figure}: "), &format!("](figures/{figure}.png)")]);
        let mut table = csv::Reader::from_reader(&data[&format!("{figure}.csv")][..]);
        assert!(table.records().map(Result::unwrap).count() > 3, "{figure}");
        let svg = String::from_utf8(figures[&format!("{figure}.svg")].clone()).unwrap();
        has_parts(&svg, &["<svg ", ours, "</svg>"]);
        assert_eq!(svg.contains("success rate"), ["fig1", "fig3", "fig4"].contains(&figure));
        assert_eq!(svg.contains("<image "), ["fig2", "fig5"].contains(&figure));
        let file = std::io::Cursor::new(figures[&format!("{figure}.png")].clone());
        let info = png::Decoder::new(file).read_info().unwrap().info().clone();
        assert!(info.width > 800 && info.height > 400, "{figure}: {info:?}");
    }
    // Four distances, for each of three methods.
    for method in ["default", "gdg-bridge", "gdg"] {
        let measured = &place.result("out", &format!("city-{method}-seed1-"))["measured"];
        for drawn in ["anywhere", "as_in_training"] {
            let success = measured["random"][drawn].as_f64().unwrap();
            assert!([0.0, 0.5, 1.0].contains(&success), "of two tasks: {success}");
        }
        let walks = measured["walks"].as_array().unwrap();
        let distances: Vec<u64> =
            walks.iter().map(|walk| walk["distance"].as_u64().unwrap()).collect();
        assert_eq!(distances, [90, 120, 150, 180]);
        for walk in walks {
            let (shortest, path) =
                (walk["shortest"].as_u64().unwrap(), walk["path"].as_array().unwrap());
            assert!(
                shortest.abs_diff(walk["distance"].as_u64().unwrap()) <= 1 && path.len() <= 501,
                "{shortest}"
            );
        }
    }
    let bridge = &place.result("out", "fourrooms-default-seed1-")["measured"]["bridge"];
    let walls =
        bridge["from_start"].as_array().unwrap().iter().filter(|value| value.is_null()).count();
    assert_eq!((bridge["to_goal"].as_array().unwrap().len(), walls), (88 * 88, 88 * 88 - 6656));
    if let Some(found) = bridge["found"].as_object() {
        let sum = found["from_start"].as_f64().unwrap() + found["to_goal"].as_f64().unwrap();
        assert!(sum < bridge["direct"].as_f64().unwrap() + 0.02, "{found:?}");
    }

    // Nothing runs again, and nothing changes.
    let before = place.outcome("out");
    let again = place.run(&args);
    has_parts(&again.err, &[" 0 to run"]);
    assert_same(&place.outcome("out"), &before);
}

#[test]
fn figures_share_jobs_and_a_changed_setting_runs_only_what_depends_on_it() {
    let place = Place::new();
    let list = |args: &[&str]| {
        let listed = place.run(&[args, &["--updates", "20", "--out", "out", "--list"]].concat());
        listed.success();
        let names = listed.out.lines().map(|line| line.split(' ').next().unwrap().to_owned());
        names.collect::<Vec<String>>()
    };
    let city = list(&["fig3"]);
    assert_eq!((list(&["fig4"]), list(&["fig3", "fig4", "fig5"])), (city.clone(), city));
    let (plain, changed) = (list(&["fig6"]), list(&["fig6", "--set", "gdg:expectile=0.7"]));
    let new: Vec<&String> = changed.iter().filter(|name| !plain.contains(name)).collect();
    assert!(new.len() == 1 && new[0].starts_with("dead-end-gdg-seed1-"), "{new:?}");

    let run =
        |more: &[&str]| place.run(&[&["fig6", "--updates", "20", "--out", "out"], more].concat());
    let mut two = program_in(place.0.path());
    two.args(["reproduce", "fig6", "--updates", "20", "--out", "out"]).args(SMALL);
    two.args(["--eval-tasks", "1", "--seeds", "2"]);
    assert_eq!(ran(two).status, Some(0));
    let one = run(&[]);
    assert_eq!(one.status, Some(0));
    assert_eq!(one.out.matches("20 updates, 2 seeds").count(), plain.len(), "{}", one.out);
    // A figure that somebody has edited is kept, and its table.
    let [table, drawing] =
        ["out/data/fig6.csv", "out/figures/fig6.svg"].map(|file| place.path(file));
    let edited = std::fs::read_to_string(&drawing).unwrap().replace("</svg>", "<g/></svg>");
    std::fs::write(&drawing, &edited).unwrap();
    let before = std::fs::read(&table).unwrap();
    let rerun = run(&["--set", "gdg:expectile=0.7"]);
    let jobs = format!("{} jobs done, 1 to run", plain.len() - 1);
    has_parts(
        &rerun.err,
        &[&jobs, "dead-end-gdg-seed1-", "fig6.svg: the file already exists, edited"],
    );
    assert_eq!(std::fs::read_to_string(drawing).unwrap(), edited);
    assert_eq!(std::fs::read(table).unwrap(), before);
    assert_eq!(rerun.err.matches(": begins").count(), 1, "{}", rerun.err);
    let report = std::fs::read_to_string(place.path("out/report.md")).unwrap();
    has_parts(&report, &["`expectile=0.7`"]);
}

#[cfg(unix)]
#[test]
fn the_arm_trains_for_steps_with_its_worlds_settings_and_goes_on_where_it_was() {
    let place = Place::new();
    let args = |out: &'static str| {
        ["fig1", "--steps", "600", "--jobs", "1", "--set", "agents=4", "--out", out]
    };
    let whole = place.run(&args("whole"));
    whole.success();
    for method in ["gdg-distance", "ddpg-distance", "gdg", "her"] {
        let result = place.result("whole", &format!("fetch-reach-{method}-seed1-"));
        let settings = result["settings"].as_array().unwrap();
        let has = |setting: &str| settings.contains(&setting.into());
        // The world's own, and what is given instead.
        assert!(has("env_steps_per_update=1") && has("agents=4"), "{settings:?}");
        assert_eq!(has("discount=0.0"), method == "ddpg-distance", "{settings:?}");
    }
    let table = String::from_utf8(place.files("whole/data").remove("fig1.csv").unwrap()).unwrap();
    assert!(table.starts_with("chart,curve,seed,environment steps,value,low,high\n"), "{table}");
    let of_gdg = table.lines().filter(|line| line.starts_with("success,GDG,1,"));
    let marks: Vec<u64> =
        of_gdg.map(|line| line.split(',').nth(3).unwrap().parse().unwrap()).collect();
    assert_eq!(marks, (1..=75).map(|i| 8 * i).collect::<Vec<u64>>());
    for (name, bytes) in place.files("whole/jobs") {
        let result: Value = serde_json::from_slice(&bytes).unwrap();
        assert_eq!(
            (&result["map"], &result["evaluations"][74]["env_steps"]),
            (&"fetch-reach".into(), &600.into()),
            "{name}"
        );
        // All updates due are done: one per step after the first 200.
        assert_eq!(result["updates"], 400, "{name}");
    }

    let mut child =
        place.command(&args("parts")).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    lines.find(|line| line.contains(" of 600 environment steps")).unwrap();
    Command::new("kill").args(["-INT".to_owned(), child.id().to_string()]).status().unwrap();
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    let resumed = place.run(&args("parts"));
    has_parts(&resumed.err, &[": resumes after "]);
    assert_same(&place.outcome("parts"), &place.outcome("whole"));

    let changed = place.run(&[&args("whole")[..], &["--set", "her:tau=0.01"]].concat());
    has_parts(&changed.err, &["3 jobs done, 1 to run", "fetch-reach-her-seed1-"]);
}

#[cfg(unix)]
#[test]
fn stopped_figures_go_on_where_they_were_and_give_the_same_bytes() {
    let place = Place::new();
    let args = |out: &'static str| ["fig6", "--updates", "600", "--jobs", "1", "--out", out];
    assert_eq!(place.run(&args("whole")).status, Some(0));

    let mut child =
        place.command(&args("parts")).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    lines.find(|line| line.contains(" of 600 updates")).unwrap();
    Command::new("kill").args(["-INT".to_owned(), child.id().to_string()]).status().unwrap();
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(!place.path("parts/report.md").exists(), "{rest:?}");

    let resumed = place.run(&args("parts"));
    resumed.success();
    has_parts(&resumed.err, &["resumes after ", "; all jobs ", " left"]);
    assert_same(&place.outcome("parts"), &place.outcome("whole"));
}

#[cfg(unix)]
#[test]
fn jobs_in_processes_of_their_own_give_the_same_bytes_as_one_process() {
    let place = Place::new();
    let args = |out: &'static str| ["fig6", "--updates", "40", "--out", out];
    assert_eq!(place.run(&args("one")).status, Some(0));
    let more = |more: &[&'static str]| place.run(&[&args("a folder")[..], more].concat());

    let none = more(&["--collect"]);
    has_parts(&none.refusal(), &["a folder: there is no such folder"]);
    std::fs::create_dir(place.path("a folder")).unwrap();
    has_parts(&more(&["--collect"]).err, &["a folder: this folder has no jobs"]);
    assert_eq!(place.files("a folder"), BTreeMap::new());
    let jobs = more(&["--list"]).out.lines().count();
    assert!(jobs >= 3);
    // The first alone, the others as a cluster runs them: all at once.
    let first = more(&["--job", "1", "--job", "1"]);
    assert_eq!((first.status, first.out.as_str()), (Some(0), ""), "{}", first.err);
    let partly = more(&["--collect"]);
    assert_eq!(partly.status, Some(1));
    has_parts(&partly.err, &[&format!("{} jobs missing", jobs - 1)]);
    let report = std::fs::read_to_string(place.path("a folder/report.md")).unwrap();
    has_parts(&report, &["**Not complete**", "`dead-end-gdg-seed1-"]);
    let start = |number: usize| {
        let number = number.to_string();
        let mut command = place.command(&[&args("a folder")[..], &["--job", &number]].concat());
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
    };
    let children: Vec<_> = (2..=jobs).map(start).collect();
    for child in children {
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let collected = more(&["--collect"]);
    collected.success();
    assert_same(&place.outcome("a folder"), &place.outcome("one"));
}

#[test]
fn budgets_of_episodes_evaluate_as_often_as_updates_do() {
    let place = Place::new();
    let args = words("fig6 --episodes 100 --set episode_steps=20 --set agents=4 --out out");
    let ran = place.run(&args);
    ran.success();
    let table = String::from_utf8(place.files("out/data").remove("fig6.csv").unwrap()).unwrap();
    for method in ["default (ours)", "GDG"] {
        let start = format!("steps left,{method},1,");
        let lines = table.lines().filter(|line| line.starts_with(&start));
        assert_eq!(lines.count(), 50, "{method}: {table}");
    }
}

#[test]
fn bad_arguments_are_named_before_anything_runs() {
    let place = Place::new();
    for (args, part) in [
        (&["fig7"][..], "fig6"),
        (&["fig6", "--set", "gd:hidden=3"], "methods of fig6: default, default-gdg, gdg-bridge"),
        (&["fig6", "--set", "her:hidden=3"], "no figure given has a method called \"her\""),
        (
            &["fig1", "--set", "default:hidden=3"],
            "methods of fig1: gdg-distance, ddpg-distance, gdg, her",
        ),
        (&["fig6", "--collect"], "out: there is no such folder"),
        (&["fig1", "--max-steps", "10", "--max-episodes", "10"], "--max-episodes"),
        (&["fig6", "--set", "gdg:hiden=3"], "did you mean hidden"),
        (&["fig6", "--job", "trap-1"], "trap-1: there is no such job"),
        (&["fig6", "--job", "99"], "give a number from 1 to"),
        (&["fig6", "--job", "0"], "there is no such job"),
        (&["fig6", "--list", "--collect"], "cannot be used with"),
        (&["fig6", "--updates", "10", "--episodes", "10"], "--max-episodes"),
        (&[], "FIGURE"),
    ] {
        let ran = place.run(&[args, &["--out", "out"]].concat());
        has_parts(&ran.refusal(), &[part]);
        assert!(!place.path("out").exists(), "{args:?}");
    }
}

/// The mazes of OGBench.
const MAZES: [&str; 4] = ["medium", "large", "giant", "teleport"];

#[test]
fn ogbench_is_learned_from_files_and_stands_beside_published_results() {
    let place = Place::new();
    std::fs::create_dir(place.path("sets")).unwrap();
    let recordings = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/gdg/tests/data/ogbench");
    for (maze, kind) in MAZES.iter().flat_map(|maze| [(maze, "navigate"), (maze, "stitch")]) {
        let to = place.path(&format!("sets/pointmaze-{maze}-{kind}-v0.npz"));
        std::fs::copy(recordings.join(format!("{maze}.npz")), to).unwrap();
    }
    let args = ["ogbench", "--updates", "2", "--data-dir", "sets", "--out", "out"];
    let whole = place.run(&args);
    whole.success();
    let report = std::fs::read_to_string(place.path("out/report.md")).unwrap();
    has_parts(
        &report,
        &[
            "# OGBench's point mazes",
            "gdg-tui reproduce ogbench --budget quick",
            "| giant-navigate | 0 | 68 | 27 | 46 | 92 | 67 | ",
            "| teleport-stitch | 44 | 9 | 4 | 34 | - | 13 | ",
            "](figures/ogbench.png)",
        ],
    );
    assert!(!report.contains("the city"), "the text about the paper's maps");
    let table = String::from_utf8(place.files("out/data").remove("ogbench.csv").unwrap()).unwrap();
    for measure in ["planned", "alone"] {
        let line = |line: &&str| line.starts_with(&format!("{measure},")) && line.contains(",1,2,");
        assert_eq!(table.lines().filter(line).count(), 8, "after two updates: {table}");
    }
    let drawn = std::fs::read_to_string(place.path("out/figures/ogbench.svg")).unwrap();
    has_parts(&drawn, &["success rate, planned", "success rate, alone"]);
    // Another file in place of one is another job.
    let again = place.run(&args);
    has_parts(&again.err, &["8 jobs done, 0 to run"]);
    let changed = place.path("sets/pointmaze-giant-stitch-v0.npz");
    std::fs::remove_file(&changed).unwrap();
    std::fs::copy(place.path("sets/pointmaze-large-stitch-v0.npz"), &changed).unwrap();
    let other = place.run(&args);
    has_parts(
        &other.err,
        &["7 jobs done, 1 to run", "impossible on this map: the data may be of another"],
    );
    other.success();
}

#[test]
fn a_dataset_that_is_not_there_is_named() {
    let refused = Place::new().run(&["ogbench", "--data-dir", "sets", "--list"]);
    has_parts(
        &refused.refusal(),
        &["pointmaze-medium-navigate-v0.npz", "collect_ogbench.py writes it"],
    );
}
