use super::*;
use crate::calibrate::Turntable;
use crate::geometry::Angle;
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

#[test]
fn neither_order_nor_threads_change_a_bit_and_views_only_remove() {
    let cones = ball_views(60.0, 7, Some(40.0));
    let bounds = find_bounds(&cones).unwrap();
    let mut forward = HullGrid::new(&bounds, 0.02).unwrap();
    let mut last = f64::INFINITY;
    for c in &cones {
        forward.carve(c);
        let v = forward.measures().volume_mm3;
        assert!(v <= last);
        last = v;
    }
    let mut backward = HullGrid::new(&bounds, 0.02).unwrap();
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    one.install(|| cones.iter().rev().for_each(|c| backward.carve(c)));
    assert_eq!(forward.count_voxels(), backward.count_voxels());
    assert_eq!(forward.measures(), one.install(|| backward.measures()));
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
fn the_hull_fills_the_silhouettes_that_carved_it() {
    let cones = ball_views(80.0, 9, None);
    let triangles = carve(&cones, 0.01).surface_triangles();
    for c in &cones {
        let iou = silhouette_iou(c, &triangles);
        assert!(iou > 0.985, "{iou}");
    }
    let moved = Cone::new(cones[0].projection().clone(), disc([200.0, 150.0], 80.0, [320, 300]));
    assert!(silhouette_iou(&moved, &triangles) < 0.7);
}
