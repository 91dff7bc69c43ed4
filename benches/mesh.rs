//! Body → tetrahedra. Run: `cargo bench --bench mesh` (about a minute).
//!
//! The built-in grain as a visual hull of 25 views and as a solid of 81,920 triangles, each at about 55,000 tetrahedra
//! (the default), 650,000 and 2 million, from the body to the checked mesh with its quality measured. The hull is also
//! meshed with an eighth of the size at the contacts. The yardstick is sorting as many 64-bit numbers as the
//! mesh has faces (four a tetrahedron) on one thread with the standard library, at the rate of four million.
//! On a machine of two cores `TetGen` made 67,000 tetrahedra a second from a finished surface mesh, Netgen
//! 18,000, fTetWild 10,000, CGAL 14,000 with its slivers removed, Gmsh's HXT 412,000 (after 12 s of remeshing
//! the surface).

mod common;

use common::{median_s, most_memory_mb, tell, views};
use grainrig::geometry::ImplicitBody;
use grainrig::hull::{VisualHull, find_bounds};
use grainrig::mesh::{Controls, Solid, mesh};

/// How many numbers are sorted for the yardstick.
const SORTED: usize = 4_000_000;

/// Numbers without order (a linear congruential generator: Knuth's MMIX).
fn numbers(count: usize) -> Vec<u64> {
    let mut x = 1u64;
    let mut next = || {
        x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        x
    };
    (0..count).map(|_| next()).collect()
}

fn bench(what: &str, body: &dyn ImplicitBody, diameter_mm: f64, sorting_one_s: f64) {
    for coarser in [1.0, 0.435, 0.3] {
        let controls = Controls::for_size(coarser * diameter_mm);
        one(what, body, &controls, sorting_one_s);
    }
}

fn one(what: &str, body: &dyn ImplicitBody, controls: &Controls, sorting_one_s: f64) {
    let make = || mesh(body, controls, &mut |_| ()).expect("a mesh");
    let seconds = median_s(make);
    let made = make();
    let tets = made.tets.len();
    let sorting = (4 * tets) as f64 * sorting_one_s;
    let rate = format!("{:.0} tets/s", tets as f64 / seconds);
    tell(what, &format!("{tets} tets"), seconds, &rate, ("sorting its faces", sorting));
    let q = made.quality();
    println!(
        "{:<22} dihedral angles {:.1}° to {:.1}° (1 %: {:.1}°), facets from {:.1}°, least altitude {:.2} of the median",
        "",
        q.dihedral_deg.min,
        q.dihedral_deg.max,
        q.dihedral_deg.p01,
        q.facet_angle_deg,
        q.altitude_min_mm / q.altitude_median_mm
    );
}

fn main() {
    let (cones, truth) = views(25);
    let diameter_mm = truth.truth().settings.grain_size_mm;
    let bounds = find_bounds(&cones).expect("a hull");
    let hull = VisualHull { cones, bounds: bounds.grown(0.02 * bounds.size().max()) };
    let unsorted = numbers(SORTED);
    let sorting = median_s(|| {
        let mut all = unsorted.clone();
        all.sort_unstable();
        all
    });
    let sorting_one_s = sorting / SORTED as f64;
    bench("hull of 25 views", &hull, diameter_mm, sorting_one_s);
    if let Some(mb) = most_memory_mb() {
        println!("{:<22} {mb:.0} MB of memory at most until here", "");
    }
    let usual = Controls::for_size(2.0 * diameter_mm);
    let graded = Controls { size_at_contact_mm: Some(0.125 * usual.surface_size_mm), ..usual };
    one("hull, fine contacts", &hull, &graded, sorting_one_s);
    let solid = Solid::new(truth.truth_mesh().clone()).expect("a closed surface");
    let making = median_s(|| Solid::new(truth.truth_mesh().clone()));
    println!("{:<22} {:>24} {:>10.2} ms", "solid from triangles", "81920 triangles", 1e3 * making);
    bench("solid", &solid, diameter_mm, sorting_one_s);
}
