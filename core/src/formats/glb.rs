//! glTF 2.0 in one binary file (`.glb`): the surface, for viewers and slides.

use super::{ExportError, Format, Writes};
use crate::geometry::TriangleMesh;
use serde_json::json;
use std::io::Write;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "glTF",
    endings: &["glb"],
    media_type: "model/gltf-binary",
    reads: None,
    writes: Some(Writes::Surface(|surface, provenance, out| write(surface, provenance, out))),
};

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
/// Kinds of chunks, and what numbers mean (glTF 2.0 specification, 3.6.1.1 and 4.4).
const JSON: &[u8; 4] = b"JSON";
const BINARY: &[u8; 4] = b"BIN\0";
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes a surface. glTF's unit is the metre and its upward axis y: a node scales by 1/1000 and turns z upwards, so the
/// stored positions are mm in our frame, in single precision. `provenance` goes into `asset.extras`.
///
/// # Errors
/// [`ExportError::Io`]; [`ExportError::Unfit`] without triangles, for a coordinate beyond single precision, or for more
/// than 4 GB.
pub fn write(surface: &TriangleMesh, provenance: &[String], mut out: impl Write) -> Result<(), ExportError> {
    let unfit = |what: String| ExportError::Unfit { format: "a glTF file", what };
    let Some(bounds) = surface.bounds().filter(|_| !surface.triangles.is_empty()) else {
        return Err(unfit("the surface has no triangle".to_owned()));
    };
    let mut data = Vec::with_capacity(12 * (surface.vertices.len() + surface.triangles.len()));
    for (i, p) in surface.vertices.iter().enumerate() {
        for x in p.iter() {
            let single = *x as f32;
            if !single.is_finite() {
                return Err(unfit(format!(
                    "vertex {i} has the coordinate {x} mm, beyond the 3.4e38 of single precision"
                )));
            }
            data.extend(single.to_le_bytes());
        }
    }
    let positions = data.len();
    surface.triangles.iter().flatten().for_each(|v| data.extend(v.to_le_bytes()));
    let single = |p: crate::geometry::Point| [p.x as f32, p.y as f32, p.z as f32];
    let document = json!({
        "asset": {
            "version": "2.0",
            "generator": concat!("grainrig ", env!("CARGO_PKG_VERSION")),
            "extras": { "unit": "mm", "provenance": provenance },
        },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        // A quarter turn about x brings z to y.
        "nodes": [{ "mesh": 0, "name": "grain", "scale": [0.001, 0.001, 0.001],
                    "rotation": [-std::f64::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2] }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "buffers": [{ "byteLength": data.len() }],
        "bufferViews": [
            { "buffer": 0, "byteOffset": 0, "byteLength": positions, "target": ARRAY_BUFFER },
            { "buffer": 0, "byteOffset": positions, "byteLength": data.len() - positions, "target": ELEMENT_ARRAY_BUFFER },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": FLOAT, "count": surface.vertices.len(), "type": "VEC3",
              "min": single(bounds.min), "max": single(bounds.max) },
            { "bufferView": 1, "componentType": UNSIGNED_INT, "count": 3 * surface.triangles.len(), "type": "SCALAR" },
        ],
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    data.resize(data.len().next_multiple_of(4), 0);
    let length = 12 + 8 + text.len() + 8 + data.len();
    let total = u32::try_from(length).map_err(|_| unfit(format!("{length} bytes, more than 4294967295")))?;
    out.write_all(MAGIC)?;
    out.write_all(&VERSION.to_le_bytes())?;
    out.write_all(&total.to_le_bytes())?;
    for (kind, chunk) in [(JSON, &text), (BINARY, &data)] {
        out.write_all(&(chunk.len() as u32).to_le_bytes())?;
        out.write_all(kind)?;
        out.write_all(chunk)?;
    }
    Ok(out.flush()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn a_file_has_its_chunks_and_the_positions_are_in_place() {
        let surface = TriangleMesh {
            vertices: [[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [0., 0., 1.]].map(Point::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]],
        };
        let mut bytes = Vec::new();
        write(&surface, &["from a test".to_owned()], &mut bytes).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let text = &bytes[20..20 + word(12)];
        let document: serde_json::Value = serde_json::from_slice(text).unwrap();
        assert_eq!(document["asset"]["extras"]["provenance"][0], "from a test");
        assert_eq!(document["accessors"][0]["max"], json!([1.0, 1.0, 1.0]));
        let data = 20 + word(12) + 8;
        assert_eq!((&bytes[data - 4..data], word(data - 8)), (&b"BIN\0"[..], 48 + 48));
        assert_eq!(bytes[data + 16..data + 20], 1f32.to_le_bytes());
        assert_eq!(word(data + 48 + 4), 1);
        assert!(matches!(write(&TriangleMesh::default(), &[], Vec::new()), Err(ExportError::Unfit { .. })));
    }
}
