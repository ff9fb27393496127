//! What `pip install .` installs: the command `gdg-tui`, and the module `gdg_tui`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Loads a policy, follows a plan, and says where the module is and what it needs.
const SCRIPT: &str = "
import importlib.metadata, sys
import gdg_tui
policy = gdg_tui.load_policy('exports/run.policy.safetensors')
walk = policy.walk([3, 3])
assert walk.step([5, 5]).shape == (2,) and len(walk.waypoints()) >= 1
assert policy.distance([5, 5], [3, 3]) >= 0
assert gdg_tui.__file__.startswith(sys.prefix), gdg_tui.__file__
print(importlib.metadata.version('gdg-tui'), importlib.metadata.requires('gdg-tui'))
";

fn success(output: Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
#[ignore = "needs `pip install .` in the virtual environment of the interpreter GDG_PYTHON"]
fn pip_installs_the_command_and_the_module() {
    let folder = tempfile::tempdir().unwrap();
    let python = PathBuf::from(std::env::var_os("GDG_PYTHON").expect("an interpreter"));
    let run = |program: &Path, args: &[&str]| {
        let mut command = Command::new(program);
        command.current_dir(folder.path()).env("HOME", folder.path()).args(args);
        success(command.output().unwrap())
    };
    let installed = python.with_file_name("gdg-tui");
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(run(&installed, &["--version"]), format!("gdg-tui {version}\n"));
    let small = ["--set", "hidden=16", "--set", "graph_every_updates=100"];
    let train = ["--no-ui", "fourrooms", "--max-updates", "300", "--save", "run.safetensors"];
    run(&installed, &[&train[..], &small].concat());
    run(&installed, &["export-policy", "run.safetensors", "--plans"]);
    assert_eq!(run(&python, &["-I", "-c", SCRIPT]), format!("{version} ['numpy']\n"));
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python_module.py");
    run(&python, &["-I", tests.to_str().unwrap()]);
}
