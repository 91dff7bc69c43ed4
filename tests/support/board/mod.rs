//! The real firmware on a simulated chip (`board.c`), whose pins are watched.

// Each test file uses its own part of this.
#![allow(dead_code)]

use crate::skip::{Lacking, skip};
use grainrig::session::sha256_hex;
use serde_json::Value;
use std::io::{BufRead, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Where what the tests compile lies.
fn built() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// What a command makes of these sources (files or folders below the project's root), made once for all tests. Tests of
/// several processes may want it at once: it is made beside its place and put there whole, under a name that follows from the
/// sources' bytes.
fn made(name: &str, sources: &[&str], command: impl FnOnce(&Path) -> Command) -> Result<PathBuf, String> {
    let mut bytes = Vec::new();
    for source in sources.iter().map(|s| Path::new(ROOT).join(s)) {
        let mut files: Vec<PathBuf> = match std::fs::read_dir(&source) {
            Ok(entries) => entries.map(|e| e.unwrap().path()).filter(|p| p.is_file()).collect(),
            Err(_) => vec![source],
        };
        files.sort();
        files.iter().for_each(|f| bytes.extend(std::fs::read(f).unwrap()));
    }
    let place = built().join(format!("{name}-{}", &sha256_hex(&bytes)[..16]));
    if place.exists() {
        return Ok(place);
    }
    let beside = tempfile::tempdir_in(built()).unwrap();
    let out = beside.path().join(name);
    let mut command = command(&out);
    let done = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if !done.status.success() {
        return Err(format!("{command:?}: {}", String::from_utf8_lossy(&done.stderr)));
    }
    // Another test may have been quicker: a folder that is there is not replaced, and is the same.
    match std::fs::rename(&out, &place) {
        Err(e) if !place.exists() => Err(format!("{}: {e}", place.display())),
        _ => Ok(place),
    }
}

fn c_compiler(options: &[&str], out: &Path) -> Command {
    let mut command = Command::new("cc");
    command.args(options).arg("-o").arg(out);
    command
}

/// The firmware as the board gets it.
pub fn firmware() -> Result<PathBuf, String> {
    let folder = made("firmware", &["firmware"], |out| {
        let mut command = Command::new("make");
        command.args(["-s", "-C"]).arg(format!("{ROOT}/firmware")).arg(format!("OUT={}", out.display()));
        command
    })?;
    Ok(folder.join("controller.elf"))
}

/// The firmware's frame reader as a program of this computer.
pub fn frame_reader() -> Result<PathBuf, String> {
    let sources = ["tests/support/board/frame_host.c", "firmware/frame.c"];
    made("frame_host", &["firmware", sources[0]], |out| {
        let options = ["-O1", "-Wall", "-Wextra", "-fsanitize=undefined", "-fno-sanitize-recover"];
        let mut command = c_compiler(&options, out);
        command.args(sources.map(|s| format!("{ROOT}/{s}")));
        command
    })
}

fn program() -> Result<PathBuf, String> {
    let source = "tests/support/board/board.c";
    made("board", &[source], |out| {
        let mut command = c_compiler(&["-O2"], out);
        command.arg(format!("{ROOT}/{source}")).args(["-lsimavr", "-lelf", "-lutil"]);
        command
    })
}

/// A running board.
pub struct Board {
    child: Child,
    to: ChildStdin,
    answers: Receiver<String>,
    shutter: Option<Receiver<i64>>,
    pub port: PathBuf,
}

impl Board {
    /// A board whose motor stands at `at` microsteps, with its switch closed at `switch_at` and below. `None`, with the reason on
    /// the screen, where the chip's tools are not there.
    pub fn start(at: i64, switch_at: i64) -> Option<Self> {
        match Self::started(at, switch_at) {
            Ok(board) => Some(board),
            Err(why) => {
                skip(Lacking::Tools, why);
                None
            }
        }
    }

    fn started(at: i64, switch_at: i64) -> Result<Self, String> {
        let (program, firmware) = (program()?, firmware()?);
        let mut child = Command::new(program)
            .arg(firmware)
            .args(["--at", &at.to_string(), "--switch-at", &switch_at.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(|e| e.to_string())?;
        let to = child.stdin.take().unwrap();
        let mut from = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        // The simulator says what it loads, too.
        while !line.starts_with("PTY ") {
            line.clear();
            assert!(from.read_line(&mut line).unwrap() > 0, "the board ended");
        }
        let port = PathBuf::from(line["PTY ".len()..].trim());
        let (answer, answers) = channel();
        let (closed, shutter) = channel();
        std::thread::spawn(move || listen(from, &answer, &closed));
        Ok(Self { child, to, answers, shutter: Some(shutter), port })
    }

    /// Has the board do something; what it says.
    pub fn tell(&mut self, command: &str) -> String {
        writeln!(self.to, "{command}").unwrap();
        let line = self.answers.recv().unwrap_or_else(|_| panic!("the board ended at {command:?}"));
        assert!(!line.starts_with("unknown"), "{line}");
        line
    }

    /// What the pins did.
    pub fn state(&mut self) -> Value {
        serde_json::from_str(&self.tell("state")).unwrap()
    }

    /// Where the motor truly is, microsteps.
    pub fn position(&mut self) -> i64 {
        self.tell("position").trim().parse().unwrap()
    }

    /// How long the chip has run, by its own clock: on a busy computer it is slow.
    pub fn time(&mut self) -> Duration {
        Duration::from_micros(self.tell("time").trim().parse().unwrap())
    }

    /// Where the motor is each time the shutter's contact closes, microsteps; ends with the board. For one listener.
    pub fn shutter(&mut self) -> Receiver<i64> {
        self.shutter.take().expect("somebody listens to the shutter already")
    }
}

/// Sorts what the board says into answers and what happens by itself.
fn listen(from: BufReader<ChildStdout>, answer: &Sender<String>, shutter: &Sender<i64>) {
    for line in from.lines().map_while(Result::ok) {
        // Whoever does not want to know has gone.
        match line.strip_prefix("SHUTTER ") {
            Some(position) => drop(shutter.send(position.parse().unwrap())),
            None => drop(answer.send(line)),
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
