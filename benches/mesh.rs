//! Body → tetrahedra. Run: `cargo bench --bench mesh` (about a minute).
//!
//! The built-in grain as a visual hull of 25 views and as a solid of 81,920 triangles, each at about 55,000 tetrahedra
//! (the default), 650,000 and 2 million, from the body to the checked mesh with its quality measured. The hull is also
//! meshed with an eighth of the size at the contacts. The yardstick is sorting as many 64-bit numbers as the
//! mesh has faces (four a tetrahedron) on one thread with the standard library, at the rate of four million.
//! Where Python has Gmsh (`GRAINRIG_GMSH_PYTHON`, or `python3`), Gmsh fills the very surface of the mesh of 650,000 beside it.
//! On a machine of two cores `TetGen` made 67,000 tetrahedra a second from a finished surface mesh, Netgen
//! 18,000, fTetWild 10,000, CGAL 14,000 with its slivers removed, Gmsh's HXT 412,000 (after 12 s of remeshing
//! the surface).

mod common;

use common::{median_s, most_memory_mb, tell, views};
use grainrig_core::formats::{msh, stl};
use grainrig_core::geometry::{ImplicitBody, TriangleMesh};
use grainrig_core::hull::{VisualHull, find_bounds};
use grainrig_core::mesh::{Controls, Distances, Quality, Solid, TetMesh, mesh};
use std::process::Command;

/// How many numbers are sorted for the yardstick.
const SORTED: usize = 4_000_000;

/// Fills a surface with tetrahedra by HXT on two threads, and prints the seconds.
const GMSH: &str = "
import gmsh, sys, time
gmsh.initialize(); gmsh.option.setNumber('General.Terminal', 0)
gmsh.merge(sys.argv[1])
faces = [tag for _, tag in gmsh.model.getEntities(2)]
gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(faces)])
gmsh.model.geo.synchronize()
for name, value in [('Mesh.Algorithm3D', 10), ('General.NumThreads', 2), ('Mesh.MaxNumThreads3D', 2), ('Mesh.SaveAll', 1),
                    ('Mesh.MshFileVersion', 4.1)]:
    gmsh.option.setNumber(name, value)
start = time.perf_counter(); gmsh.model.mesh.generate(3); print(time.perf_counter() - start)
gmsh.write(sys.argv[2])
";

/// Gmsh on a finished surface; `None` where Python has no Gmsh, or it fails.
fn gmsh(surface: &TriangleMesh) -> Option<(f64, TetMesh)> {
    let python = std::env::var("GRAINRIG_GMSH_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let folder = tempfile::tempdir().ok()?;
    let [from, to] = ["surface.stl", "filled.msh"].map(|name| folder.path().join(name));
    stl::write(surface, std::fs::File::create(&from).ok()?).ok()?;
    let out = Command::new(python).args(["-c", GMSH]).args([&from, &to]).output().ok()?;
    let seconds = String::from_utf8_lossy(&out.stdout).lines().last()?.trim().parse().ok()?;
    Some((seconds, msh::read(&std::fs::read(&to).ok()?).ok()?))
}

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
    tell_quality(&made.quality());
    let off = Distances::measure(body, &made, &[]).expect("a surface").to_body;
    println!(
        "{:<22} {:.2} % of the surface size off the body in the mean",
        "",
        100.0 * off.mean_mm / controls.surface_size_mm
    );
}

fn tell_quality(q: &Quality) {
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
    let middle = mesh(&hull, &Controls::for_size(0.435 * diameter_mm), &mut |_| ()).expect("a mesh");
    match gmsh(&middle.surface().triangles) {
        Some((seconds, filled)) => {
            let (tets, rate) = (filled.tets.len(), filled.tets.len() as f64 / seconds);
            let sorting = (4 * tets) as f64 * sorting_one_s;
            let own = ("sorting its faces", sorting);
            tell("Gmsh, surface given", &format!("{tets} tets"), seconds, &format!("{rate:.0} tets/s"), own);
            tell_quality(&filled.quality());
        }
        None => println!("Gmsh is not there: not timed"),
    }
    let usual = Controls::for_size(2.0 * diameter_mm);
    let graded = Controls { size_at_contact_mm: Some(0.125 * usual.surface_size_mm), ..usual };
    one("hull, fine contacts", &hull, &graded, sorting_one_s);
    let solid = Solid::new(truth.truth_mesh().clone()).expect("a closed surface");
    let making = median_s(|| Solid::new(truth.truth_mesh().clone()));
    println!("{:<22} {:>24} {:>10.2} ms", "solid from triangles", "81920 triangles", 1e3 * making);
    bench("solid", &solid, diameter_mm, sorting_one_s);
}
