//! Silhouettes before a pinhole camera → visual hull. Run: `cargo bench --bench hull_general` (about a minute).
//!
//! 25 views of the built-in grain over half a turn, seen about 1280 px wide from 30 mm, on grids of 128 to 1024 cells
//! along the longest edge of its box. The yardstick is a compiled loop over all voxels on as many threads: for each
//! voxel's centre, view after view, the nearest pixel of a mask, until one says outside. `power` is the base-two
//! logarithm of the time over that for half the cells: 2 as the surface, 3 as the volume. Where the system tells, the
//! processors' own time is stated too: on a machine that others use it says more than the clock.

mod common;

use common::{median_s, most_memory_mb, tell, views_by};
use grainrig::rig::simulated::Settings;
use grainrig_core::geometry::Point;
use grainrig_core::hull::{Cone, HullGrid, find_bounds};
use rayon::prelude::*;

const VIEWS: usize = 25;
/// Beyond this the yardstick takes a minute a run.
const MOST_YARDSTICK: u32 = 512;
/// Cells of the monitor's hull, and of a finer one.
const LIVE: [u32; 2] = [96, 256];

/// A view as a matrix and a mask of its rectangle.
struct Mask {
    rows: [[f64; 4]; 3],
    origin: [f64; 2],
    size: [usize; 2],
    inside: Vec<bool>,
}

impl Mask {
    fn new(cone: &Cone) -> Self {
        let m = &cone.projection().matrix;
        let s = cone.silhouette();
        Self {
            rows: [0, 1, 2].map(|i| [0, 1, 2, 3].map(|j| m[(i, j)])),
            origin: s.origin.map(|x| x as f64),
            size: s.size,
            inside: s.distance_px.iter().map(|d| *d < 0.0).collect(),
        }
    }

    fn holds(&self, p: [f64; 3]) -> bool {
        let [u, v, w] = self.rows.map(|r| r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]);
        let (x, y) = ((u / w - self.origin[0] + 0.5) as isize, (v / w - self.origin[1] + 0.5) as isize);
        let [width, height] = self.size.map(|n| n as isize);
        (0..width).contains(&x) && (0..height).contains(&y) && self.inside[(y * width + x) as usize]
    }
}

fn plain_loop(masks: &[Mask], low: &Point, pitch: f64, cells: [usize; 3]) -> u64 {
    let at = |k: usize, i: usize| low[k] + (i as f64 + 0.5) * pitch;
    let slab = |z: usize| {
        let mut count = 0;
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let p = [at(0, x), at(1, y), at(2, z)];
                count += u64::from(masks.iter().all(|m| m.holds(p)));
            }
        }
        count
    };
    (0..cells[2]).into_par_iter().map(slab).sum()
}

/// What the processors have worked for this process so far, seconds, where the system tells.
fn worked_s() -> Option<f64> {
    let mut sum = 0.0;
    for thread in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        sum += text.split_whitespace().next()?.parse::<f64>().ok()?;
    }
    Some(sum * 1e-9)
}

/// Tells what a run makes the processors work.
fn tell_work<T>(what: &str, run: impl FnOnce() -> T) -> T {
    let before = worked_s();
    let made = run();
    if let Some((before, after)) = before.zip(worked_s()) {
        println!("    {what}: the processors worked {:.1} ms", 1e3 * (after - before));
    }
    made
}

fn main() {
    let settings = Settings {
        width: 2592,
        height: 1728,
        mm_per_px: 0.9 / 1280.0,
        camera_distance_mm: Some(30.0),
        ..Settings::default()
    };
    let (cones, _) = views_by(&settings, VIEWS);
    let size = cones[0].silhouette().size;
    println!("{VIEWS} views, the first {} × {} px", size[0], size[1]);
    let bounds = find_bounds(&cones).expect("a hull");
    let finding = median_s(|| find_bounds(&cones));
    let masks: Vec<Mask> = cones.iter().map(Mask::new).collect();
    let mut before: Option<[f64; 2]> = None;
    let mut yardstick = 0.0;
    for n in [128, 256, 512, 1024] {
        let pitch = bounds.size().max() / f64::from(n);
        let cells: [usize; 3] = bounds.size().map(|x| (x / pitch).ceil() as usize).into();
        let size = format!("{} × {} × {}", cells[0], cells[1], cells[2]);
        if n <= MOST_YARDSTICK {
            yardstick = median_s(|| plain_loop(&masks, &bounds.min, pitch, cells));
            tell("plain voxel loop", &size, yardstick, "", ("plain voxel loop", yardstick));
            tell_work("plain voxel loop", || plain_loop(&masks, &bounds.min, pitch, cells));
        } else {
            // As the volume, and said so.
            yardstick *= 8.0;
        }
        let by = (if n <= MOST_YARDSTICK { "plain voxel loop" } else { "8 × that at 512" }, yardstick);
        let carve = || {
            let mut grid = HullGrid::new(&bounds, pitch).expect("a grid");
            grid.carve_all(&cones, &mut |_| {});
            grid
        };
        let carving = median_s(carve);
        let grid = carve();
        let measuring = median_s(|| grid.measures());
        let memory = most_memory_mb().map_or(String::new(), |mb| format!("{mb:.0} MB at most"));
        let power = |k: usize, now: f64| {
            before.map_or(String::new(), |b| format!("power {:.2}", (now / b[k]).log2()))
        };
        if n == 128 {
            tell("box of the hull", "", finding, "", by);
        }
        tell("carve", &size, carving, &power(0, carving), by);
        tell("volume and area", &size, measuring, &power(1, measuring), by);
        tell("box, carve, volume", &size, finding + carving + measuring, &memory, by);
        drop(grid);
        tell_work("box", || find_bounds(&cones).is_ok());
        let grid = tell_work("carve", carve);
        tell_work("volume and area", || grid.measures());
        before = Some([carving, measuring]);
    }
    for n in LIVE {
        let pitch = bounds.size().max() / f64::from(n);
        tell_work(&format!("{VIEWS} views one by one, {n} cells"), || {
            let mut grid = HullGrid::new(&bounds, pitch).expect("a grid");
            cones.iter().for_each(|c| grid.carve(c));
        });
        let mut each = vec![Vec::new(); VIEWS];
        let mut measures = Vec::new();
        for _ in 0..9 {
            let mut grid = HullGrid::new(&bounds, pitch).expect("a grid");
            for (cone, times) in cones.iter().zip(&mut each) {
                let start = std::time::Instant::now();
                grid.carve(cone);
                times.push(start.elapsed().as_secs_f64());
                let start = std::time::Instant::now();
                std::hint::black_box(grid.measures());
                measures.push(start.elapsed().as_secs_f64());
            }
        }
        let median = |times: &mut Vec<f64>| {
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        let medians: Vec<f64> = each.iter_mut().map(median).collect();
        println!(
            "one more view, {n} cells: {:.2} ms on average, the slowest of {VIEWS} {:.2} ms; its volume {:.2} ms",
            1e3 * medians.iter().sum::<f64>() / VIEWS as f64,
            1e3 * medians.iter().copied().fold(0.0, f64::max),
            1e3 * median(&mut measures)
        );
    }
}
