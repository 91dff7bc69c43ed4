//! Errors of meshing.

use super::{TetFault, broken::BrokenControl};
use crate::geometry::{MeshFault, Point};

/// Why there is no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// A control has a value that no mesh can keep.
    #[error("{name} is {value} {unit}, but it must be {limit}; {remedy}")]
    Control {
        /// The control.
        name: &'static str,
        /// What it was set to.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// What it may be.
        limit: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// The controls ask for more tetrahedra than a computer of a laboratory holds.
    #[error(
        "the controls ask for a lattice of {spacing_mm:.3e} mm and about {estimate:.2e} tetrahedra, more than {limit:.0e}: \
         they would take about {gigabytes:.0} GB of memory; set surface_size_mm and tet_volume_mm3 larger, for a lattice \
         of {remedy_mm:.3e} mm"
    )]
    TooMany {
        /// The lattice spacing that the controls ask for, mm.
        spacing_mm: f64,
        /// Tetrahedra expected.
        estimate: f64,
        /// The memory they take while they are made, GB.
        gigabytes: f64,
        /// The most that are allowed.
        limit: f64,
        /// A lattice spacing that would be allowed, mm.
        remedy_mm: f64,
    },
    /// The body's box is not a box: a size is zero, negative or not finite.
    #[error(
        "the body's box measures {0:?} mm; each edge must be positive and finite, so check where the body comes from"
    )]
    Box([f64; 3]),
    /// A body whose size is no body's.
    #[error(
        "the body is {longest_mm:.4e} mm long, it must be {least:e} to {most:e} mm; check the unit of its numbers (--unit), and \
         scale it to a size that a body has"
    )]
    Extent {
        /// The longest side of its box, mm.
        longest_mm: f64,
        /// The least that is taken, mm.
        least: f64,
        /// The most that is taken, mm.
        most: f64,
    },
    /// A body too far away for numbers to describe it.
    #[error(
        "the body is {longest_mm:.4} mm long and lies up to {far_mm:.4e} mm from the origin, where coordinates are {step_mm:.1e} mm \
         apart; move it to the origin before it is exported"
    )]
    Far {
        /// The longest side of its box, mm.
        longest_mm: f64,
        /// Its greatest coordinate, mm.
        far_mm: f64,
        /// From one coordinate in double precision to the next there, mm.
        step_mm: f64,
    },
    /// No lattice point lies inside, or none that is not on the surface.
    #[error(
        "nothing of a lattice of {spacing_mm:.3e} mm lies inside the body: it is empty or thinner than that; \
         set surface_size_mm and tet_volume_mm3 smaller"
    )]
    Empty {
        /// The lattice spacing, mm.
        spacing_mm: f64,
    },
    /// The body goes on beyond the box that it states.
    #[error("the body still reaches {0:.6?}, which is outside its own box: its bounds() is wrong")]
    Unbounded(Point),
    /// The body has no value somewhere.
    #[error("the body's value at {0:.6?} is {1}, not a finite number of mm")]
    NotFinite(Point, f64),
    /// A control could not be kept.
    #[error(transparent)]
    Promise(#[from] BrokenControl),
    /// The mesh is not one: our own fault, found before anybody used it.
    #[error(
        "the mesher made a bad mesh ({0}); move the body a little or change surface_size_mm, and report it"
    )]
    Fault(#[from] TetFault),
    /// There are not as many voxels as the volume's size states.
    #[error(
        "{count} voxels do not make a volume of {} × {} × {}; give as many as their product, at least one",
        size[0], size[1], size[2]
    )]
    Voxels {
        /// Voxels along x, y and z.
        size: [usize; 3],
        /// How many were given.
        count: usize,
    },
    /// The surface has more triangles than are worked on.
    #[error(
        "the surface has {count} triangles, more than {limit}; a mesh of a grain is decided by far fewer: decimate it to \
         some hundred thousand first"
    )]
    Triangles {
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// The surface encloses nothing.
    #[error(
        "the surface encloses {volume_mm3:.3e} mm³ under an area of {area_mm2:.3e} mm²: it is a sheet without thickness; \
         give the body a thickness"
    )]
    Flat {
        /// The volume, mm³.
        volume_mm3: f64,
        /// The area, mm².
        area_mm2: f64,
    },
    /// The surface cuts itself.
    #[error(
        "triangles {first} and {second} of the surface cut one another near {point:.6?} mm: it has no clear inside; repair it \
         (union, or `self-intersections` in a mesh program) first"
    )]
    Crossing {
        /// A triangle, from 0.
        first: usize,
        /// One that it cuts.
        second: usize,
        /// A corner of the first, mm.
        point: Point,
    },
    /// The surface that should bound a solid does not.
    #[error(
        "the surface does not bound a solid: {0}; close it (fill holes, join vertices) and turn its \
         triangles outwards first"
    )]
    Open(#[from] MeshFault),
}
