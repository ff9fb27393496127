//! `gdg-tui suite`: jobs, their results, and what happens when they are interrupted.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::ran::{Ran, SMALL, has_parts, in_folder, one_line, program_in, ran, words};
use serde_json::Value;
use tempfile::TempDir;

/// Two parts, the right one larger, and no start.
const TWO_PARTS: &str = "type octile\nheight 3\nwidth 9\nmap\n..@......\n..@......\n..@......\n";

/// A folder with a folder of maps in which suites run.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        place.map("two-parts", TWO_PARTS);
        place.map(
            "open",
            "type octile\nheight 6\nwidth 6\nmap\n......\n......\n......\n......\n......\n......\n",
        );
        std::fs::write(place.path("maps/ignored.txt"), "no map").unwrap();
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn map(&self, name: &str, text: &str) {
        std::fs::create_dir_all(self.path("maps")).unwrap();
        std::fs::write(self.path("maps").join(name).with_extension("map"), text).unwrap();
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = program_in(self.0.path());
        command.arg("suite").args(args).args(SMALL).args(["--eval-tasks", "2", "--markdown"]);
        command
    }

    fn run(&self, args: &[&str]) -> Ran {
        ran(self.command(args))
    }

    /// Returns the names of the files in a folder, sorted.
    fn files(&self, folder: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    /// Returns all results in a folder, sorted by name, as bytes.
    fn results(&self, out: &str) -> Vec<Vec<u8>> {
        let jobs = self.path(out).join("jobs");
        let names =
            self.files(&format!("{out}/jobs")).into_iter().filter(|name| is_a(name, "json"));
        names.map(|name| std::fs::read(jobs.join(name)).unwrap()).collect()
    }
}

/// Whether a file has this type.
fn is_a(name: &str, file_type: &str) -> bool {
    Path::new(name).extension().is_some_and(|extension| extension == file_type)
}

/// Returns results without their times.
fn without_times(results: Vec<Vec<u8>>) -> Vec<Value> {
    let without = |bytes: Vec<u8>| {
        let mut result: Value = serde_json::from_slice(&bytes).unwrap();
        result.as_object_mut().unwrap().remove("seconds").unwrap();
        for evaluation in result["evaluations"].as_array_mut().unwrap() {
            assert!(evaluation.as_object_mut().unwrap().remove("seconds").unwrap().is_number());
        }
        result
    };
    results.into_iter().map(without).collect()
}

#[test]
fn results_pictures_and_report_are_written_and_a_second_call_runs_nothing() {
    let place = Place::new();
    let args = ["maps", "trap", "--budget", "60", "--seeds", "2", "--out", "out", "--no-keep"];
    let first = place.run(&args);
    first.success();
    let results = place.results("out");
    assert_eq!((results.len(), place.files("out/pictures").len()), (6, 6));
    assert!(
        place.files("out/jobs").iter().all(|name| is_a(name, "json")),
        "no checkpoint or lock is left"
    );

    let read: Vec<Value> =
        results.iter().map(|bytes| serde_json::from_slice(bytes).unwrap()).collect();
    for result in &read {
        let evaluations = result["evaluations"].as_array().unwrap();
        let updates: Vec<u64> =
            evaluations.iter().map(|e| e["updates"].as_u64().unwrap()).collect();
        assert_eq!(updates, (1..=10).map(|i| 6 * i).collect::<Vec<u64>>());
        assert!(
            evaluations
                .iter()
                .all(|e| e["explored"].is_number() && e["planned"]["success"].is_number())
        );
        assert!(result["settings"].as_array().unwrap().contains(&"hidden=16".into()), "{result}");
    }
    let table: Vec<&str> = first.out.lines().collect();
    assert_eq!(table.len(), 2 + 3 + 2, "{}", first.out);
    assert!(
        table[2].starts_with("| open | gdg-bridge | 60 | ") && table[2].contains(" ("),
        "mean and worst: {}",
        table[2]
    );
    has_parts(&first.err, &["warning: 60 updates on open, where 60,000 are usual, are too few"]);
    let report = std::fs::read_to_string(place.path("out/report.md")).unwrap();
    has_parts(
        &report,
        &[
            &first.out,
            "hidden=16",
            "](pictures/trap-gdg-bridge-seed2-",
            "![Learning curves](success.svg)",
            "at the map's `S`",
        ],
    );

    // A figure and a report that somebody has edited are kept.
    std::fs::write(place.path("out/report.md"), report + "Mine.\n").unwrap();
    let curves = place.path("out/success.svg");
    let edited = std::fs::read_to_string(&curves).unwrap().replace("success rate", "share reached");
    std::fs::write(&curves, &edited).unwrap();
    let second = place.run(&args);
    assert_eq!((second.status, &second.out), (Some(0), &first.out));
    has_parts(&second.err, &["6 jobs done, 0 to run", "success.svg: the file already exists"]);
    assert_eq!(std::fs::read_to_string(curves).unwrap(), edited);
    has_parts(&second.err, &["report.md: not as gdg-tui has written it, so it is left as it is"]);
    assert!(std::fs::read_to_string(place.path("out/report.md")).unwrap().ends_with("Mine.\n"));
    assert!(!second.err.contains("begins"), "{}", second.err);
    assert_eq!(place.results("out"), results, "even the times are the same");

    // Other settings make other jobs.
    let listed = place.run(&[&args[..], &["--set", "tau=0.02", "--list"]].concat()).out;
    assert!(listed.lines().all(|line| line.ends_with("not begun")), "{listed}");
}

#[test]
fn several_methods_and_variants_share_a_folder_and_a_report() {
    let place = Place::new();
    let args = |methods: &[&'static str]| {
        [&["maps/open.map", "--budget", "30", "--out", "out"], methods].concat()
    };
    let first = place.run(&args(&["--method", "her"]));
    first.success();
    let both = ["--method", "gdg", "--method", "ddpg", "--set", "small:tau=0.02"];
    let second = place.run(&args(&[&both[..], &["--set", "ddpg:discount=0.9"]].concat()));
    second.success();
    has_parts(&second.err, &["0 jobs done, 4 to run"]);
    let table: Vec<&str> = second.out.lines().skip(2).collect();
    let parts: Vec<Vec<&str>> = table.iter().map(|line| line.split(" | ").collect()).collect();
    let methods: Vec<&str> = parts.iter().map(|row| row[1]).collect();
    let expected = ["gdg", "gdg, small", "ddpg", "ddpg, small", "her"];
    let sorted = |label: &str| {
        label
            .split([' ', '(', ')', ','])
            .map(str::to_owned)
            .collect::<std::collections::BTreeSet<_>>()
    };
    assert_eq!(methods.len(), expected.len(), "{}", second.out);
    for (found, wanted) in methods.iter().zip(expected) {
        assert_eq!(sorted(&found.replace('\\', "")), sorted(wanted), "{}", second.out);
    }
    let report = std::fs::read_to_string(place.path("out/report.md")).unwrap();
    has_parts(
        &report,
        &[
            &second.out,
            "\n### her\n",
            "](pictures/open-ddpg-small-seed1-",
            "](pictures/open-her-seed1-",
        ],
    );
    let table = std::fs::read_to_string(place.path("out/success.csv")).unwrap();
    has_parts(&table, &[",her,", ",ddpg,"]);
    let again = place.run(&args(&["--method", "her"]));
    again.success();
    has_parts(&again.out, &["| open | her |", "| open | gdg |"]);
    for (set, parts) in [
        ("sorb:tau=0.02", &["sorb is not among the methods", "add --method sorb"][..]),
        ("a/b:tau=0.02", &["not the name of a variant", "only letters, digits"]),
    ] {
        let ran = place.run(&args(&["--set", set]));
        has_parts(&ran.refusal(), parts);
    }
}

#[test]
fn sweeps_ablations_and_other_worlds_are_lists_of_jobs() {
    let place = Place::new();
    let list = |args: &[&str]| {
        let listed = place.run(&[args, &["--budget", "30", "--list"]].concat());
        listed.success();
        listed.out.lines().map(str::to_owned).collect::<Vec<_>>()
    };
    let sweep = ["trap", "--sweep", "hidden=16,32,16", "--sweep", "tau=0.01,0.02"];
    let listed = list(&sweep);
    assert_eq!(listed.len(), 4, "no job twice, none without");
    assert!(listed[1].starts_with("trap-gdg-bridge-hidden_16-tau_0.02-seed1-"), "{listed:?}");
    assert_eq!(list(&["trap", "--ablation", "ladder"]).len(), 16);
    let components = list(&["trap", "--ablation", "components"]);
    for variant in ["gdg-bridge default", "gdg-bridge no distillation", "sorb method sorb"] {
        assert!(components.iter().any(|line| line.contains(variant)), "{variant}: {components:?}");
    }
    let refused = place.run(&["fetch-reach", "--goal-radius", "2", "--list"]);
    has_parts(&refused.refusal(), &["--goal-radius applies only to maps"]);
    let line = "suite fetch-reach trap --method gdg --sweep tau=0.01,0.02 --budget 300 --eval-tasks 1 --out out";
    let ran = in_folder(place.0.path(), &[&words(line)[..], &SMALL].concat());
    ran.success();
    let first = |line: &str| line.split_whitespace().take(4).collect::<Vec<_>>().join(" ");
    let rows: Vec<String> = ran.out.lines().map(first).collect();
    assert_eq!(rows[0], "map method updates planned", "{}", ran.out);
    assert_eq!(rows[2], "fetch-reach gdg, tau=0.02 300");
    assert!(rows[3].starts_with("trap gdg, tau=0.01 ") && rows.len() == 9, "{}", ran.out);
    let refused = place.run(&["trap", "--sweep", "hidden= ", "--list"]);
    has_parts(&refused.refusal(), &["--sweep hidden= : not SETTING=VALUE,VALUE"]);
}

#[cfg(unix)]
#[test]
fn interrupted_jobs_resume_bit_for_bit_for_any_number_of_parallel_jobs() {
    let place = Place::new();
    let args = |out: &'static str, jobs: &'static str| {
        ["maps", "--budget", "900", "--out", out, "--jobs", jobs]
    };
    assert_eq!(place.run(&args("whole", "2")).status, Some(0));

    let mut child = place
        .command(&args("parts", "1"))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    lines.find(|line| line.contains(" of 900 updates")).unwrap();
    Command::new("kill").args(["-INT".to_owned(), child.id().to_string()]).status().unwrap();
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    assert!(place.files("parts/jobs").iter().any(|name| is_a(name, "safetensors")), "{rest:?}");
    let listed = place.run(&[&args("parts", "1")[..], &["--list"]].concat()).out;
    has_parts(&listed, &["begun, ", "not begun"]);

    let resumed = place.run(&args("parts", "1"));
    resumed.success();
    has_parts(&resumed.err, &["resumes after "]);
    assert_eq!(without_times(place.results("parts")), without_times(place.results("whole")));
    assert_eq!(place.files("parts/pictures"), place.files("whole/pictures"));
    for name in place.files("parts/pictures") {
        let picture =
            |out: &str| std::fs::read(place.path(out).join("pictures").join(&name)).unwrap();
        assert!(picture("parts") == picture("whole"), "{name}");
    }
}

#[test]
fn a_bad_map_is_named_with_its_line_before_anything_runs() {
    let place = Place::new();
    place.map("bad", "type octile\nheight 1\nwidth 3\nmap\n.x.\n");
    let ran = place.run(&["maps", "--out", "out"]);
    has_parts(&ran.refusal(), &["bad.map:5:2", "is not a map character"]);
    assert!(!place.path("out").exists());
    for (args, part) in [
        (&["no-such.map"][..], "no-such.map"),
        (&["fourroms"], "did you mean fourrooms"),
        (&["."], "the folder has no .map or .txt files"),
        (&["trap", "--set", "hiden=3"], "did you mean hidden"),
        (&["trap", "--out", "maps/open.map"], "results cannot be saved here"),
        (&[], "FOLDER|MAP"),
    ] {
        let ran = place.run(args);
        has_parts(&ran.refusal(), &[part]);
    }
}

#[test]
fn jobs_are_listed_and_run_by_name() {
    let place = Place::new();
    let args = ["maps", "maps/open.map", "--budget", "30", "--out", "out"];
    let list = || place.run(&[&args[..], &["--list"]].concat());
    let listed = list();
    listed.success();
    let lines: Vec<Vec<&str>> =
        listed.out.lines().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(lines.len(), 2, "the same map counts once: {}", listed.out);
    assert_eq!(
        lines[1][1..],
        ["two-parts", "gdg-bridge", "seed", "1", "30", "updates", "not", "begun"]
    );
    assert!(!place.path("out").exists(), "nothing runs");
    let (open, parts) = (lines[0][0], lines[1][0]);
    assert!(
        open.starts_with("open-gdg-bridge-seed1-")
            && parts.starts_with("two-parts-gdg-bridge-seed1-"),
        "{open} {parts}"
    );

    let unknown = place.run(&[&args[..], &["--job", "open-1"]].concat());
    has_parts(
        &unknown.refusal(),
        &["open-1: there is no such job", "give a number from 1 to 2", open],
    );

    let one = place.run(&[&args[..], &["--job", "2", "--job", parts]].concat());
    assert_eq!((one.status, &*one.out), (Some(0), ""), "{}", one.err);
    assert_eq!(place.files("out/jobs"), [format!("{parts}.json"), format!("{parts}.safetensors")]);
    let collected = place.run(&[&args[..], &["--collect"]].concat());
    assert_eq!(collected.status, Some(1), "{}", collected.err);
    has_parts(&collected.out, &["| open | gdg-bridge | 30 | - | - |"]);
    has_parts(&collected.err, &[&format!("1 job missing: {open}")]);
    let listed = list().out;
    let states: Vec<bool> = listed.lines().map(|line| line.ends_with("  done")).collect();
    assert_eq!(states, [false, true], "{listed}");

    // What goes on from it leaves its checkpoint to its result.
    let job = format!("out/jobs/{parts}.safetensors");
    let resumed = ["--no-ui", "--resume", &job, "--save", &job, "--max-updates", "40"];
    has_parts(&in_folder(place.0.path(), &resumed).refusal(), &["belongs to a finished job"]);
}

#[test]
fn damaged_results_are_named_and_made_again() {
    let place = Place::new();
    let args = ["maps/open.map", "--budget", "30", "--out", "out"];
    assert_eq!(place.run(&args).status, Some(0));
    let file = place.path("out/jobs").join(&place.files("out/jobs")[0]);
    let written = std::fs::read_to_string(&file).unwrap();
    let done = |text: &str| {
        std::fs::write(&file, text).unwrap();
        place.run(&args).err
    };
    has_parts(&done(&written), &["1 job done, 0 to run"]);
    let impossible = written.replace("\"success\": ", "\"success\": 3");
    has_parts(&done(&impossible), &["is damaged: impossible numbers at update", "1 to run"]);
    has_parts(&done(&written[..written.len() / 2]), &["is damaged: EOF while parsing", "1 to run"]);
    // A file of another kind is not replaced.
    let text = "version https://git-lfs.github.com/spec/v1\noid 1\n";
    let said = done(text);
    has_parts(&one_line(&said), &["is a Git LFS pointer, which"]);
    assert!(!said.contains("begins"), "{said}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);

    std::fs::remove_file(&file).unwrap();
    std::fs::create_dir(&file).unwrap();
    let blocked = place.run(&args);
    assert_eq!(blocked.status, Some(1), "{}", blocked.err);
    has_parts(
        &blocked.err,
        &["open-gdg-bridge-seed1-", ".json: the result cannot be saved", "move it away"],
    );
    assert!(!blocked.err.contains("begins"), "nothing is trained in vain: {}", blocked.err);
}

#[test]
fn a_job_that_fails_does_not_end_the_others() {
    let place = Place::new();
    let args = ["maps", "--budget", "30", "--out", "out", "--jobs", "1"];
    let ran = ran(place.command(&args).env("GDG_TUI_FAULTS", "trainer=panic@5"));
    assert_eq!((ran.status, place.results("out").len()), (Some(1), 1), "{}", ran.err);
    has_parts(&ran.err, &["injected fault", "1 job failed: open-gdg-bridge-seed1-"]);
    has_parts(&ran.out, &["| open | gdg-bridge | 30 | - | - |"]);
    let again = place.run(&args);
    has_parts(&again.err, &["1 job done, 1 to run"]);
    assert_eq!((again.status, place.results("out").len()), (Some(0), 2), "{}", again.err);
}

#[test]
fn two_processes_share_the_jobs_of_a_folder() {
    let place = Place::new();
    let args = ["maps", "--budget=300", "--seeds=3", "--out=out", "--jobs=1", "--no-keep"];
    let start =
        || place.command(&args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let both = [start(), start()].map(|child| child.wait_with_output().unwrap());
    let said = both.each_ref().map(|output| String::from_utf8_lossy(&output.stderr).into_owned());
    assert!(both.iter().all(|output| output.status.success()), "{said:?}");
    assert_eq!(
        said.iter().map(|text| text.matches(": begins").count()).sum::<usize>(),
        6,
        "each job once: {said:?}"
    );
    assert_eq!(place.files("out/jobs").len(), 6);
    let whole = place.run(&args);
    has_parts(&whole.err, &["6 jobs done, 0 to run"]);
}

#[test]
fn a_checkpoint_that_cannot_be_resumed_is_kept_and_its_job_fails() {
    let place = Place::new();
    let args = ["maps/open.map", "--budget", "30", "--out", "out"];
    assert_eq!(place.run(&args).status, Some(0));
    let good = place.results("out");
    let path = place.path("out/jobs").join(&place.files("out/jobs")[0]);
    std::fs::write(&path, &good[0][..100]).unwrap();
    let checkpoint = path.with_extension("safetensors");
    let bytes = std::fs::read(&checkpoint).unwrap();
    let other = ["maps/open.map", "--budget", "40", "--out", "other"];
    assert_eq!(place.run(&other).status, Some(0));
    let name = place.files("other/jobs").into_iter().find(|name| is_a(name, "safetensors"));
    let of_other = std::fs::read(place.path("other/jobs").join(name.unwrap())).unwrap();
    for (bytes, why) in
        [(&bytes[..bytes.len() - 100], "is damaged"), (&of_other[..], "is of another run")]
    {
        std::fs::write(&checkpoint, bytes).unwrap();
        let failed = place.run(&args);
        assert_eq!(failed.status, Some(1), "{}", failed.err);
        has_parts(&failed.err, &["0 jobs done, 1 to run", why, "move it away to begin anew"]);
        assert!(std::fs::read(&checkpoint).unwrap() == bytes, "{why}: it is kept");
    }
    std::fs::remove_file(&checkpoint).unwrap();
    let again = place.run(&args);
    again.success();
    assert_eq!(without_times(place.results("out")), without_times(good));
}

#[test]
fn what_another_process_runs_is_named() {
    let place = Place::new();
    let args = ["maps/open.map", "--seeds", "1", "--budget", "50", "--out", "out"];
    let listed = place.run(&[&args[..], &["--list"]].concat());
    let name = listed.out.split_whitespace().next().unwrap().to_owned();
    std::fs::create_dir_all(place.path("out/jobs")).unwrap();
    let lock = std::fs::File::create(place.path(&format!("out/jobs/{name}.lock"))).unwrap();
    lock.lock().unwrap();
    has_parts(&place.run(&args).err, &[&format!("{name}: another process runs it")]);
}

#[test]
fn files_of_others_are_not_replaced() {
    let place = Place::new();
    std::fs::create_dir_all(place.path("out/pictures")).unwrap();
    let files = ["report.md", "success.csv", "pictures/mine.png"];
    let files = files.map(|name| place.path("out").join(name));
    files.iter().for_each(|file| std::fs::write(file, "mine").unwrap());
    let ran = place.run(&["maps/open.map", "--budget", "30", "--out", "out"]);
    assert_eq!(ran.status, Some(0), "{}", ran.err);
    has_parts(&ran.err, &["report.md: not as gdg-tui has written it", "success.csv: the file"]);
    assert!(files.iter().all(|file| std::fs::read_to_string(file).unwrap() == "mine"));
    assert!(!ran.err.contains("report: "), "{}", ran.err);
    assert!(!place.path("out/success.svg").exists(), "no figure without its table");
}

#[cfg(target_os = "linux")]
#[test]
fn a_map_file_in_a_folder_may_have_any_name() {
    use std::os::unix::ffi::OsStrExt;
    let place = Place::new();
    let name = std::ffi::OsStr::from_bytes(b"caf\xe9.map");
    std::fs::write(place.path("maps").join(name), TWO_PARTS).unwrap();
    let listed = place.run(&["maps", "--budget", "30", "--out", "out", "--list"]);
    assert_eq!(
        (listed.status, listed.out.lines().count()),
        (Some(0), 3),
        "{}{}",
        listed.out,
        listed.err
    );
}

#[test]
fn a_folder_without_map_files_may_have_maps_in_text_files() {
    let place = Place::new();
    std::fs::create_dir(place.path("texts")).unwrap();
    std::fs::write(place.path("texts/small.txt"), "S...\n....\n").unwrap();
    let listed = place.run(&["texts", "--budget", "30", "--out", "out", "--list"]);
    assert_eq!(
        (listed.status, listed.out.lines().count()),
        (Some(0), 1),
        "{}{}",
        listed.out,
        listed.err
    );
    has_parts(&listed.out, &["small"]);
    let beside_maps = place.run(&["maps", "--budget", "30", "--out", "out", "--list"]);
    has_parts(&beside_maps.err, &["maps: 1 file in other formats left out"]);
}

#[test]
fn maps_of_one_name_have_rows_and_curves_of_their_own() {
    let place = Place::new();
    std::fs::create_dir(place.path("other")).unwrap();
    std::fs::write(place.path("other/open.txt"), "S...\n....\n...G\n").unwrap();
    let [here, there] = ["maps/open.map", "other/open.txt"];
    let more = ["--budget", "10", "--seeds", "2", "--out", "out"];
    for maps in [&[here, there][..], &[here]] {
        let done = place.run(&[maps, &more].concat());
        done.success();
        assert!(!done.err.contains("left out"), "{}", done.err);
        let table = std::fs::read_to_string(place.path("out/success.csv")).unwrap();
        let report = std::fs::read_to_string(place.path("out/report.md")).unwrap();
        for name in ["open (6 x 6)", "open (4 x 3)"] {
            has_parts(&done.out, &[&format!("| {name} | gdg-bridge |")]);
            has_parts(&report, &[&format!("\n## {name}\n")]);
            let seeds = ["1", "2", "mean"].map(|seed| format!("{name},gdg-bridge,{seed},10,"));
            has_parts(&table, &seeds.each_ref().map(String::as_str));
        }
    }
}
