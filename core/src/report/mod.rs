//! Pictures for a person's eye: outlines drawn over the photographs, and sheets of figures.
//!
//! The same input gives the same bytes, on any computer: letters come with the program, not from its fonts
//! (Noto Sans Mono, SIL Open Font License, drawn beforehand).

mod bitmap;
mod canvas;
mod field;
mod mesh_sheet;
mod outline;
mod poses;
mod shaded;
mod sheet;
mod svg;
mod tiles;

pub use field::{FieldCut, FieldPicture};
pub use mesh_sheet::mesh_sheet;
pub use outline::{Marks, Shot};
pub use poses::{Pose, Poses};
pub use shaded::{from_the_side, shaded};
pub use sheet::{Mark, Panel, Point, Series, Sheet};
pub use tiles::{Tile, Tiles};
