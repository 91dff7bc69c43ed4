//! The exact hull of slices against closed forms, against the hull on a grid, and against brute force on real grains.

mod grains;
mod properties;
#[path = "../support/skip.rs"]
mod skip;

use grainrig_core::calibrate::Turntable;
use grainrig_core::geometry::Angle;
use grainrig_core::hull::slices::{BitMask, RowGrid, SlicedHull, Strips};
use grainrig_core::hull::{Cone, HullGrid, find_bounds};
use grainrig_core::silhouette::Silhouette;
use std::f64::consts::PI;
use std::sync::Arc;

const RADIUS_MM: f64 = 0.5;
const VOLUME_MM3: f64 = 4.0 / 3.0 * PI * RADIUS_MM * RADIUS_MM * RADIUS_MM;

/// What the hull of a ball has more than the ball, in volume and in surface: each slice is a 2N-gon about a circle.
fn excess(views: usize) -> f64 {
    let a = PI / (2 * views) as f64;
    a.tan() / a
}

/// Analytic views of a ball of 1 mm, its centre at `c`.
fn ball(views: usize, rows: usize, c: [f64; 3]) -> SlicedHull {
    let range = [c[2] - RADIUS_MM, c[2] + RADIUS_MM];
    let row_grid = RowGrid::tiling(range, 1.000_001 * 2.0 * RADIUS_MM / rows as f64).unwrap();
    let views: Vec<Strips> = (0..views)
        .map(|k| {
            let angle = PI * k as f64 / views as f64;
            let u = c[0] * angle.cos() - c[1] * angle.sin();
            Strips::from_fn(row_grid, angle, |z, out| {
                let half = (RADIUS_MM * RADIUS_MM - (z - c[2]).powi(2)).max(0.0).sqrt();
                out.push([u - half, u + half]);
            })
            .unwrap()
        })
        .collect();
    SlicedHull::new(&views).unwrap()
}

#[test]
fn a_balls_volume_and_surface_are_the_closed_form_for_any_number_of_views() {
    for n in 2..=72 {
        let m = ball(n, 320, [0.07, -0.04, 0.6]).measures();
        let volume = m.volume_mm3 / (excess(n) * VOLUME_MM3) - 1.0;
        let surface = m.surface_area_mm2 / (excess(n) * PI) - 1.0;
        if [2, 3, 4, 6, 12, 25, 36, 72].contains(&n) {
            println!(
                "ball, {n:2} views, 320 rows: volume {volume:+.2e}, surface {surface:+.2e} off the closed form"
            );
        }
        assert!(volume.abs() < 1e-4, "N = {n}: {volume}");
        assert!(surface.abs() < 1e-3, "N = {n}: {surface}");
    }
}

#[test]
fn the_error_along_the_height_is_of_second_order() {
    let error = |rows| ball(12, rows, [0.0; 3]).volume_mm3() / (excess(12) * VOLUME_MM3) - 1.0;
    let surface = |rows| ball(12, rows, [0.0; 3]).measures().surface_area_mm2 / (excess(12) * PI) - 1.0;
    for rows in [20, 40, 80, 160] {
        let (coarse, fine) = (error(rows), error(2 * rows));
        println!("ball, {rows:3} rows: volume {coarse:+.3e}, surface {:+.3e}", surface(rows));
        // The midpoint rule's own error: pitch²/24 times the change of the area's slope.
        assert!((coarse * 2.0 * (rows as f64).powi(2) - 1.0).abs() < 0.01, "{coarse}");
        assert!((coarse / fine - 4.0).abs() < 0.05, "{coarse} {fine}");
    }
}

#[test]
fn centre_and_inertia_are_those_of_the_prism_about_a_circle() {
    // An upright 2N-gon prism: exact, whatever the rows, for its ends lie on the row grid's.
    let (n, height, r) = (6_usize, 0.8, 0.3);
    let c = [0.4, -0.25, 1.0];
    let row_grid = RowGrid::tiling([c[2] - height / 2.0, c[2] + height / 2.0], 0.11).unwrap();
    let views: Vec<Strips> = (0..n)
        .map(|k| {
            let a = PI * k as f64 / n as f64 + 0.1;
            let u = c[0] * a.cos() - c[1] * a.sin();
            Strips::from_fn(row_grid, a, |_, out| out.push([u - r, u + r])).unwrap()
        })
        .collect();
    let m = SlicedHull::new(&views).unwrap().measures();
    // A regular polygon of s sides about a circle: area s r² t, perimeter 2 s r t, polar moment s r⁴ t (3 + t²)/6, with
    // t = tan(π/s).
    let s = (2 * n) as f64;
    let t = (PI / s).tan();
    let (area, perimeter, polar) = (s * r * r * t, 2.0 * s * r * t, s * r.powi(4) * t * (3.0 + t * t) / 6.0);
    let near = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-12, "{a} {b}");
    near(m.volume_mm3, area * height);
    near(m.surface_area_mm2, perimeter * height + 2.0 * area);
    let centre = m.centroid_mm.unwrap();
    (0..3).for_each(|k| near(centre[k], c[k]));
    near(m.inertia_mm5[(2, 2)], polar * height);
    for k in 0..2 {
        near(m.inertia_mm5[(k, k)], 0.5 * polar * height + area * height.powi(3) / 12.0);
    }
    assert!((0..3).all(|k| m.inertia_mm5[(k, (k + 1) % 3)].abs() < 1e-15));
    let size = m.bounding_box_mm.unwrap().size();
    near(size.z, height);
}

/// A turntable view's silhouette from signed distances (pixels, negative inside) in its picture.
pub fn silhouette(size: [usize; 2], distance: impl Fn(f64, f64) -> f64) -> Arc<Silhouette> {
    let distance_px =
        (0..size[0] * size[1]).map(|k| distance((k % size[0]) as f64, (k / size[0]) as f64) as f32).collect();
    Arc::new(Silhouette { picture: size, origin: [0, 0], size, distance_px })
}

const TABLE: Turntable = Turntable {
    mm_per_px: 0.005,
    axis_column_px: 151.3,
    origin_row_px: 262.4,
    elevation_rad: 0.0,
    roll_rad: 0.0,
    camera_distance_mm: None,
};

/// Views of a ball of 1 mm at 5 µm a pixel, off the axis.
fn ball_cones(views: usize, table: &Turntable) -> Vec<Cone> {
    (0..views)
        .map(|k| {
            let camera = table.view(Angle::from_rad(PI * k as f64 / views as f64), 0.3 * (k % 3) as f64);
            let at = camera.project(&[0.03, -0.05, 0.613].into()).unwrap();
            let radius = RADIUS_MM / table.mm_per_px;
            Cone::new(camera, silhouette([300, 260], |x, y| (x - at[0]).hypot(y - at[1]) - radius))
        })
        .collect()
}

#[test]
fn a_ball_of_1_mm_at_5_um_a_pixel_is_within_three_in_a_thousand() {
    for n in [6, 25] {
        for roll_rad in [0.0, 0.02] {
            let table = Turntable { roll_rad, ..TABLE };
            let cones = ball_cones(n, &table);
            let outlines =
                SlicedHull::of_cones(&cones).unwrap().volume_mm3() / (excess(n) * VOLUME_MM3) - 1.0;
            let row_grid = RowGrid::of_rows(cones[0].projection(), 260).unwrap();
            let masks: Vec<Strips> = (cones.iter())
                .map(|c| {
                    let bytes: Vec<u8> =
                        c.silhouette().distance_px.iter().map(|d| u8::from(*d < 0.0)).collect();
                    Strips::from_mask(&BitMask::from_bytes(300, &bytes), c.projection(), row_grid).unwrap()
                })
                .collect();
            let masks = SlicedHull::new(&masks).unwrap().volume_mm3() / (excess(n) * VOLUME_MM3) - 1.0;
            println!(
                "ball of 200 px, {n} views, roll {roll_rad}: outlines {outlines:+.2e}, masks {masks:+.2e} off the closed form"
            );
            assert!(outlines.abs() < 3e-4, "{outlines}");
            // Against the ball itself, as published.
            assert!(n != 25 || (excess(n) * (1.0 + outlines) - 1.0).abs() < 3e-3, "{outlines}");
            assert!(n != 25 || (excess(n) * (1.0 + masks) - 1.0).abs() < 3e-3, "{masks}");
        }
    }
}

/// Two balls one above and beside the other, and a bar across a gap: outlines with several intervals a row.
fn dumbbell_cones(views: usize, table: &Turntable) -> Vec<Cone> {
    let balls = [([0.25, 0.0, 0.5], 0.2), ([-0.2, 0.1, 0.55], 0.17), ([0.02, 0.05, 0.8], 0.2)];
    (0..views)
        .map(|k| {
            let camera = table.view(Angle::from_rad(PI * k as f64 / views as f64 - 0.4), 0.0);
            let discs = balls.map(|(c, r)| (camera.project(&c.into()).unwrap(), r / table.mm_per_px));
            let distance = |x: f64, y: f64| {
                discs.iter().map(|(c, r)| (x - c[0]).hypot(y - c[1]) - r).fold(f64::MAX, f64::min)
            };
            Cone::new(camera, silhouette([300, 260], distance))
        })
        .collect()
}

#[test]
fn it_is_the_hull_on_a_grid_in_the_same_frame() {
    let table = Turntable { roll_rad: -0.015, ..TABLE };
    for (name, cones) in [("ball", ball_cones(9, &table)), ("three balls", dumbbell_cones(9, &table))] {
        let exact = SlicedHull::of_cones(&cones).unwrap();
        let m = exact.measures();
        let pieces = (0..exact.row_grid().rows).map(|k| exact.slice_figures(k).pieces).max().unwrap();
        let bounds = find_bounds(&cones).unwrap();
        let mut grid = HullGrid::new(&bounds, bounds.size().max() / 300.0).unwrap();
        cones.iter().for_each(|c| grid.carve(c));
        let g = grid.measures();
        let (volume, area) =
            (m.volume_mm3 / g.volume_mm3 - 1.0, m.surface_area_mm2 / g.surface_area_mm2 - 1.0);
        println!("{name}: exact/grid volume {volume:+.2e}, surface {area:+.2e}; at most {pieces} pieces");
        assert!(volume.abs() < 1e-3, "{name}: {volume}");
        assert!(area.abs() < 0.02, "{name}: {area}");
        let (a, b) = (m.bounding_box_mm.unwrap(), g.bounding_box_mm.unwrap());
        let off = (a.min - b.min).amax().max((a.max - b.max).amax());
        assert!(off < 1.2 * table.mm_per_px, "{name}: {off} mm");
        assert_eq!(pieces > 1, name != "ball");
    }
}
