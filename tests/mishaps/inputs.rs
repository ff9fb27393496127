//! What people type and bring, in the ways of many places.

use crate::command_line::typed;
use crate::*;

#[test]
fn tables_with_other_line_ends_are_continued_and_links_are_not() {
    let folder = folder();
    let path = folder.path().join("table.csv");
    let run = |args: &[&str]| {
        let args = [args, &["--eval-tasks", "1", "--threads", "1", "--csv", "table.csv"]].concat();
        outcome(&mut headless(folder.path(), &args))
    };
    assert_eq!(run(&["trap", "--max-updates", "1000", "--save", "run.safetensors"]).0, 0);
    let saved = std::fs::read_to_string(&path).unwrap().replace('\n', "\r\n");
    let resume = ["--resume", "run.safetensors", "--max-updates", "1100"];
    let later = saved.lines().last().unwrap().replace(",1000,", ",1001,");
    for more in ["", &format!("{later}\r\n"), &later] {
        std::fs::write(&path, format!("{saved}{more}")).unwrap();
        let (status, _, errors) = run(&resume);
        assert_eq!(status, 0, "{errors}");
        let table = std::fs::read_to_string(&path).unwrap();
        let added = table.strip_prefix(&saved).unwrap_or_else(|| panic!("{more:?}: {table}"));
        assert!(added.lines().count() > 0 && added.lines().all(|row| row.contains(",1100,")), "{more:?}: {added}");
    }
    std::fs::rename(&path, folder.path().join("elsewhere.csv")).unwrap();
    symlink("elsewhere.csv", &path).unwrap();
    let (status, _, errors) = run(&resume);
    assert!(status == 2 && errors.contains("is a symbolic link"), "{errors}");
}

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
    assert!(script.contains("case $line[1] in\n        (maps)") && !script.contains("$line[2]"), "{script}");
    assert!(script.contains("commands \"$@\"\n    _files\n"), "the first word may be a file: {script}");
}
