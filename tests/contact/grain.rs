//! A real grain, elastic and plastic, between plates.

use crate::skip::shared_data;
use crate::sphere::long;
use grainrig_core::contact::QUASI_STATIC;
use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;

/// The longest side of the grain, mm.
const LONGEST_MM: f64 = 1.0;

/// Binary STL of a real grain, scaled.
pub fn grain() -> Option<Vec<u8>> {
    let bytes = std::fs::read(shared_data("grains/sand_ma107_00107.stl")?).unwrap();
    let mut surface = grainrig_core::formats::stl::read(&bytes).unwrap();
    let size = surface.bounds().unwrap().size();
    let by = LONGEST_MM / size.x.max(size.y).max(size.z);
    surface.vertices.iter_mut().for_each(|p| p.coords *= by);
    let mut out = Vec::new();
    grainrig_core::formats::stl::write(&surface, &mut out).unwrap();
    Some(out)
}

fn pressed(folder: &TempDir, out: &str, args: &[&str]) -> Value {
    let run = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .current_dir(folder.path())
        .args(["compress", "grain.stl", "--json", "--out", out])
        .args(args)
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

/// At every sample since the first contact had formed (2 % of the last force) motion is below 5 % of the internal energy, and the
/// balance held.
fn check_samples(curve: &Path) {
    let text = std::fs::read_to_string(curve).unwrap();
    let names: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|l| l.split(',').map(|w| w.parse().unwrap()).collect()).collect();
    let column = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let of = |row: &[f64], name: &str| row[column(name)];
    let last = of(rows.last().unwrap(), "force_n");
    let formed = rows.iter().position(|r| of(r, "force_n") > 0.02 * last).unwrap();
    for r in &rows[formed..] {
        let share = of(r, "kinetic_n_mm") / of(r, "internal_n_mm");
        assert!(share < QUASI_STATIC, "{}: {share} at {} mm", curve.display(), of(r, "approach_mm"));
        assert!(of(r, "balance_error").abs() < 0.01, "{}: {r:?}", curve.display());
    }
    assert!(rows.len() - formed > 10, "{} of {}", rows.len() - formed, rows.len());
}

#[test]
fn a_real_grain_is_pressed_elastic_and_plastic() {
    let Some(bytes) = grain() else { return };
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("grain.stl"), bytes).unwrap();
    let sizes: &[&str] = if long() { &[] } else { &["--size-mm", "0.12", "--size-at-contact-mm", "0.04"] };
    let elastic = pressed(&folder, "elastic", sizes);
    let with = [sizes, &["--material", "plastic", "--beside", "elastic"]].concat();
    let plastic = pressed(&folder, "plastic", &with);
    for (name, r) in [("elastic", &elastic), ("plastic", &plastic)] {
        let last = r["curve"].as_array().unwrap().last().unwrap();
        println!(
            "{name}: {} elements, {} steps, {:.1} s, {:.2} N at {:.2} um, delta_i {:.2} um, balance {:.1e}, motion {:.3} at most",
            r["elements"],
            r["steps"],
            r["wall_s"].as_f64().unwrap(),
            last["force_n"].as_f64().unwrap(),
            1e3 * last["approach_mm"].as_f64().unwrap(),
            1e3 * r["delta_i_mm"].as_f64().unwrap(),
            r["energy"]["balance_error"].as_f64().unwrap(),
            r["quasi_static"]["largest"].as_f64().unwrap(),
        );
        check_samples(&folder.path().join(name).join("curve.csv"));
        assert!(r["warnings"].as_array().unwrap().is_empty(), "{}", r["warnings"]);
        assert!(r["contacts"].as_array().unwrap().len() >= 4, "three below and one above");
    }
    let delta = |r: &Value| r["delta_i_mm"].as_f64().unwrap();
    assert!(delta(&plastic) > delta(&elastic), "{} {}", delta(&plastic), delta(&elastic));
    if long() {
        // The same at a third finer contacts, and with half the speed.
        let finer = ["--size-mm", "0.04", "--size-at-contact-mm", "0.0105", "--to-force-n", "2.2"];
        let slower = ["--size-mm", "0.08", "--size-at-contact-mm", "0.02", "--to-force-n", "2.2"];
        let halved = [&slower[..], &["--speed", "0.5"]].concat();
        let [finer, coarse, halved] =
            [("finer", &finer[..]), ("coarse", &slower[..]), ("halved", &halved[..])].map(|(name, args)| {
                let r = pressed(&folder, name, args);
                println!("{name}: {} elements, delta_i {:.3} um", r["elements"], 1e3 * delta(&r));
                delta(&r)
            });
        assert!((finer / delta(&elastic) - 1.0).abs() < 0.1, "{finer} {}", delta(&elastic));
        assert!((halved / coarse - 1.0).abs() < 0.01, "{halved} {coarse}");
    }
}
