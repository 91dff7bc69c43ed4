//! Real grains in two poses, seen by ideal views: the exact volume against voxels counted one by one.
//!
//! `GRAINRIG_ALL=1 cargo test --release --test hull_exact real -- --nocapture` gives each grain all numbers of views;
//! else each grain and pose takes its turn with one of them.

use crate::skip::shared_data;
use grainrig_core::formats::stl;
use grainrig_core::geometry::{Point, TriangleMesh};
use grainrig_core::hull::slices::{RowGrid, SlicedHull, Strips};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Voxels along the longest edge, usually and with the hours, and rows of the slices: different, so that nothing coincides.
const VOXELS: [f64; 2] = [312.0, 512.0];
const ROWS: f64 = 640.0;

fn grains() -> Vec<PathBuf> {
    let Some(folder) = shared_data("grains") else { return Vec::new() };
    let mut files: Vec<PathBuf> = (std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()))
        .filter(|p| p.extension().is_some_and(|e| e == "stl") && !p.to_string_lossy().contains("analytic"))
        // The same shape as lsdem_sand, in smaller triangles.
        .filter(|p| !p.ends_with("lsdem_sand_finer.stl"))
        .collect();
    files.sort();
    files
}

/// On each row, what a view at an angle sees of the mesh: the union of the triangles' cuts at that height.
fn intervals(mesh: &TriangleMesh, row_grid: RowGrid, angle: f64) -> Vec<Vec<[f64; 2]>> {
    let (sin, cos) = angle.sin_cos();
    let mut rows = vec![Vec::new(); row_grid.rows];
    for t in 0..mesh.triangles.len() {
        let c = mesh.corners(t).map(|p| [p.x * cos - p.y * sin, p.z]);
        let row = |z: f64| ((z - row_grid.first_mm) / row_grid.pitch_mm).clamp(-1.0, row_grid.rows as f64);
        let low = c.iter().map(|p| row(p[1])).fold(f64::MAX, f64::min).ceil().max(0.0) as usize;
        let high = c.iter().map(|p| row(p[1])).fold(f64::MIN, f64::max).floor();
        for (k, out) in rows.iter_mut().enumerate().skip(low).take_while(|(k, _)| *k as f64 <= high) {
            let z = row_grid.height(k);
            let mut ends = [f64::MAX, f64::MIN];
            for (a, b) in [(c[0], c[1]), (c[1], c[2]), (c[2], c[0])] {
                if (a[1] <= z) != (b[1] <= z) {
                    let u = a[0] + (b[0] - a[0]) * (z - a[1]) / (b[1] - a[1]);
                    ends = [ends[0].min(u), ends[1].max(u)];
                }
            }
            if ends[0] <= ends[1] {
                out.push(ends);
            }
        }
    }
    for row in &mut rows {
        row.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let mut merged: Vec<[f64; 2]> = Vec::new();
        for [a, b] in row.drain(..) {
            match merged.last_mut() {
                // The cuts of neighbouring triangles meet to rounding.
                Some(last) if a <= last[1] + 1e-9 => last[1] = last[1].max(b),
                _ => merged.push([a, b]),
            }
        }
        *row = merged;
    }
    rows
}

/// How many voxels each set of views leaves: every place, every view, plainly.
fn brute_force(mesh: &TriangleMesh, sets: &[Vec<f64>], pitch: f64) -> Vec<f64> {
    let b = mesh.bounds().unwrap().grown(pitch);
    // The hull may be wider than the grain, but not than six strips about the circle that it turns in.
    let reach = mesh.vertices.iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max) / (PI / 12.0).cos();
    let across = (2.0 * reach / pitch).ceil() as usize;
    let layers = (b.size().z / pitch).ceil() as usize;
    let row_grid = RowGrid { first_mm: b.min.z + 0.5 * pitch, pitch_mm: pitch, rows: layers };
    let at = |i: usize| (i as f64 + 0.5) * pitch - reach;
    (sets.iter())
        .map(|angles| {
            let seen: Vec<_> = angles.par_iter().map(|a| intervals(mesh, row_grid, *a)).collect();
            let counts: Vec<u64> = (0..layers)
                .into_par_iter()
                .map(|k| {
                    let mut count = 0;
                    let mut alive = vec![true; across];
                    for y in (0..across).map(at) {
                        alive.fill(true);
                        let mut left = 0..across;
                        for (angle, seen) in angles.iter().zip(&seen) {
                            let (sin, cos) = angle.sin_cos();
                            let at = |i: usize| at(i) * cos - y * sin;
                            match seen[k].as_slice() {
                                [[a, b]] => {
                                    for (i, alive) in left.clone().zip(&mut alive[left.clone()]) {
                                        *alive = *alive & (at(i) >= *a) & (at(i) <= *b);
                                    }
                                }
                                several => {
                                    for (i, alive) in left.clone().zip(&mut alive[left.clone()]) {
                                        *alive &= several.iter().any(|[a, b]| at(i) >= *a && at(i) <= *b);
                                    }
                                }
                            }
                            // What is dead at either end stays so.
                            let first = left.clone().find(|i| alive[*i]);
                            let Some(first) = first else { break };
                            left = first..left.clone().rfind(|i| alive[*i]).unwrap() + 1;
                        }
                        count += left.filter(|i| alive[*i]).count() as u64;
                    }
                    count
                })
                .collect();
            counts.iter().sum::<u64>() as f64 * pitch.powi(3)
        })
        .collect()
}

#[test]
fn real_grains_have_the_volume_of_their_voxels() {
    let files = grains();
    if files.is_empty() {
        return;
    }
    // In strides, so that few views leave little to the rest; none of the counts has the factor 7.
    let sets: Vec<Vec<f64>> = [6_u32, 12, 25, 72]
        .map(|k| (0..k).map(|i| PI * f64::from(7 * i % k) / f64::from(k)).collect())
        .to_vec();
    println!("hull over grain, %, by views: exact slices (brute-force voxels; most pieces in a slice)");
    let all = std::env::var_os("GRAINRIG_ALL").is_some();
    let mut turn = 0;
    for file in files {
        let stored = stl::read(&std::fs::read(&file).unwrap()).unwrap();
        for tipped in [false, true] {
            let mut mesh = stored.clone();
            let longest = stored.bounds().unwrap().size().max();
            let c = stored.bounds().unwrap().center();
            for p in &mut mesh.vertices {
                let d = (*p - c) / longest;
                *p = if tipped { Point::new(d.z, d.y, -d.x) } else { Point::from(d) };
            }
            let volume = mesh.volume_mm3();
            let b = mesh.bounds().unwrap();
            let row_grid = RowGrid::tiling([b.min.z, b.max.z], 1.0 / ROWS).unwrap();
            let own = if all { &sets[..] } else { &sets[turn % sets.len()..][..1] };
            turn += 1;
            let voxels = brute_force(&mesh, own, 1.0 / VOXELS[usize::from(all)]);
            let mut line = String::new();
            for (angles, counted) in own.iter().zip(voxels) {
                let views: Vec<Strips> = (angles.par_iter())
                    .map(|a| {
                        let rows = intervals(&mesh, row_grid, *a);
                        let mut next = rows.iter();
                        Strips::from_fn(row_grid, *a, |_, out| out.extend(next.next().unwrap())).unwrap()
                    })
                    .collect();
                let hull = SlicedHull::new(&views).unwrap();
                let (exact, counted) = (100.0 * hull.volume_mm3() / volume, 100.0 * counted / volume);
                let pieces = (0..row_grid.rows).map(|k| hull.slice_figures(k).pieces).max().unwrap();
                write!(line, "  {}: {exact:7.3} ({counted:7.3}; {pieces})", angles.len()).unwrap();
                assert!(exact > 99.95, "{}: the hull has {exact} % of the grain", file.display());
                assert!((exact - counted).abs() < 0.3, "{}: {exact} {counted}", file.display());
            }
            let name = file.file_stem().unwrap().to_string_lossy().into_owned();
            println!("{name:20} {}{line}", if tipped { "tipped" } else { "stored" });
        }
    }
}
