//! The decks that are written run in `CalculiX` and give the forces that mechanics gives.

use crate::skip::{Lacking, skip};
use grainrig_core::formats::inp;
use grainrig_core::geometry::{Ball, Point};
use grainrig_core::mesh::{Controls, TetMesh, mesh};
use std::fs;
use std::io::BufWriter;
use std::path::Path;
use std::process::Command;

const YOUNG_MPA: f64 = 100_000.0;

/// A unit cube of n³ cubes, six tetrahedra each (Kuhn 1960: one for each order of the axes).
fn cube(n: u32) -> TetMesh {
    let m = n + 1;
    let number = |c: [u32; 3]| c[0] + m * (c[1] + m * c[2]);
    let place = |i: u32| Point::from([i % m, i / m % m, i / (m * m)].map(|x| f64::from(x) / f64::from(n)));
    let mut tets = Vec::new();
    for cell in 0..n * n * n {
        let low = [cell % n, cell / n % n, cell / (n * n)];
        for (order, even) in [
            ([0, 1, 2], true),
            ([1, 2, 0], true),
            ([2, 0, 1], true),
            ([0, 2, 1], false),
            ([2, 1, 0], false),
            ([1, 0, 2], false),
        ] {
            let mut at = low;
            let mut t = [number(at); 4];
            for (k, axis) in order.into_iter().enumerate() {
                at[axis] += 1;
                t[k + 1] = number(at);
            }
            if !even {
                t.swap(2, 3);
            }
            tets.push(t);
        }
    }
    TetMesh::new((0..m * m * m).map(place).collect(), tets)
}

/// Whether `ccx` is there; says so where it is not.
fn has_calculix() -> bool {
    let there = Command::new("ccx").arg("-v").output().is_ok();
    if !there {
        skip(Lacking::Tools, "no ccx on the path");
    }
    there
}

/// The reaction (N) of the set BOTTOM under boundary conditions `held`. `None` without `ccx`.
fn bottom_reaction(grain: &TetMesh, band_mm: f64, held: &str) -> Option<[f64; 3]> {
    if !has_calculix() {
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let file = BufWriter::new(fs::File::create(folder.path().join("grain.inp")).unwrap());
    inp::write(grain, &["tests/meshes/calculix.rs".to_owned()], band_mm, file).unwrap();
    Some(reactions(folder.path(), held, ["BOTTOM"])[0])
}

/// Runs a deck that includes the folder's `grain.inp`, in one linear static step with boundary conditions
/// `held`; the reactions (N) of node sets.
fn reactions<const N: usize>(folder: &Path, held: &str, sets: [&str; N]) -> [[f64; 3]; N] {
    let prints = sets.map(|set| format!("*NODE PRINT, NSET={set}, TOTALS=ONLY\nRF\n")).concat();
    let deck = format!(
        "*INCLUDE, INPUT=grain.inp\n*MATERIAL, NAME=QUARTZ\n*ELASTIC\n{YOUNG_MPA}, 0.22\n\
         *SOLID SECTION, ELSET=GRAIN, MATERIAL=QUARTZ\n*STEP\n*STATIC\n*BOUNDARY\n{held}\
         *DLOAD\nGRAIN, P1, 0.\n{prints}*NODE FILE\nU\n*END STEP\n"
    );
    fs::write(folder.join("deck.inp"), deck).unwrap();
    let out =
        Command::new("ccx").arg("deck").env("OMP_NUM_THREADS", "1").current_dir(folder).output().unwrap();
    let said = String::from_utf8_lossy(&out.stdout);
    assert!(
        said.contains("Job finished") && !said.contains("*WARNING") && !said.contains("*ERROR"),
        "{said}"
    );
    assert!(fs::metadata(folder.join("deck.frd")).unwrap().len() > 0);
    let data = fs::read_to_string(folder.join("deck.dat")).unwrap();
    sets.map(|set| {
        let header = format!("for set {set} ");
        let mut lines = data.lines().skip_while(|line| !line.contains(&header)).skip(1);
        let numbers = lines.find(|line| !line.trim().is_empty()).unwrap_or_default();
        let numbers: Vec<f64> = numbers.split_whitespace().filter_map(|w| w.parse().ok()).collect();
        numbers.try_into().unwrap_or_else(|_| panic!("no reaction of {set} in {data}"))
    })
}

#[test]
fn a_cube_between_smooth_plates_gives_hookes_force() {
    let grain = cube(4);
    assert_eq!(grain.check(), Ok(()));
    assert!((grain.volume_mm3() - 1.0).abs() < 1e-12);
    // Free to widen: E A δ / L = 100 GPa · 1 mm² · 0.001. Three nodes of the bottom keep it from sliding and
    // turning.
    let held = "BOTTOM, 3, 3, 0.\nTOP, 3, 3, -0.001\n1, 1, 2, 0.\n5, 2, 2, 0.\n";
    let Some(reaction) = bottom_reaction(&grain, 0.1, held) else { return };
    assert!((reaction[2] / 100.0 - 1.0).abs() < 1e-5, "{reaction:?}");
    assert!(reaction[0].abs() < 1e-4 && reaction[1].abs() < 1e-4, "{reaction:?}");
}

/// A cube whose corner nodes inside are moved about: no element like another.
fn shaken_cube(n: u32) -> TetMesh {
    let mut mesh = cube(n);
    let inner = |p: &Point| p.iter().all(|x| *x > 1e-9 && *x < 1.0 - 1e-9);
    for (i, p) in mesh.nodes.iter_mut().enumerate().filter(|(_, p)| inner(p)) {
        let wave = |k: f64| 0.15 / f64::from(n) * (k * i as f64).sin();
        *p = Point::new(p.x + wave(1.0), p.y + wave(2.0), p.z + wave(3.0));
    }
    mesh
}

#[test]
fn ten_node_tetrahedra_pass_the_patch_test() {
    if !has_calculix() {
        return;
    }
    let grain = shaken_cube(3);
    assert_eq!(grain.check(), Ok(()));
    let folder = tempfile::tempdir().unwrap();
    let mut deck = Vec::new();
    inp::write_order(&grain, inp::Order::Second, &[], 0.01, &mut deck).unwrap();
    fs::write(folder.path().join("grain.inp"), deck).unwrap();
    // Every node of the surface follows one linear field of displacements: inside all must do so, and the stress be the
    // same everywhere.
    let second = grain.second_order();
    let field = |p: &Point| [1e-3 * p.x + 2e-4 * p.y, 3e-4 * p.y - 1e-4 * p.z, -5e-4 * p.z + 4e-4 * p.x];
    let on_surface = |p: &Point| p.iter().any(|x| *x < 1e-9 || *x > 1.0 - 1e-9);
    let held: String = second
        .nodes
        .iter()
        .enumerate()
        .filter(|(_, p)| on_surface(p))
        .flat_map(|(i, p)| {
            (0..3).map(move |k| format!("{}, {1}, {1}, {2:.12e}\n", i + 1, k + 1, field(p)[k]))
        })
        .collect();
    let deck = format!(
        "*INCLUDE, INPUT=grain.inp\n*MATERIAL, NAME=QUARTZ\n*ELASTIC\n{YOUNG_MPA}, 0.22\n\
         *SOLID SECTION, ELSET=GRAIN, MATERIAL=QUARTZ\n*STEP\n*STATIC\n*BOUNDARY\n{held}\
         *NODE PRINT, NSET=GRAIN_NODES\nU\n*EL PRINT, ELSET=GRAIN\nS\n*END STEP\n"
    );
    fs::write(folder.path().join("deck.inp"), deck).unwrap();
    let out = Command::new("ccx").arg("deck").current_dir(folder.path()).output().unwrap();
    let said = String::from_utf8_lossy(&out.stdout);
    assert!(said.contains("Job finished") && !said.contains("*ERROR"), "{said}");
    let data = fs::read_to_string(folder.path().join("deck.dat")).unwrap();
    let rows = |header: &str| -> Vec<Vec<f64>> {
        let lines = data.lines().skip_while(|l| !l.contains(header)).skip(2);
        lines
            .take_while(|l| !l.trim().is_empty())
            .map(|l| l.split_whitespace().filter_map(|w| w.parse().ok()).collect())
            .collect()
    };
    let moved = rows("displacements");
    assert_eq!(moved.len(), second.nodes.len(), "{data:.2000}");
    for row in moved {
        let should = field(&second.nodes[row[0] as usize - 1]);
        assert!((0..3).all(|k| (row[k + 1] - should[k]).abs() < 1e-9), "{row:?} {should:?}");
    }
    // Hooke's law for ε = (1, 0.3, −0.5)·10⁻³ and half the sums of the slopes across.
    let (lame, shear) = (0.22 * YOUNG_MPA / (1.22 * 0.56), YOUNG_MPA / 2.44);
    let trace = 0.8e-3;
    let straight = [1e-3, 3e-4, -5e-4].map(|e| lame * trace + 2.0 * shear * e);
    let across = [2e-4, 4e-4, -1e-4].map(|g| shear * g);
    let stresses = rows("stresses");
    assert!(stresses.len() >= 4 * grain.tets.len());
    for row in stresses {
        let should = straight.iter().chain(&across);
        assert!(
            row[2..].iter().zip(should).all(|(is, s)| (is - s).abs() < 1e-3),
            "{row:?} {straight:?} {across:?}"
        );
    }
}

#[test]
fn a_meshed_ball_is_compressed_with_a_plausible_force() {
    let ball = Ball { center: Point::origin(), radius_mm: 0.5 };
    let controls = Controls::for_size(2.0);
    let grain = mesh(&ball, &controls, &mut |_| ()).unwrap();
    let held = "BOTTOM, 1, 3, 0.\nTOP, 3, 3, -0.001\n";
    let Some(reaction) = bottom_reaction(&grain, controls.surface_size_mm, held) else { return };
    // Each cap moves as a rigid punch on its own circle: between a punch of that radius a on two half-spaces,
    // F = E/(1 − ν²) · a · δ (δ/2 at each), and the full cylinder around the ball, E A δ / L.
    let cap = (controls.surface_size_mm * (1.0 - controls.surface_size_mm)).sqrt();
    let punches = YOUNG_MPA / (1.0 - 0.22f64.powi(2)) * cap * 0.001;
    let cylinder = YOUNG_MPA * std::f64::consts::FRAC_PI_4 * 0.001;
    assert!(reaction[2] > 0.5 * punches && reaction[2] < cylinder, "{} {punches} {cylinder}", reaction[2]);
}

#[test]
fn what_a_capture_writes_is_compressed_between_its_own_sets() {
    const APPROACH_MM: f64 = 0.001;
    if !has_calculix() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    // The default scale in small pictures, and a coarse mesh: a second of CalculiX rather than a minute.
    let config = "[simulated]\nwidth = 1000\nheight = 760\n\
                  [plan]\nsettle_ms = 0\n[mesh]\nsurface_size_mm = 0.05\n";
    fs::write(folder.path().join("small.toml"), config).unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_grainrig"))
        .args(["capture", "grain", "--config", "small.toml", "--json"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let result: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let corner = |which: &str, k: usize| result["hull"]["bounding_box_mm"][which][k].as_f64().unwrap();
    let size = [0, 1, 2].map(|k| corner("max", k) - corner("min", k));

    let products = folder.path().join("data/grain/products");
    let held = format!("BOTTOM, 1, 3, 0.\nTOP, 3, 3, -{APPROACH_MM}\n");
    let [top, bottom] = reactions(&products, &held, ["TOP", "BOTTOM"]);
    // What pushes down at the top comes out at the bottom, and nothing sideways: the top is free to slide.
    assert!(bottom[2] > 0.0 && (top[2] + bottom[2]).abs() < 1e-4 * bottom[2], "{top:?} {bottom:?}");
    assert!(bottom[0].hypot(bottom[1]) < 1e-3 * bottom[2], "{bottom:?}");
    // Softer than the block that the grain could be cut from, E A δ / L, yet no feather.
    let block = YOUNG_MPA * size[0] * size[1] * APPROACH_MM / size[2];
    assert!((0.05..0.8).contains(&(bottom[2] / block)), "{} of {block} N", bottom[2]);
}
