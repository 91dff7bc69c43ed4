//! The program on a set's pictures, and what it says of them.

use super::plan::Row;
use super::render::{Rendered, STEP_DEG, VIEWS, file_name};
use anyhow::{Context as _, Result};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// What the program says of a set.
pub struct Said {
    /// `result.json`, or why there is none.
    pub result: Result<Value, String>,
    /// How long it took.
    pub seconds: f64,
}

/// The program that is measured: this build's, or the one that `GRAINRIG_BIN` names.
pub fn program() -> PathBuf {
    std::env::var_os("GRAINRIG_BIN").map_or_else(|| env!("CARGO_BIN_EXE_grainrig").into(), PathBuf::from)
}

/// Imports a set's pictures with what an operator knows, by the default configuration.
///
/// # Errors
/// Where the program cannot be started; what it refuses is an answer.
pub fn imported(row: &Row, set: &Rendered, data: &Path) -> Result<Said> {
    let session = data.join(row.name);
    if session.exists() {
        std::fs::remove_dir_all(&session)?;
    }
    std::fs::create_dir_all(data)?;
    let program = program();
    let mut command = Command::new(&program);
    command.arg("--data").arg(data).env("XDG_CONFIG_HOME", data.join(".none")).args(["--json", "import"]);
    command.arg(&set.folder).args(["--pattern", &file_name(row, "grain_*"), "--name", row.name]);
    command.args(["--step-deg", &STEP_DEG.to_string(), "--closing-view", &VIEWS.to_string()]);
    command.args(["--mm-per-px", &row.mm_per_px().to_string()]);
    if row.camera.distance_mm > 0.0 {
        command.args(["--camera-distance-mm", &row.camera.distance_mm.to_string()]);
    }
    if row.gives_empty {
        command.arg("--background").arg(set.folder.join(file_name(row, "empty")));
    }
    let start = Instant::now();
    let out = command.output().with_context(|| format!("cannot run {}", program.display()))?;
    let seconds = start.elapsed().as_secs_f64();
    let result = if out.status.success() {
        serde_json::from_slice(&out.stdout).map_err(|e| format!("no result: {e}"))
    } else {
        let text = String::from_utf8_lossy(&out.stderr);
        let lines = text.lines().skip_while(|line| !line.starts_with("error"));
        Err(lines.collect::<Vec<_>>().join(" ").trim_start_matches("error: ").to_owned())
    };
    Ok(Said { result, seconds })
}

/// Whether a result can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    /// It can.
    Good,
    /// Something is to be known.
    Doubtful,
    /// It cannot.
    Bad,
}

impl Grade {
    /// In one word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Doubtful => "doubtful",
            Self::Bad => "bad",
        }
    }
}

/// A result read.
pub struct Verdicts {
    /// Of the whole.
    pub grade: Grade,
    /// Views that are good, doubtful, bad.
    pub views: [usize; 3],
    /// Findings: slips, lost steps, another size of the step.
    pub findings: Vec<String>,
    /// Findings that are slips, or could be.
    pub slips: Vec<f64>,
    /// All warnings.
    pub warnings: Vec<String>,
}

fn list<'a>(value: &'a Value, pointer: &str) -> &'a [Value] {
    value.pointer(pointer).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

impl Verdicts {
    /// Of a result, as it judges itself.
    pub fn of(result: &Value) -> Self {
        // What nobody judged is not good.
        let mut views: [Option<Grade>; VIEWS + 1] = [None; VIEWS + 1];
        let details = list(result, "/view_details").iter().map(|v| (&v["index"], &v["quality"]["verdict"]));
        let calibrated = list(result, "/calibration/views").iter().map(|v| (&v["index"], &v["verdict"]));
        for (index, verdict) in details.chain(calibrated) {
            let grade = match verdict.as_str() {
                Some("bad") => Some(Grade::Bad),
                Some("doubtful") => Some(Grade::Doubtful),
                Some("good") => Some(Grade::Good),
                _ => None,
            };
            if let Some(view) = index.as_u64().and_then(|k| views.get_mut(k as usize)) {
                *view = grade.max(*view);
            }
        }
        let count = |grade| views.iter().filter(|v| **v == Some(grade)).count();
        let counts = [Grade::Good, Grade::Doubtful, Grade::Bad].map(count);
        let found = list(result, "/calibration/findings");
        let kind = |f: &Value| f["kind"].as_str().unwrap_or("?").to_owned();
        let degrees = |f: &Value| f["degrees"].as_f64().unwrap_or(f64::NAN);
        let is_slip = |f: &&Value| kind(f) != "step_size";
        let warnings: Vec<String> =
            list(result, "/warnings").iter().filter_map(Value::as_str).map(str::to_owned).collect();
        let grade = match result["verdict"]["verdict"].as_str() {
            Some("good") => Grade::Good,
            Some("bad") => Grade::Bad,
            _ => Grade::Doubtful,
        };
        Self {
            grade,
            views: counts,
            findings: found.iter().map(|f| format!("{} {:+.2}°", kind(f), degrees(f))).collect(),
            slips: found.iter().filter(is_slip).map(degrees).collect(),
            warnings,
        }
    }
}
