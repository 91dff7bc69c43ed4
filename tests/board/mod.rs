//! The real firmware on a simulated chip (`board.c`), whose pins are watched.

// Each test file uses its own part of this.
#![allow(dead_code)]

use serde_json::Value;
use std::io::{BufRead, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Where what the tests compile lies.
fn built() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

fn compiled(command: &mut Command) -> Result<(), String> {
    let done = command.output().map_err(|e| format!("{command:?}: {e}"))?;
    if done.status.success() {
        return Ok(());
    }
    Err(format!("{command:?}: {}", String::from_utf8_lossy(&done.stderr)))
}

/// The firmware as the board gets it, compiled once for all tests of this program.
pub fn firmware() -> Result<PathBuf, String> {
    static DONE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    DONE.get_or_init(|| {
        let out = built().join("firmware");
        compiled(
            Command::new("make")
                .args(["-s", "-C"])
                .arg(format!("{ROOT}/firmware"))
                .arg(format!("OUT={}", out.display())),
        )?;
        Ok(out.join("controller.elf"))
    })
    .clone()
}

/// The firmware's frame reader as a program of this computer.
pub fn frame_reader() -> Result<PathBuf, String> {
    let out = built().join("frame_host");
    let sources = ["tests/board/frame_host.c", "firmware/frame.c"].map(|s| format!("{ROOT}/{s}"));
    compiled(
        Command::new("cc")
            .args(["-O1", "-Wall", "-Wextra", "-fsanitize=undefined", "-fno-sanitize-recover", "-o"])
            .arg(&out)
            .args(sources),
    )?;
    Ok(out)
}

fn program() -> Result<PathBuf, String> {
    static DONE: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    DONE.get_or_init(|| {
        let out = built().join("board");
        let source = format!("{ROOT}/tests/board/board.c");
        compiled(
            Command::new("cc")
                .args(["-O2", "-o"])
                .arg(&out)
                .arg(source)
                .args(["-lsimavr", "-lelf", "-lutil"]),
        )?;
        Ok(out)
    })
    .clone()
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
                println!("skipped: {why}");
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
