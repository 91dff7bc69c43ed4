//! `grainrig compress`, killed as by a power failure, and the same command again.

use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Stdio};
use tempfile::TempDir;

/// Some thousand elements to a force: seconds.
const COMMAND: [&str; 9] = [
    "compress",
    "--sphere-diameter-mm",
    "0.8",
    "--size-mm",
    "0.12",
    "--size-at-contact-mm",
    "0.06",
    "--to-force-n",
    "12",
];

/// Waits for a moment of a running command.
type Wait = fn(&mut Running);

struct Running {
    child: Child,
    lines: BufReader<ChildStderr>,
    out: PathBuf,
}

fn command(lab: &TempDir, out: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_grainrig"));
    command.current_dir(lab.path()).args(COMMAND).args(["--out", out]);
    command
}

fn start(lab: &TempDir, out: &str) -> Running {
    let mut child = command(lab, out).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(child.stderr.take().unwrap());
    Running { child, lines, out: lab.path().join(out) }
}

/// Runs the command to its end.
fn finish(lab: &TempDir, out: &str) -> String {
    let ran = command(lab, out).output().unwrap();
    let said = String::from_utf8(ran.stderr).unwrap();
    assert!(ran.status.success(), "{said}");
    said
}

impl Running {
    /// Waits for a line that says so; whether it came before the end.
    fn says(&mut self, part: &str) -> bool {
        self.lines.by_ref().lines().map(Result::unwrap).any(|line| line.contains(part))
    }

    /// Waits until so many per cent are done; whether that came before the end.
    fn reaches(&mut self, percent: f64) -> bool {
        self.lines.by_ref().lines().map(Result::unwrap).any(|line| done(&line) >= percent)
    }

    /// Waits until the folder has this file, or the program has ended.
    fn wrote(&mut self, file: &str) {
        while !self.out.join(file).exists() && self.child.try_wait().unwrap().is_none() {
            std::thread::yield_now();
        }
    }

    /// As a power failure.
    fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Ctrl-C: it writes a checkpoint and what results there are.
    fn interrupt(mut self) {
        let pid = rustix::process::Pid::from_raw(self.child.id() as i32).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
        while self.says("") {}
        assert!(self.child.wait().unwrap().success());
    }
}

/// What a line says is done, per cent: `50 %: …`, `going on from the checkpoint at 50 %`; 0 where it says nothing.
fn done(line: &str) -> f64 {
    let figure = line.split_once(" %").and_then(|(before, _)| before.rsplit(' ').next());
    figure.and_then(|f| f.parse().ok()).unwrap_or(0.0)
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .filter(|n| !n.starts_with("state"))
        .collect();
    names.sort();
    names
}

/// Asserts that what came out is what comes out without a kill, but for the time that it took.
fn assert_same(lab: &TempDir, out: &str) {
    let (whole, part) = (lab.path().join("whole"), lab.path().join(out));
    assert_eq!(names(&part), names(&whole), "{out}: nothing is missing and nothing is left over");
    for name in ["curve.csv", "stages.pvd", "stage_01.vtu", "stage_08.vtu", "abaqus.inp", "curve.svg"] {
        let read = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert!(read(&part) == read(&whole), "{out}/{name}");
    }
}

#[test]
fn killed_at_any_moment_the_same_command_comes_to_the_same_bytes() {
    let lab = TempDir::new().unwrap();
    finish(&lab, "whole");
    // Before the mesh is there; once it is; while plates move; while results are written.
    let moments: [(&str, Wait); 7] = [
        ("asked", |r| r.wrote("asked.json")),
        ("meshed", |r| r.wrote("run.json")),
        ("began", |r| assert!(r.says("tetrahedra"))),
        ("moved", |r| assert!(r.reaches(1.0))),
        ("staged", |r| r.wrote("stage_02.png")),
        ("far", |r| assert!(r.reaches(85.0))),
        ("written", |r| r.wrote("curve.csv")),
    ];
    for (out, wait) in moments {
        let mut running = start(&lab, out);
        wait(&mut running);
        running.kill();
        finish(&lab, out);
        assert_same(&lab, out);
    }
}

#[test]
fn killed_again_and_again_it_goes_on_from_its_checkpoint_each_time() {
    let lab = TempDir::new().unwrap();
    finish(&lab, "whole");
    let mut running = start(&lab, "part");
    assert!(running.reaches(25.0));
    // Such a small one has no checkpoint by itself before its end.
    running.interrupt();
    for percent in [35.0, 50.0, 65.0] {
        let mut running = start(&lab, "part");
        assert!(running.says("going on from the checkpoint at"));
        assert!(running.reaches(percent));
        running.kill();
    }
    let said = finish(&lab, "part");
    let from = said.lines().find(|line| line.contains("going on from the checkpoint at")).map_or(0.0, done);
    assert!(from >= 25.0, "{said}");
    let first = said.lines().find(|line| line.contains(" %: ")).map_or(0.0, done);
    assert!(first >= from, "what was done is not done again: {said}");
    assert_same(&lab, "part");
}
