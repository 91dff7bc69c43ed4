use super::{estimate as estimated, *};
use crate::calibrate::Turntable;
use crate::geometry::{Angle, Point};
use crate::silhouette::Silhouette;
use std::f64::consts::PI;
use std::sync::Arc;

const MM_PER_PX: f64 = 0.004;

/// Views of a body of revolution about the axis, of radius `r(z)` pixels between ±100 px, over `degrees`.
fn views(radius: impl Fn(f64) -> f64, count: usize, degrees: f64, table: Turntable) -> Vec<Cone> {
    let size = [260, 260];
    // Along the rows: no true distance, but its zero is the outline and it grows no faster than a distance does here.
    let distance_px = (0..size[0] * size[1])
        .map(|k| {
            let (x, z) = ((k % size[0]) as f64 - 130.0, 130.0 - (k / size[0]) as f64);
            (0.4 * (x.abs() - radius(z.clamp(-100.0, 100.0))).max(z.abs() - 100.0)) as f32
        })
        .collect();
    let silhouette = Arc::new(Silhouette { picture: size, origin: [0, 0], size, distance_px });
    (0..count)
        .map(|i| {
            let angle = Angle::from_deg(degrees * i as f64 / count as f64);
            Cone::new(table.view(angle, 0.0), Arc::clone(&silhouette))
        })
        .collect()
}

fn level() -> Turntable {
    Turntable {
        mm_per_px: MM_PER_PX,
        axis_column_px: 130.0,
        origin_row_px: 130.0,
        elevation_rad: 0.0,
        roll_rad: 0.0,
        camera_distance_mm: None,
    }
}

fn ball(z: f64) -> f64 {
    (100.0_f64.powi(2) - z * z).max(0.0).sqrt()
}

/// A ball with ripples along its axis.
fn rippled(z: f64) -> f64 {
    ball(z) * (1.0 + 0.05 * (z / 4.0).sin())
}

/// The estimate of a hull that has one.
fn estimate(cones: &[Cone], known: &Known) -> VolumeEstimate {
    estimated(cones, known).unwrap()
}

/// The hull of a body of revolution, exactly.
fn known(radius: impl Fn(f64) -> f64, views: usize) -> Known {
    let slices = (0..4000).map(|k| radius((f64::from(k) + 0.5) / 20.0 - 100.0).powi(2) / 20.0).sum::<f64>();
    let angle = PI / (2 * views) as f64;
    let reach = 100.0 * MM_PER_PX;
    Known {
        volume_mm3: PI * slices * MM_PER_PX.powi(3) * angle.tan() / angle,
        surface_mm2: 4.0 * PI * reach * reach,
        bounds: Aabb { min: Point::new(-reach, -reach, -reach), max: Point::new(reach, reach, reach) },
        scale: None,
        cameras: 0.0,
        foot: 0.0,
        outline_px: 0.0,
    }
}

#[test]
fn a_ball_fills_its_hull_but_for_the_corners() {
    let truth = 4.0 / 3.0 * PI * (100.0 * MM_PER_PX).powi(3);
    for distance in [None, Some(60.0)] {
        let known = known(ball, 25);
        let cones = views(ball, 25, 180.0, Turntable { camera_distance_mm: distance, ..level() });
        let e = estimate(&cones, &known);
        let signs = e.signs.unwrap();
        assert!(
            signs.concavity < 0.003 && signs.curvature_variation < 0.3 && signs.gaps < 0.003,
            "{signs:?}"
        );
        assert!((e.volume_mm3 / truth - 1.0).abs() < 0.004, "{distance:?}: {} {truth}", e.volume_mm3);
        assert!(e.interval_mm3[0] < truth && truth < e.interval_mm3[1], "{distance:?}: {e:?}");
        assert!(e.interval_mm3[1] - e.interval_mm3[0] < 0.02 * truth);
    }
}

#[test]
fn ripples_along_the_axis_tell_of_hollows_across_it() {
    let smooth = estimate(&views(ball, 25, 180.0, level()), &known(ball, 25));
    let rough = estimate(&views(rippled, 25, 180.0, level()), &known(rippled, 25));
    let concavity = |e: &VolumeEstimate| e.signs.unwrap().concavity;
    assert!(concavity(&rough) > concavity(&smooth) + 0.02, "{rough:?}");
    let share = |e: &VolumeEstimate, radius: fn(f64) -> f64| e.volume_mm3 / known(radius, 25).volume_mm3;
    assert!(share(&rough, rippled) < share(&smooth, ball));
}

#[test]
fn looking_from_behind_too_tells_no_more() {
    let half = estimate(&views(rippled, 25, 180.0, level()), &known(rippled, 25));
    let whole = estimate(&views(rippled, 50, 360.0, level()), &known(rippled, 25));
    assert_eq!(whole.signs.unwrap().views.to_bits(), 25.0_f64.to_bits());
    assert!((whole.volume_mm3 / half.volume_mm3 - 1.0).abs() < 1e-6);
}

#[test]
fn cameras_that_show_no_slices_leave_more_open() {
    let width = |e: &VolumeEstimate| (e.interval_mm3[1] - e.interval_mm3[0]) / e.volume_mm3;
    let level_views = estimate(&views(rippled, 25, 180.0, level()), &known(rippled, 25));
    let above = Turntable { elevation_rad: 0.3, ..level() };
    let few = views(rippled, 5, 180.0, level());
    let part = views(rippled, 25, 90.0, level());
    for cones in [views(rippled, 25, 180.0, above), few, part] {
        let e = estimate(&cones, &known(rippled, 25));
        assert!(e.signs.is_none() && width(&e) > 1.5 * width(&level_views), "{e:?}");
        assert!(e.shares[0].what.contains("alone"), "{e:?}");
    }
}

#[test]
fn each_uncertainty_widens_the_interval_and_is_named() {
    let cones = views(ball, 25, 180.0, level());
    let plain = estimate(&cones, &known(ball, 25));
    assert!(plain.shares.iter().any(|s| s.what.contains("taken as exact")), "{plain:?}");
    for (known, name, percent) in [
        // Three times 0.5 %, twice.
        (Known { scale: Some(0.005), ..known(ball, 25) }, "size of a pixel", 2.98),
        (Known { cameras: 0.01, ..known(ball, 25) }, "axis", 1.98),
        (Known { foot: 0.04, ..known(ball, 25) }, "foot", 1.98),
    ] {
        let e = estimate(&cones, &known);
        let share = e.shares.iter().find(|s| s.what.contains(name)).unwrap();
        assert!((share.percent[1] - percent).abs() < 0.02, "{share:?}");
        assert!(e.interval_mm3[0] < plain.interval_mm3[0] && e.interval_mm3[1] > plain.interval_mm3[1]);
        // What the views may have wrong is all that can make the grain larger than its hull.
        assert!(e.interval_mm3[1] / known.volume_mm3 < 1.0 + (percent + 0.9) / 100.0, "{e:?}");
    }
}

#[test]
fn a_body_unlike_all_that_was_fitted_to_is_named_and_leaves_more_open() {
    // Thick and thin: its outline leaves a fifth of its convex hull free. Its slices are discs none the less.
    let waisted = |z: f64| if z.abs() < 40.0 { 50.0 } else { 100.0 };
    let e = estimate(&views(waisted, 25, 180.0, level()), &known(waisted, 25));
    assert!(e.shares[0].what.contains("farther than in any grain"), "{e:?}");
    let plain = estimate(&views(ball, 25, 180.0, level()), &known(ball, 25));
    assert!(!plain.shares[0].what.contains("farther"), "{plain:?}");
    assert!(e.shares[0].percent[0] < plain.shares[0].percent[0] - 0.1, "{e:?} {plain:?}");
}
