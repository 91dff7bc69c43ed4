//! A grain pressed in many ways, by the real program.

use crate::rests::{block, grainrig, json};
use serde_json::Value;
use tempfile::TempDir;

/// A block on its broad side, coarse and laid askew a little.
const ASKED: [&str; 17] = [
    "compress",
    "block.stl",
    "--rest",
    "1",
    "--ensemble",
    "60",
    "--cases",
    "6",
    "--placing-deg",
    "0.3",
    "--young-span-mpa",
    "90000",
    "110000",
    "--size-mm",
    "0.15",
    "--size-at-contact-mm",
    "0.1",
];

fn interval(of: &Value) -> [f64; 3] {
    ["p05", "median", "p95"].map(|key| of[key].as_f64().unwrap_or_else(|| panic!("{of}")))
}

/// Without how long it took.
fn timeless(mut result: Value) -> Value {
    result.as_object_mut().unwrap().remove("core_s").unwrap();
    result
}

fn result(folder: &TempDir) -> Value {
    let text = std::fs::read(folder.path().join("block-ensemble/result.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

#[test]
fn an_ensemble_is_an_interval_with_what_it_comes_from_and_goes_on_with_the_missing_cases() {
    let size = [0.8, 0.6, 0.4];
    let folder = block(size);
    let found = json(&folder, &ASKED);
    assert_eq!((&found["finished"], &found["draws"], &found["cases"]), (&true.into(), &60.into(), &6.into()));
    let [low, middle, high] = interval(&found["delta_i_mm"]);
    assert!(low < middle && middle < high, "{found}");
    // Tilts about both axes with a standard deviation of s: half are above 1.18 s, and what they stand up is between the sides' widths.
    let rocking = interval(&found["rocking_mm"]);
    let s = f64::to_radians(0.3);
    assert!((1.0 * s * size[1]..1.3 * s * size[0].hypot(size[1])).contains(&rocking[1]), "{found}");
    assert!(middle > rocking[1] && high > rocking[2], "what sinks in comes on top: {found}");
    // As it is placed it lies flat: all is deformation. One thing alone unknown is told for each that is unknown.
    let as_placed = found["delta_i_mm"]["as_placed"].as_f64().unwrap();
    let alone = found["alone"].as_array().unwrap();
    let whats: Vec<&str> = alone.iter().map(|a| a["what"].as_str().unwrap()).collect();
    assert_eq!(whats, ["placing", "friction", "young", "regression"]);
    let of = |what: &str| {
        interval(&alone.iter().find(|a| a["what"] == what).unwrap_or_else(|| panic!("{what}"))["delta_i_mm"])
    };
    // A flat sinks in as one over its modulus: a tenth up and down, less what the twentieths cut off.
    let [soft, _, stiff] = of("young");
    assert!((1.17..1.22).contains(&(stiff / soft)), "{soft} {stiff}");
    let [slips, held, _] = of("friction");
    assert!((slips / held - 1.0).abs() < 1e-9, "a flat block does not mind");
    assert!(of("placing")[1] > rocking[1]);
    // Cases foretell each other, and the block as it was placed.
    let left_out = found["regression"]["left_out"].as_array().unwrap();
    assert_eq!(left_out.len(), 6);
    assert!(found["regression"]["error"].as_f64().unwrap() < 0.25, "{found}");
    assert!((held / as_placed - 1.0).abs() < 0.5, "{held} {as_placed}");
    let band = found["band"].as_array().unwrap();
    assert!(band.windows(2).all(|w| interval(&w[1]["approach_mm"])[1] > interval(&w[0]["approach_mm"])[1]));
    let place = folder.path().join("block-ensemble");
    assert_eq!(std::fs::read_to_string(place.join("draws.csv")).unwrap().lines().count(), 61);
    assert_eq!(std::fs::read_to_string(place.join("cases.csv")).unwrap().lines().count(), 7);
    let picture = image::open(place.join("ensemble.png")).unwrap();
    assert!(picture.width() > 1000 && picture.height() > 600);
    assert_eq!(timeless(result(&folder)), timeless(found.clone()));

    // What was computed is kept: only what is missing is computed again, to the same bits.
    let before = std::fs::read(place.join("case-002.json")).unwrap();
    std::fs::remove_file(place.join("case-004.json")).unwrap();
    assert_eq!(timeless(json(&folder, &ASKED)), timeless(found));
    assert_eq!(std::fs::read(place.join("case-002.json")).unwrap(), before);
    assert!(place.join("case-004.json").exists());

    // Something else asked for goes elsewhere, and nothing is lost.
    let mut other = ASKED;
    other[9] = "0.4";
    let refused = grainrig(&folder, &other);
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(2) && said.contains("--out"), "{said}");
    assert_eq!(std::fs::read(place.join("case-002.json")).unwrap(), before);
}

#[test]
fn what_makes_no_sense_of_an_ensemble_is_refused_with_its_remedy() {
    let folder = block([0.8, 0.6, 0.4]);
    let with = |more: &[&'static str]| [&["compress", "block.stl", "--ensemble", "50"], more].concat();
    for (args, words) in [
        (vec!["compress", "block.stl", "--ensemble", "5"], &["ensemble = 5 draws", "from 20", "1000"][..]),
        (with(&["--cases", "3"]), &["cases = 3", "from 6", "24"]),
        (with(&["--placing-deg", "-1"]), &["placing_deg = -1", "from 0 to 45"]),
        (with(&["--outline-um", "1000"]), &["outline_um = 1000", "from 0 to 100"]),
        (with(&["--young-span-mpa", "110000", "90000"]), &["young_span_mpa = 110000", "the lesser first"]),
        (with(&["--young-span-mpa", "nan", "90000"]), &["young_span_mpa = NaN"]),
        (with(&["--to-approach-mm", "0.01"]), &["--to-force-n"]),
        (with(&["--rocking", "elements"]), &["--rocking"]),
        (with(&["--rest", "9"]), &["rest 9", "1 to 6"]),
        (vec!["compress", "block.stl", "--cases", "8"], &["--ensemble"]),
        (vec!["compress", "--sphere-diameter-mm", "0.8", "--ensemble", "50"], &["sphere lies anyhow"]),
    ] {
        let run = grainrig(&folder, &args);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(2), "{args:?}: {said}");
        assert!(words.iter().all(|word| said.contains(word)), "{args:?}: {said}");
    }
    assert!(!folder.path().join("block-ensemble/case-001.json").exists());
}
