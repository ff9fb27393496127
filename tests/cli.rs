//! The program as run from a shell: records, exit statuses, errors.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::ran::{Ran, SMALL, in_folder, one_line, program_in, words};
use serde_json::Value;

fn gdg(args: &[&str]) -> Ran {
    in_folder(Path::new(env!("CARGO_TARGET_TMPDIR")), args)
}

fn run(args: &[&str]) -> Vec<Value> {
    let done = gdg(&[&["--no-ui"], args, &SMALL].concat());
    // Small runs have few candidates, whatever their method.
    let mut said =
        done.err.lines().filter(|line| !line.starts_with("warning: --set candidates: changes"));
    assert_eq!(said.next(), None, "nothing on standard error on success");
    done.success();
    done.records()
}

/// Returns the path of a file of the repository.
fn own(name: &str) -> String {
    format!("{}/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Returns the path of a map or scenario among the tests.
fn file(name: &str) -> String {
    own(&format!("crates/gdg/tests/maps/{name}"))
}

#[test]
fn records_have_the_documented_format() {
    let all = run(&words(
        "trap --seed 5 --max-updates 1000 --eval-tasks 2 --eval-every-updates \
        500",
    ));
    let of = |event: &str| all.iter().filter(|r| r["event"] == event).collect::<Vec<_>>();
    let start = of("start")[0];
    assert_eq!(start["map"]["name"], "trap");
    assert_eq!(start["map"]["width"], 53);
    assert_eq!(start["map"]["diameter_steps"], 92);
    assert_eq!(
        (&start["method"], &start["preset"], &start["seed"]),
        (&"gdg-bridge".into(), &"default".into(), &5.into())
    );
    let progress = of("progress")[0];
    assert_eq!(progress["updates"], 1000);
    for field in ["seconds", "env_steps", "episodes", "updates_per_second", "left"] {
        assert!(progress[field].is_number(), "{field}");
    }
    for loss in ["critic", "model", "actor"] {
        assert!(progress["losses"][loss].as_f64().unwrap() > 0.0, "{loss}");
    }
    let evaluations = of("evaluation");
    assert_eq!(evaluations.len(), 2, "one during training, one at the end");
    let last = evaluations[1];
    for score in [&last["alone"], &last["planned"]] {
        assert!((0.0..=1.0).contains(&score["success"].as_f64().unwrap()));
        let groups = score["by_distance"].as_array().unwrap();
        assert_eq!(groups.len(), 6);
        assert!(
            groups.iter().all(|g| g["tasks"] == 2
                && g["spl"].is_number()
                && g["distance_steps"].is_number())
        );
    }
    for field in ["mape", "near_mape", "bias", "spearman"] {
        assert!(last["error"][field].is_number(), "{field}");
    }
    for field in ["candidates", "edges", "false_edges"] {
        assert!(last["bridges"][field].is_number(), "{field}");
    }
    let end = all.last().unwrap();
    assert_eq!(
        (&end["event"], &end["reason"], &end["updates"]),
        (&"end".into(), &"max-updates".into(), &1000.into())
    );
}

#[test]
fn metrics_are_also_written_as_a_table() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    let path = path.to_str().unwrap();
    let args = words("trap --seed 5 --max-updates 1000 --eval-tasks 2 --eval-every-updates 500");
    let all = run(&[&args[..], &["--csv", path]].concat());
    let mut table = csv::Reader::from_path(path).unwrap();
    let head: Vec<String> = table.headers().unwrap().iter().map(str::to_owned).collect();
    let lines: Vec<csv::StringRecord> = table.records().map(Result::unwrap).collect();
    let of = |line: &csv::StringRecord, name: &str| {
        line[head.iter().position(|h| h == name).unwrap()].to_owned()
    };
    let (evaluated, points): (Vec<_>, Vec<_>) =
        lines.iter().partition(|line| of(line, "event") == "evaluation");
    assert!(points.iter().all(|line| of(line, "critic_loss").parse::<f64>().is_ok()));
    assert!(points.len() > 5 && points.iter().all(|line| of(line, "alone_success").is_empty()));
    let records = all.iter().filter(|record| record["event"] == "evaluation");
    assert_eq!(evaluated.len(), 2, "{lines:?}");
    for (line, record) in evaluated.into_iter().zip(records) {
        let left = &record["marked"]["planned"]["left_straight"];
        for (name, value) in [
            ("seconds", &record["seconds"]),
            ("updates", &record["updates"]),
            ("env_steps", &record["env_steps"]),
            ("alone_success", &record["alone"]["success"]),
            ("planned_success_6", &record["planned"]["by_distance"][5]["success"]),
            ("goal_distance_left", left),
        ] {
            let (found, expected) = (of(line, name), value.as_f64().unwrap());
            assert!((found.parse::<f64>().unwrap() - expected).abs() < 1e-5, "{name}: {found}");
        }
    }
    let again = gdg(&["--no-ui", "trap", "--max-updates", "1", "--csv", path]).refusal();
    assert!(again.contains("already exists"), "{again}");
}

/// Returns the records without times, rates and the number of threads.
fn without_times(mut records: Vec<Value>) -> Vec<Value> {
    for record in &mut records {
        let object = record.as_object_mut().unwrap();
        object.remove("seconds");
        object.remove("updates_per_second");
        object.remove("left");
        object.remove("threads");
    }
    records
}

#[test]
fn the_same_seed_prints_the_same_records_on_any_number_of_threads() {
    let args = ["trap", "--seed", "9", "--max-updates", "1200", "--eval-tasks", "2"];
    let once = without_times(run(&[&args[..], &["--threads", "1"]].concat()));
    for (threads, reported) in [("2", Value::from(2)), ("auto", "auto".into())] {
        let again = run(&[&args[..], &["--threads", threads]].concat());
        assert_eq!(again[0]["threads"], reported);
        assert_eq!(once, without_times(again), "{threads}");
    }
}

#[test]
fn other_methods_and_the_paper_preset_run() {
    let plans = [
        (["--method", "gdg"], false),
        (["--method", "gdg-distance"], false),
        (["--method", "random"], false),
        (["--method", "ddpg-distance"], false),
        (["--method", "her+sorb"], true),
        (["--preset", "paper"], true),
    ];
    for (args, plans) in [(["--method", "sorb"], true)].into_iter().chain(plans) {
        let all = run(&["trap", "--max-updates", "200", "--eval-tasks", "1", args[0], args[1]]);
        let evaluation = all.iter().find(|r| r["event"] == "evaluation").unwrap();
        assert_eq!(evaluation["planned"].is_null(), !plans, "{args:?}");
        assert_eq!(evaluation["bridges"].is_null(), !plans, "{args:?}");
        assert!(evaluation["straight"]["success"].is_number(), "{args:?}");
        let preset = match args {
            ["--preset", preset] => preset,
            [_, "ddpg-distance" | "her+sorb"] => "tuned",
            _ => "default",
        };
        assert_eq!(all[0]["preset"], preset, "{args:?}");
        assert_eq!(evaluation["error"]["graph"].is_null(), !plans, "{args:?}");
        // The trap marks a start and a goal, so this task is evaluated too.
        let journey = &evaluation["marked"]["alone"];
        assert!(
            journey["left_steps"].as_u64().unwrap() <= 200 && journey["reached"].is_boolean(),
            "{journey}"
        );
        assert_eq!(evaluation["marked"]["planned"].is_null(), !plans, "{args:?}");
    }
}

#[test]
fn episodes_can_be_restricted_to_the_start_cell() {
    let args = ["trap", "--max-updates", "20", "--eval-tasks", "1"];
    let coverage = |more: &[&str]| {
        let all = run(&[&args[..], more].concat());
        all.iter().find(|r| r["event"] == "evaluation").unwrap()["explored"].as_f64().unwrap()
    };
    let (anywhere, start) =
        (coverage(&["--set", "restart=anywhere"]), coverage(&["--set", "restart=start-cell"]));
    assert!(
        start > 0.0 && start < 0.7 * anywhere,
        "{start} of the cells from the start, {anywhere} from anywhere"
    );
    assert_eq!(coverage(&[]), start, "a map's start is the default");
    let args = ["--no-ui", &file("valid/plain.txt"), "--set", "restart=start-cell"];
    let error = gdg(&args).refusal();
    assert!(error.contains("plain.txt") && error.contains("no start S"), "{error}");
    let error = gdg(&["--no-ui", "fourrooms", "--set", "goals=map"]).refusal();
    assert!(error.contains("fourrooms: has no goal G, which goals=map requires"), "{error}");
}

#[test]
fn maps_prints_random_maps() {
    for (kind, size) in [("maze", 44), ("city", 101)] {
        let printed = gdg(&["maps", "--random", kind, "--seed", "3"]);
        assert_eq!(printed.success().lines().filter(|line| line.len() == size).count(), size);
    }
}

#[test]
fn limits_of_a_resumed_run_count_from_the_start_of_training() {
    let folder = tempfile::tempdir().unwrap();
    let (half, whole) =
        (folder.path().join("half.safetensors"), folder.path().join("whole.safetensors"));
    let (half, whole) = (half.to_str().unwrap(), whole.to_str().unwrap());
    run(&["trap", "--seed", "2", "--max-updates", "300", "--eval-tasks", "1", "--save", half]);
    let line = format!("--no-ui --resume {half} --max-updates 500 --eval-tasks 1 --save {whole}");
    let done = gdg(&words(&line));
    done.success();
    let resumed = done.records();
    assert_eq!(resumed[0]["updates"], 300);
    assert_eq!(resumed.last().unwrap()["updates"], 500);
    let straight = run(&["trap", "--seed", "2", "--max-updates", "500", "--eval-tasks", "1"]);
    let evaluation = |all: &[Value]| {
        without_times(all.to_vec()).into_iter().find(|r| r["event"] == "evaluation")
    };
    assert_eq!(evaluation(&straight), evaluation(&resumed));
    // What it was begun with, also if it is what it was, or belongs to other worlds.
    for (option, value) in
        [("--seed", "3"), ("--goal-radius", "1"), ("--cell", "1"), ("--python", "python3")]
    {
        let conflict = gdg(&["--no-ui", "--resume", half, option, value]).refusal();
        assert!(conflict.contains(option), "{option}: {conflict}");
    }
}

#[test]
fn saved_runs_are_listed_and_the_newest_is_resumed() {
    let folder = tempfile::tempdir().unwrap();
    let here = |args: &[&str]| in_folder(folder.path(), args);
    assert!(here(&["runs"]).success().contains("no runs here yet"));
    assert!(here(&["check", "city"]).success().contains("farthest"));
    for (line, part) in [
        ("--no-ui --resume", "there is no checkpoint in saves/"),
        ("runs elsewhere", "elsewhere: cannot be read"),
        ("rusn", "did you mean runs?"),
        ("check citty", "did you mean city?"),
        ("check city --map city.map", "is not a scenario: --map goes with a .scen file"),
    ] {
        let error = here(&words(line)).refusal();
        assert!(error.contains(part), "{line}: {error}");
    }
    for (map, seed, updates) in [("trap", "4", "20"), ("fourrooms", "5", "30")] {
        let file = format!("saves/{map}.safetensors");
        let line = format!(
            "--no-ui {map} --seed {seed} --max-updates {updates} --eval-tasks 1 \
            --save {file}"
        );
        here(&words(&line)).success();
    }
    std::fs::write(folder.path().join("saves/none.safetensors"), "no checkpoint").unwrap();
    let listed = here(&["runs"]);
    let table = listed.success();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 3, "{table}");
    let columns: Vec<&str> = lines[0].split_whitespace().collect();
    let names = "map method seed updates planned alone state written file";
    assert_eq!(columns.join(" "), names);
    assert!(lines[1].ends_with("saves/fourrooms.safetensors"), "newest first: {table}");
    for part in ["trap", "gdg-bridge", " 4 ", " 20 ", " 0.", " saved "] {
        assert!(lines[2].contains(part), "{part:?} is not in {}", lines[2]);
    }
    assert!(listed.err.contains("saves/none.safetensors: "), "{}", listed.err);
    for (args, map, updates) in [
        (&["--resume"][..], "fourrooms", 30),
        (&["trap", "--resume"], "trap", 20),
        (&["--resume", "trap"], "trap", 20),
        (&["--resume", "saves/trap.safetensors"], "trap", 20),
    ] {
        let done = here(&[&["--no-ui", "--max-updates", "0", "--eval-tasks", "1"], args].concat());
        done.success();
        let start = &done.records()[0];
        assert_eq!(
            (start["map"]["name"].as_str(), start["updates"].as_u64()),
            (Some(map), Some(updates)),
            "{args:?}: {start}"
        );
    }
    // A map or a checkpoint of one's own, by its name.
    std::fs::write(folder.path().join("hall.txt"), "S..G\n").unwrap();
    here(&words("--no-ui hall.txt --max-updates 3 --eval-tasks 1 --save saves/mine.safetensors"))
        .success();
    for name in ["hall", "mine"] {
        let args = ["--no-ui", "--resume", name, "--max-updates", "0", "--eval-tasks", "1"];
        let done = here(&args);
        assert!(done.success().contains("hall"), "{name}: {}", done.err);
    }
    for (args, part) in [
        (&["city", "--resume"][..], "there is no checkpoint of city in saves/"),
        (&["trap", "--resume", "saves/trap.safetensors"], "a checkpoint has its map"),
        (&["--resume", "nosuch"], "nosuch: cannot be read"),
        (&["--resume", "--seed", "3"], "cannot be used with"),
    ] {
        let error = here(&[&["--no-ui", "--max-updates", "0"], args].concat()).refusal();
        assert!(error.contains(part), "{args:?}: {error}");
    }
}

#[test]
fn without_a_terminal_it_says_that_it_trains_without_the_interface() {
    let folder = tempfile::tempdir().unwrap();
    let args = ["trap", "--max-updates", "3", "--eval-tasks", "1"];
    let line = "trains without the interface, as the output is not a terminal (--no-ui says that this is meant)";
    for (more, said) in [(&[][..], format!("{line}\n")), (&["--no-ui"], String::new())] {
        let done = in_folder(folder.path(), &[&args[..], more].concat());
        assert_eq!((done.status, done.err), (Some(0), said));
    }
    let mut endless = program_in(folder.path());
    let endless = endless.arg("trap").stdin(Stdio::null()).stdout(Stdio::piped());
    let mut child = endless.stderr(Stdio::piped()).spawn().unwrap();
    let mut said = String::new();
    BufReader::new(child.stderr.take().unwrap()).read_line(&mut said).unwrap();
    child.kill().and_then(|()| child.wait()).unwrap();
    assert_eq!(said, format!("{line}, until Ctrl-C or a limit: --max-updates N\n"));
}

#[test]
fn episode_and_time_limits_end_a_run() {
    let all = run(&["trap", "--max-episodes", "40", "--eval-tasks", "1"]);
    assert_eq!(all.last().unwrap()["reason"], "max-episodes");
    let all = run(&["trap", "--max-seconds", "0.3", "--eval-tasks", "1"]);
    assert_eq!(all.last().unwrap()["reason"], "max-seconds");
    assert!(all.last().unwrap()["seconds"].as_f64().unwrap() >= 0.3);
}

#[test]
fn missing_the_required_success_is_status_3() {
    let line = "--no-ui trap --max-updates 10 --eval-tasks 2 --method random --require-success";
    for (least, status) in [("1", 3), ("0", 0)] {
        let done = gdg(&[&words(line)[..], &[least], &SMALL].concat());
        assert_eq!(done.status, Some(status), "{}", done.err);
    }
}

#[test]
fn a_start_without_a_path_to_the_goal_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("apart.txt");
    std::fs::write(&path, "S..#..G\n...#...\n...#...\n").unwrap();
    let line = "--max-updates 1 --eval-tasks 1 --set hidden=16 --no-ui";
    let done = gdg(&[&words(line)[..], &[path.to_str().unwrap()]].concat());
    done.success();
    let warning =
        "warning: apart: the goal G at column 7, row 1 cannot be reached from any start S\n";
    assert!(done.err.contains(warning), "{}", done.err);
}

#[test]
fn a_start_that_is_cut_off_is_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pocket.txt");
    for (text, warns) in
        [("S.#...\n###...\n", true), ("..#..S\n###...\n", false), ("S.#..S\n###...\n", true)]
    {
        std::fs::write(&path, text).unwrap();
        let facts = gdg(&["check", path.to_str().unwrap()]).out;
        let warning = "warning:    the start S at column 1, row 1 is cut off from the largest component, where tasks";
        assert_eq!(facts.contains(warning), warns, "{text}: {facts}");
    }
}

#[test]
fn an_evaluation_without_tasks_reports_no_numbers() {
    let map = file("valid/one-cell.txt");
    let args = ["--no-ui", &map, "--max-updates", "5", "--require-success", "0.5"];
    let done = gdg(&[&args[..], &SMALL].concat());
    assert!(done.status == Some(3) && done.err.contains("no tasks"), "{}", done.err);
    let all = done.records();
    let evaluation = all.iter().find(|r| r["event"] == "evaluation").unwrap();
    for score in [&evaluation["alone"], &evaluation["planned"]] {
        for number in ["success", "spl", "steps_ratio"] {
            assert!(
                score[number].is_null() && score.as_object().unwrap().contains_key(number),
                "{number}: {score}"
            );
        }
    }
    assert!(evaluation["error"].is_null(), "{evaluation}");
}

#[test]
fn a_scenario_is_evaluated_in_six_ranges() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tasks.scen");
    let tasks: String = (0..12).map(|i| format!("0\ttrap\t53\t41\t0\t0\t{i}\t0\t{i}\n")).collect();
    std::fs::write(&path, format!("version 1\n{tasks}")).unwrap();
    let saved = folder.path().join("run.safetensors");
    let [path, saved] = [&path, &saved].map(|path| path.to_str().unwrap());
    let given = ["trap", "--max-updates", "10", "--eval-tasks", "2", "--scen", path];
    let begun = run(&[&given[..], &["--save", saved]].concat());
    // A resumed run goes on with both.
    let resumed = gdg(&words(&format!("--no-ui --resume {saved} --max-updates 20"))).records();
    // Or has another from then on, which is a curve of its own.
    let other = folder.path().join("other.scen");
    std::fs::write(&other, format!("version 1\n{}", tasks.replace("\t11\t0\t11", "\t10\t0\t10")))
        .unwrap();
    let copy = folder.path().join("copy");
    let [other, copy] = [&other, &copy].map(|path| path.to_str().unwrap());
    let line = format!(
        "--no-ui --resume {saved} --max-updates 20 --scen {other} --save {copy}/own.safetensors"
    );
    gdg(&words(&line)).success();
    let listed: Value = serde_json::from_str(gdg(&["runs", "--json", copy]).success()).unwrap();
    let tasks = listed["eval_tasks"].as_str().unwrap();
    assert!(tasks.starts_with("2 of ") && tasks.contains(",2 of "), "{tasks}");
    for all in [begun, resumed] {
        assert_eq!(
            (&all[0]["eval_tasks"], all[0]["map"]["scenario"].is_string()),
            (&2.into(), true)
        );
        let evaluation = all.iter().find(|r| r["event"] == "evaluation").unwrap();
        let groups = evaluation["alone"]["by_distance"].as_array().unwrap();
        let means: Vec<_> = groups.iter().map(|g| g["distance_steps"].as_f64().unwrap()).collect();
        assert_eq!(means, [0.5, 2.5, 4.5, 6.5, 8.5, 10.5]);
    }
}

/// Checks unusable arguments, and what their errors say.
#[test]
fn bad_usage_and_input_are_status_2_with_a_hint() {
    let scenario = file("valid/plain.scen");
    let bad: &[(&[&str], &[&str])] = &[
        (
            &["--no-ui", "fourroms"],
            &["neither a built-in map nor a file", "did you mean fourrooms"],
        ),
        (
            &["--no-ui", "no/such.map"],
            &["no/such.map", "cannot be read", "or a name from 'gdg-tui maps'"],
        ),
        (
            &["--no-ui", "trap", "--scen", "no-such.scen"],
            &["cannot be read", "give a scenario file"],
        ),
        (
            &["--no-ui", "trap", "--edit-at", "5:no-such.txt"],
            &["cannot be read", "give a map file"],
        ),
        (&["check", "no-such.txt"], &["cannot be read", "or a name from 'gdg-tui maps'"]),
        (
            &["check", &file("valid/plain.scn")],
            &["did you mean plain.scen? give a map file, or a name from 'gdg-tui maps'"],
        ),
        (&["watch", "no-such"], &["no-such: cannot be read: No such file", "--save FILE"]),
        (&["check", "no-such.scen"], &["cannot be read", "give a scenario file"]),
        (&["check", &scenario, "--map", &scenario], &["this is a scenario file", "--scen"]),
        (&["--no-ui", &scenario], &["plain.scen:1:1", "this is a scenario file", "--scen"]),
        (&["--no-ui", "--set", "expectil=0.9"], &["expectil", "did you mean expectile"]),
        (&["--no-ui", "--set", "expectile=2"], &["expectile cannot be 2", "above 0 and below 1"]),
        (
            &["--no-ui", "--method", "my-own+none"],
            &["unknown learner \"my-own\"", "gdg, gdg-distance, ddpg, her"],
        ),
        (&["--no-ui", "--set", "hidden=many"], &["hidden cannot be \"many\"", "integer from 1"]),
        (
            &["--no-ui", "--set", "loss=cubic"],
            &["loss cannot be \"cubic\"", "squared, sqrt or log"],
        ),
        (&["--no-ui", "--set", "tau"], &["no value", "name=value"]),
        (&["--no-ui", "--config", "no-such.json"], &["no-such.json", "cannot be read"]),
        (
            &["--no-ui", "--resume", "no-such.safetensors"],
            &["no-such.safetensors", "cannot be read"],
        ),
        (
            &["--no-ui", "--set", "episode_steps=60000"],
            &["episode_steps=60000", "buffer_size must be at least 1920032"],
        ),
        (&["--no-ui", "--method", "gpg"], &["gpg", "possible values"]),
        (
            &["--no-ui", "--method", "gdg+foo"],
            &["gdg+foo", "LEARNER+PLANNER", "gdg, gdg-distance, ddpg, her", "none, bridges, sorb"],
        ),
        (&["--no-ui", "--method", "my-own+none"], &["LEARNER+PLANNER", "none, bridges, sorb"]),
        (&["--no-ui", "--max-updates", "-3"], &["invalid value '-3' for '--max-updates"]),
        (&["suite", "trap", "--budget", "-3"], &["invalid value '-3' for '--max-updates"]),
        (&["--no-ui", "--require-success", "2"], &["fraction from 0 to 1"]),
        (&["--no-ui", "--max-seconds", "soon"], &["number of seconds"]),
        (&["check", "trap", "--margin", "-1"], &["--margin", "a number from 0"]),
        (
            &["--no-ui", "trap", "--python", "python3"],
            &["--python applies only to environments in Python", "gym:ID"],
        ),
        (
            &["--no-ui", "fetch-reach", "--env-timeout", "5"],
            &["--env-timeout applies only to environments in Python", "leave --env-timeout out"],
        ),
        (&["--no-ui", "trap", "--goal", "0,1"], &["--goal applies only to environments"]),
        (
            &["--no-ui", "trap", "--workers", "2", "--print-config"],
            &["--workers applies only to environments"],
        ),
        (&["--no-ui", "fetch-reach", "--cell", "1"], &["--cell applies only to maps"]),
        (&["--no-ui", "fetch-reach", "--threshold", "0.5"], &["--threshold applies only to maps"]),
        (&["--nonsense"], &["--nonsense"]),
    ];
    for (args, expected) in bad {
        let done = gdg(args);
        let message = done.refusal();
        assert_eq!(done.out, "", "{args:?}");
        for part in *expected {
            assert!(message.contains(part), "{args:?}: {part:?} is not in {message}");
        }
        let name_accepted = expected.iter().any(|part| part.contains("gdg-tui maps"));
        assert_eq!(message.contains("gdg-tui maps"), name_accepted, "{args:?}: {message}");
    }
}

#[test]
fn errors_in_a_settings_file_are_reported_with_their_location() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("settings.json");
    let error = |text: &str| {
        std::fs::write(&path, text).unwrap();
        in_folder(folder.path(), &["--print-config", "--config", "settings.json"]).refusal()
    };
    assert!(
        error("{\n  \"tau\": 0.1,\n  \"hiden\": 3\n}")
            .contains("settings.json:3:4: unknown setting \"hiden\"")
    );
    assert!(error("{\n  \"tau\": \"x\"\n}").contains("settings.json:2:10: tau cannot be \"x\""));
    assert!(error("{\n  \"tau\": 0.1\n  \"batch\": 3\n}").contains("settings.json:3:3: expected"));
    assert!(error("[]").contains("settings.json:1:"));
    let twice = error("{\n  \"tau\": 0.1,\n  \"tau\": 0.2\n}");
    assert!(twice.contains("settings.json:3:4: tau is given twice"), "{twice}");
    let tab = error("{\n\t\"hiden\": 3\n}");
    assert!(tab.contains("settings.json:2:3") && !tab.contains("?\"hiden"), "{tab}");
}

#[test]
fn settings_are_explained_by_name() {
    let found = gdg(&["settings", "n_step"]).out;
    assert!(found.starts_with("n_step: ") && found.contains("Possible: an integer"), "{found}");
    assert!(gdg(&["settings", "nstep"]).refusal().contains("did you mean n_step?"));
    let found = gdg(&["settings", "noise"]).out;
    assert!(found.lines().count() == 3 && found.contains("env_noise: "), "{found}");
}

#[test]
fn settings_that_change_nothing_with_a_method_say_so() {
    const OF_PLANS: &str = "graph_bounds=false actor_waypoints=false distillation=0.1 short_pairs=0.9 \
                            imagined_walks=0 hop_steps=2 bridge_epsilon=0.9 planned_episodes=0.1 \
                            frontier_epsilon=0.9 open_loop=true progress_check=false lookahead=false \
                            candidates=40 candidate_spacing=2 edge_cutoff_steps=5 verify_edges=false \
                            keep_observed_edges=false graph_every_updates=50";
    const OF_D: &str = "distance_scale_steps=20 n_step=1 pessimism=0.5 expectile=0.4 greedy_targets=false \
                        model_check=false hindsight_bound=false unblock_actor=false \
                        max_distance_steps=15 loss=squared";
    let found = |method: &str, more: &[&str]| {
        let line = "--no-ui trap --seed 2 --max-updates 300 --eval-tasks 1 --set learning_starts=200 \
                    --set hidden=16 --set batch_size=16 --method";
        let set = more.iter().flat_map(|set| ["--set", set]);
        let done = gdg(&words(line).into_iter().chain([method]).chain(set).collect::<Vec<_>>());
        let mut last = done.records().into_iter().find(|one| one["event"] == "evaluation").unwrap();
        last["seconds"].take();
        (last, done.err)
    };
    for (method, idle) in [("gdg", "actor_l2=0.5 discount=0.5 target_noise=0.3"), ("her", OF_D)] {
        let changed = [words(OF_PLANS), words(idle)].concat();
        let (own, said) = found(method, &changed);
        assert_eq!(own, found(method, &[]).0, "{method}");
        for set in changed {
            let name = set.split('=').next().unwrap();
            assert!(
                said.contains(&format!("--set {name}: changes nothing with {method}")),
                "{said}"
            );
        }
    }
}

#[test]
fn printed_settings_can_be_read_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("settings.json");
    let printed = gdg(&["--print-config", "--preset", "paper", "--set", "tau=0.25"]);
    assert!(printed.success().contains("\"tau\": 0.25"));
    // Some editors begin a file with a byte-order mark.
    for mark in ["", "\u{feff}"] {
        std::fs::write(&path, format!("{mark}{}", printed.out)).unwrap();
        let again = gdg(&["--print-config", "--config", path.to_str().unwrap()]);
        assert_eq!(printed.out, again.out);
    }
}

#[test]
fn a_world_has_default_settings_which_given_ones_override() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("settings.json");
    std::fs::write(&config, "{\"learning_starts\": 300, \"agents\": 5}").unwrap();
    let printed = |args: &[&str]| -> Value {
        serde_json::from_str(gdg(&[&["--print-config"], args].concat()).success()).unwrap()
    };
    let all = ["agents", "learning_starts", "env_steps_per_update", "frontier_epsilon"];
    let some = |args: &[&str]| {
        serde_json::to_string(&all.map(|name| printed(args)[name].clone())).unwrap()
    };
    assert_eq!(some(&["fourrooms"]), r#"[32,4000,16,"auto"]"#);
    assert_eq!(some(&["fetch-reach"]), r#"[8,200,1,"auto"]"#);
    assert_eq!(some(&["fetch-reach", "--method", "her"]), "[8,200,1,0.0]");
    let given = ["fetch-reach", "--config", config.to_str().unwrap(), "--set", "agents=3"];
    assert_eq!(some(&given), r#"[3,300,1,"auto"]"#);
    // Presets that others have published stay as they are.
    for preset in ["paper", "sb3"] {
        assert_eq!(
            printed(&["fetch-reach", "--preset", preset]),
            printed(&["--preset", preset]),
            "{preset}"
        );
    }
}

#[test]
fn a_resumed_run_keeps_its_worlds_settings_and_records_show_them() {
    let folder = tempfile::tempdir().unwrap();
    let saved = folder.path().join("arm.safetensors");
    let saved = saved.to_str().unwrap();
    let line = format!("fetch-reach --set agents=4 --max-updates 20 --eval-tasks 1 --save {saved}");
    let begun = run(&words(&line));
    let settings = serde_json::json!({
        "hidden": 16, "buffer_size": 20000, "candidates": 50,
        "agents": 4, "learning_starts": 200, "env_steps_per_update": 1,
    });
    assert_eq!(begun[0]["settings"], settings);
    let resume = ["--no-ui", "--resume", saved, "--max-updates", "30", "--eval-tasks", "1"];
    let resumed = gdg(&resume).records();
    assert_eq!((&resumed[0]["settings"], &resumed[0]["updates"]), (&settings, &20.into()));
    let printed = gdg(&["--print-config", "--resume", saved]);
    let printed: Value = serde_json::from_str(printed.success()).unwrap();
    assert_eq!((&printed["agents"], &printed["env_steps_per_update"]), (&4.into(), &1.into()));
}

#[test]
fn maps_lists_maps_and_check_validates_them() {
    let text = gdg(&["maps"]).out;
    for (name, size, farthest) in [
        ("fourrooms", " 6,656 ", " 119 steps"),
        ("city", "101x101", " 226 steps"),
        ("trap", "53x41", " 92 steps"),
    ] {
        let line = text.lines().find(|l| l.starts_with(name)).unwrap();
        assert!(line.contains(size) && line.ends_with(farthest), "{line}");
    }
    let good = gdg(&["check", &file("valid/starts-and-goals.txt")]);
    let text = good.success();
    assert!(
        text.contains("3 x 3")
            && text.contains("components: 1")
            && text.contains("2 starts, 2 goals"),
        "{text}"
    );
    assert!(gdg(&["check", &file("valid/plain.scen")]).out.contains("1 task,"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walled.txt");
    for (text, warns) in [("S#G\n", true), ("S.G\n", false), ("SG#G\n", true), ("G#SG\n", true)] {
        std::fs::write(&path, text).unwrap();
        let checked = gdg(&["check", path.to_str().unwrap()]);
        let facts = checked.success();
        assert!(facts.contains("1 start, "), "{facts}");
        assert_eq!(
            facts.contains("warning:") && facts.contains("cannot be reached"),
            warns,
            "{text}: {facts}"
        );
    }
    let [lost, map] = ["invalid/off-the-map.scen", "valid/plain.txt"].map(file);
    gdg(&["check", &lost, "--map", &map]).refusal();
    let bad = gdg(&["check", &file("invalid/short-row.txt")]).refusal();
    assert!(bad.contains("short-row.txt:2:3"), "{bad}");
}

/// Uses the largest map allowed; the time limit leaves room for a busy machine.
#[test]
fn check_of_the_largest_map_takes_seconds() {
    let folder = tempfile::tempdir().unwrap();
    let map = folder.path().join("open.txt");
    std::fs::write(&map, format!("{}\n", ".".repeat(4096)).repeat(4096)).unwrap();
    let began = Instant::now();
    let Ran { out, err, .. } = gdg(&["check", map.to_str().unwrap()]);
    assert!(began.elapsed() < Duration::from_secs(20), "it took {:?}", began.elapsed());
    assert!(
        out.contains("farthest:   at least 4,095 steps") && out.contains("components: 1,"),
        "{out}"
    );
    assert!(!err.contains(['\r', '\u{1b}']), "lines unless it is a terminal: {err:?}");
}

/// Checks the text below the options of a command and of its own commands: what is indented is not
/// wrapped well, and so fits; paragraphs are wrapped, and so have no breaks of their own.
fn check_width_of_help(command: &clap::Command) {
    let text = command.get_after_help().map(ToString::to_string).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    for line in &lines {
        let fits = !line.starts_with(' ') || line.chars().count() <= 80;
        assert!(fits, "{}: {line}", command.get_name());
    }
    let is_text = |line: &str| !line.is_empty() && !line.starts_with(' ');
    let broken = lines.windows(2).find(|pair| pair.iter().all(|line| is_text(line)));
    assert!(broken.is_none(), "{}: {broken:?}", command.get_name());
    command.get_subcommands().for_each(check_width_of_help);
}

#[test]
fn help_fits_80_columns() {
    check_width_of_help(&<gdg_tui::cli::Cli as clap::CommandFactory>::command());
}

#[test]
fn only_options_of_environments_are_below_their_heading() {
    let mut command = <gdg_tui::cli::Cli as clap::CommandFactory>::command();
    let help = command.render_long_help().to_string();
    let (before, below) = help.split_once("\nGymnasium environments:").unwrap();
    for option in ["--cell", "--ui-config", "--print-config-template", "--require-success"] {
        assert!(before.contains(option) && !below.contains(&format!("\n      {option}")));
    }
    assert!(below.contains("\n      --python"));
}

#[test]
fn recorded_data_of_ogbench_are_learned_from_in_its_built_in_mazes() {
    let recording = own("crates/gdg/tests/data/ogbench/giant.npz");
    let small = ["--set", "hidden=16", "--max-updates", "5", "--eval-tasks", "1"];
    let args = [&["--no-ui", "ogbench-pointmaze-giant", "--data", &recording][..], &small].concat();
    let done = gdg(&args);
    done.success();
    let warning = done.err;
    assert!(warning.contains("of 4000 transitions are left out"), "contacts differ: {warning}");
    assert!(!warning.contains("another map"), "{warning}");
    let refused = gdg(&[&args[..4], &["--max-episodes", "1"]].concat()).refusal();
    assert!(refused.contains("--max-episodes: with --data alone, no episode ends"), "{refused}");
    let error = gdg(&["check", "ogbench-pointmaze-giant", "--cell", "2"]).refusal();
    assert!(error.contains("the map has a scale of its own"), "{error}");
}

#[test]
fn a_map_can_be_edited_at_a_given_update() {
    let folder = tempfile::tempdir().unwrap();
    let edited = folder.path().join("wider.txt");
    let trap = std::fs::read_to_string(own("maps/trap.txt")).unwrap();
    // Turns all walls into free cells.
    std::fs::write(&edited, trap.replace('#', ".")).unwrap();
    let at = format!("100:{}", edited.display());
    // Saved before, the run is edited all the same.
    let saved = folder.path().join("saved.safetensors");
    let saved = saved.to_str().unwrap();
    run(&["trap", "--max-seconds", "0", "--eval-tasks", "1", "--edit-at", &at, "--save", saved]);
    std::fs::remove_file(&edited).unwrap();
    let rest = ["--no-ui", "--resume", saved, "--max-updates", "200", "--eval-tasks", "1"];
    let done = gdg(&rest);
    let all = done.records();
    assert!(done.err.contains("at update 100, the map is to become wider"), "{}", done.err);
    assert!(all[0]["edit_at"][0].as_str().unwrap().starts_with("100:"), "{}", all[0]);
    let edit = all.iter().find(|r| r["event"] == "edit").unwrap();
    assert_eq!(
        (&edit["updates"], &edit["map"], &edit["walled"]),
        (&100.into(), &"wider".into(), &0.into())
    );
    assert!(
        edit["opened"].as_u64().unwrap() > 100 && edit["transitions_removed"].is_number(),
        "{edit}"
    );
    let large = gdg(&["check", "trap", "--goal-radius", "27"]).out;
    assert!(large.contains("radius of 27 cells is more than half of the map's 53"), "{large}");
    let wrong = format!("100:{}", file("valid/plain.txt"));
    let error = gdg(&["--no-ui", "trap", "--edit-at", &wrong]).refusal();
    assert!(error.contains("plain.txt") && error.contains("53 x 41"), "{error}");
}

#[test]
fn edits_at_the_first_update_are_applied_before_the_first_step() {
    let folder = tempfile::tempdir().unwrap();
    let trap = std::fs::read_to_string(own("maps/trap.txt")).unwrap();
    let at = |updates: u64, name: &str| {
        let path = folder.path().join(name).with_extension("txt");
        std::fs::write(&path, trap.replace('#', ".")).unwrap();
        format!("{updates}:{}", path.display())
    };
    let edits = |all: &[Value]| -> Vec<(u64, String)> {
        let edits = all.iter().filter(|r| r["event"] == "edit");
        edits
            .map(|r| (r["updates"].as_u64().unwrap(), r["map"].as_str().unwrap().to_owned()))
            .collect()
    };
    let saved = folder.path().join("saved.safetensors");
    let saved = saved.to_str().unwrap();
    let (first, second, third) = (at(0, "first"), at(0, "second"), at(40, "third"));
    let all = run(&[
        &["trap", "--max-updates", "40", "--eval-tasks", "1", "--save", saved][..],
        &["--edit-at", &third, "--edit-at", &second, "--edit-at", &first],
    ]
    .concat());
    // Edits at the same update are applied in the order in which they are given.
    assert_eq!(
        edits(&all),
        [(0, "second".to_owned()), (0, "first".to_owned()), (40, "third".to_owned())]
    );
    let order: Vec<&str> = all.iter().map(|r| r["event"].as_str().unwrap()).collect();
    assert_eq!(order, ["start", "edit", "edit", "edit", "saved", "evaluation", "saved", "end"]);
    assert_eq!(all[1]["transitions_removed"], 0, "there are none yet");

    let resume = |at: &str, most: &str| {
        let line = format!(
            "--no-ui --resume {saved} --eval-tasks 1 --edit-at {at} --max-updates \
            {most}"
        );
        let done = gdg(&words(&line));
        (done.status, one_line(&done.err), edits(&done.records()))
    };
    let unsaved = "not saved: give --save FILE, which may be the file resumed \
                   not saved: 20 updates; give --save FILE to keep them"
        .to_owned();
    assert_eq!(
        resume(&at(40, "again"), "60"),
        (Some(0), unsaved.clone(), vec![(40, "again".to_owned())])
    );
    assert_eq!(
        resume(&at(60, "again"), "60"),
        (Some(0), unsaved.clone(), vec![(60, "again".to_owned())])
    );
    // The run had applied this one before it was saved.
    assert_eq!(resume(&third, "60"), (Some(0), unsaved, vec![]));
    for (at, expected) in [
        (at(39, "late"), "the run starts at update 40"),
        (at(0, "late"), "the run starts at update 40"),
        (at(61, "late"), "the run ends at update 60"),
    ] {
        let (status, error, edits) = resume(&at, "60");
        assert_eq!((status, edits.len()), (Some(2), 0), "{error}");
        assert!(error.contains(expected) && error.contains("--edit-at"), "{error}");
    }
}
