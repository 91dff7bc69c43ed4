//! The volume of pinhole views' hulls of real grains, against a plain loop over all places of a fine lattice.

use crate::skip::shared_data;
use grainrig::rig::simulated::{Settings, open};
use grainrig_core::geometry::{Angle, Point};
use grainrig_core::hull::{Cone, HullGrid, find_bounds};
use grainrig_core::silhouette::{self, PedestalMode, Picture};
use rayon::prelude::*;
use std::path::Path;
use std::sync::Arc;

/// The folder of real grains, which not every checkout has.
/// Cells along the longest edge: what the pipeline takes where nothing else is said.
const DEFAULT_CELLS: f64 = 400.0;
/// Places of the plain loop along the longest edge; counting errs by about 1/n², as the surface's places are many.
const PLAIN: usize = 288;

/// Pinhole views of a grain, 0.9 mm large and seen from 12 mm.
fn views(stl: &Path, count: usize) -> Vec<Cone> {
    let settings = Settings {
        grain_stl: Some(stl.into()),
        width: 1296,
        height: 864,
        mm_per_px: 0.0022,
        camera_distance_mm: Some(12.0),
        ..Settings::default()
    };
    let (_, _, truth) = open(&settings).unwrap();
    let cut_out = silhouette::Settings { pedestal: PedestalMode::None, ..silhouette::Settings::default() };
    (0..count)
        .map(|i| {
            let angle = Angle::from_deg(180.0 * i as f64 / count as f64);
            let seen = truth.true_silhouette(angle, 0.0);
            let mut grey = vec![230u8; settings.width * settings.height];
            for (k, part) in seen.coverage.iter().enumerate() {
                let (column, row) = (k % seen.window.size[0], k / seen.window.size[0]);
                let at = (row + seen.window.origin[1]) * settings.width + column + seen.window.origin[0];
                grey[at] = (230.0 - 200.0 * part) as u8;
            }
            let picture = Picture::new(settings.width, settings.height, 1, grey).unwrap();
            let found = silhouette::find(&picture, None, &cut_out).unwrap();
            Cone::new(truth.projection(angle, 0.0), Arc::new(found.silhouette))
        })
        .collect()
}

/// Whether a place is seen inside the outline: the matrix times the place, and the distances of four pixels.
fn inside(cone: &Cone, p: [f64; 3]) -> bool {
    let m = &cone.projection().matrix;
    let [u, v, w] = [0, 1, 2].map(|r| m[(r, 0)] * p[0] + m[(r, 1)] * p[1] + m[(r, 2)] * p[2] + m[(r, 3)]);
    let s = cone.silhouette();
    let (x, y) = (u / w - s.origin[0] as f64, v / w - s.origin[1] as f64);
    if x < 0.0 || y < 0.0 || x >= (s.size[0] - 1) as f64 || y >= (s.size[1] - 1) as f64 {
        return false;
    }
    let (i, j) = (x as usize, y as usize);
    let d = |di: usize, dj: usize| f64::from(s.distance_px[(j + dj) * s.size[0] + i + di]);
    let (fx, fy) = (x - i as f64, y - j as f64);
    let value =
        (1.0 - fy) * ((1.0 - fx) * d(0, 0) + fx * d(1, 0)) + fy * ((1.0 - fx) * d(0, 1) + fx * d(1, 1));
    value < 0.0
}

#[test]
fn the_volume_is_a_plain_loops_to_a_thousandth_at_the_default_resolution() {
    let chosen = ["sand_ma107_00002.stl", "ct_ma160_02444.stl", "gravel_az_00002.stl"];
    for (name, count) in chosen.into_iter().zip([5, 25, 12]) {
        let Some(stl) = shared_data(&format!("grains/{name}")) else { continue };
        let cones = views(&stl, count);
        let bounds = find_bounds(&cones).unwrap();
        let longest = bounds.size().max();
        let mut grid = HullGrid::new(&bounds, longest / DEFAULT_CELLS).unwrap();
        let mut told = Vec::new();
        grid.carve_all(&cones, &mut |done| told.push(done));
        assert!(told.is_sorted() && told.last() == Some(&1.0), "{told:?}");
        let got = grid.measures();
        // A box of its own about the body, so that a hull cut off by its bounds would show.
        let (low, step) = (bounds.center() - bounds.size() * 0.55, 1.1 * longest / PLAIN as f64);
        let counts = bounds.size().map(|x| (1.1 * x / step).ceil() as usize);
        let layer = |z: usize| {
            let mut within = 0u64;
            for y in 0..counts.y {
                for x in 0..counts.x {
                    let at = |k: usize, i: usize| low[k] + (i as f64 + 0.37) * step;
                    within += u64::from(cones.iter().all(|c| inside(c, [at(0, x), at(1, y), at(2, z)])));
                }
            }
            within
        };
        let within: u64 = (0..counts.z).into_par_iter().map(layer).sum();
        let expected = within as f64 * step.powi(3);
        let off = got.volume_mm3 / expected - 1.0;
        println!("{name}, {count} views: {:.6} mm³, off by {off:.1e}", got.volume_mm3);
        assert!(off.abs() < 1e-3, "{name}, {count} views: {} {expected} {off}", got.volume_mm3);
        let voxels = grid.count_voxels().volume_mm3 / expected - 1.0;
        assert!(voxels.abs() < 1e-3, "{name}: {voxels}");
        // The body itself is within: views from other angles remove nothing that these need.
        let tight = got.bounding_box_mm.unwrap();
        assert!((0..3).all(|k| tight.min[k] > bounds.min[k] && tight.max[k] < bounds.max[k]));
    }
}

#[test]
fn the_hull_of_pinhole_views_holds_every_place_of_the_grain() {
    let Some(stl) = shared_data("grains/sand_ma107_00107.stl") else { return };
    let cones = views(&stl, 9);
    let settings = Settings { grain_stl: Some(stl), camera_distance_mm: Some(12.0), ..Settings::default() };
    let (_, _, truth) = open(&settings).unwrap();
    // What is above the table's zero is seen. The outline of an ideal picture is placed to about 0.2 px.
    let seen: Vec<&Point> = truth.truth_mesh().vertices.iter().filter(|p| p.z > 0.005).collect();
    assert!(seen.len() > 5000, "{}", seen.len());
    let worst =
        seen.iter().flat_map(|p| cones.iter().map(|c| c.value_mm(p))).fold(f64::NEG_INFINITY, f64::max);
    println!("the farthest place outside: {:.3} px", worst / 0.0022);
    assert!(worst < 0.3 * 0.0022, "{worst} mm");
}
