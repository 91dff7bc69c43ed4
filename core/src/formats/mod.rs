//! Files for other programs: Abaqus and `CalculiX` decks, VTK, Gmsh, STL, PLY, glTF; some of them read back, and voxels
//! read.
//!
//! [`FORMATS`] has them all. The writers know no paths: each writes to anything that takes bytes, and the same input gives the same bytes.

mod encoding;
mod error;
pub mod glb;
pub mod inp;
pub mod inp_read;
pub mod jpeg;
pub mod msh;
pub mod nrrd;
mod numbers;
pub mod obj;
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

use crate::geometry::TriangleMesh;
use crate::mesh::TetMesh;
use std::io::Write;
use std::path::Path;

/// Formats of meshes, surfaces and voxels. What reads or writes files, serves them or lists their endings, reads this table: a
/// format is a module here and its line.
pub static FORMATS: [&Format; 8] = [
    &inp::FORMAT,
    &vtu::FORMAT,
    &msh::FORMAT,
    &stl::FORMAT,
    &ply::FORMAT,
    &obj::FORMAT,
    &glb::FORMAT,
    &nrrd::FORMAT,
];

/// A format of files.
#[derive(Debug)]
pub struct Format {
    /// Its own name, or that of the program it belongs to.
    pub name: &'static str,
    /// Endings of its files' names, in small letters, the usual one first.
    pub endings: &'static [&'static str],
    /// Its media type, for a browser.
    pub media_type: &'static str,
    /// What is read of it.
    pub reads: Option<Reads>,
    /// What it is written of.
    pub writes: Option<Writes>,
}

/// Makes a body of a file's bytes, in the file's own unit.
pub type Reader<T> = fn(&[u8]) -> Result<T, ExportError>;

/// What a file holds, and how it is read.
#[derive(Debug, Clone, Copy)]
pub enum Reads {
    /// Triangles.
    Surface(Reader<TriangleMesh>),
    /// Tetrahedra.
    Volume(Reader<TetMesh>),
    /// Voxels.
    Voxels(Reader<nrrd::Volume>),
}

/// How a file is written, in mm.
#[derive(Debug, Clone, Copy)]
pub enum Writes {
    /// Of a surface's triangles, with lines that say where it is from.
    Surface(fn(&TriangleMesh, &[String], &mut dyn Write) -> Result<(), ExportError>),
    /// Of tetrahedra.
    Volume(fn(&TetMesh, &Particulars, &mut dyn Write) -> Result<(), ExportError>),
}

/// What is to be said of a mesh that is written, beside the mesh.
#[derive(Debug, Clone, Copy)]
pub struct Particulars<'a> {
    /// Nodes of an element.
    pub order: inp::Order,
    /// How far sets for contacts reach from the highest and the lowest node, mm.
    pub band_mm: f64,
    /// Lines that say where it is from.
    pub provenance: &'a [String],
}

impl Format {
    /// The format of a file of this name, by its ending.
    pub fn of(file: impl AsRef<Path>) -> Option<&'static Self> {
        let ending = file.as_ref().extension()?;
        FORMATS.into_iter().find(|f| f.endings.iter().any(|e| ending.eq_ignore_ascii_case(e)))
    }

    /// Writes a mesh, or its surface where the format holds no more.
    ///
    /// # Errors
    /// [`ExportError`]: what the format cannot hold; [`ExportError::Unfit`] for one that is only read.
    pub fn write(
        &self,
        mesh: &TetMesh,
        particulars: &Particulars,
        out: &mut dyn Write,
    ) -> Result<(), ExportError> {
        match self.writes {
            Some(Writes::Surface(write)) => write(&mesh.surface().triangles, particulars.provenance, out),
            Some(Writes::Volume(write)) => write(mesh, particulars, out),
            None => Err(ExportError::Unfit { format: self.name, what: "it is only read".to_owned() }),
        }
    }
}

/// The usual endings of formats for which something holds, as a sentence has them: `.stl, .ply or .nrrd`.
pub fn endings(which: impl Fn(&Format) -> bool, last: &str) -> String {
    let all = FORMATS.into_iter().filter(|f| which(f)).map(|f| format!(".{}", f.endings[0]));
    let all: Vec<String> = all.collect();
    match all.split_last() {
        Some((end, others)) if !others.is_empty() => format!("{}{last}{end}", others.join(", ")),
        _ => all.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn every_ending_names_one_format_and_what_a_format_writes_it_reads() {
        let nodes = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point::from).to_vec();
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]]);
        let from = ["from a test".to_owned()];
        let particulars = Particulars { order: inp::Order::First, band_mm: 0.1, provenance: &from };
        for format in FORMATS {
            for ending in format.endings {
                let found = Format::of(format!("a.b.{}", ending.to_uppercase())).unwrap();
                assert_eq!(found.name, format.name);
            }
            let mut bytes = Vec::new();
            let written = format.write(&mesh, &particulars, &mut bytes);
            assert_eq!(written.is_ok(), format.writes.is_some(), "{}", format.name);
            let volume = match format.reads.filter(|_| format.writes.is_some()) {
                Some(Reads::Surface(read)) => {
                    let surface = read(&bytes).unwrap();
                    assert_eq!(surface.check(), Ok(()), "{}", format.name);
                    surface.volume_mm3()
                }
                Some(Reads::Volume(read)) => read(&bytes).unwrap().tet_volumes_mm3().sum(),
                _ => continue,
            };
            assert!((6.0 * volume - 1.0).abs() < 1e-6, "{}: {volume}", format.name);
        }
        assert!(Format::of("stl").is_none() && Format::of("a.txt").is_none());
    }

    #[test]
    fn endings_are_listed_as_in_a_sentence() {
        assert_eq!(endings(|f| matches!(f.reads, Some(Reads::Voxels(_))), " or "), ".nrrd");
        assert_eq!(endings(|f| f.reads.is_none(), " or "), ".vtu or .glb");
        assert!(endings(|f| f.writes.is_some(), ", ").starts_with(".inp, .vtu, .msh, "));
    }
}
