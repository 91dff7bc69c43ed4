//! The real firmware on a simulated chip (`tests/board/board.c`), whose pins are watched.

use serde_json::Value;
use std::io::{BufRead, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::OnceLock;

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
    from: BufReader<ChildStdout>,
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
        Ok(Self { child, to, from, port })
    }

    /// Has the board do something; what it says.
    pub fn tell(&mut self, command: &str) -> String {
        writeln!(self.to, "{command}").unwrap();
        let mut line = String::new();
        assert!(self.from.read_line(&mut line).unwrap() > 0, "the board ended at {command:?}");
        assert!(!line.starts_with("unknown"), "{line}");
        line
    }

    /// What the pins did.
    pub fn state(&mut self) -> Value {
        serde_json::from_str(&self.tell("state")).unwrap()
    }

    /// Where the motor truly is, microsteps.
    pub fn position(&mut self) -> i64 {
        self.state()["position"].as_i64().unwrap()
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
