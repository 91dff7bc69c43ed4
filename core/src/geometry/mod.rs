//! Points, boxes, angles, cameras as projections, triangle meshes, implicit bodies, convex hulls.
//!
//! The world frame is right-handed, its origin on the rotation axis, z along it and up. Lengths are mm.

mod angle;
mod bounds;
mod convex;
mod implicit;
mod projection;
mod triangles;

pub use angle::Angle;
pub use bounds::Aabb;
pub use convex::ConvexHull;
pub use implicit::{Ball, ImplicitBody};
pub use projection::Projection;
pub use triangles::{MeshFault, TriangleMesh};

/// A point in the world, in mm.
pub type Point = nalgebra::Point3<f64>;
/// A displacement in the world, in mm.
pub type Vector = nalgebra::Vector3<f64>;
