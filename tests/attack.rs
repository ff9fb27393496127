//! Stress tests that attack the program and count their attempts. The short form runs with the
//! other tests, the long one with
//! `ATTACK=long cargo test --release --test program attack:: -- --nocapture`.

use std::collections::BTreeMap;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant, SystemTime};

use crate::ran::words;
use crate::support::{Session, checkpoints, headless, non_zero, outcome, size, wait_until};
use gdg::job::Job;
use gdg::train::Registry;
use gdg::{env, map, train};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Returns the number of attempts: `short`, or `long` in the long form.
fn times(short: usize, long: usize) -> usize {
    if std::env::var("ATTACK").is_ok_and(|form| form == "long") { long } else { short }
}

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// Seeds the random numbers of an attack; `ATTACK_SEED` overrides the seed, to reproduce a failure.
fn rng(attack: u64) -> ChaCha8Rng {
    let seed = std::env::var("ATTACK_SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(attack);
    rng
}

fn load(path: &Path) -> train::Trainer {
    train::load(path, &Registry::builtin(), 1).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn kills_while_saving_never_corrupt_a_checkpoint() {
    let (kills, folder, mut rng) = (times(6, 300), folder(), rng(1));
    let path = folder.path().join("kept.safetensors");
    let mut args = vec!["trap", "--save", "kept.safetensors", "--save-every", "0.0001"];
    let mut updates = 0;
    for _ in 0..kills {
        let mut child = headless(folder.path(), &args)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        wait_until("nothing is saved", || path.exists());
        std::thread::sleep(Duration::from_micros(rng.random_range(0..600_000)));
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().signal(), Some(9));
        let now = load(&path).counters().updates;
        assert!(now >= updates, "update {updates} was saved, and {now} is left");
        updates = now;
        args = words("--resume kept.safetensors --save kept.safetensors --save-every 0.0001");
    }
    // The next save removes what the killed programs left behind, once it is old enough to count as
    // stale.
    for left in std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()) {
        if left.extension().is_some_and(|end| end == "tmp") {
            let old = SystemTime::now() - Duration::from_mins(1);
            std::fs::File::open(left).unwrap().set_modified(old).unwrap();
        }
    }
    let stop = (updates + 1).to_string();
    args.extend(["--max-updates", &stop, "--eval-tasks", "1"]);
    assert_eq!(outcome(&mut headless(folder.path(), &args)).0, 0);
    let left: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| name == "kept.safetensors" || name == "home"), "{left:?}");
    println!("{kills} kills, {updates} updates, no checkpoint broken, nothing left behind");
}

/// Trains a small run to the last of `stops`, saving and resuming at each one; returns its
/// checkpoint.
fn trained(folder: &Path, name: &str, stops: &[u64]) -> PathBuf {
    let file = format!("{name}.safetensors");
    for (i, stop) in stops.iter().enumerate() {
        let stop = stop.to_string();
        let mut args = if i == 0 { vec!["trap", "--seed", "5"] } else { vec!["--resume", &file] };
        args.extend(["--max-updates", &stop, "--eval-tasks", "1", "--save", &file]);
        let (status, _, errors) = outcome(&mut headless(folder, &args));
        assert_eq!(status, 0, "{errors}");
    }
    folder.join(file)
}

/// Returns the state in a checkpoint, without the elapsed time.
fn contents(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut parts = train::read_saved(&std::fs::read(path).unwrap()).unwrap().state.parts();
    parts.remove("seconds").unwrap();
    parts
}

#[test]
fn runs_resumed_at_random_updates_continue_bitwise() {
    let (rounds, folder, mut rng) = (times(3, 50), folder(), rng(2));
    let straight = contents(&trained(folder.path(), "straight", &[900]));
    for round in 0..rounds {
        let mut stops: Vec<u64> =
            (0..rng.random_range(1..4)).map(|_| rng.random_range(1..900)).collect();
        stops.push(900);
        stops.sort_unstable();
        stops.dedup();
        let found = contents(&trained(folder.path(), &format!("round-{round}"), &stops));
        let differ: Vec<_> = straight
            .iter()
            .filter(|(name, bytes)| found.get(*name) != Some(*bytes))
            .map(|d| d.0)
            .collect();
        assert!(
            differ.is_empty() && found.len() == straight.len(),
            "stopped at {stops:?}: {differ:?} differ"
        );
    }
    println!("{rounds} runs stopped and resumed, all the same");
}

/// Applies random mutations: changes bytes, inserts numbers, and removes, repeats or cuts off
/// parts.
fn mutated(bytes: &[u8], rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..rng.random_range(1..6) {
        let length = bytes.len().max(1);
        let (a, b) = (rng.random_range(0..length), rng.random_range(0..length));
        let (from, to) = (a.min(b).min(bytes.len()), a.max(b).min(bytes.len()));
        match rng.random_range(0..6) {
            0 => drop(bytes.drain(from..to)),
            1 => {
                let part = bytes[from..to.min(from + 2000)].to_vec();
                bytes.splice(from..from, part);
            }
            2 => bytes.truncate(to),
            3 => {
                let number = rng.random_range(0..1000u64).to_string().into_bytes();
                bytes.splice(from..from, number);
            }
            _ => {
                if let Some(byte) = bytes.get_mut(from) {
                    *byte = rng.random();
                }
            }
        }
    }
    bytes
}

#[test]
fn mutated_maps_scenarios_and_settings_are_read_or_refused() {
    let (count, folder, mut rng) = (times(150, 1000), folder(), rng(3));
    let grid = map::builtin("trap").unwrap();
    let scenario: String =
        (0..9).map(|i| format!("0\ttrap\t53\t41\t0\t0\t{i}\t0\t{i}\n")).collect();
    let config = serde_json::to_string_pretty(&train::Preset::Default.settings()).unwrap();
    let ascii = map::print_ascii(&grid);
    let (height, width) = (grid.height(), grid.width());
    let movingai = format!("type octile\nheight {height}\nwidth {width}\nmap\n{ascii}");
    let path = folder.path().join("file");
    let mut taken = [0; 4];
    for _ in 0..count {
        for (i, text) in
            [&ascii, &movingai, &format!("version 1\n{scenario}"), &config].into_iter().enumerate()
        {
            let bytes = mutated(text.as_bytes(), &mut rng);
            std::fs::write(&path, &bytes).unwrap();
            let fine = match i {
                0 | 1 => map::load_map(&path).map(drop).map_err(|e| e.to_string()),
                2 => map::read_scenario(&path)
                    .and_then(|read| read.tasks(&grid).map(drop))
                    .map_err(|e| e.to_string()),
                _ => {
                    let overrides =
                        train::Overrides { config: Some(&path), ..train::Overrides::default() };
                    train::settings_from(train::Preset::Default, &overrides)
                        .map(drop)
                        .map_err(|e| e.to_string())
                }
            };
            match fine {
                Ok(()) => taken[i] += 1,
                Err(error) => assert!(error.contains("file") && error.len() < 2_000, "{error}"),
            }
        }
    }
    println!(
        "{count} each of maps, Moving AI maps, scenarios and settings: {taken:?} were still valid"
    );
}

#[test]
fn mutated_checkpoints_are_refused_or_can_be_trained() {
    let (count, folder, mut rng) = (times(120, 1000), folder(), rng(4));
    let good = std::fs::read(trained(folder.path(), "good", &[150])).unwrap();
    let mut taken = 0;
    for i in 0..count {
        // Half of them get a correct checksum, as an attacker would give them.
        let bytes = if i % 2 == 0 {
            mutated(&good, &mut rng)
        } else {
            train::with_changed_state(&good, |state| *state = mutated(state, &mut rng)).unwrap()
        };
        match train::from_bytes(&bytes, &Registry::builtin(), 1) {
            Ok(mut trainer) => {
                taken += 1;
                let more = trainer.counters().updates + 30;
                // Training may fail, but must neither hang nor panic.
                let began = Instant::now();
                while trainer.counters().updates < more && trainer.tick().is_ok() {
                    assert!(
                        began.elapsed() < Duration::from_mins(1),
                        "checkpoint {i} trains forever"
                    );
                }
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    println!("{count} checkpoints, {taken} were still valid");
}

/// Returns all files in a folder and its subfolders, with their contents.
fn files_and_contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = BTreeMap::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.path().is_dir() {
            all.extend(files_and_contents(&entry.path()));
        } else {
            all.insert(entry.path(), std::fs::read(entry.path()).unwrap());
        }
    }
    all
}

#[test]
fn random_keys_and_clicks_break_nothing_and_touch_no_other_files() {
    let (events, outside, mut rng) = (times(500, 5000), folder(), rng(6));
    let inside = outside.path().join("inside");
    std::fs::create_dir(&inside).unwrap();
    std::fs::write(outside.path().join("mine.txt"), "..S\n.G.\n").unwrap();
    std::fs::write(outside.path().join("mine.safetensors"), "not a checkpoint").unwrap();
    let before = std::fs::read(outside.path().join("mine.txt")).unwrap();
    let mut session = Session::start(&inside, &["trap"]);
    session.wait_for("training");
    let special = [
        "\r", "\x1b", "\t", " ", "\x7f", "\x1b[A", "\x1b[B", "\x1b[C", "\x1b[D", "\x1b[5~",
        "\x1b[6~", "\x15",
    ];
    for i in 0..events {
        let keys = match rng.random_range(0..10) {
            0..5 => char::from(rng.random_range(b' '..=b'~')).to_string(),
            5..8 => special[rng.random_range(0..special.len())].to_owned(),
            _ => {
                let (button, x, y) =
                    (rng.random_range(0..70), rng.random_range(1..90), rng.random_range(1..30));
                format!("\x1b[<{button};{x};{y}M\x1b[<{button};{x};{y}m")
            }
        };
        session.press(&keys);
        if i % 10 == 0 {
            std::thread::sleep(Duration::from_millis(5));
        }
        if let Some(status) = session.child.try_wait().unwrap() {
            // Random keys can quit the program, as a user does.
            assert!(
                status.exit_code() == 0,
                "{status:?} after {i} events:\n{}",
                session.screen_text()
            );
            session = Session::start(&inside, &["trap"]);
            session.wait_for("training");
        }
    }
    session.signal("TERM");
    // The last keys may have quit it before.
    let status = session.end();
    assert!([0, 143].contains(&status), "{status}");
    let after = files_and_contents(outside.path());
    let strangers: Vec<_> = after.keys().filter(|path| !path.starts_with(&inside)).collect();
    assert_eq!(strangers.len(), 2, "nothing new outside its folder: {strangers:?}");
    assert_eq!(std::fs::read(outside.path().join("mine.txt")).unwrap(), before);
    for path in checkpoints(&inside) {
        load(&path);
    }
    println!("{events} keys and clicks");
}

#[test]
fn the_interface_survives_resize_storms() {
    let (resizes, folder, mut rng) = (times(60, 500), folder(), rng(7));
    let session = Session::start(folder.path(), &["trap"]);
    session.wait_for("training");
    for _ in 0..resizes {
        let (cols, rows) = match rng.random_range(0..10) {
            0 => (65535, 65535),
            1 => (1, 1),
            2 => (0, 0),
            _ => (rng.random_range(1..300), rng.random_range(1..90)),
        };
        session.master.resize(size(cols, rows)).unwrap();
        let bounded = |n: u16| non_zero(n.clamp(1, 500));
        session.screen.lock().unwrap().screen_mut().set_size(bounded(rows), bounded(cols));
        std::thread::sleep(Duration::from_millis(rng.random_range(0..40)));
    }
    session.master.resize(size(80, 24)).unwrap();
    session.screen.lock().unwrap().screen_mut().set_size(non_zero(24), non_zero(80));
    session.wait_for("updates");
    session.signal("TERM");
    assert_eq!(session.end(), 143);
    println!("{resizes} sizes");
}

#[test]
fn concurrent_programs_never_save_to_the_same_file() {
    let (programs, folder) = (times(6, 40), folder());
    let done = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..programs {
            scope.spawn(|| {
                let args = words("trap --max-updates 20 --eval-tasks 1 --save same.safetensors");
                assert_eq!(outcome(&mut headless(folder.path(), &args)).0, 0);
                done.fetch_add(1, Ordering::Relaxed);
            });
        }
    });
    let found = checkpoints(folder.path());
    assert_eq!((done.into_inner(), found.len()), (programs, programs), "{found:?}");
    found.iter().for_each(|path| drop(load(path)));
    println!("{programs} concurrent programs");
}

/// Returns a program's current memory in MB, its open handles and its updates.
#[cfg(target_os = "linux")]
fn measured(session: &Session) -> Option<(f64, usize, f64)> {
    let process = format!("/proc/{}", session.child.process_id()?);
    let pages = std::fs::read_to_string(format!("{process}/statm")).ok()?;
    let pages: f64 = pages.split(' ').nth(1)?.parse().ok()?;
    let handles = std::fs::read_dir(format!("{process}/fd")).ok()?.count();
    let shown = session.screen_text();
    let updates =
        shown.split("\u{2502} updates").nth(1)?.split_whitespace().next()?.replace(',', "");
    let units = [('k', 1e3), ('M', 1e6)];
    let unit =
        units.iter().find(|(sign, _)| updates.ends_with(*sign)).map_or(1.0, |(_, unit)| *unit);
    let updates = unit * updates.trim_end_matches(char::is_alphabetic).parse::<f64>().ok()?;
    Some((pages * 4096.0 / 1e6, handles, updates))
}

/// Trains with the interface open while the map is edited, autosaved and evaluated repeatedly:
/// memory and open handles stay constant once the replay is full. Takes 20 minutes in the long
/// form.
#[cfg(target_os = "linux")]
#[test]
fn a_run_leaks_no_handles_and_a_long_one_no_memory() {
    let (rounds, folder) = (times(20, 2_400), folder());
    std::fs::write(folder.path().join("own.toml"), "autosave_minutes = 0.02\n").unwrap();
    let args = ["trap", "--ui-config", "own.toml", "--threads", "1"];
    let mut session = Session::start(folder.path(), &args);
    session.wait_for("training");
    let mut all = Vec::new();
    for round in 0..rounds {
        // Draw a wall next to the goal and undo it, then show all panes in turn.
        session.press(["e", "x", "u", "\x1b", "n", "1", "2", "3", "4", "5"][round % 10]);
        std::thread::sleep(Duration::from_millis(500));
        if round % 10 == 9 {
            // Away from the list of messages, to the pane with numbers.
            for key in ["\x1b", "1"] {
                session.press(key);
                std::thread::sleep(Duration::from_millis(300));
            }
            all.extend(measured(&session));
        }
    }
    session.signal("TERM");
    assert_eq!(session.end(), 143);
    assert!(all.len() >= rounds / 10 / 2, "{} measurements", all.len());
    for (memory, handles, updates) in all.iter().step_by((all.len() / 20).max(1)) {
        println!("{memory:.0} MB, {handles} handles, {updates:.0} updates");
    }
    // After a fifth of the time the replay is full and all buffers have their final size. Writing a
    // checkpoint takes more memory temporarily, so compare the minima.
    let fifth = all.len() / 5;
    let (first, last) = (&all[fifth], &all[all.len() - 1]);
    if rounds > 1_000 {
        let least =
            |part: &[(f64, usize, f64)]| part.iter().map(|m| m.0).fold(f64::INFINITY, f64::min);
        let most = all[fifth..].iter().map(|m| m.0).fold(0.0, f64::max);
        let (early, late) = (least(&all[fifth..2 * fifth]), least(&all[4 * fifth..]));
        assert!(
            late < 1.05 * early && most < 1.5 * early,
            "{early:.0} MB early, {late:.0} MB late, at most {most:.0} MB"
        );
        let rate =
            |part: &[(f64, usize, f64)]| (part[part.len() - 1].2 - part[0].2) / part.len() as f64;
        println!(
            "{:.0} updates a round early, {:.0} late",
            rate(&all[fifth..2 * fifth]),
            rate(&all[4 * fifth..])
        );
    }
    assert!(last.1 <= first.1 + 4, "{} handles, {} at first", last.1, first.1);
    assert!(checkpoints(folder.path()).len() <= 4, "of autosaves three are kept");
}

/// Replays the fuzzers' seeds and findings, to prevent regressions.
#[test]
fn fuzzing_seeds_are_read_or_refused() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds");
    let trap = map::builtin("trap").unwrap();
    let base = std::fs::read(folder.join("../checkpoint.safetensors")).unwrap();
    let mut count = 0;
    for (path, bytes) in files_and_contents(&folder) {
        let text = String::from_utf8_lossy(&bytes);
        match path.parent().unwrap().file_name().unwrap().to_str().unwrap() {
            "map" => drop(map::parse_map("kept", &bytes)),
            "scenario" => {
                drop(map::Scenario::parse("kept", &bytes).and_then(|found| found.tasks(&trap)));
            }
            "config" => {
                let overrides = train::Overrides { config: Some(&path), ..Default::default() };
                drop(train::settings_from(train::Preset::Default, &overrides));
                drop(gdg_tui::tui::parse_config("kept", &text));
            }
            "checkpoint" => {
                let forged = train::with_changed_state(&base, |state| *state = bytes).unwrap();
                if let Ok(mut trainer) = train::from_bytes(&forged, &Registry::builtin(), 1) {
                    (0..4).for_each(|_| drop(trainer.tick()));
                }
            }
            "data" => {
                let world = env::PointMaze::new(std::sync::Arc::new(trap.clone()), 0);
                drop(train::Dataset::read(&path, &world, &Job::default()));
            }
            other => panic!("unknown fuzz target {other}"),
        }
        count += 1;
    }
    assert!(count > 15, "the kept inputs are there: {count}");
}

#[test]
fn out_of_range_full_states_give_a_finite_arm() {
    let mut rng = rng(4);
    let mut world = env::FetchReach::new(1);
    let length = env::Environment::full_state(&world, 0).len();
    for case in 0..200 {
        let size = if case % 2 == 0 { 1e300 } else { 30.0 };
        let full: Vec<f64> = (0..length).map(|_| rng.random_range(-1.0..1.0) * size).collect();
        let world: &mut dyn env::Environment = &mut world;
        world.set_full_state(0, &full).unwrap();
        for _ in 0..20 {
            world.step(&[1.0, -1.0, f32::MAX, 0.0], &mut rng).unwrap();
            assert!(world.states().iter().all(|v| v.is_finite()), "{full:?}");
            assert!(world.full_state(0).iter().all(|v| v.is_finite()), "{full:?}");
        }
    }
}
