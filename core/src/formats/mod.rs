//! Files for other programs: Abaqus and `CalculiX` decks, VTK, Gmsh, STL, PLY, glTF; some of them read back, and voxels
//! read.
//!
//! The writers know no paths: each writes to anything that takes bytes, and the same input gives the same bytes.

mod encoding;
mod error;
pub mod glb;
pub mod inp;
pub mod inp_read;
pub mod jpeg;
pub mod msh;
pub mod nrrd;
mod numbers;
mod photograph;
pub mod ply;
pub mod press_deck;
pub mod pvd;
mod resolution;
pub mod stl;
pub mod vtu;

pub use encoding::Encoding;
pub use error::ExportError;
pub use photograph::{Photograph, decode};
