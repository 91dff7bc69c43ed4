//! The whole way from a recorded session to its mesh, by parts: 26 pictures of 18 megapixels on the simulated rig, through the real
//! program, to some 630,000 tetrahedra. Run: `cargo bench --bench whole` (two minutes; the first time a session is captured).
//!
//! The yardstick is what no program can do without: the entropy decoding of all pictures, by a general decoder, on the same cores.

#[allow(dead_code)]
mod common;

use rayon::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Largest circumradius of a facet, mm.
const SURFACE_MM: &str = "0.0135";
/// Times that the way is gone.
const RUNS: usize = 5;
/// What a run states of its time, in its order; silhouettes are added up over the threads.
const PARTS: [&str; 4] = ["silhouette", "calibrate", "hull", "mesh"];
/// The process's memory is read this often.
const LOOK: Duration = Duration::from_millis(5);

fn main() {
    let data = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("whole");
    std::fs::create_dir_all(&data).expect("a folder");
    if !data.join("grain/products/result.json").exists() {
        let _ = std::fs::remove_dir_all(data.join("grain"));
        let config = data.join("config.toml");
        std::fs::write(&config, "[plan]\nsettle_ms = 0\n").expect("a configuration");
        let config = config.to_str().expect("a path in Unicode");
        ran(&data, &["--config", config, "capture", "grain", "--quality", "label"]);
    }
    let frames: Vec<Vec<u8>> = (std::fs::read_dir(data.join("grain/frames")).expect("the pictures"))
        .map(|entry| std::fs::read(entry.expect("a picture").path()).expect("a picture"))
        .collect();
    let decoded = common::median_s(|| {
        frames.par_iter().map(|bytes| image::load_from_memory(bytes).expect("a picture").width()).sum::<u32>()
    });
    println!("{} pictures decoded whole: {:.2} s", frames.len(), decoded);

    let args = ["--json", "reconstruct", "grain", "--surface-size-mm", SURFACE_MM, "--no-pictures"];
    let mut all: Vec<(f64, Value, f64)> = (0..RUNS).map(|_| ran(&data, &args)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (seconds, result, memory_mb) = &all[RUNS / 2];
    for part in PARTS {
        if let Some(s) = result["timing_s"][part].as_f64() {
            println!("{part:<14} {s:>8.2} s {:>8.2} × decoding", s / decoded);
        }
    }
    println!(
        "{:<14} {seconds:>8.2} s {:>8.2} × decoding, {memory_mb:.0} MB at most, {} tetrahedra",
        "the process",
        seconds / decoded,
        result["mesh"]["tetrahedra"]
    );
}

/// Runs the program to its end: seconds, what it printed, and its memory at most, MB.
fn ran(data: &Path, args: &[&str]) -> (f64, Value, f64) {
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .arg("--data")
        .arg(data)
        .args(args)
        .env("XDG_CONFIG_HOME", data.join("none"))
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program");
    let id = child.id();
    let watch = std::thread::spawn(move || {
        let mut most = 0.0_f64;
        while let Some(now) = common::most_memory_mb_of(id) {
            most = most.max(now);
            std::thread::sleep(LOOK);
        }
        most
    });
    let mut text = String::new();
    std::io::Read::read_to_string(child.stdout.as_mut().expect("its output"), &mut text).expect("its output");
    let ended = child.wait().expect("its end");
    assert!(ended.success(), "{args:?}: {text}");
    let seconds = start.elapsed().as_secs_f64();
    (seconds, serde_json::from_str(&text).unwrap_or_default(), watch.join().expect("its memory"))
}
