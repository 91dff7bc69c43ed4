//! Gmsh reads the `.msh` files that are written, in either order.
//!
//! Gmsh is asked through a Python that has it: `GRAINRIG_GMSH_PYTHON`, or `python3` on the path.

use crate::skip::{Lacking, skip};
use grainrig_core::formats::msh;
use grainrig_core::geometry::{Ball, Point};
use grainrig_core::mesh::{Controls, mesh};
use std::process::Command;

/// Prints the numbers of triangles and tetrahedra, the physical groups, the least quality (radius ratio) and the volume.
const ASK: &str = "
import gmsh, sys
gmsh.initialize(); gmsh.option.setNumber('General.Terminal', 0)
gmsh.open(sys.argv[1])
order = int(sys.argv[2])
tri, _ = gmsh.model.mesh.getElementsByType([2, 9][order - 1])
tet, _ = gmsh.model.mesh.getElementsByType([4, 11][order - 1])
names = ','.join(gmsh.model.getPhysicalName(d, t) for d, t in gmsh.model.getPhysicalGroups())
print(len(tri), len(tet), names, min(gmsh.model.mesh.getElementQualities(tet, 'minSJ')),
      sum(gmsh.model.mesh.getElementQualities(tet, 'volume')))
";

#[test]
fn gmsh_reads_what_is_written() {
    let python = std::env::var("GRAINRIG_GMSH_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let there = Command::new(&python).args(["-c", "import gmsh"]).output();
    if !there.is_ok_and(|out| out.status.success()) {
        let why = format!("{python} has no gmsh (set GRAINRIG_GMSH_PYTHON)");
        return skip(Lacking::System, why);
    }
    let ball = Ball { center: Point::origin(), radius_mm: 0.5 };
    let made = mesh(&ball, &Controls::for_size(3.0), &mut |_| ()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for order in [1, 2] {
        let path = folder.path().join(format!("ball{order}.msh"));
        msh::write(&made, order == 2, &["from a test".to_owned()], std::fs::File::create(&path).unwrap())
            .unwrap();
        let out = Command::new(&python).args(["-c", ASK]).arg(&path).arg(order.to_string()).output().unwrap();
        let said = String::from_utf8_lossy(&out.stdout).into_owned();
        let words: Vec<&str> = said.split_whitespace().collect();
        let [triangles, tets, names, quality, volume] = words[..] else {
            panic!("{said} {}", String::from_utf8_lossy(&out.stderr));
        };
        assert_eq!(triangles, made.surface().triangles.triangles.len().to_string());
        assert_eq!(tets, made.tets.len().to_string());
        assert_eq!(names, "GRAIN_SURFACE,GRAIN");
        assert!(quality.parse::<f64>().unwrap() > 0.1, "{said}");
        assert!((volume.parse::<f64>().unwrap() / made.volume_mm3() - 1.0).abs() < 1e-9, "{said}");
    }
}
