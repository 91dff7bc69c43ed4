//! Files for other programs: Abaqus and `CalculiX` decks, VTK, STL.
//!
//! The writers know no paths: each writes to anything that takes bytes, and the same input gives the same bytes.

mod error;
pub mod inp;
pub mod press_deck;
pub mod pvd;
pub mod stl;
pub mod vtu;

pub use error::ExportError;
