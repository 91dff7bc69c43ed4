//! The real program on small, quick pictures, in a folder that is gone afterwards.

// Each test file uses its own part of this.
#![allow(dead_code)]

use grainrig::rig::simulated::{self, Settings};
use grainrig::rig::{Camera as _, RotationStage as _};
use grainrig::session::{Recording, sha256_hex};
use grainrig_core::geometry::Angle;
use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use tempfile::TempDir;

/// Views of the small plan: four that carve, 45° apart, and one at 180°.
pub const VIEWS: usize = 5;
/// Size of the small pictures, pixels.
pub const SIZE: [u32; 2] = [324, 216];
/// Size of their pixels, mm.
pub const MM_PER_PX: f64 = 0.009;

/// A configuration for pictures that are computed in a fraction of a second.
pub const SMALL: &str = "\
[plan]
views = 4
steps_per_view = 50
settle_ms = 0
[optics]
mm_per_px = 0.009
[hull]
voxel_mm = 0.03
[mesh]
surface_size_mm = 0.12
[simulated]
width = 324
height = 216
mm_per_px = 0.009
wobble_px = 0.0
noise_sd = 1.0
";

/// A folder with a data folder in it.
pub struct Lab {
    dir: TempDir,
}

impl Lab {
    pub fn new() -> Self {
        let lab = Self { dir: tempfile::tempdir().unwrap() };
        lab.write("small.toml", SMALL);
        lab
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// The folder of a session.
    pub fn session(&self, name: &str) -> PathBuf {
        self.path("data").join(name)
    }

    /// What the session's journal says.
    pub fn recording(&self, name: &str) -> Recording {
        Recording::read(&self.session(name)).unwrap()
    }

    /// Writes a file; its path as an argument.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, bytes).unwrap();
        path.display().to_string()
    }

    /// The small configuration with a line of one section changed or added: `("plan", "retakes = 0")`.
    pub fn config(&self, changes: &[(&str, &str)]) -> String {
        let mut table: toml::Table = SMALL.parse().unwrap();
        for (section, line) in changes {
            let added: toml::Table = line.parse().unwrap();
            let at = table.entry(*section).or_insert_with(|| toml::Table::new().into());
            at.as_table_mut().unwrap().extend(added);
        }
        self.write("changed.toml", toml::to_string(&table).unwrap())
    }

    /// The program with these arguments, in this folder.
    pub fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_grainrig"));
        command.current_dir(self.dir.path()).arg("--data").arg(self.path("data")).args(args);
        quiet(&mut command, self.dir.path());
        command.stdin(Stdio::null());
        command
    }

    /// Runs the program to its end.
    pub fn run(&self, args: &[&str]) -> Ran {
        Ran::from(&mut self.command(args))
    }

    /// Captures a session with the small configuration.
    pub fn capture(&self, name: &str) -> Ran {
        self.run(&["--config", "small.toml", "capture", name])
    }

    /// A capture that is under way.
    pub fn start(&self, args: &[&str]) -> Running {
        let mut command = self.command(args);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let lines = BufReader::new(child.stderr.take().unwrap());
        Running { child, lines, said: String::new() }
    }

    /// A folder of photographs as the small plan takes them.
    pub fn photos(&self, folder: &str) -> PathBuf {
        for (n, bytes) in pictures().iter().enumerate() {
            self.write(&format!("{folder}/photo_{n}.jpg"), bytes);
        }
        self.path(folder)
    }

    /// Imports a folder of photographs.
    pub fn import(&self, folder: &str, more: &[&str]) -> Ran {
        let known = [
            "--config",
            "small.toml",
            "import",
            folder,
            "--step-deg",
            "45",
            "--mm-per-px",
            "0.009",
            "--closing-view",
            "4",
        ];
        self.run(&[&known, more].concat())
    }

    /// Hash of every file in a session's folder of products.
    pub fn products(&self, name: &str) -> BTreeMap<String, String> {
        let folder = self.session(name).join("products");
        files(&folder).into_iter().map(|f| (f.clone(), sha256_hex(&read(&folder.join(f))))).collect()
    }

    /// Asserts that every file of a session is as recorded.
    pub fn assert_sound(&self, name: &str) {
        self.run(&["verify", name]).succeeds();
    }
}

/// Keeps what the developer's own environment says from a program: its settings, and the account's configuration.
pub fn quiet(command: &mut Command, home: &Path) {
    for name in ["GRAINRIG_LOG", "GRAINRIG_LOG_FORMAT", "GRAINRIG_DATA", "GRAINRIG_CONFIG", "XDG_CONFIG_HOME"]
    {
        command.env_remove(name);
    }
    command.env("HOME", home);
}

/// The names in a folder, sorted.
pub fn files(folder: &Path) -> Vec<String> {
    let entry = |e: std::io::Result<std::fs::DirEntry>| e.unwrap().file_name().into_string().unwrap();
    let mut names: Vec<String> = std::fs::read_dir(folder).unwrap().map(entry).collect();
    names.sort();
    names
}

/// A file's bytes.
pub fn read(path: &Path) -> Vec<u8> {
    std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The small plan's photographs, taken once.
pub fn pictures() -> &'static [Vec<u8>] {
    static TAKEN: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    TAKEN.get_or_init(|| {
        let [width, height] = SIZE.map(|s| s as usize);
        let settings = Settings { width, height, mm_per_px: MM_PER_PX, ..Settings::default() };
        let (mut stage, mut camera, _) = simulated::open(&settings).unwrap();
        let mut take = |deg| {
            stage.move_to(Angle::from_deg(deg)).unwrap();
            camera.capture().unwrap().bytes
        };
        [0.0, 45.0, 90.0, 135.0, 180.0].map(&mut take).into()
    })
}

/// A program that has ended.
#[derive(Debug)]
pub struct Ran {
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Ran {
    pub fn from(command: &mut Command) -> Self {
        let out = command.output().unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Self::of(out.status.code(), text(out.stdout), text(out.stderr))
    }

    /// What a program that ran elsewhere came to.
    pub fn of(code: Option<i32>, stdout: String, stderr: String) -> Self {
        let ran = Self { code, stdout, stderr };
        assert!(!ran.stderr.contains("panicked"), "{ran:?}");
        // It was not a terminal that this went to.
        assert!(!ran.stderr.contains('\x1b'), "{ran:?}");
        ran
    }

    #[track_caller]
    pub fn succeeds(self) -> Self {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        self
    }

    /// Asserts the exit code, and that the error has all these parts.
    #[track_caller]
    pub fn fails(self, code: i32, parts: &[&str]) -> Self {
        assert_eq!(self.code, Some(code), "{}{}", self.stdout, self.stderr);
        for part in parts {
            assert!(self.stderr.contains(part), "{part:?} is missing from: {}", self.stderr);
        }
        self
    }

    /// The one object on standard output.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("{e}: {}", self.stdout))
    }
}

/// A program that is still at work.
pub struct Running {
    child: Child,
    lines: BufReader<std::process::ChildStderr>,
    said: String,
}

impl Running {
    /// Waits for the next line on standard error; `None` at the end.
    pub fn next_line(&mut self) -> Option<String> {
        let mut line = String::new();
        let read = self.lines.read_line(&mut line).unwrap();
        self.said.push_str(&line);
        (read > 0).then_some(line)
    }

    /// Waits for a line that begins so.
    pub fn wait_for(&mut self, beginning: &str) {
        while let Some(line) = self.next_line() {
            if line.starts_with(beginning) {
                return;
            }
        }
        panic!("no line begins with {beginning:?}: {}", self.said);
    }

    /// Its process.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn interrupt(&self) {
        let pid = rustix::process::Pid::from_raw(self.child.id() as i32).unwrap();
        rustix::process::kill_process(pid, rustix::process::Signal::INT).unwrap();
    }

    /// Ends the program as a power failure would, and waits until it is gone.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits for the end.
    pub fn end(mut self) -> Ran {
        self.lines.read_to_string(&mut self.said).unwrap();
        let code = self.child.wait().unwrap().code();
        Ran::of(code, String::new(), self.said)
    }
}
