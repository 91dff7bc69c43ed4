use super::*;
use crate::calibrate::Turntable;
use crate::geometry::{Angle, Point, Vector};
use crate::silhouette::Silhouette;
use std::sync::Arc;

/// The silhouette of a disc, as an exact distance field with a margin.
fn disc(center: [f64; 2], radius: f64, picture: [usize; 2]) -> Arc<Silhouette> {
    let low = |k: usize| (center[k] - radius - 10.0).floor().max(0.0) as usize;
    let high = |k: usize| ((center[k] + radius + 10.0).ceil() as usize).min(picture[k] - 1);
    let origin = [low(0), low(1)];
    let size = [high(0) - origin[0] + 1, high(1) - origin[1] + 1];
    let distance_px = (0..size[0] * size[1])
        .map(|n| {
            let x = (n % size[0] + origin[0]) as f64 - center[0];
            let y = (n / size[0] + origin[1]) as f64 - center[1];
            (x.hypot(y) - radius) as f32
        })
        .collect();
    Arc::new(Silhouette { picture, origin, size, distance_px })
}

/// Views of a ball of `radius` pixels (5 µm each) on the axis, `n` over half a turn.
fn ball_views(radius: f64, n: usize, distance: Option<f64>) -> Vec<Cone> {
    let table = Turntable {
        mm_per_px: 0.005,
        axis_column_px: 160.0,
        origin_row_px: 150.0,
        elevation_rad: 0.0,
        roll_rad: 0.0,
        camera_distance_mm: distance,
    };
    (0..n)
        .map(|i| {
            let angle = Angle::from_deg(180.0 * i as f64 / n as f64);
            Cone::new(table.view(angle, 0.0), disc([160.0, 150.0], radius, [320, 300]))
        })
        .collect()
}

fn carve(cones: &[Cone], pitch: f64) -> HullGrid {
    let mut grid = HullGrid::new(&find_bounds(cones).unwrap(), pitch).unwrap();
    cones.iter().for_each(|c| grid.carve(c));
    grid
}

#[test]
fn a_balls_hull_has_the_closed_form_excess() {
    // V_hull/V = (2N/π) tan(π/2N): each slice is a 2N-gon about the slice's circle.
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.5f64.powi(3);
    for n in [2, 4, 6, 12, 25] {
        let angle = std::f64::consts::PI / (2 * n) as f64;
        let expected = angle.tan() / angle;
        let got = carve(&ball_views(100.0, n, None), 0.01).measures();
        let ratio = got.volume_mm3 / volume;
        assert!((ratio / expected - 1.0).abs() < 4e-3, "N = {n}: {ratio}, expected {expected}");
    }
}

#[test]
fn voxels_of_a_1000_um_ball_at_5_um_follow_the_published_curve() {
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 0.5f64.powi(3);
    for (n, low, high) in [(4, 0.94, 1.06), (25, 0.995, 1.005)] {
        let ratio = carve(&ball_views(100.0, n, None), 0.005).count_voxels().volume_mm3 / volume;
        assert!((low..=high).contains(&ratio), "N = {n}: {ratio}");
    }
}

/// Views of the same ball by cameras that share no axis, near (30 mm) and far.
fn odd_views() -> Vec<Cone> {
    let turned = |c: Cone, tilt: f64, roll: f64| {
        let turn = nalgebra::Rotation3::from_euler_angles(tilt, roll, 0.3).to_homogeneous();
        let matrix = c.projection().matrix * turn;
        Cone::new(crate::geometry::Projection::new(matrix), Arc::new(c.silhouette().clone()))
    };
    (0..7)
        .map(|i| {
            let distance = [Some(30.0), None, Some(8.0)][i % 3];
            let view = ball_views(60.0, 7, distance).swap_remove(i);
            turned(view, 0.2 * i as f64 - 0.5, 0.07 * i as f64)
        })
        .collect()
}

/// All that a grid holds, as bits.
fn all_bits(grid: &HullGrid) -> Vec<u32> {
    let [nx, ny, nz] = grid.groups_along.map(|n| n * grid::R);
    let mut out = Vec::new();
    for n in 0..nx * ny * nz {
        match grid.block(grid::unravel(n, [nx, ny, nz])) {
            grid::Block::Outside => out.push(0),
            grid::Block::Inside => out.push(1),
            grid::Block::Mixed(values) => out.extend(values.iter().map(|v| v.to_bits())),
        }
    }
    out
}

#[test]
fn neither_order_nor_batches_nor_threads_change_a_bit_and_views_only_remove() {
    for cones in [ball_views(60.0, 7, Some(40.0)), ball_views(60.0, 6, None), odd_views()] {
        let bounds = find_bounds(&cones).unwrap();
        let new = || HullGrid::new(&bounds, 0.011).unwrap();
        let mut forward = new();
        let mut last = f64::INFINITY;
        for c in &cones {
            forward.carve(c);
            let v = forward.measures().volume_mm3;
            assert!(v <= last, "{v} {last}");
            last = v;
        }
        let one_by_one = (all_bits(&forward), forward.measures(), forward.count_voxels());
        for threads in 1..=3 {
            rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
                let mut backward = new();
                cones.iter().rev().for_each(|c| backward.carve(c));
                let mut together = new();
                together.carve_all(&cones, &mut |_| {});
                let mut parts = new();
                let (some, others) = cones.split_at(3);
                parts.carve_all(others, &mut |_| {});
                parts.carve_all(some, &mut |_| {});
                for grid in [&backward, &together, &parts] {
                    assert!(*grid == forward && all_bits(grid) == one_by_one.0, "{threads} threads");
                    assert_eq!((grid.measures(), grid.count_voxels()), (one_by_one.1, one_by_one.2));
                }
            });
        }
    }
}

#[test]
fn a_blocks_values_are_the_views_distances_wherever_its_picture_lies() {
    // About the outline, on the ends of the silhouette's rectangle, and far beyond them.
    for cone in odd_views().iter().chain(&ball_views(60.0, 2, None)) {
        let center = Point::new(0.0, 0.0, 0.0);
        for n in 0..343 {
            let at = grid::unravel(n, [7; 3]).map(|x| 0.09 * (x as f64 - 3.0));
            for pitch in [0.002, 0.011, 0.05] {
                let first = center + crate::geometry::Vector::from(at);
                let mut values = [f32::NEG_INFINITY; grid::POINTS];
                cone.raise(&first, pitch, &mut values);
                for (k, value) in values.iter().enumerate() {
                    let step = grid::unravel(k, [grid::B; 3]).map(|x| x as f64 * pitch);
                    let exact = cone.value_mm(&(first + crate::geometry::Vector::from(step)));
                    // 1e-4 px of 5 µm; the scale within the block is that of its centre to 1 %.
                    let off = (f64::from(*value) - exact).abs();
                    assert!(off < 1e-6 + 0.01 * exact.abs(), "{value} {exact} {pitch}");
                    assert!(exact.abs() < 1e-6 || (*value < 0.0) == (exact < 0.0), "{value} {exact}");
                }
            }
        }
    }
}

#[test]
fn turning_the_cameras_about_any_axis_changes_the_volume_by_discretisation_only() {
    let volume = |cones: &[Cone]| {
        let bounds = find_bounds(cones).unwrap();
        let mut grid = HullGrid::new(&bounds, bounds.size().max() / 96.0).unwrap();
        grid.carve_all(cones, &mut |_| {});
        grid.measures().volume_mm3
    };
    let straight = ball_views(80.0, 5, Some(25.0));
    let expected = volume(&straight);
    for (x, y, z) in [(0.0, 0.0, 0.4), (0.7, 0.0, 0.0), (0.3, -1.1, 2.0), (1.5, 0.2, -0.9)] {
        let turn = nalgebra::Rotation3::from_euler_angles(x, y, z).to_homogeneous();
        let turned: Vec<Cone> = (straight.iter())
            .map(|c| {
                let matrix = c.projection().matrix * turn;
                Cone::new(crate::geometry::Projection::new(matrix), Arc::new(c.silhouette().clone()))
            })
            .collect();
        // Cells across the ridges cut them off: an edge of length L and opening angle a loses about a cell's square.
        let change = volume(&turned) / expected - 1.0;
        assert!(change.abs() < 2e-3, "{x} {y} {z}: {change}");
    }
}

#[test]
fn the_hull_holds_the_body_and_its_function_agrees_with_its_grid() {
    let cones = ball_views(80.0, 9, Some(30.0));
    let bounds = find_bounds(&cones).unwrap();
    let hull = VisualHull { cones, bounds };
    for i in 0..500 {
        let (a, b) = (f64::from(i) * 0.7, f64::from(i) * 0.13);
        let d = Point::new(a.cos() * b.cos(), a.sin() * b.cos(), b.sin());
        assert!(hull.value(&(d * 0.39)) < 0.0);
        assert!(hull.value(&(d * 0.7)) > 0.0);
    }
    let size = bounds.size();
    assert!(size.min() > 0.8 && size.max() < 1.0, "{size:?}");
}

#[test]
fn views_without_a_common_body_and_bad_pitches_are_errors() {
    assert_eq!(find_bounds(&[]), Err(HullError::NoViews));
    let mut cones = ball_views(40.0, 2, None);
    cones.push(Cone::new(cones[0].projection().clone(), disc([250.0, 250.0], 20.0, [320, 300])));
    assert_eq!(find_bounds(&cones), Err(HullError::Empty { views: 3 }));
    assert_eq!(find_bounds(&ball_views(40.0, 1, None)), Err(HullError::Unbounded { views: 1 }));
    let b = find_bounds(&ball_views(40.0, 3, None)).unwrap();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(HullGrid::new(&b, bad), Err(HullError::Voxel(_))));
    }
    assert!(matches!(HullGrid::new(&b, 1e-6), Err(HullError::TooFine { .. })));
}

#[test]
fn the_surface_faces_outwards_and_encloses_the_volume_that_is_measured() {
    let grid = carve(&ball_views(80.0, 9, None), 0.01);
    let (surface, measures) = (grid.surface(), grid.measures());
    let over = surface.volume_mm3() / measures.volume_mm3 - 1.0;
    assert!(over.abs() < 1e-9, "{over}");
    // Of a closed surface that is oriented the areas seen from any side cancel.
    let sum = |p: [Point; 3]| (p[1] - p[0]).cross(&(p[2] - p[0]));
    let all: Vector = (0..surface.triangles.len()).map(|t| sum(surface.corners(t))).sum();
    assert!(all.norm() < 1e-9 * measures.surface_area_mm2, "{all}");
    assert!((surface.area_mm2() / measures.surface_area_mm2 - 1.0).abs() < 1e-9);
    // Vertices are shared: a surface that shared none would have three times as many as triangles, one that shared all half as many.
    let shared = surface.vertices.len() as f64 / surface.triangles.len() as f64;
    assert!((0.5..0.75).contains(&shared), "{shared}");
}

#[test]
fn the_hull_fills_the_silhouettes_that_carved_it() {
    let cones = ball_views(80.0, 9, None);
    let surface = carve(&cones, 0.01).surface();
    for c in &cones {
        let iou = silhouette_iou(c, &surface);
        assert!(iou > 0.985, "{iou}");
    }
    let moved = Cone::new(cones[0].projection().clone(), disc([200.0, 150.0], 80.0, [320, 300]));
    assert!(silhouette_iou(&moved, &surface) < 0.7);
}
