//! No number leaves the program that is none: whole reconstructions of bodies that are flaky, thin, hollow, tiny or in
//! pieces, as cut-outs (black on white, without noise).
//!
//! `GRAINRIG_BODIES=500 cargo test --test numbers` tries as many bodies.

#[path = "support/kit/mod.rs"]
mod kit;

use grainrig::pipeline::{Cameras, Pipeline, ResultHead, Settings, TurntableSettings, View};
use grainrig::session::event::{CapturedView, EventKind, Role};
use grainrig::session::{check_finite, sha256_hex, to_json};
use grainrig_core::geometry::Angle;
use kit::Lab;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use std::io::Cursor;
use std::sync::Mutex;

/// Width and height of a picture, pixels, and the size of a pixel, mm.
const PICTURE: [usize; 2] = [160, 140];
const MM_PER_PX: f64 = 0.01;

/// An ellipsoid: its middle from the axis and the picture's middle row, and its half axes, pixels.
#[derive(Debug, Clone, Copy)]
struct Ellipsoid {
    middle: [f64; 3],
    axes: [f64; 3],
}

/// The shadow of some ellipsoids together, dark on white, as a PNG file.
fn shadow(body: &[Ellipsoid], angle: Angle, levels: [f64; 2]) -> Vec<u8> {
    const LINES: usize = 4;
    let [width, height] = PICTURE;
    let (sin, cos) = angle.deg().to_radians().sin_cos();
    let mut covered = vec![0.0_f64; width * height];
    for e in body {
        let [x, y, z] = e.middle;
        let (u, v) = (x * cos - y * sin + 79.7, 70.2 - z);
        let half = (e.axes[0] * cos).hypot(e.axes[1] * sin);
        for line in 0..height * LINES {
            let row = (line as f64 + 0.5) / LINES as f64 - 0.5;
            let q = half * (1.0 - ((row - v) / e.axes[2]).powi(2)).max(0.0).sqrt();
            for column in 0..width {
                let x = column as f64;
                let part = ((x + 0.5).min(u + q) - (x - 0.5).max(u - q)).max(0.0);
                covered[line / LINES * width + column] += part / LINES as f64;
            }
        }
    }
    let pixel = |c: &f64| (levels[0] + (levels[1] - levels[0]) * c.min(1.0)).round() as u8;
    let picture =
        image::GrayImage::from_raw(width as u32, height as u32, covered.iter().map(pixel).collect()).unwrap();
    let mut file = Cursor::new(Vec::new());
    picture.write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

/// A plate of 21 ellipsoids that leans, beside the axis: its slices are thinner than a pixel at many angles, and their
/// tangents lie far from the hull's middle.
fn leaning_plate() -> Vec<Ellipsoid> {
    const Y_AND_HALF: [[f64; 2]; 21] = [
        [23.5, 8.0],
        [23.4, 5.1],
        [19.7, 8.8],
        [21.2, 8.6],
        [16.9, 6.9],
        [18.0, 7.2],
        [20.6, 5.1],
        [17.7, 6.1],
        [23.3, 8.1],
        [17.3, 8.2],
        [17.1, 7.5],
        [17.0, 5.0],
        [23.0, 5.8],
        [17.7, 8.9],
        [23.0, 6.2],
        [23.7, 7.2],
        [21.4, 5.8],
        [23.5, 7.8],
        [23.7, 8.6],
        [18.4, 6.4],
        [17.3, 5.6],
    ];
    let one = |(k, [y, half]): (usize, &[f64; 2])| {
        let up = 3.0 * (k as f64 - 10.0);
        Ellipsoid { middle: [1.34 * up, *y, up], axes: [*half, 2.15, 6.0] }
    };
    Y_AND_HALF.iter().enumerate().map(|(k, v)| one((k, v))).collect()
}

#[test]
fn a_leaning_plate_has_bounds_in_every_place_that_states_them() {
    let lab = Lab::new();
    for view in 0..=25 {
        let angle = Angle::from_deg(7.2 * f64::from(view));
        lab.write(&format!("plate/p_{view:02}.png"), shadow(&leaning_plate(), angle, [255.0, 0.0]));
    }
    let arguments = [
        "import",
        "plate",
        "--name",
        "plate",
        "--step-deg",
        "7.2",
        "--mm-per-px",
        "0.01",
        "--closing-view",
        "25",
    ];
    let ran = lab.run(&arguments).succeeds();
    assert!(!ran.stdout.contains("NaN") && !ran.stdout.contains("inf "), "{}", ran.stdout);
    let file = kit::read(&lab.session("plate").join("products/result.json"));
    let hull = &serde_json::from_slice::<serde_json::Value>(&file).unwrap()["hull"];
    let number = |v: &serde_json::Value| v.as_f64().unwrap_or_else(|| panic!("{v}: {hull}"));
    let [least, most] = [0, 1].map(|k| number(&hull["volume_interval_mm3"][k]));
    let estimate = number(&hull["volume_estimate_mm3"]);
    assert!(0.0 < least && least < estimate && estimate < most, "{hull}");
    assert!(estimate < 0.98 * number(&hull["volume_mm3"]), "the hull's own volume is no estimate: {hull}");
    assert!(hull["volume_unknown"].is_null() && !hull["volume_says"].to_string().contains("NaN"), "{hull}");
}

/// Reconstructs a body; what is returned is its result, as it would be written.
fn reconstructed(body: &[Ellipsoid], views: usize, levels: [f64; 2]) -> Result<serde_json::Value, String> {
    let pipeline = Pipeline {
        settings: Settings::default(),
        cameras: Cameras::Turntable(TurntableSettings {
            mm_per_px: MM_PER_PX,
            ..TurntableSettings::default()
        }),
        background: None,
        views: views + 1,
        full_step_deg: 0.9,
        judges: true,
    };
    let (sender, receiver) = std::sync::mpsc::sync_channel(views + 1);
    for index in 0..=views {
        let angle = Angle::from_deg(180.0 * index as f64 / views as f64);
        let role = if index == views { Role::Closing } else { Role::Grain };
        let bytes = shadow(body, angle, levels);
        let captured = CapturedView {
            view: index,
            role,
            file: format!("view_{index:03}.png"),
            bytes: bytes.len() as u64,
            sha256: sha256_hex(&bytes),
            commanded_deg: angle.deg(),
            reached_deg: angle.deg(),
            others: Vec::new(),
        };
        sender.send(View::recorded(&captured, bytes)).unwrap();
    }
    drop(sender);
    let wrong = Mutex::new(Vec::new());
    let observer = |what: EventKind| {
        if let Err(e) = check_finite(&what) {
            wrong.lock().unwrap().push(e.to_string());
        }
    };
    let made = pipeline.run(receiver, &observer).map_err(|e| e.to_string())?;
    assert_eq!(*wrong.lock().unwrap(), [""; 0]);
    let timing = serde_json::json!(made.timing_s);
    let head = ResultHead {
        software: "test".into(),
        session: "test".into(),
        products: std::collections::BTreeMap::new(),
        timing_s: timing,
    };
    let bytes = to_json(&made.result_file(head)).unwrap();
    Ok(serde_json::from_slice(&bytes).unwrap())
}

#[test]
fn whatever_the_body_its_volume_has_bounds_or_a_reason_why_it_has_none() {
    let cases = std::env::var("GRAINRIG_BODIES").ok().and_then(|n| n.parse().ok()).unwrap_or(16);
    let thickness = prop_oneof![0.3..2.0_f64, 2.0..30.0_f64];
    let part = (
        [-25.0..25.0_f64, -25.0..25.0_f64, -20.0..20.0_f64],
        (4.0..30.0_f64, thickness, 4.0..30.0_f64),
        any::<bool>(),
    );
    let one = part.prop_map(|(middle, (a, b, c), lies)| Ellipsoid {
        middle,
        // A plate that stands, or one that lies.
        axes: if lies { [a, c, b] } else { [a, b, c] },
    });
    let bodies = (prop::collection::vec(one, 1..5), 2..13_usize, any::<bool>());
    let mut runner = TestRunner::new_with_rng(
        Config { cases, failure_persistence: None, max_shrink_iters: 8, ..Config::default() },
        proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha),
    );
    let counts = Mutex::new([0; 3]);
    let outcome = runner.run(&bodies, |(body, views, cut_out)| {
        let levels = if cut_out { [255.0, 0.0] } else { [210.0, 60.0] };
        let result = match reconstructed(&body, views, levels) {
            Ok(result) => result,
            Err(refused) => {
                prop_assert!(!refused.contains("NaN") && !refused.contains(" inf"), "{}", refused);
                counts.lock().unwrap()[2] += 1;
                return Ok(());
            }
        };
        let hull = &result["hull"];
        let text = result.to_string();
        prop_assert!(!text.contains("NaN") && !text.contains(" inf"), "{}", text);
        let number = |v: &serde_json::Value| v.as_f64();
        let ends = [0, 1].map(|k| number(&hull["volume_interval_mm3"][k]));
        match (ends, number(&hull["volume_estimate_mm3"]), hull["volume_unknown"].as_str()) {
            ([Some(least), Some(most)], Some(estimate), None) => {
                prop_assert!(0.0 < least && least <= estimate && estimate <= most, "{}", hull);
                counts.lock().unwrap()[0] += 1;
            }
            ([None, None], None, Some(why)) => {
                prop_assert!(
                    why.len() > 20 && result["warnings"].to_string().contains("no bound"),
                    "{}",
                    hull
                );
                counts.lock().unwrap()[1] += 1;
            }
            _ => prop_assert!(false, "{}", hull),
        }
        Ok(())
    });
    let [bounded, reasoned, refused] = *counts.lock().unwrap();
    println!("{bounded} with bounds, {reasoned} with a reason, {refused} refused");
    outcome.unwrap();
    assert!(bounded > 0, "nothing was reconstructed");
}
