//! The rendered turntable, whose truth is known: `../shared/data/turntable-rendered`.

use crate::kit::Lab;
use crate::skip::shared_data;
use serde_json::Value;

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("no number at {pointer}"))
}

/// Root mean square of the differences of two columns.
fn rms(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let squares: Vec<f64> = pairs.map(|(a, b)| (a - b).powi(2)).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn the_rendered_turntable_is_measured_from_its_pictures() {
    let Some(folder) = shared_data("turntable-rendered/sand_ma107_00002") else { return };
    let text = |name: &str| std::fs::read_to_string(folder.join("truth").join(name)).unwrap();
    let truth: Value = serde_json::from_str(&text("truth.json")).unwrap();
    let table: Vec<Vec<f64>> = (text("true_angles.csv").lines().skip(1))
        .map(|line| line.split(',').map(|x| x.parse().unwrap()).collect())
        .collect();
    let lab = Lab::new();
    let (pictures, background) =
        (folder.display().to_string(), folder.join("empty.png").display().to_string());
    let arguments = ["--json", "import", &pictures, "--pattern", "grain_*.png", "--closing-view", "25"];
    let more = ["--background", &background, "--mm-per-px", "0.00437", "--name", "rendered", "--no-pictures"];
    let result = lab.run(&[&arguments[..], &more[..]].concat()).succeeds().json();
    let c = &result["calibration"];
    let views = c["views"].as_array().unwrap();
    let column = |k: usize| table.iter().map(move |row| row[k]);
    let angles = rms(views.iter().map(|v| number(v, "/angle_deg")).zip(column(2)));
    let offsets = rms(views.iter().map(|v| number(v, "/offset_px")).zip(column(3)));
    let off = |pointer: &str, truth: f64| number(c, pointer) - truth;
    let axis = off("/axis_column_px/value", number(&truth, "/camera/axis_u"));
    let roll = off("/roll_deg/value", number(&truth, "/camera/roll"));
    let hull =
        100.0 * (number(&result, "/hull/volume_mm3") / number(&truth, "/volume_above_pedestal_mm3") - 1.0);
    println!(
        "axis {axis:+.3} px, roll {roll:+.4}°, offsets {offsets:.3} px and angles {angles:.4}° (root mean square), hull {hull:+.2} %; {}",
        c["camera_distance_says"]
    );
    assert!(axis.abs() < 0.5 && roll.abs() < 0.05 && offsets < 0.25 && angles < 0.05);
    // With the true cameras and the true silhouettes the hull has 2.3 % more than the grain.
    assert!((hull - 2.3).abs() < 0.5, "{hull}");
    assert_eq!(c["findings"], serde_json::json!([]));
    let sigma = |pointer: &str| number(c, pointer);
    assert!(roll.abs() < 2.0 * sigma("/roll_deg/sigma") && axis.abs() < 2.5 * sigma("/axis_column_px/sigma"));
}
