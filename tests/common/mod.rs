//! The real program on the simulated rig, for tests.

use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;

/// A finished capture.
pub struct Run {
    /// Deleted with this.
    _folder: tempfile::TempDir,
    /// The session's folder.
    pub session: PathBuf,
    /// The folder of the simulation's truth.
    pub truth: PathBuf,
    /// What `--json` printed.
    pub result: Value,
}

/// Captures a grain with this configuration (TOML).
pub fn capture(config: &str, arguments: &[&str]) -> Run {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("rig.toml"), config).unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .args(["capture", "grain", "--json", "--truth"])
        .arg(at("truth"))
        .args(arguments)
        .arg("--config")
        .arg(at("rig.toml"))
        .arg("--data")
        .arg(at("data"))
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let result = serde_json::from_slice(&out.stdout).unwrap();
    Run { session: at("data/grain"), truth: at("truth"), result, _folder: folder }
}

/// The number at a JSON pointer.
pub fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number at {pointer} in {value}"))
}
