//! What people type and bring, in the ways of many places.

use super::command_line::typed;
use super::*;

/// Returns what a shell offers after these words.
fn bash_offers(script: &Path, words: &[&str]) -> Vec<String> {
    let (last, before) = words.split_last().unwrap();
    let asked = format!(
        "source {}; COMP_WORDS=({}); COMP_CWORD={}; _gdg__tui gdg-tui '{last}' {}; echo \"${{COMPREPLY[*]}}\"",
        script.display(),
        words.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" "),
        before.len(),
        before.last().unwrap(),
    );
    let answered = Command::new("bash").args(["--norc", "-c", &asked]).output().unwrap();
    assert!(answered.stderr.is_empty(), "{}", String::from_utf8_lossy(&answered.stderr));
    String::from_utf8_lossy(&answered.stdout).split_whitespace().map(str::to_owned).collect()
}

#[test]
fn bash_completes_maps_commands_and_their_options() {
    let folder = folder();
    let script = folder.path().join("completions.bash");
    std::fs::write(&script, typed(folder.path(), &["completions", "bash"]).1).unwrap();
    for (words, offered) in [
        (&["gdg-tui", "su"][..], &["suite"][..]),
        (&["gdg-tui", "tra"], &["trap"]),
        (&["gdg-tui", "suite", "--me"], &["--method"]),
        (&["gdg-tui", "export-policy", "--ov"], &["--overwrite"]),
        (&["gdg-tui", "fetch-reach", "--max-u"], &["--max-updates"]),
        (&["gdg-tui", "my.map", "--max-u"], &["--max-updates"]),
        (&["gdg-tui", "--preset", "tun"], &["tuned"]),
        (&["gdg-tui", "completions", "zs"], &["zsh"]),
    ] {
        assert_eq!(bash_offers(&script, words), offered, "{words:?}");
    }
}

#[test]
fn zsh_takes_the_first_word_for_the_command() {
    let folder = folder();
    let (_, script, _) = typed(folder.path(), &["completions", "zsh"]);
    assert!(
        script.contains("case $line[1] in") && !script.contains("case $line[2] in"),
        "{script}"
    );
    assert!(
        script.contains("commands \"$@\"\n    _files\n"),
        "the first word may be a file: {script}"
    );
}

#[test]
fn numbers_are_written_in_one_way_everywhere() {
    let folder = folder();
    for (written, number) in [("60,000", 60_000.0), (".5", 0.5), ("5.", 5.0), ("+300", 300.0)] {
        let line = format!("--no-ui trap --max-updates 0 --eval-tasks 1 --max-seconds {written}");
        let args = words(&line);
        let (status, _, errors) = typed(folder.path(), &args);
        assert_eq!(status, 0, "{written}: {errors}");
        let set = format!("learning_rate={written}");
        let (status, output, errors) = typed(folder.path(), &["--print-config", "--set", &set]);
        let errors = one_line(&errors);
        let is_refused =
            status == 2 && errors.contains(&format!("learning_rate cannot be {number:?}"));
        assert!(
            is_refused || status == 0 && output.contains(&format!("\"learning_rate\": {number:?}")),
            "{errors}"
        );
        std::fs::write(
            folder.path().join("settings.json"),
            format!("{{\"learning_rate\": \"{written}\"}}"),
        )
        .unwrap();
        assert_eq!(
            typed(folder.path(), &["--print-config", "--config", "settings.json"]).0,
            status,
            "{written}"
        );
    }
    for args in [
        &["--no-ui", "trap", "--max-seconds", "60.000"][..],
        &["--print-config", "--set", "learning_rate=60.000"],
        &["--print-config", "--set", "batch_size=60.000"],
    ] {
        let (status, _, errors) = typed(folder.path(), args);
        assert!(
            status == 2 && one_line(&errors).contains("could mean 60 or 60000"),
            "{args:?}: {errors}"
        );
    }
    let (status, _, errors) =
        typed(folder.path(), &["--no-ui", "trap", "--max-updates", "1e99999999999"]);
    assert!(status == 2 && errors.contains("is too large a number"), "{errors}");
}

#[test]
fn messages_say_what_was_meant() {
    let folder = folder();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("list.json", b"[1, 2]");
    write("ros.yaml", b"image: floor.pgm\nresolution: 0.05\n");
    write("empty.map", b"");
    for (args, part) in [
        (
            &["--no-ui", "trap", "city"][..],
            "one map is trained, and 'city' is one more: gdg-tui suite",
        ),
        (&["--no-ui", "a.map", "b.map"], "'b.map' is one more"),
        (&["--no-ui", "trap", "suite"], "cannot be used with"),
        (&["--no-ui", "TRAP"], "did you mean trap?"),
        (&["--no-ui", "SUITE"], "did you mean suite?"),
        (&["--print-config", "--set", "HIDDEN=3"], "did you mean hidden?"),
        (&["--no-ui", "trap", "--method", "GDG"], "'gdg'"),
        (&["check", "ros.yaml"], "ros.yaml:1:8"),
        (&["check", "empty.map"], "is empty"),
        (&["--print-config", "--config", "list.json"], "expected an object of settings"),
    ] {
        let (status, _, errors) = typed(folder.path(), args);
        assert!(status == 2 && one_line(&errors).contains(part), "{args:?}: {errors}");
    }
}

#[test]
fn all_readers_of_checkpoints_say_the_same_of_one_that_was_cut_off() {
    let folder = folder();
    let bytes = std::fs::read(checkpoint(folder.path())).unwrap();
    let header = 8 + u64::from_le_bytes(*bytes.first_chunk().unwrap()) as usize;
    let size = "is damaged: its size differs from what its header says";
    for (length, why) in
        [(bytes.len() - 1, size), (header, size), (header / 2, size), (0, "is empty")]
    {
        std::fs::write(folder.path().join("cut.safetensors"), &bytes[..length]).unwrap();
        for args in [
            &["--no-ui", "--resume", "cut.safetensors"][..],
            &["export-data", "cut.safetensors"],
            &["export-policy", "cut.safetensors"],
        ] {
            let (status, _, errors) = typed(folder.path(), args);
            assert!(status == 2 && one_line(&errors).contains(why), "{length} {args:?}: {errors}");
        }
        let (status, _, errors) = typed(folder.path(), &["runs", "."]);
        let line = errors.lines().find(|line| line.contains("cut")).unwrap();
        assert!(status == 0 && line.contains(why), "{length}: {line}");
    }
}

#[test]
fn a_file_called_like_a_built_in_map_is_not_blamed_for_it() {
    let folder = folder();
    std::fs::write(folder.path().join("trap"), "#..\n#..\n").unwrap();
    let (status, _, errors) =
        typed(folder.path(), &["--no-ui", "trap", "--max-updates", "0", "--eval-tasks", "1"]);
    assert!(status == 0 && !errors.contains("warning"), "{errors}");
    let (_, facts, _) = typed(folder.path(), &["check", "./trap"]);
    assert!(facts.contains("size:       3 x 2"), "{facts}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_limit_of_the_address_space_is_called_that() {
    let folder = folder();
    let program = headless(folder.path(), &words("trap --max-updates 0 --threads 1"));
    let (status, _, errors) = outcome(&mut after("ulimit -v 750000", &program));
    let errors = one_line(&errors);
    assert!(status == 2 && errors.contains("limit of address space (ulimit -v)"), "{errors}");
}
