//! What the benches share: the grain, its views, and how a time is taken and told.

use grainrig::rig::simulated::{Settings, TruthHandle, open};
use grainrig_core::geometry::Angle;
use grainrig_core::hull::Cone;
use grainrig_core::silhouette::{self, PedestalMode, Picture};
use std::sync::Arc;
use std::time::Instant;

/// Least time spent on one figure, seconds.
const LEAST_S: f64 = 0.4;
/// Most runs for one figure.
const MOST_RUNS: usize = 15;

/// The median time of a run, seconds; what a run returns is dropped outside the measured time.
pub fn median_s<T>(mut run: impl FnMut() -> T) -> f64 {
    let mut times = Vec::new();
    while times.len() < MOST_RUNS && (times.is_empty() || times.iter().sum::<f64>() < LEAST_S) {
        let start = Instant::now();
        let made = std::hint::black_box(run());
        times.push(start.elapsed().as_secs_f64());
        drop(made);
    }
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

/// One line: what, how large, how long, how many a second, and the time over a yardstick's.
#[allow(dead_code)]
pub fn tell(what: &str, size: &str, seconds: f64, throughput: &str, yardstick: (&str, f64)) {
    let (name, by) = yardstick;
    println!(
        "{what:<22} {size:>24} {:>10.2} ms {throughput:>24} {:>8.2} × {name}",
        1e3 * seconds,
        seconds / by
    );
}

/// The simulated rig with a smaller picture of the same scene.
pub fn rig(width: usize, height: usize) -> Settings {
    let mm_per_px = 0.0043 * 5184.0 / width as f64;
    Settings { width, height, mm_per_px, ..Settings::default() }
}

/// Ideal views of the built-in grain over half a turn, cut out of pictures of 17 µm a pixel.
#[allow(dead_code)]
pub fn views(count: usize) -> (Vec<Cone>, TruthHandle) {
    views_by(&rig(1296, 864), count)
}

/// Ideal views of a rig's grain over half a turn.
#[allow(dead_code)]
pub fn views_by(settings: &Settings, count: usize) -> (Vec<Cone>, TruthHandle) {
    let (_, _, truth) = open(settings).expect("the built-in grain");
    let cut_out = silhouette::Settings { pedestal: PedestalMode::None, ..silhouette::Settings::default() };
    let cones = (0..count)
        .map(|i| {
            let angle = Angle::from_deg(180.0 * i as f64 / count as f64);
            let seen = truth.true_silhouette(angle, 0.0);
            let mut grey = vec![230u8; settings.width * settings.height];
            for (k, part) in seen.coverage.iter().enumerate() {
                let (column, row) = (k % seen.window.size[0], k / seen.window.size[0]);
                let at = (row + seen.window.origin[1]) * settings.width + column + seen.window.origin[0];
                grey[at] = (230.0 - 200.0 * part) as u8;
            }
            let picture = Picture::new(settings.width, settings.height, 1, grey).expect("a picture");
            let found = silhouette::find(&picture, None, &cut_out).expect("a silhouette");
            Cone::new(truth.projection(angle, 0.0), Arc::new(found.silhouette))
        })
        .collect();
    (cones, truth)
}

/// Memory of this process at its most so far, MB, where the system tells.
#[allow(dead_code)]
pub fn most_memory_mb() -> Option<f64> {
    most_memory_mb_of(std::process::id())
}

/// The same of another process; `None` where it has ended.
#[allow(dead_code)]
pub fn most_memory_mb_of(id: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}
