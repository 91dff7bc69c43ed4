//! Grains measured by X-ray tomography, and closed forms, from STL files.

use super::{assert_good, assert_sound, default_controls, on_threads};
use crate::skip::shared_data;
use grainrig_core::formats::{inp, stl};
use grainrig_core::geometry::Point;
use grainrig_core::mesh::{Controls, Distances, Solid, mesh};
use std::path::PathBuf;

/// The STL files, in the order of their names.
pub fn files() -> Vec<PathBuf> {
    let Some(folder) = shared_data("grains") else { return Vec::new() };
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().path()).collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "stl"));
    files.sort();
    files
}

#[test]
fn every_grain_is_meshed_at_three_sizes() {
    let all = std::env::var_os("GRAINRIG_ALL").is_some();
    for (k, file) in files().into_iter().enumerate() {
        let surface = stl::read(&std::fs::read(&file).unwrap()).unwrap();
        let volume = surface.volume_mm3();
        let places: Vec<Point> = surface.vertices.clone();
        let solid = Solid::new(surface).unwrap();
        assert_eq!(solid.crossing(), None, "{}", file.display());
        // The finest, which costs most, for every third grain; for all with the hours (`make test-long`).
        let sizes = [(2.0, 6_000..9_500), (1.0, 45_000..75_000), (0.7, 130_000..220_000)];
        let sizes = if all || k % 3 == 0 { &sizes[..] } else { &sizes[..2] };
        for (coarser, tets) in sizes {
            let coarser = *coarser;
            let name = format!("{} {coarser}", file.display());
            let controls = default_controls(volume, coarser);
            let made = mesh(&solid, &controls, &mut |_| ()).unwrap();
            assert_good(&made, &controls, &name);
            assert_eq!(made.dropped_pieces, 0, "{name}");
            // Whatever the shape and the unit.
            assert!(tets.contains(&made.tets.len()), "{name}: {}", made.tets.len());
            // Facets lie on both sides of the surface: what they cut off they put on elsewhere.
            let excess = made.volume_mm3() / volume - 1.0;
            let allowed = if coarser > 1.0 { 0.005 } else { 0.002 };
            assert!(excess.abs() < allowed, "{name}: {excess}");
            let d = Distances::measure(&solid, &made, &places).unwrap();
            let tenth = 0.1 * controls.surface_size_mm;
            assert!(d.to_body.mean_mm < tenth && d.from_body.mean_mm < tenth, "{name}: {d:?}");
        }
    }
}

#[test]
fn the_distance_to_the_surface_falls_with_the_square_of_the_size() {
    let Some(file) = files().into_iter().find(|f| f.ends_with("sand_ma107_00002.stl")) else { return };
    let surface = stl::read(&std::fs::read(&file).unwrap()).unwrap();
    let volume = surface.volume_mm3();
    let solid = Solid::new(surface).unwrap();
    let mean = [2.0, 1.0].map(|coarser| {
        let made = mesh(&solid, &default_controls(volume, coarser), &mut |_| ()).unwrap();
        Distances::measure(&solid, &made, &[]).unwrap().to_body.mean_mm
    });
    assert!((2.5..5.5).contains(&(mean[0] / mean[1])), "{mean:?}");
}

#[test]
fn a_promised_distance_is_kept_by_finer_elements_or_refused() {
    let Some(file) = files().into_iter().find(|f| f.ends_with("sand_ma107_00107.stl")) else { return };
    let surface = stl::read(&std::fs::read(&file).unwrap()).unwrap();
    let base = default_controls(surface.volume_mm3(), 2.0);
    let places = surface.vertices.clone();
    let solid = Solid::new(surface).unwrap();
    let distance = 0.25 * base.surface_size_mm;
    let controls = Controls { distance_mm: Some(distance), ..base };
    let made = mesh(&solid, &controls, &mut |_| ()).unwrap();
    assert_sound(&made, &controls, "distance");
    // The triangles' corners were not asked while it was made.
    assert!(Distances::measure(&solid, &made, &places).unwrap().max_mm() < 1.5 * distance);
    let controls = Controls { distance_mm: Some(1e-9), ..base };
    let text = mesh(&solid, &controls, &mut |_| ()).unwrap_err().to_string();
    assert!(
        text.contains("distance_mm = 1.000e-9 mm could not be kept") && text.contains("surface_size_mm"),
        "{text}"
    );
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
