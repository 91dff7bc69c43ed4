//! `grainrig calibrate scale`: the size of a pixel from pictures of a ball, held against the truth.

#[path = "support/kit/mod.rs"]
mod kit;
#[path = "support/skip.rs"]
mod skip;

use grainrig::jobs::{Angles, BodyKind, ScaleRequest, calibrate_scale};
use grainrig::rig::simulated::{Settings, open};
use grainrig::rig::{Camera as _, RotationStage as _};
use grainrig_core::geometry::Angle;
use kit::Lab;
use serde_json::Value;
use skip::shared_data;
use std::path::PathBuf;

fn rendered() -> Option<PathBuf> {
    shared_data("turntable-rendered/sand_ma107_00002")
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[test]
fn a_rendered_ball_shows_its_pixels_within_a_thousandth() {
    let Some(folder) = rendered() else { return };
    let lab = Lab::new();
    let folder_text = folder.to_str().unwrap();
    let empty = folder.join("empty.png");
    let calibrate =
        ["--json", "calibrate", "scale", folder_text, "--pattern", "ball_*.png", "--ball-diameter-mm", "2"];
    let mut calibrate = calibrate.to_vec();
    calibrate.extend(["--background", empty.to_str().unwrap(), "--out", "scale.json"]);
    let truth = 0.004_37;
    let cases: [&[&str]; 4] = [
        &["--step-deg", "36", "--camera-distance-mm", "120"],
        &["--angles", "0,36,72,108,144"],
        &["--camera-distance-mm", "120"],
        &[],
    ];
    // The best known case last: its file is what is imported with.
    for more in cases.iter().rev() {
        let printed = lab.run(&[&calibrate, *more].concat()).succeeds().json();
        let (value, sigma) = (number(&printed["mm_per_px"]["value"]), number(&printed["mm_per_px"]["sigma"]));
        println!(
            "{more:?}: {value:.7} ± {sigma:.7} mm per pixel, {:+.4} % off",
            100.0 * (value / truth - 1.0)
        );
        assert!((value / truth - 1.0).abs() < 1e-3, "{value} is not {truth}");
        assert!((value - truth).abs() < 2.0 * sigma, "{value} ± {sigma} is not {truth}");
        assert_eq!(printed["pictures"].as_array().unwrap().len(), 5);
        let written: Value = serde_json::from_slice(&kit::read(&lab.path("scale.json"))).unwrap();
        assert_eq!(written, printed);
    }

    // The session keeps what the file said, and needs the file no more. Every fifth view, the closing one among them.
    let import = [
        "--json",
        "import",
        folder_text,
        "--pattern",
        "grain_?[05].png",
        "--step-deg",
        "36",
        "--closing-view",
        "5",
        "--name",
        "one",
    ];
    let result = lab.run(&[&import[..], &["--calibration", "scale.json"]].concat()).succeeds().json();
    let written: Value = serde_json::from_slice(&kit::read(&lab.path("scale.json"))).unwrap();
    assert_eq!(result["scale_mm_per_px"], written["mm_per_px"]["value"]);
    std::fs::remove_file(lab.path("scale.json")).unwrap();
    let recording = lab.recording("one");
    let geometry = &recording.manifest().geometry;
    assert_eq!(geometry["mm_per_px_sigma"], written["mm_per_px"]["sigma"]);
    assert_eq!(geometry["camera_distance_mm"], serde_json::json!(120.0));
    lab.run(&["replay", "one"]).succeeds();
}

/// Takes pictures of a simulated ball and measures; the true size of a pixel over the measured one less 1, and the
/// stated standard uncertainty over the value.
fn error_of(settings: &Settings, angles: &[f64], known: bool) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let (mut stage, mut camera, _) = open(settings).unwrap();
    stage.home().unwrap();
    for (k, angle) in angles.iter().enumerate() {
        stage.move_to(Angle::from_deg(*angle)).unwrap();
        std::fs::write(folder.path().join(format!("ball_{k}.jpg")), camera.capture().unwrap().bytes).unwrap();
    }
    let request = ScaleRequest {
        folder: folder.path().into(),
        pattern: "*.jpg".into(),
        background: None,
        body: BodyKind::Ball,
        diameter_mm: settings.sphere_diameter_mm.unwrap(),
        tolerance_mm: 0.0,
        camera_distance_mm: settings.camera_distance_mm.filter(|_| known),
        angles: if known { Angles::Each(angles.to_vec()) } else { Angles::Unknown },
        silhouette: grainrig_core::silhouette::Settings::default(),
    };
    let file = calibrate_scale(&request).unwrap();
    let (value, sigma) = (file.mm_per_px.value.unwrap(), file.mm_per_px.sigma.unwrap());
    (value / settings.mm_per_px - 1.0, sigma / value)
}

#[test]
fn a_simulated_balls_error_is_within_its_uncertainty() {
    let all = std::env::var_os("GRAINRIG_ALL").is_some();
    let (mut cases, mut within, mut worst) = (0, 0, 0_f64);
    for (d, distance) in [Some(60.0), Some(120.0), Some(300.0), None].into_iter().enumerate() {
        for (b, blur_px) in [0.5, 1.0, 2.0, 3.0].into_iter().enumerate() {
            // Every lens and blur before one of the grounds; before both with the hours (`make test-long`).
            let grounds = if all { &[true, false][..] } else { &[[true, false][(d + b / 2) % 2]] };
            for &bright in grounds {
                let (diameter_mm, mm_per_px) = ([1.0, 2.0][b % 2], [0.0035, 0.0045][d % 2]);
                let picture = |room: f64| (diameter_mm / mm_per_px + room) as usize;
                let settings = Settings {
                    seed: 7 + (10 * d + b) as u64,
                    sphere_diameter_mm: Some(diameter_mm),
                    mm_per_px,
                    width: picture(200.0),
                    height: picture(220.0),
                    eccentricity_mm: [0.08, -0.05],
                    camera_distance_mm: distance,
                    blur_px,
                    noise_sd: [1.0, 4.0][(d + b) % 2],
                    bright_background: bright,
                    ..Settings::default()
                };
                let known = (d + b) % 3 != 0;
                let (error, sigma) = error_of(&settings, &[0.0, 72.0, 144.0], known);
                println!(
                    "distance {distance:?} mm, blur {blur_px} px, {} background, known {known}: {:+.3} % ± {:.3} %",
                    if bright { "bright" } else { "dark" },
                    100.0 * error,
                    100.0 * sigma
                );
                cases += 1;
                within += usize::from(error.abs() < 2.0 * sigma);
                worst = worst.max(error.abs());
            }
        }
    }
    println!("{within} of {cases} within two standard deviations; the worst is {:.3} % off", 100.0 * worst);
    assert!(within * 100 >= 95 * cases, "{within} of {cases}");
    // An uncertainty that covers everything says nothing.
    assert!(worst < 5e-3, "{worst}");
}

#[test]
fn what_cannot_be_measured_is_told() {
    let lab = Lab::new();
    let folder = lab.path("balls");
    std::fs::create_dir(&folder).unwrap();
    let settings = Settings { sphere_diameter_mm: Some(1.0), width: 700, height: 600, ..Settings::default() };
    let (mut stage, mut camera, _) = open(&settings).unwrap();
    stage.home().unwrap();
    let ball = camera.capture().unwrap().bytes;
    std::fs::write(folder.join("ball.jpg"), &ball).unwrap();
    let (_, mut camera, _) = open(&Settings { sphere_diameter_mm: None, ..settings }).unwrap();
    std::fs::write(folder.join("grain.jpg"), camera.capture().unwrap().bytes).unwrap();
    // The ball with its left half cropped away.
    let whole = image::load_from_memory(&ball).unwrap();
    whole.crop_imm(350, 0, 350, 600).save(folder.join("cut.png")).unwrap();

    let scale = ["calibrate", "scale", "balls", "--out", "scale.json", "--ball-diameter-mm"];
    let cases: [(&[&str], i32, &[&str]); 11] = [
        (&["1", "--pattern", "none*"], 1, &["no file in", "none*"]),
        (&["1", "--pattern", "grain.jpg"], 1, &["grain.jpg", "not round", "% is the limit"]),
        (&["1", "--pattern", "cut.png"], 1, &["cut.png", "left border"]),
        (&["0", "--pattern", "ball.jpg"], 2, &["diameter is 0 mm", "positive"]),
        (&["nan", "--pattern", "ball.jpg"], 2, &["diameter is NaN mm", "positive"]),
        (
            &["1", "--pattern", "ball.jpg", "--ball-tolerance-mm", "0.6"],
            2,
            &["ball_tolerance_mm is 0.6 mm", "--as-given"],
        ),
        (
            &["1", "--pattern", "ball.jpg", "--ball-tolerance-mm", "0.6", "--as-given"],
            2,
            &["tolerance is 0.6 mm"],
        ),
        (
            &["1", "--pattern", "ball.jpg", "--camera-distance-mm", "1"],
            2,
            &["camera_distance_mm is 1 mm", "--as-given"],
        ),
        (&["1", "--pattern", "ball.jpg", "--angles", "0,36"], 2, &["2 angle(s)", "1 picture(s)"]),
        (&["1", "--pin-diameter-mm", "1"], 2, &["--pin-diameter-mm"]),
        (&["1", "--pattern", "ball.jpg", "--background", "balls/cut.png"], 1, &["700 × 600"]),
    ];
    for (more, code, words) in cases {
        lab.run(&[&scale[..], more].concat()).fails(code, words);
        assert!(!lab.path("scale.json").exists());
    }
    lab.run(&[&scale[..], &["1", "--pattern", "ball.jpg"]].concat()).succeeds();

    // The file is read strictly, and no two scales are taken at once.
    let good = String::from_utf8(kit::read(&lab.path("scale.json"))).unwrap();
    let spoiled = [
        ("version", good.replace("\"version\": 1", "\"version\": 9")),
        ("kind", good.replace("grainrig scale", "recipe")),
        ("unknown field", good.replace("\"eccentricity_mm\"", "\"colour\": 1, \"eccentricity_mm\"")),
        ("no JSON", good[..100].to_owned()),
    ];
    for (word, text) in spoiled {
        lab.write("bad.json", &text);
        lab.run(&["import", "balls", "--calibration", "bad.json"]).fails(2, &[word, "bad.json"]);
    }
    let both = ["import", "balls", "--calibration", "scale.json", "--mm-per-px", "0.004"];
    lab.run(&both).fails(2, &["--calibration", "--mm-per-px"]);
    std::fs::remove_file(folder.join("ball.jpg")).unwrap();
    std::fs::remove_file(folder.join("grain.jpg")).unwrap();
    std::fs::copy(folder.join("cut.png"), folder.join("cut2.png")).unwrap();
    lab.run(&["import", "balls", "--calibration", "scale.json"]).fails(2, &["700 × 600 px", "350 × 600 px"]);
}
