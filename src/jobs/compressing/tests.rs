//! Checkpoints, on a clock of the test's own.

use super::{Claim, CompressInput, CompressRequest, CompressSettings, Compression, JobError, Placing, STATE};
use std::cell::Cell;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;

/// A ball in a folder, claimed and meshed, or gone on with.
fn claimed(folder: &Path, placing: &Placing, settings: &CompressSettings) -> Result<Compression, JobError> {
    Claim::new(folder, CompressInput::Sphere(0.8), placing, settings)?.build(&mut |_, _| {})
}

/// A ball of some hundred elements, pressed in less than a second.
fn begin(folder: &Path) -> Compression {
    let sizes = (Some(0.2), Some(0.15));
    let request = CompressRequest {
        size_mm: sizes.0,
        size_at_contact_mm: sizes.1,
        to_force_n: Some(4.0),
        ..CompressRequest::default()
    };
    let settings = request.settings().unwrap();
    claimed(folder, &request.placing(), &settings).unwrap()
}

fn run(compression: &mut Compression) -> bool {
    compression.run(&AtomicBool::new(false), &mut |_| {}).unwrap().finished
}

fn curve(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("curve.csv")).unwrap()
}

/// The computing time that the checkpoint in a folder holds; nought where there is none.
fn kept(folder: &Path) -> Duration {
    let Ok(bytes) = std::fs::read(folder.join(STATE)) else { return Duration::ZERO };
    Duration::from_secs_f64(f64::from_le_bytes(*bytes.first_chunk().unwrap()))
}

#[test]
fn whenever_it_is_killed_it_loses_at_most_twenty_seconds_and_a_piece_and_comes_to_the_same_bits() {
    let lab = TempDir::new().unwrap();
    let (whole, part, copy) = (lab.path().join("whole"), lab.path().join("part"), lab.path().join("copy"));
    assert!(run(&mut begin(&whole)));
    // A slow computer: a piece of work takes seven seconds.
    let piece = Duration::from_secs(7);
    let (clock, pieces, most_lost) = (Cell::new(Duration::ZERO), Cell::new(0), Cell::new(Duration::ZERO));
    let mut killed_in_a_sample = None;
    let mut compression = begin(&part);
    let now = || {
        // The computer is about to die: what is on the disk is all that there will be.
        let lost = (clock.get() + piece).saturating_sub(kept(&part));
        most_lost.set(most_lost.get().max(lost));
        pieces.set(pieces.get() + 1);
        if pieces.get() == 40 && kept(&part) > Duration::ZERO {
            std::fs::create_dir(&copy).unwrap();
            for file in ["asked.json", "run.json", "mesh.bin", STATE] {
                std::fs::copy(part.join(file), copy.join(file)).unwrap();
            }
        }
        clock.set(clock.get() + piece);
        clock.get()
    };
    let result = compression.run_by(&now, &AtomicBool::new(false), &mut |p| {
        killed_in_a_sample.get_or_insert(p.sample.steps);
    });
    assert!(result.unwrap().finished && pieces.get() > 100, "{} pieces", pieces.get());
    assert!(
        most_lost.get() <= Duration::from_secs(20) + piece,
        "{:?} of work could be lost",
        most_lost.get()
    );
    // Samples end where pieces do not: checkpoints fell into the midst of samples.
    assert!(!killed_in_a_sample.unwrap().is_multiple_of(super::PIECE));
    assert_eq!(curve(&part), curve(&whole));
    let mut resumed = Compression::resume(&copy).unwrap();
    assert!((0.0..0.9).contains(&resumed.done()) && kept(&copy) > Duration::ZERO);
    assert!(run(&mut resumed));
    assert_eq!(curve(&copy), curve(&whole));
}

#[test]
fn one_that_is_stopped_before_its_first_step_goes_on() {
    let lab = TempDir::new().unwrap();
    let (whole, part) = (lab.path().join("whole"), lab.path().join("part"));
    assert!(run(&mut begin(&whole)));
    let mut compression = begin(&part);
    let stopped = compression.run(&AtomicBool::new(true), &mut |_| {}).unwrap();
    assert!(!stopped.finished && stopped.curve.is_empty());
    drop(compression);
    assert!(run(&mut Compression::resume(&part).unwrap()));
    assert_eq!(curve(&part), curve(&whole));
}

#[test]
fn the_same_again_goes_on_and_something_else_is_refused() {
    let lab = TempDir::new().unwrap();
    let folder = lab.path().join("ball");
    let stop = AtomicBool::new(false);
    let mut first = begin(&folder);
    // Nobody else computes in a folder in which somebody does.
    let locked = Compression::resume(&folder).err().unwrap().to_string();
    assert!(locked.contains("is being written by process"), "{locked}");
    first.run(&stop, &mut |p| stop.store(p.done > 0.3, Ordering::Relaxed)).unwrap();
    drop(first);
    let request = CompressRequest { young_mpa: 50e3, ..CompressRequest::default() };
    let other = request.settings().unwrap();
    let refused = claimed(&folder, &request.placing(), &other);
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("not an empty folder"), "{refused}");
    let mut again = begin(&folder);
    assert!(again.done() > 0.3);
    assert!(run(&mut again));
    drop(again);
    // What has come to its end is somebody's result.
    let request = CompressRequest { to_force_n: Some(4.0), size_mm: Some(0.2), ..CompressRequest::default() };
    let request = CompressRequest { size_at_contact_mm: Some(0.15), ..request };
    let (placing, settings) = (request.placing(), request.settings().unwrap());
    let refused = claimed(&folder, &placing, &settings);
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("not an empty folder"), "{refused}");
}
