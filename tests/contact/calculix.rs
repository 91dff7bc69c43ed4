//! The same mesh and load in `CalculiX`.

use crate::skip::{Lacking, skip};
use serde_json::Value;
use std::process::{Command, Stdio};
use tempfile::TempDir;

/// A force at which contact is no longer a matter of single facets, N.
const SOME_N: f64 = 1.0;

/// The force of a curve at an approach, N.
fn force_at(curve: &[[f64; 2]], approach_mm: f64) -> Option<f64> {
    let w = curve.windows(2).find(|w| w[0][0] <= approach_mm && approach_mm <= w[1][0])?;
    Some(w[0][1] + (approach_mm - w[0][0]) / (w[1][0] - w[0][0]) * (w[1][1] - w[0][1]))
}

#[test]
fn calculix_runs_the_deck_of_a_real_grain_with_friction_to_its_end() {
    if Command::new("ccx").arg("-v").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
        return skip(Lacking::Tools, "no ccx on the path");
    }
    let Some(bytes) = crate::grain::grain() else { return };
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("grain.stl"), bytes).unwrap();
    let at_contact_mm = 0.04;
    // Friction as it is by default.
    let out = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .current_dir(folder.path())
        .args([
            "compress",
            "grain.stl",
            "--size-mm",
            "0.12",
            "--size-at-contact-mm",
            "0.04",
            "--out",
            "s",
            "--json",
        ])
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let result: Value = serde_json::from_slice(&out.stdout).unwrap();
    let curve: Vec<[f64; 2]> = (result["curve"].as_array().unwrap().iter())
        .map(|p| [p["approach_mm"].as_f64().unwrap(), p["force_n"].as_f64().unwrap()])
        .collect();
    let (deck, end_mm) = (folder.path().join("s"), curve.last().unwrap()[0]);
    let run = Command::new("ccx").current_dir(&deck).args(["-i", "calculix"]).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(said.contains("Job finished"), "{}", &said[said.len().saturating_sub(2000)..]);
    let increments = std::fs::read_to_string(deck.join("calculix.sta")).unwrap();
    assert!(increments.lines().count() < 40, "it does not creep: {increments}");
    let text = std::fs::read_to_string(deck.join("calculix.inp")).unwrap();
    assert!(text.contains("*FRICTION\n0.2, ") && text.contains("SURFACE TO SURFACE"));
    let line = text.lines().find(|l| l.starts_with("LOWER_PLATE_NODES, 3, 3")).unwrap();
    let way = 2.0 * line.split(", ").last().unwrap().parse::<f64>().unwrap();
    // A contact of facets that are integrated inside begins later than one of nodes, by what they sag at either plate.
    let later_mm =
        2.0 * at_contact_mm * at_contact_mm / (4.0 * result["settings"]["gap_mm"].as_f64().unwrap());
    let table = std::fs::read_to_string(deck.join("calculix.dat")).unwrap();
    let mut lines = table.lines();
    let mut last = [0.0; 2];
    while let Some(line) = lines.next() {
        if !line.contains("LOWER_PLATE_NODES") {
            continue;
        }
        let time: f64 = line.split_whitespace().last().unwrap().parse().unwrap();
        let force: f64 = lines.nth(1).unwrap().split_whitespace().last().unwrap().parse().unwrap();
        let approach = end_mm - way * (1.0 - time);
        let (Some(most), Some(least)) = (force_at(&curve, approach), force_at(&curve, approach - later_mm))
        else {
            continue;
        };
        println!("{:5.2} um: CalculiX {force:8.3} N, here {least:8.3} to {most:8.3} N", 1e3 * approach);
        if force > SOME_N {
            assert!(
                0.9 * least <= force && force <= 1.1 * most,
                "{force} N at {approach} mm: {least} to {most} N"
            );
        }
        last = [time, force / most];
    }
    assert!((last[0] - 1.0).abs() < 1e-6 && (last[1] - 1.0).abs() < 0.2, "{last:?}");
}

#[test]
fn calculix_finds_the_same_forces_at_every_stage() {
    let there = Command::new("ccx").arg("-v").stdout(Stdio::null()).stderr(Stdio::null()).status();
    if there.is_err() {
        return skip(Lacking::Tools, "no ccx on the path");
    }
    let folder = TempDir::new().unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .current_dir(folder.path())
        .args(["compress", "--sphere-diameter-mm", "0.815", "--to-approach-mm", "0.02", "--friction", "0"])
        .args(["--size-mm", "0.12", "--size-at-contact-mm", "0.035", "--out", "s", "--json"])
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let result: Value = serde_json::from_slice(&out.stdout).unwrap();
    let curve: Vec<[f64; 2]> = (result["curve"].as_array().unwrap().iter())
        .map(|p| [p["approach_mm"].as_f64().unwrap(), p["force_n"].as_f64().unwrap()])
        .collect();
    let deck = folder.path().join("s");
    let run = Command::new("ccx").current_dir(&deck).args(["-i", "calculix"]).output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(said.contains("Job finished"), "{}", &said[said.len().saturating_sub(2000)..]);
    let table = std::fs::read_to_string(deck.join("calculix.dat")).unwrap();
    // The plates of the deck begin at the nodes, which may lie a little outside the sphere.
    let text = std::fs::read_to_string(deck.join("calculix.inp")).unwrap();
    let line = text.lines().find(|l| l.starts_with("LOWER_PLATE_NODES, 3, 3")).unwrap();
    let way = 2.0 * line.split(", ").last().unwrap().parse::<f64>().unwrap();
    let mut stages = 0;
    let mut lines = table.lines();
    while let Some(line) = lines.next() {
        if !line.contains("LOWER_PLATE_NODES") {
            continue;
        }
        let time: f64 = line.split_whitespace().last().unwrap().parse().unwrap();
        let force: f64 = lines.nth(1).unwrap().split_whitespace().last().unwrap().parse().unwrap();
        let approach = 0.02 - way * (1.0 - time);
        let Some(w) = curve.windows(2).find(|w| w[0][0] <= approach && approach <= w[1][0]) else { continue };
        let part = (approach - w[0][0]) / (w[1][0] - w[0][0]);
        let own = w[0][1] + part * (w[1][1] - w[0][1]);
        println!(
            "{:5.2} um: CalculiX {force:8.3} N, here {own:8.3} N, ratio {:.4}",
            1e3 * approach,
            own / force
        );
        assert!((own / force - 1.0).abs() < 0.02, "{own} N, CalculiX {force} N at {approach} mm");
        stages += 1;
    }
    assert!(stages >= 8, "{stages}");
}
