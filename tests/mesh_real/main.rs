//! The mesher on real grains, on visual hulls and on bodies that are no grains.

mod bodies;
mod fuzz;
mod graded;
mod grains;
mod hulls;
#[path = "../support/random.rs"]
mod random;
#[path = "../support/skip.rs"]
mod skip;

use grainrig_core::mesh::{Controls, Quality, TetMesh};

/// Least and greatest dihedral angle of any mesh of a grain or hull, degrees. Isosurface stuffing proves 10.7° and 164.8°
/// before smoothing (Labelle and Shewchuk 2007).
const LEAST_DIHEDRAL_DEG: f64 = 18.0;
const GREATEST_DIHEDRAL_DEG: f64 = 155.0;
/// Smallest altitude over the median: an explicit simulation pays for it.
const LEAST_ALTITUDE: f64 = 0.4;

/// Asserts that a mesh is one, and keeps the three controls; its quality.
fn assert_sound(mesh: &TetMesh, controls: &Controls, name: &str) -> Quality {
    assert_eq!(mesh.check(), Ok(()), "{name}");
    let surface = mesh.surface();
    assert_eq!(surface.triangles.check(), Ok(()), "{name}");
    // Two ways to the same volume: the sum of the tetrahedra, and the divergence theorem on the surface.
    let volume = mesh.volume_mm3();
    assert!((surface.triangles.volume_mm3() / volume - 1.0).abs() < 1e-9, "{name}");
    let q = mesh.quality();
    assert!(q.facet_circumradius_mm <= controls.surface_size_mm, "{name}: {q:?}");
    assert!(q.facet_angle_deg >= controls.facet_angle_deg, "{name}: {q:?}");
    assert!(q.tet_volume_mm3 <= controls.tet_volume_mm3, "{name}: {q:?}");
    q
}

/// The same, and no tetrahedron is a sliver.
fn assert_good(mesh: &TetMesh, controls: &Controls, name: &str) -> Quality {
    let q = assert_sound(mesh, controls, name);
    let d = q.dihedral_deg;
    assert!(d.min > LEAST_DIHEDRAL_DEG && d.max < GREATEST_DIHEDRAL_DEG, "{name}: {d:?}");
    assert!(d.p01 > 25.0, "{name}: {d:?}");
    assert!(q.altitude_min_mm >= LEAST_ALTITUDE * q.altitude_median_mm, "{name}: {q:?}");
    q
}

/// The controls that the program takes by default for a body of this volume, for a size `coarser` times as large.
fn default_controls(volume_mm3: f64, coarser: f64) -> Controls {
    Controls::for_size(coarser * (6.0 * volume_mm3 / std::f64::consts::PI).cbrt())
}

/// Runs `work` on a pool of as many threads.
fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}
