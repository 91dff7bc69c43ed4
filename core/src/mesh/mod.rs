//! Meshing: tetrahedra and boundary triangles for an implicit body.
//!
//! Isosurface stuffing (Labelle and Shewchuk, ACM Trans. Graphics 26(3), 57, 2007): a body-centred cubic
//! lattice, graded by an octree, is laid over the body, lattice points close to the surface are warped onto it, and
//! the tetrahedra that the surface still crosses are cut by a short list of stencils. What the stencils leave is then
//! improved by smoothing in which surface nodes stay on the surface ([`optimise`](self)). The three controls
//! are promises: a mesh that breaks one is an error, not a result.

mod background;
mod broken;
mod controls;
mod crossing;
mod cut;
mod distance;
mod error;
mod extent;
mod faces;
mod octree;
mod optimise;
mod pieces;
mod quality;
mod repair;
mod score;
mod second;
mod sizes;
mod solid;
mod spread;
mod star;
mod stencil;
mod tetmesh;
mod voxels;

pub use controls::Controls;
pub use distance::{Distance, Distances};
pub use error::MeshError;
pub use extent::check_extent;
pub use faces::FACES;
pub use quality::{Dihedral, Quality};
pub use second::{MIDDLES, SecondOrder};
pub use solid::{MOST_TRIANGLES, Solid};
pub use spread::{Histogram, Spread};
pub use tetmesh::{Surface, TetFault, TetMesh};
pub use voxels::Voxels;

use crate::geometry::{ImplicitBody, Point};
use background::Background;
use octree::Octree;
use sizes::{Contacts, Sizes};
use star::Targets;

/// Attempts with a finer or shifted lattice before a promise is given up.
const ATTEMPTS: usize = 5;
/// A least dihedral angle below this is worth another attempt, degrees: almost every lattice gives 25°, and one bad
/// tetrahedron costs an explicit simulation its time step.
const POOR_DIHEDRAL_DEG: f64 = 18.0;
/// Attempts until the best of them is taken all the same.
const POOR_ATTEMPTS: usize = 3;

/// Fills a body with tetrahedra.
///
/// Costs about 24 body values for each surface node and one for each lattice point near the surface (everywhere in the
/// body's box where its [`steepness`](ImplicitBody::steepness) is not known), all in parallel; the same body and controls give the same bytes on any number of threads. Of a body in several
/// pieces the largest is kept; [`TetMesh::dropped_pieces`] counts the others. A mesh that keeps the
/// controls with a dihedral angle below 18° is tried again on a shifted lattice, and the best is returned.
/// `progress` is called with the part done, from 0 to 1, never falling.
///
/// # Errors
/// [`MeshError`]: bad controls, a body that is empty, not finite or larger than its own box, a size that
/// would need too many tetrahedra, or a control that no attempt could keep.
pub fn mesh(
    body: &dyn ImplicitBody,
    controls: &Controls,
    progress: &mut dyn FnMut(f64),
) -> Result<TetMesh, MeshError> {
    controls.check()?;
    let contacts = Contacts::of(body, controls);
    let mut finer = [1.0; 3];
    let mut last = None;
    let mut poor: Option<(f64, TetMesh)> = None;
    for attempt in 0..ATTEMPTS {
        let sizes = Sizes::new(controls, contacts, finer);
        let mut report = |part: f64| progress((attempt as f64 + part) / ATTEMPTS as f64);
        let (mesh, surface_points) = match on_lattice(body, controls, &sizes, contacts, attempt, &mut report)
        {
            Ok(mesh) => mesh,
            // What an earlier attempt made is good enough.
            Err(_) if poor.is_some() => break,
            // What the promise would take is beyond memory: the promise is what is reported.
            Err(MeshError::TooMany { .. }) if last.is_some() => break,
            Err(e) => return Err(e),
        };
        let quality = mesh.quality();
        let mut broken = controls.broken_by(&quality, contacts.map(|c| c.largest_facet_mm(&mesh)));
        if broken.is_none() && controls.distance_mm.is_some() {
            broken = controls.too_far(Distances::measure(body, &mesh, &surface_points)?.max_mm());
        }
        if let Some(broken) = broken {
            broken.refine(&mut finer);
            last = Some(broken);
            continue;
        }
        let least = quality.dihedral_deg.min;
        if poor.as_ref().is_none_or(|(p, _)| least > *p) {
            poor = Some((least, mesh));
        }
        if least >= POOR_DIHEDRAL_DEG || attempt + 1 >= POOR_ATTEMPTS {
            break;
        }
    }
    if let Some((_, mesh)) = poor {
        progress(1.0);
        return Ok(mesh);
    }
    // The loop ran, so a promise was broken.
    Err(last.map_or(MeshError::Empty { spacing_mm: controls.surface_size_mm }, MeshError::Promise))
}

/// One attempt: a checked mesh, which may break the controls, and points on the body's surface.
fn on_lattice(
    body: &dyn ImplicitBody,
    controls: &Controls,
    sizes: &Sizes,
    contacts: Option<Contacts>,
    attempt: usize,
    progress: &mut dyn FnMut(f64),
) -> Result<(TetMesh, Vec<Point>), MeshError> {
    progress(0.0);
    let tree = Octree::over(body, sizes, attempt)?;
    progress(0.1);
    let field = cut::Field::new(body, Background::new(body, &tree)?)?;
    progress(0.3);
    let filled = repair::fill(body, &field);
    if filled.mesh.tets.is_empty() {
        // The few points inside were all warped onto the surface.
        return Err(MeshError::Empty { spacing_mm: sizes.surface_mm });
    }
    progress(0.5);
    let mut filled = pieces::largest(filled);
    optimise::improve(body, &Targets::new(controls, contacts), &mut filled);
    let mesh = filled.mesh;
    mesh.check()?;
    Ok((mesh, field.surface_points()))
}
