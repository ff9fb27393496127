//! Runs the real program, with or without a pseudo-terminal, and modifies checkpoints.

use std::io::{Read, Write};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, Once};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use portable_pty::{Child, CommandBuilder, MasterPty, PtySize, native_pty_system};
use signal_hook::consts::{SIGINT, SIGQUIT};

use crate::ran::ran;

/// Settings that keep a run small.
const SMALL: [&str; 6] =
    ["--set", "hidden=16", "--set", "candidates=50", "--set", "buffer_size=20000"];

/// The program in its own terminal.
pub struct Session {
    pub child: Box<dyn Child + Send + Sync>,
    pub master: Box<dyn MasterPty + Send>,
    pub keys: Box<dyn Write + Send>,
    pub screen: Arc<Mutex<vt100::Parser>>,
    /// Everything the program has written.
    pub raw: Arc<Mutex<Vec<u8>>>,
    reader: JoinHandle<()>,
    hangs_up: Arc<AtomicBool>,
    stalls: Arc<AtomicBool>,
}

/// Returns a non-zero size.
pub fn non_zero(n: u16) -> NonZero<u16> {
    NonZero::new(n).unwrap()
}

/// Returns a terminal size.
pub fn size(cols: u16, rows: u16) -> PtySize {
    PtySize { rows, cols, pixel_width: 0, pixel_height: 0 }
}

impl Session {
    pub fn start(folder: &Path, args: &[&str]) -> Self {
        Self::start_with(folder, args, &[])
    }

    /// Like [`Self::start`], with environment variables.
    pub fn start_with(folder: &Path, args: &[&str], variables: &[(&str, &str)]) -> Self {
        let program = CommandBuilder::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
        Self::start_program(program, folder, args, variables)
    }

    /// Starts an interactive shell, in which `$PROGRAM` is the program.
    pub fn start_shell(folder: &Path) -> Self {
        let mut shell = CommandBuilder::new("sh");
        shell.arg("-i");
        let program = assert_cmd::cargo::cargo_bin!("gdg-tui");
        Self::start_command(shell, folder, &[("PROGRAM", program.to_str().unwrap())])
    }

    /// Like [`Self::start`], with a limit in the form of the options of `ulimit`.
    pub fn start_with_limit(folder: &Path, args: &[&str], limit: &str) -> Self {
        let mut program = CommandBuilder::new("sh");
        program.args(["-c", &format!("ulimit {limit}; exec \"$0\" \"$@\"")]);
        program.arg(assert_cmd::cargo::cargo_bin!("gdg-tui"));
        Self::start_program(program, folder, args, &[])
    }

    fn start_program(
        mut command: CommandBuilder,
        folder: &Path,
        args: &[&str],
        variables: &[(&str, &str)],
    ) -> Self {
        command.args(args);
        // A checkpoint carries its own settings, the tour has always the same, and others none.
        let has_none = matches!(args.first(), Some(&("tour" | "runs" | "watch" | "check")));
        if !args.contains(&"--resume") && !has_none {
            command.args(SMALL);
        }
        Self::start_command(command, folder, variables)
    }

    fn start_command(
        mut command: CommandBuilder,
        folder: &Path,
        variables: &[(&str, &str)],
    ) -> Self {
        let pty = native_pty_system().openpty(size(80, 24)).unwrap();
        command.cwd(folder);
        command.env("TERM", "xterm-256color");
        // Isolate the tests from the user's own configuration and recent maps.
        for name in ["HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME"] {
            command.env(name, folder);
        }
        variables.iter().for_each(|(name, value)| command.env(name, value));
        let child = pty.slave.spawn_command(command).unwrap();
        let screen = Arc::new(Mutex::new(vt100::Parser::new(non_zero(24), non_zero(80), 0)));
        let raw = Arc::new(Mutex::new(Vec::new()));
        let mut reader = pty.master.try_clone_reader().unwrap();
        let (parser, bytes) = (screen.clone(), raw.clone());
        let hangs_up = Arc::new(AtomicBool::new(false));
        let ends = hangs_up.clone();
        let stalls = Arc::new(AtomicBool::new(false));
        let waits = stalls.clone();
        let reader = std::thread::spawn(move || {
            let mut chunk = [0; 4096];
            while let (Ok(n @ 1..), false) = (reader.read(&mut chunk), ends.load(Ordering::Relaxed))
            {
                parser.lock().unwrap().process(&chunk[..n]);
                bytes.lock().unwrap().extend(&chunk[..n]);
                while waits.load(Ordering::Relaxed) {
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
        });
        let keys = pty.master.take_writer().unwrap();
        Self { child, master: pty.master, keys, screen, raw, reader, hangs_up, stalls }
    }

    /// Has the terminal stop, or go on, to read what the program writes.
    pub fn stall(&self, stalls: bool) {
        self.stalls.store(stalls, Ordering::Relaxed);
    }

    /// Returns how often the program has written `bytes`.
    pub fn count(&self, bytes: &[u8]) -> usize {
        self.raw.lock().unwrap().windows(bytes.len()).filter(|w| *w == bytes).count()
    }

    /// Presses keys; does nothing if the program has exited.
    pub fn press(&mut self, keys: &str) {
        let _ = self.keys.write_all(keys.as_bytes()).and_then(|()| self.keys.flush());
    }

    /// Presses keys, and waits for what they show.
    pub fn press_for(&mut self, keys: &str, text: &str) {
        self.press(keys);
        self.wait_for(text);
    }

    /// Closes what shows this text.
    pub fn close(&mut self, text: &str) {
        self.press("\x1b");
        self.wait_until_gone(text);
    }

    /// Quits, without saving if that is asked.
    pub fn quit(self) -> u32 {
        self.quit_by("q", "\x1b[B\r")
    }

    /// The same by Ctrl-C.
    pub fn interrupt(self) -> u32 {
        self.quit_by("\x03", "\x03")
    }

    fn quit_by(mut self, quit: &str, confirm: &str) -> u32 {
        self.press(quit);
        self.wait_for_end_or("quit without saving");
        self.press(confirm);
        self.end()
    }

    pub fn screen_text(&self) -> String {
        self.screen.lock().unwrap().screen().contents()
    }

    pub fn wait_for(&self, text: &str) {
        self.wait_while(&format!("{text:?} did not appear"), || !self.screen_text().contains(text));
    }

    fn wait_while(&self, problem: &str, mut is: impl FnMut() -> bool) {
        let began = Instant::now();
        while is() {
            let shown = self.screen_text();
            assert!(began.elapsed() < Duration::from_mins(1), "{problem}:\n{shown}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    pub fn wait_until_gone(&self, text: &str) {
        self.wait(|session| !session.screen_text().contains(text));
    }

    pub fn wait(&self, is: impl Fn(&Self) -> bool) {
        self.wait_while("timed out", || !is(self));
    }

    /// Waits for a question that is asked only if much would be lost, or for the program to exit.
    pub fn wait_for_end_or(&mut self, text: &str) {
        let began = Instant::now();
        while !self.screen_text().contains(text) && self.child.try_wait().unwrap().is_none() {
            let shown = self.screen_text();
            assert!(began.elapsed() < Duration::from_mins(1), "neither appeared:\n{shown}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Closes the terminal like a window, and returns the program, which is still running.
    pub fn close_terminal(self) -> Box<dyn Child + Send + Sync> {
        self.hangs_up.store(true, Ordering::Relaxed);
        // The next frame ends the reader.
        self.reader.join().unwrap();
        self.child
    }

    /// Sends a signal by its name.
    pub fn signal(&self, name: &str) {
        kill(self.child.process_id().unwrap(), name);
    }

    /// Waits for the program to exit and returns its exit status.
    pub fn status(&mut self) -> u32 {
        let began = Instant::now();
        loop {
            if let Some(status) = self.child.try_wait().unwrap() {
                return status.exit_code();
            }
            if began.elapsed() > Duration::from_mins(1) {
                let shown = self.screen_text();
                self.child.kill().unwrap();
                panic!("the program did not exit:\n{shown}");
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Checks that the terminal was restored: every mode that was enabled was disabled afterwards.
    pub fn assert_terminal_restored(&self) {
        let missing = || {
            let raw = self.raw.lock().unwrap();
            let last = |sequence: &[u8]| raw.windows(sequence.len()).rposition(|w| w == sequence);
            let modes = [
                [&b"\x1b[?1049h"[..], &b"\x1b[?1049l"[..]],
                [b"\x1b[?1000h", b"\x1b[?1000l"],
                [b"\x1b[?2004h", b"\x1b[?2004l"],
                [b"\x1b[?25l", b"\x1b[?25h"],
            ];
            let is_kept =
                |[taken, back]: &[&[u8]; 2]| last(taken).is_none() || last(back) <= last(taken);
            modes.into_iter().find(is_kept).map(|[_, back]| String::from_utf8_lossy(back))
        };
        // The last output may still be in transit.
        let began = Instant::now();
        while missing().is_some() && began.elapsed() < Duration::from_secs(10) {
            std::thread::sleep(Duration::from_millis(10));
        }
        let missing = missing();
        assert!(missing.is_none(), "{missing:?} is missing");
    }

    /// Waits for the program to exit, checks that it restored the terminal, and returns its exit
    /// status.
    pub fn end(mut self) -> u32 {
        let status = self.status();
        self.assert_terminal_restored();
        status
    }
}

/// Waits until `is` holds.
pub fn wait_until(what: &str, is: impl Fn() -> bool) {
    let began = Instant::now();
    while !is() {
        assert!(began.elapsed() < Duration::from_mins(1), "{what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Returns `command` as a shell runs it after `first`.
pub fn after(first: &str, command: &Command) -> Command {
    let mut shell = Command::new("sh");
    shell.args(["-c", &format!("{first}; exec \"$0\" \"$@\"")]);
    shell.arg(command.get_program()).args(command.get_args());
    shell.current_dir(command.get_current_dir().unwrap());
    shell.envs(command.get_envs().filter_map(|(name, value)| Some((name, value?))));
    shell
}

/// Sends a signal by its name.
pub fn kill(process: u32, name: &str) {
    let sent =
        Command::new("kill").args([format!("-{name}"), process.to_string()]).status().unwrap();
    assert!(sent.success(), "kill -{name} {process}");
}

/// Returns a command for the program in `folder` without the interface, isolated from the user's
/// own configuration.
pub fn headless(folder: &Path, args: &[&str]) -> Command {
    let mut command = isolated_command(folder);
    command.arg("--no-ui").args(args);
    if !args.contains(&"--resume") {
        command.args(SMALL);
        command.args(["--set", "learning_starts=500", "--set", "graph_every_updates=100"]);
    }
    command
}

/// Returns a command for the program with its working folder and home in `folder`.
pub fn isolated_command(folder: &Path) -> Command {
    // In the background of a script, SIGINT and SIGQUIT are ignored, also by what is started. What
    // has a handler here has none there.
    static HANDLED: Once = Once::new();
    HANDLED.call_once(|| {
        let ends = Arc::new(AtomicBool::new(true));
        for signal in [SIGINT, SIGQUIT] {
            signal_hook::flag::register_conditional_default(signal, ends.clone()).unwrap();
        }
    });
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("gdg-tui"));
    command.current_dir(folder).env("NO_COLOR", "1");
    for name in ["HOME", "XDG_CONFIG_HOME", "XDG_STATE_HOME", "XDG_DATA_HOME"] {
        command.env(name, folder.join("home"));
    }
    command
}

/// Runs a command and returns its exit status, standard output and standard error.
pub fn outcome(command: &mut Command) -> (i32, String, String) {
    let done = ran(command);
    (done.status.unwrap_or(-1), done.out, done.err)
}

/// Returns all checkpoints below `folder`, sorted.
pub fn checkpoints(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(checkpoints(&path));
        } else if path.extension().is_some_and(|e| e == "safetensors") {
            found.push(path);
        }
    }
    found.sort();
    found
}
