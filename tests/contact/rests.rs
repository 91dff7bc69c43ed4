//! How grains come to lie and how plates turn them, by the real program.

use crate::skip::shared_data;
use grainrig_core::contact::{Rests, rest};
use grainrig_core::formats::stl;
use grainrig_core::geometry::{ConvexHull, Point, TriangleMesh, Vector};
use nalgebra::Rotation3;
use serde_json::Value;
use std::process::{Command, Output};
use tempfile::TempDir;

pub(crate) fn grainrig(folder: &TempDir, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_grainrig")).current_dir(folder.path()).args(args).output().unwrap()
}

pub(crate) fn json(folder: &TempDir, args: &[&str]) -> Value {
    let run = grainrig(folder, &[&["--json"], args].concat());
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

/// A block of this size in a folder of its own, as the program reads it.
pub(crate) fn block(size: [f64; 3]) -> TempDir {
    let corner = |i: usize| {
        let at = |k: usize| if i >> k & 1 == 1 { size[k] } else { 0.0 };
        Point::new(at(0), at(1), at(2))
    };
    let triangles = vec![
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    let surface = TriangleMesh { vertices: (0..8).map(corner).collect(), triangles };
    surface.check().unwrap();
    let folder = TempDir::new().unwrap();
    let mut bytes = Vec::new();
    stl::write(&surface, &mut bytes).unwrap();
    std::fs::write(folder.path().join("block.stl"), bytes).unwrap();
    folder
}

#[test]
fn a_block_has_six_rests_with_a_picture_of_each() {
    let folder = block([0.8, 0.6, 0.4]);
    let found = json(&folder, &["rests", "block.stl"]);
    let rests = found["rests"].as_array().unwrap();
    assert_eq!(rests.len(), 6);
    assert_eq!(found["as_photographed"].as_u64().map(|n| n <= 2), Some(true), "it lies on a broad side");
    let f = |r: &Value, key: &str| r[key].as_f64().unwrap();
    assert!((rests.iter().map(|r| f(r, "chance")).sum::<f64>() - 1.0).abs() < 1e-9);
    for (r, height) in rests.iter().zip([0.4, 0.4, 0.6, 0.6, 0.8, 0.8]) {
        assert!((f(r, "height_mm") - height).abs() < 1e-6, "{r}");
        assert!(f(r, "gap_deg") < 1e-6 && r["rocks"] == false && f(r, "rocking_mm") == 0.0, "{r}");
        assert_eq!(r["feet_mm"].as_array().unwrap().len(), 4);
    }
    assert_eq!(rests.iter().filter(|r| r["lift_mm"].is_null()).count(), 1, "the lowest alone has none");
    let csv = std::fs::read_to_string(folder.path().join("block-rests/rests.csv")).unwrap();
    assert_eq!(csv.lines().count(), 7);
    let png = image::open(folder.path().join("block-rests/rests.png")).unwrap();
    assert!(png.width() >= 4 * 280 && png.height() >= 2 * 280);
    // The same, by a person's eyes.
    let said = String::from_utf8(grainrig(&folder, &["rests", "block.stl"]).stdout).unwrap();
    for part in ["plates of friction 0.2", "stands; as photographed", "block-rests/rests.png"] {
        assert!(said.contains(part), "{said}");
    }
}

#[test]
fn what_makes_no_sense_is_refused_with_its_limit() {
    let folder = block([0.8, 0.6, 0.4]);
    for (args, code, words) in [
        (&["rests", "block.stl", "--friction", "-0.1"][..], 2, &["friction", "not negative"][..]),
        (&["rests", "block.stl", "--least-lift-mm", "-1"], 2, &["least_lift_mm", "not negative"]),
        (&["rests", "block.stl", "--ensemble", "5"], 2, &["ensemble = 5 draws", "from 20 to 100000", "1000"]),
        (
            &["rests", "block.stl", "--ensemble", "50", "--placing-deg", "90"],
            2,
            &["placing_deg = 90", "from 0 to 45"],
        ),
        (&["rests", "block.stl", "--placing-deg", "1"], 2, &["--ensemble"]),
        (&["rests", "nothing.stl"], 1, &["nothing.stl"]),
        (&["compress", "block.stl", "--rest", "7"], 2, &["rest 7", "1 to 6", "grainrig rests"]),
        (&["compress", "block.stl", "--rest", "0"], 2, &["rest 0", "1 to 6"]),
        (&["compress", "block.stl", "--rest", "1", "--rotate-deg", "0", "0", "0"], 2, &["--rest"]),
    ] {
        let run = grainrig(&folder, args);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(code), "{args:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{args:?}: {said}");
    }
}

/// A block that is laid askew by t comes down by what its side across the tilt stands up, about w·t. Of tilts about both axes with a
/// standard deviation of s half are above 1.18 s.
#[test]
fn an_ensemble_tells_what_laying_askew_does() {
    let size = [0.8, 0.6, 0.4];
    let folder = block(size);
    let found = json(
        &folder,
        &["rests", "block.stl", "--friction", "0", "--ensemble", "400", "--placing-deg", "0.5"],
    );
    let all = &found["ensemble"];
    assert_eq!((&all["draws"], &all["friction"]), (&400.into(), &serde_json::json!([0.0, 0.0])));
    assert_eq!(all["foot_depths_mm"], serde_json::json!([]));
    let of = |i: &Value| {
        let [low, middle, high] = ["p05", "median", "p95"].map(|key| i["rocking_mm"][key].as_f64().unwrap());
        [low, middle, high, i["rocks_share"].as_f64().unwrap()]
    };
    let s = f64::to_radians(0.5);
    for r in found["rests"].as_array().unwrap() {
        let [low, middle, high, turned] = of(&r["askew"]);
        let height = r["height_mm"].as_f64().unwrap();
        let sides: Vec<f64> = size.iter().copied().filter(|side| (side - height).abs() > 1e-6).collect();
        let (least, most) = (sides[0].min(sides[1]), sides[0].hypot(sides[1]));
        assert!((1.1 * s * least..1.25 * s * most).contains(&middle), "{r}");
        assert!(low < 0.4 * middle && high > 1.8 * middle && turned > 0.99, "{r}");
    }
    let [low, middle, high, _] = of(all);
    assert!(low < middle && middle < high);
    // A line for each rest, and one for all.
    let said = grainrig(&folder, &["rests", "block.stl", "--ensemble", "20"]);
    let said = String::from_utf8(said.stdout).unwrap();
    assert!(said.contains("Laid askew by 2°") && said.contains(" all "), "{said}");
}

/// A block that leans is turned upright by the plates first: as far as the closed form says, whatever their speed; then it is
/// pressed from there.
#[test]
fn approach_is_rocking_and_deformation() {
    let (height, width, tilt) = (0.8, 0.6, 6f64);
    let folder = block([width, 0.4, height]);
    let coarse = [
        "--size-mm",
        "0.12",
        "--size-at-contact-mm",
        "0.08",
        "--to-approach-mm",
        "0.0593",
        "--rotate-deg",
        "0",
        "6",
        "0",
    ];
    let (s, c) = tilt.to_radians().sin_cos();
    let rocking = height * c + width * s - height;
    let mut forces = Vec::new();
    for (name, more) in [("usual", &[][..]), ("fast", &["--speed", "4"])] {
        let args = [&["compress", "block.stl", "--out", name][..], &coarse, more].concat();
        let r = json(&folder, &args);
        let by = &r["settings"]["rocking"];
        assert!((by["approach_mm"].as_f64().unwrap() - rocking).abs() < 1e-6, "{by}");
        assert!((by["turned_deg"].as_f64().unwrap() - tilt).abs() < 1e-4 && by["held_by_friction"] == false);
        let curve: Vec<[f64; 2]> = (r["curve"].as_array().unwrap().iter())
            .map(|p| [p["approach_mm"].as_f64().unwrap(), p["force_n"].as_f64().unwrap()])
            .collect();
        assert!(curve[0][0] == 0.0 && curve[0][1] == 0.0, "{:?}", curve[0]);
        assert!((curve[1][0] - rocking).abs() < 1e-4 && curve[1][1] == 0.0, "{:?}", curve[1]);
        assert!(curve.windows(2).all(|w| w[0][0] <= w[1][0]), "the approach only grows");
        let (delta, part) = (r["delta_i_mm"].as_f64().unwrap(), r["deformation_mm"].as_f64().unwrap());
        assert!((delta - part - rocking).abs() < 1e-8, "{delta} {part}");
        forces.push(curve[curve.len() - 1]);
    }
    // A column of this section: E A u/H, as near as plates that hold its ends make it.
    let [at, force] = forces[0];
    let column = 1e5 * width * 0.4 * (at - rocking) / height;
    assert!((force / column - 1.0).abs() < 0.15, "{force} {column}");
    assert!((forces[1][1] / forces[1][0] / (force / at) - 1.0).abs() < 0.05, "{forces:?}");
}

/// Between plates of friction a grain that leans a little is held as it lies, and what is printed lays it so again.
#[test]
fn what_is_printed_can_be_given_back() {
    let folder = block([0.5, 0.45, 0.4]);
    let coarse = ["--size-mm", "0.2", "--size-at-contact-mm", "0.15", "--to-approach-mm", "0.0002"];
    let first =
        json(&folder, &[&["compress", "block.stl", "--rest", "3", "--out", "a"][..], &coarse].concat());
    let deg = first["settings"]["placed_deg"].as_array().unwrap().clone();
    let given: Vec<String> = deg.iter().map(ToString::to_string).collect();
    let args = ["compress", "block.stl", "--out", "b", "--rotate-deg", &given[0], &given[1], &given[2]];
    let again = json(&folder, &[&args[..], &coarse].concat());
    let height = |r: &Value| r["settings"]["gap_mm"].as_f64().unwrap();
    assert!((height(&first) - height(&again)).abs() < 1e-6 && (height(&first) - 0.45).abs() < 1e-6);
    for (a, b) in deg.iter().zip(again["settings"]["placed_deg"].as_array().unwrap()) {
        assert!((a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-6, "{deg:?}");
    }
    let rests = json(&folder, &["rests", "block.stl"]);
    let listed = rests["rests"][2]["rotate_deg"].as_array().unwrap();
    for (a, b) in deg.iter().zip(listed) {
        assert!((a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-6, "{listed:?}");
    }
    // Diagonal within the friction's angle of the normal: the plates hold it on two edges.
    let leaning = [
        "--rotate-deg",
        "0",
        "51",
        "0",
        "--out",
        "c",
        "--size-mm",
        "0.2",
        "--size-at-contact-mm",
        "0.15",
        "--to-approach-mm",
        "0.0002",
    ];
    let held = json(&folder, &[&["compress", "block.stl"][..], &leaning].concat());
    let by = &held["settings"]["rocking"];
    assert!(by["held_by_friction"] == true && by["approach_mm"].as_f64() == Some(0.0), "{by}");
}

/// The chances are those of letting the grain down, with every corner of its hull looked at in every turn.
#[test]
fn real_grains_come_to_rest_as_when_they_are_let_down() {
    let Some(folder) = shared_data("grains") else { return };
    let count = 120;
    for name in [
        "ct_cement140_02210",
        "ct_ma160_00357",
        "ct_ma160_00593",
        "ct_ma160_02444",
        "gravel_az_00002",
        "lsdem_sand",
        "sand_ma107_00002",
        "sand_ma107_00107",
    ] {
        let grain = stl::read(&std::fs::read(folder.join(format!("{name}.stl"))).unwrap()).unwrap();
        let hull = ConvexHull::new(&grain.vertices).unwrap();
        let middle = grain.vertices.iter().map(|p| p.coords).sum::<Vector>() / grain.vertices.len() as f64;
        let rests = Rests::new(hull, &Point::from(middle), None);
        let corners = &rests.hull().vertices;
        let mut reached = vec![0.0; rests.rests.len()];
        let mut elsewhere = 0;
        for k in 0..count {
            let z = 1.0 - (2.0 * f64::from(k) + 1.0) / f64::from(count);
            let (s, c) = (2.4 * f64::from(k)).sin_cos();
            let down = Vector::new(c * (1.0 - z * z).sqrt(), s * (1.0 - z * z).sqrt(), z);
            let lay = Rotation3::rotation_between(&down, &-Vector::z()).unwrap();
            let laid: Vec<Point> = corners.iter().map(|p| lay * p).collect();
            let lies = (rest::rotation(&laid, &Point::origin()) * lay).inverse() * -Vector::z();
            // What is too shallow to be a rest counts for the one that it is left for.
            let came_to = rests.reached_from(&lies);
            reached[came_to] += 1.0 / f64::from(count);
            elsewhere += usize::from(came_to != rests.reached_from(&down));
        }
        println!("{name}: {} rests, {elsewhere} of {count} elsewhere", reached.len());
        assert!(elsewhere * 50 <= count as usize, "{name}: {elsewhere} of {count} came to another rest");
        for (r, share) in rests.rests.iter().zip(reached) {
            assert!((r.chance - share).abs() < 0.05, "{name}: {share} of the drops, {r:?}");
        }
    }
}
