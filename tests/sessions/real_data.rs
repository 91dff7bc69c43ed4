//! Other people's pictures go through `grainrig import` to a mesh. The data are not part of the project;
//! where they are not there, each test says so and passes.

use crate::skip::shared_data;
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Runs `grainrig import` on a folder with the default settings; checks the mesh and gives the result.
fn import(folder: &Path, pattern: &str, geometry: &[&str]) -> Value {
    let home = tempfile::tempdir().unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .arg("--data")
        .arg(home.path())
        // No configuration of whoever runs this.
        .env("XDG_CONFIG_HOME", home.path())
        .args(["--json", "import"])
        .arg(folder)
        .args(["--pattern", pattern, "--name", "one"])
        .args(geometry)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{said}");
    let result: Value = serde_json::from_slice(&run.stdout).unwrap();

    let bytes = std::fs::read(result["products"]["stl"].as_str().unwrap()).unwrap();
    let surface = grainrig_core::formats::stl::read(&bytes).unwrap();
    surface.check().unwrap();
    assert_eq!(surface.triangles.len() as u64, result["mesh"]["triangles"].as_u64().unwrap());
    assert!(result["mesh"]["tetrahedra"].as_u64().unwrap() > 10_000);
    result
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The least and the mean agreement of hull and silhouettes.
fn agreement(result: &Value) -> (f64, f64) {
    let iou = &result["hull"]["silhouette_iou"];
    println!("IoU {iou}, axis {}, hull {}", result["axis"], result["hull"]);
    (number(&iou["min"]), number(&iou["mean"]))
}

#[test]
fn a_rendered_grain_comes_out_at_its_true_size() {
    let Some(folder) = shared_data("turntable-rendered/sand_ma107_00002") else { return };
    let truth: Value =
        serde_json::from_slice(&std::fs::read(folder.join("truth/truth.json")).unwrap()).unwrap();
    let camera = &truth["camera"];
    let (scale, distance) = (camera["mm_per_px"].to_string(), camera["D"].to_string());
    let empty = folder.join("empty.png");
    let result = import(
        &folder,
        "grain_*.png",
        &[
            "--step-deg",
            "7.2",
            "--closing-view",
            "25",
            "--background",
            empty.to_str().unwrap(),
            "--camera-distance-mm",
            &distance,
            "--mm-per-px",
            &scale,
        ],
    );
    let (least, mean) = agreement(&result);
    assert!(mean >= 0.995 && least >= 0.99, "IoU {mean}, least {least}");
    // The hull of 25 views is larger than the grain: with the true cameras by 2.3 %.
    let excess = number(&result["hull"]["volume_mm3"]) / number(&truth["volume_mm3"]);
    assert!((excess / 1.023 - 1.0).abs() < 0.005, "hull over grain {excess}");
    let axis = &result["axis"];
    let (column, roll) = (number(&axis["axis_column_px"]), number(&axis["roll_deg"]));
    // Each picture was moved sideways at random by 0.2 px (standard deviation): the closing pair alone, of
    // which the axis is the mirror, is off by 0.14 px on average.
    assert!((column - number(&camera["axis_u"])).abs() < 0.4, "axis at column {column}");
    assert!((roll - number(&camera["roll"])).abs() < 0.05, "roll {roll}°");
    assert!((number(&axis["origin_row_px"]) - number(&camera["row0"])).abs() < 0.5, "{axis}");
}

#[test]
fn a_plaster_dinosaur_has_the_size_its_makers_give() {
    let Some(folder) = shared_data("middlebury-dinoSparseRing") else { return };
    let cameras = folder.join("dinoSR_par.txt");
    let result = import(&folder, "dinoSR*.png", &["--cameras", cameras.to_str().unwrap()]);
    let (least, mean) = agreement(&result);
    assert!(mean >= 0.93 && least >= 0.90, "IoU {mean}, least {least}");
    // README.txt's "tight bounding box", in mm.
    let (low, high) = ([-61.897, -18.874, -57.845], [10.897, 68.227, 15.495]);
    let found = &result["hull"]["bounding_box_mm"];
    for k in 0..3 {
        let below = low[k] - number(&found["min"][k]);
        let above = number(&found["max"][k]) - high[k];
        // No camera sees the base from below: see the next test.
        let limit = if k == 1 { 6.0 } else { 5.0 };
        assert!((-5.0..=limit).contains(&below), "axis {k}: {below:.2} mm beyond the lower face");
        assert!(above.abs() <= 5.0, "axis {k}: {above:.2} mm beyond the upper face");
    }
}

/// The plaster dinosaur stands on a round base of about 25 mm radius. How far below a flat disc of 20 mm do its
/// perfect silhouettes let the hull reach? A place below it is carved away only where some camera sees it past the
/// disc's rim.
#[test]
fn no_silhouettes_can_end_the_plaster_dinosaurs_hull_at_its_base() {
    let Some(folder) = shared_data("middlebury-dinoSparseRing") else { return };
    let (base_mm, radius_mm, middle) = (-18.874, 20.0, [-20.0, -30.0]);
    let text = std::fs::read_to_string(folder.join("dinoSR_par.txt")).unwrap();
    let centres: Vec<[f64; 3]> = (text.lines().skip(1))
        .map(|line| {
            let n: Vec<f64> = line.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect();
            let (r, t) = (&n[9..18], &n[18..21]);
            // −Rᵀ t, metres to mm.
            [0, 1, 2].map(|k| -1000.0 * (0..3).map(|i| r[3 * i + k] * t[i]).sum::<f64>())
        })
        .collect();
    assert_eq!(centres.len(), 16);
    let hidden = |x: f64, z: f64, below: f64| {
        centres.iter().all(|c| {
            // Where the ray from the place to the camera comes through the disc's plane.
            let k = below / (c[1] - (base_mm - below));
            (x + k * (c[0] - x) - middle[0]).hypot(z + k * (c[2] - z) - middle[1]) <= radius_mm
        })
    };
    let mut deepest = 0.0_f64;
    for i in -12..=12 {
        for j in -12..=12 {
            let (x, z) = (middle[0] + f64::from(i), middle[1] + f64::from(j));
            let depths = (1..200).map(|n| 0.05 * f64::from(n)).take_while(|&h| hidden(x, z, h));
            deepest = depths.fold(deepest, f64::max);
        }
    }
    println!("the hull of a disc of {radius_mm} mm reaches {deepest:.2} mm below it");
    assert!(deepest > 6.0, "{deepest}");
}

#[test]
fn a_toy_dinosaur_before_a_blue_screen_is_one_shape_from_all_sides() {
    let Some(folder) = shared_data("oxford-dinosaur") else { return };
    let cameras = folder.join("projection_matrices.csv");
    let geometry = ["--cameras", cameras.to_str().unwrap(), "--camera-unit", "none"];
    let result = import(&folder, "viff.*.png", &geometry);
    let (least, mean) = agreement(&result);
    assert!(mean >= 0.95 && least >= 0.92, "IoU {mean}, least {least}");
    for lengths in ["volume_mm3", "voxel_volume_mm3", "surface_area_mm2", "bounding_box_mm"] {
        assert!(result["hull"][lengths].is_null(), "{lengths} has no unit");
    }
    assert!(result["mesh"]["volume_mm3"].is_null());
    for view in result["view_details"].as_array().unwrap() {
        // The digitiser's black lines: columns 694 … 719 and rows 0 … 1 at least.
        let frame = view["silhouette"]["frame_px"].as_array().unwrap();
        let frame: Vec<u64> = frame.iter().map(|v| v.as_u64().unwrap()).collect();
        assert!(frame[0] == 0 && (2..8).contains(&frame[1]) && (680..695).contains(&frame[2]), "{frame:?}");
    }
}
