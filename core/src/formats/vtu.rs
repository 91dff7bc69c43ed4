//! VTK's XML unstructured grid (`.vtu`): the tetrahedra and figures on their nodes and cells, for `ParaView`.

use super::inp::Order;
use super::{ExportError, Format, Writes};
use crate::geometry::Point;
use crate::mesh::{SecondOrder, TetMesh};
use base64::{Engine as _, engine::general_purpose::STANDARD as BASE64};
use std::io::Write;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "ParaView",
    endings: &["vtu"],
    media_type: "application/xml",
    reads: None,
    writes: Some(Writes::Volume(|mesh, p, out| match p.order {
        Order::First => write_plain(mesh, p.provenance, out),
        Order::Second => write_second(&mesh.second_order(), p.provenance, out),
    })),
};

/// VTK's number for a tetrahedron of four nodes, which numbers them as [`TetMesh`] does.
const VTK_TETRA: u8 = 10;
/// The same for one of ten nodes, which it numbers as [`SecondOrder`] does.
const VTK_QUADRATIC_TETRA: u8 = 24;
/// The components of a symmetric tensor, as VTK orders them.
const TENSOR: [&str; 6] = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"];
/// Bytes of the length before an array's own (`header_type` of `UInt64`).
const LENGTH: usize = 8;

/// A figure for each node or each cell: of one component, a vector of three, or a symmetric tensor of six (xx, yy, zz, xy, yz,
/// xz, which is VTK's order).
#[derive(Debug, Clone, Copy)]
pub struct Column<'a> {
    /// Its name, with its unit, for instance `stress_zz_mpa`.
    pub name: &'a str,
    /// Values that belong to one node or cell; three make a vector.
    pub components: usize,
    /// The values, node by node or cell by cell.
    pub values: &'a [f64],
}

/// Writes the mesh with figures on its nodes and cells. Arrays are exact (64 bits, little endian, base64).
///
/// # Errors
/// [`ExportError::Io`]; [`ExportError::Unfit`] where a column has no component or not one value for each component
/// of each node or cell.
pub fn write(
    mesh: &TetMesh,
    on_nodes: &[Column],
    on_cells: &[Column],
    out: impl Write,
) -> Result<(), ExportError> {
    grid((&mesh.nodes, &mesh.tets, VTK_TETRA), &[], on_nodes, on_cells, out)
}

/// The same, with a comment of these lines.
///
/// # Errors
/// As [`write()`].
pub fn write_commented(
    mesh: &TetMesh,
    comment: &[String],
    on_nodes: &[Column],
    on_cells: &[Column],
    out: impl Write,
) -> Result<(), ExportError> {
    grid((&mesh.nodes, &mesh.tets, VTK_TETRA), comment, on_nodes, on_cells, out)
}

/// Writes a mesh alone, with its origin as a comment.
///
/// # Errors
/// [`ExportError::Io`].
pub fn write_plain(mesh: &TetMesh, provenance: &[String], out: impl Write) -> Result<(), ExportError> {
    grid((&mesh.nodes, &mesh.tets, VTK_TETRA), provenance, &[], &[], out)
}

/// The same in ten-node tetrahedra.
///
/// # Errors
/// [`ExportError::Io`].
pub fn write_second(mesh: &SecondOrder, provenance: &[String], out: impl Write) -> Result<(), ExportError> {
    grid((&mesh.nodes, &mesh.tets, VTK_QUADRATIC_TETRA), provenance, &[], &[], out)
}

fn grid<const N: usize>(
    (points, elements, kind): (&[Point], &[[u32; N]], u8),
    provenance: &[String],
    on_nodes: &[Column],
    on_cells: &[Column],
    mut out: impl Write,
) -> Result<(), ExportError> {
    let (nodes, cells) = (points.len(), elements.len());
    for (columns, count, what) in [(on_nodes, nodes, "nodes"), (on_cells, cells, "cells")] {
        for c in columns {
            if c.components == 0 || c.values.len() != c.components * count {
                let what = format!(
                    "column {} has {} values for {count} {what} of {} components",
                    c.name,
                    c.values.len(),
                    c.components
                );
                return Err(ExportError::Unfit { format: "a VTK grid", what });
            }
        }
    }
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    for line in provenance {
        // Two hyphens would end a comment.
        writeln!(
            out,
            "<!-- {} -->",
            line.replace("--", "- -").replace(['\n', '\r'], " ").trim_end_matches('-')
        )?;
    }
    writeln!(
        out,
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">"
    )?;
    writeln!(out, "<UnstructuredGrid>")?;
    writeln!(out, "<Piece NumberOfPoints=\"{nodes}\" NumberOfCells=\"{cells}\">")?;
    writeln!(out, "<Points>")?;
    let points = points.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f64::to_le_bytes);
    array(&mut out, "Float64", "Points", 3, points)?;
    writeln!(out, "</Points>\n<Cells>")?;
    let connectivity = elements.iter().flatten().flat_map(|n| i64::from(*n).to_le_bytes());
    array(&mut out, "Int64", "connectivity", 1, connectivity)?;
    array(&mut out, "Int64", "offsets", 1, (1..=cells as i64).flat_map(|i| (N as i64 * i).to_le_bytes()))?;
    array(&mut out, "UInt8", "types", 1, std::iter::repeat_n(kind, cells))?;
    writeln!(out, "</Cells>")?;
    for (tag, columns) in [("PointData", on_nodes), ("CellData", on_cells)] {
        writeln!(out, "<{tag}>")?;
        for c in columns {
            let bytes = c.values.iter().flat_map(|x| x.to_le_bytes());
            array(&mut out, "Float64", c.name, c.components, bytes)?;
        }
        writeln!(out, "</{tag}>")?;
    }
    writeln!(out, "</Piece>\n</UnstructuredGrid>\n</VTKFile>")?;
    Ok(out.flush()?)
}

/// One array: the length of its bytes (64 bits), then the bytes, in one run of base64.
fn array(
    out: &mut impl Write,
    kind: &str,
    name: &str,
    components: usize,
    bytes: impl Iterator<Item = u8>,
) -> std::io::Result<()> {
    let name = name.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
    let names: String = if components == TENSOR.len() {
        let named = TENSOR.iter().enumerate().map(|(k, n)| format!(" ComponentName{k}=\"{n}\""));
        named.collect::<Vec<_>>().concat()
    } else {
        String::new()
    };
    writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"{names} format=\"binary\">"
    )?;
    let mut all = vec![0; LENGTH];
    all.extend(bytes);
    let length = (all.len() - LENGTH) as u64;
    all[..LENGTH].copy_from_slice(&length.to_le_bytes());
    out.write_all(BASE64.encode(all).as_bytes())?;
    writeln!(out, "\n</DataArray>")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn a_grid_has_its_arrays_and_names() {
        let nodes = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point::from).to_vec();
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]]);
        let column = |name, values| Column { name, components: 1, values };
        let mut bytes = Vec::new();
        write(&mesh, &[column("a<b", &[1.0; 4])], &[column("volume_mm3", &[1.0])], &mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        // Eight bytes of length (1), then the cell type 10.
        assert!(
            text.contains("Name=\"types\" NumberOfComponents=\"1\" format=\"binary\">\nAQAAAAAAAAAK\n"),
            "{text}"
        );
        assert!(
            text.contains("Name=\"a&lt;b\"") && text.contains("NumberOfPoints=\"4\" NumberOfCells=\"1\"")
        );
        let short = write(&mesh, &[column("a", &[1.0; 3])], &[], Vec::new()).unwrap_err().to_string();
        assert!(short.contains("3 values for 4 nodes"), "{short}");
    }
}
