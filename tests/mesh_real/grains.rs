//! Grains measured by X-ray tomography, and closed forms, from STL files.

use super::{assert_good, default_controls, on_threads};
use grainrig::export::{inp, stl};
use grainrig::mesh::{Solid, mesh};
use std::path::PathBuf;

/// The folder of real grains, which not every checkout has.
pub const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/grains");

/// The STL files, in the order of their names.
pub fn files() -> Vec<PathBuf> {
    let Ok(folder) = std::fs::read_dir(FOLDER) else {
        println!("skipped: no grains in {FOLDER}");
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = folder.map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "stl"));
    files.sort();
    files
}

#[test]
fn every_grain_is_meshed_under_the_default_controls() {
    for file in files() {
        let name = file.display().to_string();
        let surface = stl::read(&std::fs::read(&file).unwrap()).unwrap();
        let volume = surface.volume_mm3();
        let solid = Solid::new(surface).unwrap();
        let controls = default_controls(volume, 1.0);
        let made = mesh(&solid, &controls, &mut |_| ()).unwrap();
        assert_good(&made, &controls, &name);
        assert_eq!(made.dropped_pieces, 0, "{name}");
        // Facets are chords of the curved surface: what they cut off is 0.28 % on a ball, to 0.39 % on a
        // rough grain.
        let excess = made.volume_mm3() / volume - 1.0;
        assert!(excess.abs() < 0.006, "{name}: {excess}");
        // 55 000 tetrahedra or so, whatever the shape and the unit.
        assert!((45_000..75_000).contains(&made.tets.len()), "{name}: {}", made.tets.len());
    }
}

#[test]
fn the_volume_cut_off_by_facets_falls_with_the_square_of_their_size() {
    let Some(file) = files().into_iter().find(|f| f.ends_with("sand_ma107_00002.stl")) else { return };
    let surface = stl::read(&std::fs::read(&file).unwrap()).unwrap();
    let volume = surface.volume_mm3();
    let solid = Solid::new(surface).unwrap();
    let missing = [4.0, 2.0].map(|coarser| {
        let made = mesh(&solid, &default_controls(volume, coarser), &mut |_| ()).unwrap();
        1.0 - made.volume_mm3() / volume
    });
    let ratio = missing[0] / missing[1];
    assert!((3.0..5.0).contains(&ratio), "{missing:?}");
}

#[test]
fn the_same_bytes_come_from_one_thread_and_from_three() {
    let Some(file) = files().into_iter().find(|f| f.ends_with("ct_ma160_02444.stl")) else { return };
    let surface = stl::read(&std::fs::read(&file).unwrap()).unwrap();
    let controls = default_controls(surface.volume_mm3(), 2.0);
    let solid = Solid::new(surface).unwrap();
    let deck = |threads| {
        on_threads(threads, || {
            let made = mesh(&solid, &controls, &mut |_| ()).unwrap();
            let mut bytes = Vec::new();
            inp::write(&made, &[], controls.surface_size_mm, &mut bytes).unwrap();
            bytes
        })
    };
    assert!(deck(1) == deck(3), "the decks differ");
}
