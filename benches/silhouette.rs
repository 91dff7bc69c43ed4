//! Photograph → silhouette, on one core. Run: `make bench`, or `cargo bench --bench silhouette` (a few seconds).
//!
//! Pictures of the simulated rig at three sizes. Two yardsticks run beside ours on the same files: libjpeg-turbo's
//! decode of all pixels to grey (its program `djpeg`, where it is installed, with its start and the writing of the
//! pixels to nowhere), and the way of an image-processing toolbox: all pixels decoded, Otsu's threshold, the mask, its
//! connected components, the largest of them.

mod common;

use common::{median_s, rig, tell};
use grainrig::rig::{Camera as _, RotationStage as _, simulated::open};
use grainrig_core::formats::{Photograph, decode};
use grainrig_core::silhouette::{Histogram, Settings, assess, find};
use std::path::Path;
use std::process::Command;

fn main() {
    let one_core = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let folder = tempfile::tempdir().expect("a folder for the pictures");
    for (width, height) in [(1296, 864), (2592, 1728), (5184, 3456)] {
        let (mut stage, mut camera, _) = open(&rig(width, height)).expect("the built-in grain");
        stage.home().expect("the simulated stage");
        let bytes = camera.capture().expect("the simulated camera").bytes;
        let file = folder.path().join(format!("{width}.jpg"));
        std::fs::write(&file, &bytes).expect("a picture file");
        let settings = Settings::default();
        let whole = |bytes: &[u8]| {
            let photograph = Photograph::open(bytes).expect("a JPEG");
            find(&photograph, None, &settings).expect("a grain")
        };
        let photograph = Photograph::open(&bytes).expect("a JPEG");
        let found = whole(&bytes);
        one_core.install(|| {
            let opening = median_s(|| Photograph::open(&bytes));
            let ours = median_s(|| whole(&bytes));
            let judging = median_s(|| assess(&photograph, &found));
            let toolbox = median_s(|| largest_component(&bytes));
            let size = format!("{width} × {height} px");
            let rate = |s: f64| format!("{:.0} Mpx/s", (width * height) as f64 / s * 1e-6);
            let yardstick = match turbo(&file) {
                Some(turbo) => ("libjpeg-turbo to grey", turbo),
                None => ("decode, Otsu, components", toolbox),
            };
            tell("photograph, opened", &size, opening, &rate(opening), yardstick);
            tell("photograph → silhouette", &size, ours, &rate(ours), yardstick);
            tell("", &size, ours, &rate(ours), ("decode, Otsu, components", toolbox));
            tell("view quality", &size, judging, &rate(judging), ("one silhouette", ours));
            tell("decode, Otsu, components", &size, toolbox, &rate(toolbox), yardstick);
        });
    }
}

/// Time of libjpeg-turbo's decode to grey; `None`, told, where its program is not installed.
fn turbo(file: &Path) -> Option<f64> {
    let run = || {
        let mut djpeg = Command::new("djpeg");
        djpeg.args(["-grayscale", "-outfile", "/dev/null"]).arg(file).status()
    };
    if !run().is_ok_and(|status| status.success()) {
        println!("skipped: libjpeg-turbo's decode (install libjpeg-turbo-progs)");
        return None;
    }
    Some(median_s(run))
}

/// Pixels of the largest dark component under Otsu's threshold.
fn largest_component(bytes: &[u8]) -> usize {
    let picture = decode(bytes).expect("a JPEG");
    let grey: Vec<u8> = (picture.data().chunks_exact(3))
        .map(|p| ((77 * u32::from(p[0]) + 150 * u32::from(p[1]) + 29 * u32::from(p[2])) >> 8) as u8)
        .collect();
    let mut counts = vec![0u64; 256];
    grey.iter().for_each(|&v| counts[usize::from(v)] += 1);
    let threshold = Histogram::from_counts(-0.5, 1.0, counts).otsu2().expect("two classes").threshold;
    let mask: Vec<bool> = grey.iter().map(|&v| f64::from(v) < threshold).collect();
    // Two passes over the pixels, labels joined by union and find.
    let width = picture.width();
    let mut labels = vec![0u32; mask.len()];
    let mut parents = vec![0u32];
    for k in (0..mask.len()).filter(|&k| mask[k]) {
        let left = if k % width > 0 { labels[k - 1] } else { 0 };
        let above = if k >= width { labels[k - width] } else { 0 };
        labels[k] = match (left, above) {
            (0, 0) => {
                parents.push(parents.len() as u32);
                parents.len() as u32 - 1
            }
            (label, 0) | (0, label) => label,
            (a, b) => {
                let (a, b) = (root(&mut parents, a), root(&mut parents, b));
                parents[a.max(b) as usize] = a.min(b);
                a.min(b)
            }
        };
    }
    let mut areas = vec![0usize; parents.len()];
    for label in labels.into_iter().filter(|l| *l != 0) {
        areas[root(&mut parents, label) as usize] += 1;
    }
    areas.into_iter().max().unwrap_or(0)
}

fn root(parents: &mut [u32], mut k: u32) -> u32 {
    while parents[k as usize] != k {
        parents[k as usize] = parents[parents[k as usize] as usize];
        k = parents[k as usize];
    }
    k
}
