//! What `grainrig compress` tells of a run, and what it does not: figures that mean nothing.

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// A sphere of few elements.
const SPHERE: [&str; 6] = ["--sphere-diameter-mm", "0.8", "--size-mm", "0.15", "--size-at-contact-mm", "0.1"];

/// What a run printed, what it said beside, and its `result.json`.
fn compress(folder: &Path, out: &str, args: &[&str]) -> (String, String, Value) {
    let run = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .current_dir(folder)
        .args(["compress", "--out", out])
        .args(args)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{said}");
    let text = std::fs::read_to_string(folder.join(out).join("result.json")).unwrap();
    (String::from_utf8_lossy(&run.stdout).into_owned(), said, serde_json::from_str(&text).unwrap())
}

/// Significant digits of the longest number in a text.
fn longest_number(text: &str) -> (usize, String) {
    let numbers = text.split(|c: char| !(c.is_ascii_digit() || ".eE-+".contains(c)));
    let digits = |n: &str| {
        let mantissa = n.split(['e', 'E']).next().unwrap_or("");
        let all: String = mantissa.chars().filter(char::is_ascii_digit).collect();
        all.trim_start_matches('0').len()
    };
    numbers.map(|n| (digits(n), n.to_owned())).max().unwrap()
}

#[test]
fn a_transition_that_may_not_be_the_last_is_not_a_bare_number() {
    let folder = TempDir::new().unwrap();
    let sphere = |more: &[&'static str]| [&SPHERE[..], more].concat();
    let (text, _, early) = compress(folder.path(), "early", &sphere(&["--to-approach-mm", "0.0025"]));
    assert_eq!(early["transition"]["settled"], false, "{early}");
    assert_eq!(early["transition"]["needed_n"], 8.0);
    assert!(text.contains("preliminary: not known whether the force falls again"), "{text}");
    assert!(early["warnings"].to_string().contains("press on to 8 N"), "{}", early["warnings"]);
    let sheet = std::fs::read_to_string(folder.path().join("early/curve.svg")).unwrap();
    assert!(sheet.contains("preliminary"), "the sheet says so as well");

    // Wherever somebody asks it to stop past the transition, δ_i is the same, and it says how far it went.
    let delta_i = |name: &str, force: &'static str| {
        let (_, said, run) = compress(folder.path(), name, &sphere(&["--to-force-n", force]));
        assert_eq!(run["transition"]["settled"], true, "{force} N: {}", run["transition"]);
        assert_eq!(said.contains("N asked for to 8 N"), run["settings"].get("goes_on_from_n").is_some());
        run["delta_i_mm"].clone()
    };
    assert_eq!(delta_i("just_past", "2.3"), delta_i("far_past", "10.2"));
    let sheet = std::fs::read_to_string(folder.path().join("just_past/curve.svg")).unwrap();
    assert!(sheet.contains("pressed past the 2.3 N asked for to 8 N"));
    // Short of the transition nothing is read off, and it stops where it was asked to.
    let (_, said, short) = compress(folder.path(), "short", &sphere(&["--to-force-n", "1.2"]));
    assert!(short["delta_i_mm"].is_null() && !said.contains("asked for"), "{said}");
    assert_eq!(short["settings"]["loading"]["to_force_n"], 1.2);

    // Nobody says where to stop: far enough to know, wherever the transition is read.
    let (text, _, whole) = compress(folder.path(), "whole", &sphere(&["--transition-n", "3"]));
    assert_eq!(whole["transition"]["settled"], true, "{}", whole["transition"]);
    assert_eq!(whole["settings"]["loading"]["to_force_n"], 12.0);
    assert!(
        !text.contains("preliminary") && !whole["warnings"].to_string().contains("preliminary"),
        "{text}"
    );
    assert_eq!(whole["transition"]["first_crossing_mm"], whole["delta_i_mm"]);

    // No number has more digits than it means.
    for file in ["result.json", "curve.csv", "stages.pvd", "abaqus.inp", "calculix.inp"] {
        let read = std::fs::read_to_string(folder.path().join("whole").join(file)).unwrap();
        let (digits, number) = longest_number(&read);
        assert!(digits <= 10, "{file}: {number}");
    }
    let (digits, number) = longest_number(&text);
    assert!(digits <= 6, "{number}: {text}");
}

#[test]
fn what_means_nothing_is_not_told() {
    let folder = TempDir::new().unwrap();
    // Before the plates carry anything there is no energy to balance, and no motion to compare with.
    let sphere = |more: &[&'static str]| [&SPHERE[..], more].concat();
    let (text, said, early) = compress(folder.path(), "early", &sphere(&["--to-approach-mm", "2e-6"]));
    assert!(early["energy"]["balance_error"].is_null() && early["quasi_static"].is_null(), "{early}");
    assert!(
        early["over_two_plate_form"].is_null() && early["warnings"].as_array().unwrap().is_empty(),
        "{early}"
    );
    assert!(text.contains("before the contacts have formed") && text.contains("does not pass 2 N"), "{text}");
    assert!(!said.contains('%') || !said.contains("balance"), "{said}");
    // A plastic grain follows neither Hertz nor the two-plate form.
    let plastic = ["--material", "plastic", "--yield-mpa", "100", "--to-force-n", "8.5"];
    let (text, _, plastic) = compress(folder.path(), "plastic", &sphere(&plastic));
    assert!(plastic["hertz"].is_null() && plastic["over_two_plate_form"].is_null(), "{plastic}");
    assert!(
        plastic["delta_i_mm"].is_number() && !text.contains("Hertz") && !text.contains("two-plate"),
        "{text}"
    );
}

#[test]
fn how_a_body_was_placed_is_told_as_rotate_deg_takes_it() {
    let folder = TempDir::new().unwrap();
    let nodes = "1, 0, 0, 0\n2, .5, .02, .03\n3, .04, .5, 0\n4, .01, .05, .5\n5, .5, .55, .6\n";
    let deck = format!("*NODE\n{nodes}*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n2, 2, 5, 3, 4\n");
    std::fs::write(folder.path().join("two.inp"), deck).unwrap();
    let short = ["two.inp", "--to-approach-mm", "1e-6", "--as-given"];
    let (text, _, rests) = compress(folder.path(), "rests", &short);
    assert!(text.contains("placed     --rotate-deg "), "{text}");
    let placed: Vec<f64> =
        rests["settings"]["placed_deg"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert!(placed.iter().any(|x| x.abs() > 1.0), "{placed:?}");
    let words: Vec<String> = placed.iter().map(f64::to_string).collect();
    let turn = ["--rotate-deg", &words[0], &words[1], &words[2]];
    let (_, _, again) = compress(folder.path(), "again", &[&short[..], &turn].concat());
    for key in ["gap_mm", "middle_mm"] {
        let of = |r: &Value| r["settings"][key].as_f64().unwrap();
        assert!((of(&rests) - of(&again)).abs() < 1e-7, "{key}: {} {}", of(&rests), of(&again));
    }
    for (a, b) in placed.iter().zip(again["settings"]["placed_deg"].as_array().unwrap()) {
        assert!((a - b.as_f64().unwrap()).abs() < 1e-5, "{placed:?} {again}");
    }
}

#[test]
fn what_is_done_before_the_plates_move_is_told_as_it_is_done() {
    let folder = TempDir::new().unwrap();
    let (_, said, _) = compress(folder.path(), "s", &[&SPHERE[..], &["--to-force-n", "1"]].concat());
    let at =
        |what: &str| said.lines().position(|l| l.contains(what)).unwrap_or_else(|| panic!("{what}: {said}"));
    assert_eq!(at("reading the body"), 0, "{said}");
    let order = [
        "reading the body",
        "meshing, 100 µm at the contacts",
        "finding the time step",
        "tetrahedra, ",
        " N, ",
    ];
    assert!(order.map(at).is_sorted(), "{said}");
}

#[test]
fn the_stages_carry_the_stress_tensor_and_say_what_their_numbers_are() {
    let folder = TempDir::new().unwrap();
    compress(folder.path(), "s", &[&SPHERE[..], &["--to-force-n", "1"]].concat());
    let read = |name: &str| std::fs::read_to_string(folder.path().join("s").join(name)).unwrap();
    let stage = read("stage_01.vtu");
    assert!(stage.contains("Name=\"cauchy_stress_mpa\" NumberOfComponents=\"6\" ComponentName0=\"XX\""));
    for part in ["lengths in mm, stresses in MPa, tension positive", "approach ", " µm, force ", " N, time "]
    {
        assert!(stage.contains(part), "{part}");
    }
    assert!(read("stages.pvd").contains("<!-- timestep: approach of the plates, µm -->"));
}
