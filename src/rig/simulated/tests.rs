//! The rig as a whole: what it photographs is what the formulas say.

use super::*;
use crate::rig::{Camera, RotationStage};

/// A picture small enough for unoptimised code: the grain is about 100 pixels wide.
fn small() -> Settings {
    Settings { width: 240, height: 200, mm_per_px: 0.009, ..Settings::default() }
}

fn luma(bytes: &[u8]) -> image::GrayImage {
    image::load_from_memory(bytes).unwrap().to_luma8()
}

#[test]
fn a_balls_silhouette_has_the_area_of_the_closed_form() {
    let r = 0.45;
    let s = Settings { sphere_diameter_mm: Some(2.0 * r), roll_deg: 1.3, ..small() };
    // A circle without the segment below the pedestal's top, which the ball enters by 0.02 mm.
    let h = r - s.embedded_mm;
    let segment = r * r * (h / r).acos() - h * (r * r - h * h).sqrt();
    let want = (std::f64::consts::PI * r * r - segment) / s.mm_per_px.powi(2);
    let truth = open(&s).unwrap().2;
    for deg in [0.0, 50.0, 200.0] {
        let got = truth.true_silhouette(Angle::from_deg(deg), 0.3).area_px();
        assert!((got / want - 1.0).abs() < 1e-3, "{deg}°: {got} px, expected {want}");
    }
}

#[test]
fn a_pinhole_sees_a_ball_larger_by_its_tangent_cone() {
    let (r, d) = (0.45, 6.0);
    let s = Settings {
        sphere_diameter_mm: Some(2.0 * r),
        embedded_mm: 0.0,
        eccentricity_mm: [0.0; 2],
        camera_distance_mm: Some(d),
        roll_deg: 0.0,
        ..small()
    };
    let got = open(&s).unwrap().2.true_silhouette(Angle::default(), 0.0);
    // The ellipse of a ball at depth D, its centre r beside the optical axis: π f² r² (ρ² − r²)^½ / (D² − r²)^(3/2)
    // with ρ² = D² + r², and f = D because the scale is given at the axis.
    let want = std::f64::consts::PI * r * r * d.powi(3) / (d * d - r * r).powf(1.5) / s.mm_per_px.powi(2);
    assert!((got.area_px() / want - 1.0).abs() < 1e-3, "{} {want}", got.area_px());
}

#[test]
fn the_grain_turns_counter_clockwise_seen_from_above() {
    // A ball at (0.2, 0) mm: at 90° it is behind the axis (y = +0.2), at 180° to the left.
    let s = Settings {
        sphere_diameter_mm: Some(0.5),
        eccentricity_mm: [0.2, 0.0],
        camera_distance_mm: Some(4.0),
        roll_deg: 0.0,
        step_error: 0.0,
        ..small()
    };
    let truth = open(&s).unwrap().2;
    let axis = truth.truth().camera.axis_column_px;
    let at = |deg| {
        let c = truth.true_silhouette(Angle::from_deg(deg), 0.0);
        (c.centroid_px()[0] - axis, c.area_px())
    };
    let (right, _) = at(0.0);
    let (behind, far_area) = at(90.0);
    let (left, _) = at(180.0);
    let (before, near_area) = at(270.0);
    assert!((right - 0.2 / s.mm_per_px).abs() < 0.2, "{right}");
    assert!((left + right).abs() < 0.01, "{left}");
    assert!(behind.abs() < 0.01 && before.abs() < 0.01);
    assert!(far_area < 0.9 * near_area, "{far_area} {near_area}");
}

#[test]
fn the_picture_shows_the_silhouette() {
    // Without noise, against an even background: half-way between the levels lies the true outline.
    let s = Settings {
        noise_sd: 0.0,
        background_unevenness: 0.0,
        embedded_mm: 0.0,
        jpeg_quality: 100,
        ..small()
    };
    let (mut stage, mut camera, truth) = open(&s).unwrap();
    stage.move_to(Angle::from_deg(72.0)).unwrap();
    let picture = luma(&camera.capture().unwrap().bytes);
    let seen = truth.truth().exposures[0].clone();
    assert!((seen.true_angle_deg - 72.0).abs() <= 0.045 && (seen.true_angle_deg - 72.0).abs() > 1e-6);
    let body = truth.true_silhouette(Angle::from_deg(seen.true_angle_deg), seen.wobble_px);
    let top = truth.truth().camera.axis_row_px;
    let mut wrong = 0;
    for (k, covered) in body.coverage.iter().enumerate() {
        let (i, j) = (
            body.window.origin[0] + k % body.window.size[0],
            body.window.origin[1] + k / body.window.size[0],
        );
        let dark = picture.get_pixel(i as u32, j as u32).0[0] < 165;
        let clear = !(0.01..=0.99).contains(covered);
        if (j as f64) < top - 2.0 && clear && dark != (*covered > 0.5) {
            wrong += 1;
        }
    }
    assert!(wrong < body.coverage.len() / 100, "{wrong} of {}", body.coverage.len());
}

/// Grey levels' counts, smoothed over five.
fn histogram(picture: &image::GrayImage) -> Vec<f64> {
    let mut counts = [0f64; 256];
    picture.iter().for_each(|g| counts[usize::from(*g)] += 1.0);
    (0..256usize).map(|g| counts[g.saturating_sub(3)..(g + 4).min(256)].iter().sum::<f64>() / 7.0).collect()
}

#[test]
fn the_histogram_has_three_peaks_in_both_polarities() {
    for (bright_background, ranges) in
        [(true, [15..55, 60..160, 170..235]), (false, [5..35, 45..125, 126..250])]
    {
        let s = Settings { bright_background, ..small() };
        let picture = luma(&open(&s).unwrap().1.capture().unwrap().bytes);
        let h = histogram(&picture);
        let peaks = ranges.map(|r| r.max_by(|a, b| h[*a].total_cmp(&h[*b])).unwrap());
        for pair in peaks.windows(2) {
            let valley = h[pair[0]..pair[1]].iter().copied().fold(f64::INFINITY, f64::min);
            let lower = h[pair[0]].min(h[pair[1]]);
            assert!(valley < 0.5 * lower, "peaks at {peaks:?}: valley {valley}, lower peak {lower}");
        }
    }
}

#[test]
fn the_same_settings_angle_and_exposure_give_the_same_bytes() {
    let shoot = |settings: &Settings, threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let (mut stage, mut camera, _) = open(settings).unwrap();
            stage.move_to(Angle::from_deg(7.2)).unwrap();
            [camera.capture().unwrap().bytes, camera.capture().unwrap().bytes]
        })
    };
    let [first, second] = shoot(&small(), 1);
    assert_eq!(shoot(&small(), 3), [first.clone(), second.clone()]);
    assert_ne!(first, second);
    assert_ne!(shoot(&Settings { seed: 2, ..small() }, 1)[0], first);
}

#[test]
fn the_file_is_a_colour_jpeg_with_exif() {
    // More than one strip, and a last one that is not a whole number of coding units.
    let s = Settings { width: 250, height: 301, ..small() };
    let frame = open(&s).unwrap().1.capture().unwrap();
    assert_eq!(crate::rig::Encoding::sniff(&frame.bytes), Some(frame.encoding));
    let picture = image::load_from_memory(&frame.bytes).unwrap();
    assert_eq!((picture.width(), picture.height(), picture.color().channel_count()), (250, 301, 3));
    let exif = frame.bytes.windows(6).position(|w| w == b"Exif\0\0").unwrap();
    assert_eq!(&frame.bytes[exif + 6..exif + 10], b"II\x2a\0");
    // The seam between the strips is not to be seen: both sides are background of one level.
    let grey = picture.to_luma8();
    let mean = |row: u32| (0..60).map(|i| f64::from(grey.get_pixel(i, row).0[0])).sum::<f64>() / 60.0;
    assert!((mean(127) - mean(128)).abs() < 1.5, "{} {}", mean(127), mean(128));
}

#[test]
fn faults_come_when_they_are_asked_for() {
    let mut s = small();
    s.faults = Faults {
        empty_frame_at: Some(0),
        truncate_frame_at: Some(1),
        fail_capture_at: Some(2),
        slip: Some(Slip { at: 3, deg: 5.0 }),
        ..Faults::default()
    };
    let (_, mut camera, truth) = open(&s).unwrap();
    assert!(camera.capture().unwrap().bytes.is_empty());
    let cut = camera.capture().unwrap().bytes;
    assert!(cut.starts_with(&[0xff, 0xd8]) && !cut.ends_with(&[0xff, 0xd9]));
    assert!(matches!(camera.capture(), Err(RigError::Device(_))));
    camera.capture().unwrap();
    let angles: Vec<f64> = truth.truth().exposures.iter().map(|e| e.true_angle_deg).collect();
    assert_eq!(angles.len(), 4);
    assert!(angles[2] == 0.0 && (angles[3] - 5.0).abs() < 1e-12, "{angles:?}");
}

#[test]
fn the_truth_is_kept_in_files_that_are_read_again() {
    let (_, mut camera, truth) = open(&small()).unwrap();
    camera.capture().unwrap();
    let [(_, json), (_, surface)] = truth.files().unwrap();
    let json: Truth = serde_json::from_slice(&json).unwrap();
    assert_eq!((json.settings, json.exposures.len()), (small(), 1));
    assert!((json.grain_volume_mm3 / truth.truth().grain_volume_mm3 - 1.0).abs() < 1e-12);
    let surface = grainrig_core::formats::stl::read(&surface).unwrap();
    assert_eq!(surface.triangles.len(), truth.truth_mesh().triangles.len());
}
