//! Records of `--no-ui` against their schema and its page, and the page's jq lines.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

use crate::ran::{SMALL, in_folder, isolated, ran, words};
use serde_json::Value;

const SCHEMA: &str = include_str!("../docs/records.schema.json");
const PAGE: &str = include_str!("../docs/records.md");

/// Runs without the interface; returns the records as text.
fn recorded(folder: &Path, args: &[&str]) -> String {
    let done = in_folder(folder, &[&["--no-ui"], args, &SMALL, &["--eval-tasks", "2"]].concat());
    done.success().to_owned()
}

/// Returns what is wrong with `value` by those rules of JSON Schema that ours uses. Stricter than
/// the schema, which lets programs ignore fields of later versions: all fields must be described.
fn fault(value: &Value, schema: &Value, root: &Value) -> Option<String> {
    let within = |value: &Value, schema: &Value| fault(value, schema, root);
    let broken = |(rule, wanted): (&String, &Value)| match rule.as_str() {
        "$schema" | "$defs" | "title" | "description" | "additionalProperties" => None,
        "$ref" => within(
            value,
            root.pointer(wanted.as_str().unwrap().strip_prefix('#').unwrap()).unwrap(),
        ),
        "oneOf" | "anyOf" => {
            let faults = wanted.as_array().unwrap().iter().map(|one| within(value, one));
            let faults: Vec<_> = faults.collect();
            let fitting = faults.iter().filter(|fault| fault.is_none()).count();
            (fitting != 1).then(|| format!("fits {fitting} of {faults:?}"))
        }
        "items" => value.as_array().unwrap().iter().find_map(|item| within(item, wanted)),
        "properties" => value.as_object()?.iter().find_map(|(name, own)| match wanted.get(name) {
            Some(schema) => within(own, schema).map(|fault| format!("{name}: {fault}")),
            None => Some(format!("{name} is not described")),
        }),
        _ => (!is_met(value, rule, wanted)).then(|| format!("{value}: {rule} is {wanted}")),
    };
    schema.as_object().unwrap().iter().find_map(broken)
}

/// Whether `value` meets a rule about itself alone.
fn is_met(value: &Value, rule: &str, wanted: &Value) -> bool {
    let number = Value::as_f64;
    match rule {
        "const" => value == wanted,
        "enum" => wanted.as_array().unwrap().contains(value),
        "minimum" => number(value).is_none_or(|value| value >= number(wanted).unwrap()),
        "maximum" => number(value).is_none_or(|value| value <= number(wanted).unwrap()),
        "required" => {
            let mut names = wanted.as_array().unwrap().iter();
            names.all(|name| value.get(name.as_str().unwrap()).is_some())
        }
        "type" => {
            let types = wanted.as_array().map_or_else(|| vec![wanted], |all| all.iter().collect());
            types.iter().any(|name| match name.as_str().unwrap() {
                "integer" => value.is_u64() || value.is_i64(),
                "number" => value.is_number(),
                "string" => value.is_string(),
                "boolean" => value.is_boolean(),
                "null" => value.is_null(),
                "array" => value.is_array(),
                "object" => value.is_object(),
                name => panic!("type {name}"),
            })
        }
        rule => panic!("rule {rule}"),
    }
}

#[test]
fn records_are_as_their_schema_says() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("room.txt", "S.....\n......\n.....G\n");
    write("closed.txt", "S..#..\n......\n...#.G\n");
    let saving = words(
        "room.txt --max-updates 1000 --edit-at 500:closed.txt --save \
        a.safetensors",
    );
    let runs = [
        recorded(folder.path(), &saving),
        recorded(
            folder.path(),
            &["room.txt", "--method", "her", "--max-updates", "5", "--threads", "1"],
        ),
        recorded(folder.path(), &["room.txt", "--method", "random", "--max-updates", "5"]),
        recorded(folder.path(), &["fetch-reach", "--method", "gdg", "--max-updates", "2"]),
    ];
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    assert!(!SCHEMA.contains("\"additionalProperties\": false"), "fields may be added");
    let mut events = BTreeSet::new();
    for line in runs.iter().flat_map(|run| run.lines()) {
        let record: Value = serde_json::from_str(line).unwrap();
        assert_eq!(fault(&record, &schema, &schema), None, "{line}");
        events.insert(record["event"].as_str().unwrap().to_owned());
        let mut other = record.clone();
        other["unknown"] = 1.into();
        assert!(fault(&other, &schema, &schema).is_some());
        let mut other = record;
        other["updates"] = "many".into();
        assert!(fault(&other, &schema, &schema).is_some());
    }
    let start: Value = serde_json::from_str(runs[0].lines().next().unwrap()).unwrap();
    let edit = start["edit_at"][0].as_str().unwrap();
    assert!(edit.starts_with("500:6 x 3, goal radius 1, ") && start["eval_tasks"] == 2, "{start}");
    // A setting that changes nothing with the method is a warning.
    let all = ["edit", "end", "evaluation", "progress", "saved", "start", "warning"];
    assert_eq!(events.into_iter().collect::<Vec<_>>(), all, "all but recoveries");
}

#[test]
fn the_page_lists_every_field() {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    for (name, object) in schema["$defs"].as_object().unwrap() {
        let section = PAGE.split(&format!("\n### {name}\n")).nth(1).unwrap();
        let section = section.split("\n### ").next().unwrap();
        for (field, about) in object["properties"].as_object().unwrap() {
            let row = section.lines().find(|line| line.starts_with(&format!("| `{field}` |")));
            let what = about["description"].as_str().unwrap_or_default();
            assert!(field == "event" || row.unwrap().contains(what), "{name}.{field}: {what}");
        }
    }
}

#[test]
#[ignore = "needs jq"]
fn the_lines_for_jq_work() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("room.txt"), "S...\n...G\n").unwrap();
    let run = ["room.txt", "--max-updates", "1500", "--eval-every-updates", "500"];
    std::fs::write(folder.path().join("run.jsonl"), recorded(folder.path(), &run)).unwrap();
    let lines: Vec<&str> = PAGE.lines().filter(|line| line.starts_with("jq ")).collect();
    let answers: Vec<String> = lines
        .iter()
        .map(|line| {
            let output =
                Command::new("sh").args(["-c", line]).current_dir(folder.path()).output().unwrap();
            let problem = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(output.status.success() && problem.is_empty(), "{line}: {problem}");
            String::from_utf8(output.stdout).unwrap()
        })
        .collect();
    let [over_updates, best, first, by_distance, ends] = &answers[..] else {
        panic!("five lines: {lines:?}")
    };
    let starts: Vec<&str> =
        over_updates.lines().map(|line| line.split('\t').next().unwrap()).collect();
    assert_eq!(starts, ["500", "1000", "1500"], "{over_updates}");
    let best: Value = serde_json::from_str(best).unwrap();
    assert!(best["planned"].is_number() && best["updates"].as_u64().unwrap() <= 1500, "{best}");
    assert!(first.trim().parse::<u64>().is_ok_and(|updates| updates <= 1500), "{first}");
    assert!(by_distance.lines().all(|line| line.split(',').count() == 2), "{by_distance}");
    assert!(ends.starts_with("run.jsonl: max-updates after 1500 updates, "), "{ends}");
}

#[test]
#[ignore = "needs Python with numpy (GDG_PYTHON), and those of tensorboard, mlflow, trackio and wandb that are to be tried"]
fn records_are_logged_where_people_look() {
    let folder = tempfile::tempdir().unwrap();
    let keep = ["--save", "a.safetensors", "--eval-every-updates", "100"];
    for (name, of) in [
        ("a", ["fourrooms", "--max-updates", "200"]),
        ("b", ["--resume=a.safetensors", "--max-updates", "400"]),
    ] {
        let small = if name == "a" { &SMALL[..] } else { &[] };
        let all = [&["--no-ui", "--eval-tasks", "2"], &of[..], &keep, small].concat();
        let done = in_folder(folder.path(), &all);
        std::fs::write(folder.path().join(name).with_extension("jsonl"), done.success()).unwrap();
    }
    let suite = words("suite fourrooms --budget 200 --eval-tasks 2 --out .");
    in_folder(folder.path(), &[&suite[..], &SMALL].concat()).success();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let python = std::env::var_os("GDG_PYTHON").unwrap_or_else(|| "python3".into());
    let mut command = isolated(Command::new(python), folder.path());
    command.arg("-B").arg(root.join("tests/logged.py")).arg(".");
    command.env("PYTHONPATH", root.join("python"));
    println!("{}", ran(command).success());
}
