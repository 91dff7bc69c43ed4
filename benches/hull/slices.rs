//! The exact slices: volume and voxels from 25 masks of 1280², and how the cost grows with rows and views.
//!
//! The body is three balls, which meet: most rows have one interval, some two or three. The yardstick is a plain loop
//! over the voxels in two threads, compiled like the rest: view after view the nearest pixel of a mask of bytes, until
//! one says outside. What bounds the slices: the masks are read once (41 MB as bytes, 5 MB as bits), a slice costs some
//! ten operations a half-plane, and the voxels are written once (16 MiB at 512³, 128 MiB at 1024³).

use super::common::{median_s, tell};
use grainrig_core::calibrate::Turntable;
use grainrig_core::geometry::{Angle, Point, Projection};
use grainrig_core::hull::Cone;
use grainrig_core::hull::slices::{BitMask, RowGrid, SlicedHull, Strips, VoxelGrid};
use grainrig_core::silhouette::Silhouette;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::Arc;

const SIDE: usize = 1280;
const VIEWS: usize = 25;
/// Places (mm) and radii (mm); the pixels are 1 µm.
const BALLS: [([f64; 3], f64); 3] =
    [([0.05, 0.02, 0.6], 0.45), ([-0.25, 0.1, 0.85], 0.28), ([0.3, -0.2, 0.35], 0.27)];

fn camera(k: usize, views: usize) -> Projection {
    let table = Turntable {
        mm_per_px: 0.001,
        axis_column_px: 640.0,
        origin_row_px: 1270.0,
        elevation_rad: 0.0,
        roll_rad: 0.0,
        camera_distance_mm: None,
    };
    table.view(Angle::from_rad(PI * k as f64 / views as f64), 0.0)
}

/// Distance (pixels) to the balls' outline.
fn distance(camera: &Projection) -> impl Fn(f64, f64) -> f64 {
    let discs = BALLS.map(|(c, r)| (camera.project(&Point::from(c)).expect("before the camera"), 1000.0 * r));
    move |x, y| discs.iter().map(|(c, r)| (x - c[0]).hypot(y - c[1]) - r).fold(f64::MAX, f64::min)
}

/// Intervals of the balls at a height, as a view at an angle sees them.
fn intervals(angle: f64, z: f64, out: &mut Vec<[f64; 2]>) {
    let mut all: Vec<[f64; 2]> = (BALLS.iter())
        .filter(|(c, r)| (z - c[2]).abs() < *r)
        .map(|(c, r)| {
            let (u, half) = (c[0] * angle.cos() - c[1] * angle.sin(), (r * r - (z - c[2]).powi(2)).sqrt());
            [u - half, u + half]
        })
        .collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let first = out.len();
    for [a, b] in all {
        match out[first..].last_mut() {
            Some(last) if a <= last[1] => last[1] = last[1].max(b),
            _ => out.push([a, b]),
        }
    }
}

/// The voxels inside all masks, plainly, in two threads.
fn plain_loop(cameras: &[Projection], masks: &[Vec<u8>], grid: &VoxelGrid) -> u64 {
    let rows: Vec<[[f64; 4]; 2]> =
        cameras.iter().map(|c| [0, 1].map(|i| [0, 1, 2, 3].map(|j| c.matrix[(i, j)]))).collect();
    let [nx, ny, nz] = grid.dims;
    let layer = |z: usize| {
        let mut count = 0;
        for y in 0..ny {
            for x in 0..nx {
                let at = |k: usize, i: usize| grid.origin[k] + i as f64 * grid.pitch_mm;
                let p = [at(0, x), at(1, y), at(2, z)];
                let inside = rows.iter().zip(masks).all(|(rows, mask)| {
                    let seen =
                        rows.map(|r| (r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + r[3] + 0.5).floor() as i64);
                    let within = seen.iter().all(|s| (0..SIDE as i64).contains(s));
                    within && mask[seen[1] as usize * SIDE + seen[0] as usize] != 0
                });
                count += u64::from(inside);
            }
        }
        count
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    pool.install(|| (0..nz).into_par_iter().map(layer).sum())
}

/// The most memory that the program has held so far, MB; `None` where the system does not say.
fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    Some(line.split_whitespace().nth(1)?.parse::<f64>().ok()? / 1024.0)
}

fn told_peak() -> String {
    peak_mb().map_or_else(|| "unknown".into(), |mb| format!("{mb:.0} MiB"))
}

pub fn run() {
    let cameras: Vec<Projection> = (0..VIEWS).map(|k| camera(k, VIEWS)).collect();
    let masks: Vec<Vec<u8>> = (cameras.par_iter())
        .map(|c| {
            let d = distance(c);
            (0..SIDE * SIDE).map(|k| u8::from(d((k % SIDE) as f64, (k / SIDE) as f64) < 0.0)).collect()
        })
        .collect();
    println!("peak memory with the masks as bytes: {}", told_peak());
    let pack = || -> Vec<BitMask> { masks.par_iter().map(|m| BitMask::from_bytes(SIDE, m)).collect() };
    let packed = pack();
    let row_grid = RowGrid::of_rows(&cameras[0], SIDE).expect("rows");
    let read = |masks: &[BitMask]| -> Vec<Strips> {
        let strips = masks.par_iter().zip(&cameras).map(|(m, c)| Strips::from_mask(m, c, row_grid));
        strips.collect::<Result<_, _>>().expect("strips")
    };
    let hull_of = |masks: &[BitMask]| SlicedHull::new(&read(masks)).expect("a hull");
    let grid = |n: usize| {
        let pitch_mm = 1.25 / n as f64;
        VoxelGrid { origin: Point::new(-0.625, -0.625, 0.0), pitch_mm, dims: [n; 3] }
    };
    let voxels = |n: usize| hull_of(&packed).voxels(grid(n)).expect("voxels");

    let hull = hull_of(&packed);
    let size = format!("{VIEWS} masks of {SIDE}²");
    let plain = median_s(|| plain_loop(&cameras, &masks, &grid(512)));
    let yardstick = ("plain loop 512³", plain);
    tell("plain loop, 2 threads", "512³", plain, "", yardstick);
    tell("bytes to bits", &size, median_s(pack), "", yardstick);
    tell("exact volume", &format!("{size}, bits"), median_s(|| hull_of(&packed).volume_mm3()), "", yardstick);
    let whole = median_s(|| hull_of(&pack()).volume_mm3());
    tell("exact volume", &format!("{size}, bytes"), whole, "", yardstick);
    tell("all measures", "slices", median_s(|| hull.measures()), "", yardstick);
    for n in [512, 1024] {
        tell("masks to voxels", &format!("{n}³"), median_s(|| voxels(n)), "", yardstick);
        tell("slices to voxels", &format!("{n}³"), median_s(|| hull.voxels(grid(n))), "", yardstick);
        println!("peak memory so far, masks and {n}³ voxels: {}", told_peak());
    }
    let (counted, by_loop) = (voxels(512).count(), plain_loop(&cameras, &masks, &grid(512)));
    println!(
        "voxels at 512³: {counted}, plain loop {by_loop} ({:+.1e}); exact volume {:.6} mm³, voxels {:.6} mm³",
        counted as f64 / by_loop as f64 - 1.0,
        hull.volume_mm3(),
        counted as f64 * grid(512).pitch_mm.powi(3)
    );
    println!("rows × views: time of cutting the slices and their volume, and per row and view");
    for views in [6, 12, 25, 50] {
        for rows in [320, 640, 1280] {
            let row_grid = RowGrid::tiling([0.1, 1.1], 1.000_001 / f64::from(rows)).expect("rows");
            let strips: Vec<Strips> = (0..views)
                .map(|k| {
                    let angle = PI * f64::from(k) / f64::from(views);
                    Strips::from_fn(row_grid, angle, |z, out| intervals(angle, z, out)).expect("strips")
                })
                .collect();
            let s = median_s(|| SlicedHull::new(&strips).expect("a hull").volume_mm3());
            let each = format!("{:.1} ns a row-view", 1e9 * s / f64::from(rows * views));
            tell("slices and volume", &format!("{views} views, {rows} rows"), s, &each, yardstick);
        }
    }
    silhouettes(&cameras, yardstick);
}

/// The way that the pipeline takes: from fields of distances.
fn silhouettes(cameras: &[Projection], yardstick: (&str, f64)) {
    let cones: Vec<Cone> = (cameras.par_iter())
        .map(|c| {
            let d = distance(c);
            let distance_px =
                (0..SIDE * SIDE).map(|k| d((k % SIDE) as f64, (k / SIDE) as f64) as f32).collect();
            let size = [SIDE, SIDE];
            let s = Silhouette { picture: size, origin: [0, 0], size, distance_px };
            Cone::new(c.clone(), Arc::new(s))
        })
        .collect();
    let seconds = median_s(|| SlicedHull::of_cones(&cones).expect("a hull").volume_mm3());
    tell("exact volume", &format!("{VIEWS} silhouettes of {SIDE}²"), seconds, "", yardstick);
}
