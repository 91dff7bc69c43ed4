//! Silhouettes → visual hull. Run: `cargo bench --bench hull` (about a minute). First the exact slices (`slices.rs`), then
//! the grid of blocks:
//!
//! 25 orthographic views of the built-in grain over half a turn, on grids of 128³, 256³ and 512³ cells about its
//! box. The yardstick is what one writes first, on one thread: for each voxel's centre, view after view, the
//! nearest pixel of a mask, until one says outside. A machine of two cores gave 0.26 s (numpy, a view at a time)
//! and 0.12 s (compiled, two threads) for such masks at 256³, 2.0 s and 0.84 s at 512³.

#[path = "../common/mod.rs"]
mod common;
mod slices;

use common::{median_s, tell, views};
use grainrig_core::geometry::Point;
use grainrig_core::hull::{Cone, HullGrid, find_bounds};

const VIEWS: usize = 25;

/// A view as a matrix and a mask.
struct Mask {
    rows: [[f64; 4]; 2],
    size: [usize; 2],
    inside: Vec<bool>,
}

impl Mask {
    fn new(cone: &Cone) -> Self {
        let m = &cone.projection().matrix;
        let [w, h] = cone.silhouette().picture;
        let inside = (0..w * h).map(|k| cone.silhouette().contains(k % w, k / w)).collect();
        Self { rows: [0, 1].map(|i| [0, 1, 2, 3].map(|j| m[(i, j)])), size: [w, h], inside }
    }

    fn holds(&self, p: [f64; 3]) -> bool {
        let at = self.rows.map(|r| (r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3]).round());
        let [w, h] = self.size;
        (0.0..w as f64).contains(&at[0])
            && (0.0..h as f64).contains(&at[1])
            && self.inside[at[1] as usize * w + at[0] as usize]
    }
}

fn plain_loop(masks: &[Mask], low: &Point, pitch: f64, cells: [usize; 3]) -> u64 {
    let mut count = 0;
    for z in 0..cells[2] {
        for y in 0..cells[1] {
            for x in 0..cells[0] {
                let at = |k: usize, i: usize| low[k] + (i as f64 + 0.5) * pitch;
                let p = [at(0, x), at(1, y), at(2, z)];
                count += u64::from(masks.iter().all(|m| m.holds(p)));
            }
        }
    }
    count
}

fn main() {
    slices::run();
    let (cones, _) = views(VIEWS);
    let bounds = find_bounds(&cones).expect("a hull");
    let finding = median_s(|| find_bounds(&cones));
    let masks: Vec<Mask> = cones.iter().map(Mask::new).collect();
    for n in [128, 256, 512] {
        let pitch = bounds.size().max() / f64::from(n);
        let cells: [usize; 3] = bounds.size().map(|x| (x / pitch).ceil() as usize).into();
        let voxel_views = (cells.iter().product::<usize>() * VIEWS) as f64;
        let rate = |s: f64| format!("{:.2} G voxel-views/s", voxel_views / s * 1e-9);
        let size = format!("{} × {} × {}", cells[0], cells[1], cells[2]);
        let plain = median_s(|| plain_loop(&masks, &bounds.min, pitch, cells));
        let carve = || {
            let mut grid = HullGrid::new(&bounds, pitch).expect("a grid");
            cones.iter().for_each(|c| grid.carve(c));
            grid
        };
        let carving = median_s(carve);
        let grid = carve();
        let measuring = median_s(|| grid.measures());
        let yardstick = ("plain voxel loop", plain);
        if n == 128 {
            tell("box of the hull", &format!("{VIEWS} views"), finding, "", yardstick);
        }
        tell("plain voxel loop", &size, plain, &rate(plain), yardstick);
        tell("carve", &size, carving, &rate(carving), yardstick);
        tell("volume and area", &size, measuring, "", yardstick);
    }
}
