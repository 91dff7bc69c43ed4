//! STL: triangles without shared vertices, in binary or text.

use super::{ExportError, Format, Reads, Writes, resolution};
use crate::geometry::{Point, TriangleMesh};
use std::collections::HashMap;
use std::io::{Cursor, Write};

/// The format in the table. The header has room for a part of the hash of what it was made from.
pub(super) static FORMAT: Format = Format {
    name: "STL",
    endings: &["stl"],
    media_type: "model/stl",
    reads: Some(Reads::Surface(read)),
    writes: Some(Writes::Surface(|surface, provenance, out| {
        let hash = provenance.iter().find_map(|line| line.strip_prefix("sha256 of the input "));
        write_from(surface, &hash.map_or(String::new(), |h| format!("from sha256 {h:.24}")), out)
    })),
};

/// Bytes before the first triangle in binary STL.
pub const HEADER: usize = 84;
/// Bytes of a triangle in binary STL.
pub const TRIANGLE: usize = 50;

/// Writes binary STL. Coordinates are rounded to single precision, as the format has no other; the unit, mm, is stated
/// in the header.
///
/// # Errors
/// [`ExportError::Io`], [`ExportError::Resolution`] for a body too far from the origin, and [`ExportError::Unfit`] for a
/// coordinate beyond single precision or too many triangles for the format's count.
pub fn write(mesh: &TriangleMesh, out: impl Write) -> Result<(), ExportError> {
    write_from(mesh, "", out)
}

/// The same with as much of `source` (where the surface comes from; what is not ASCII becomes `?`) as the header holds.
///
/// # Errors
/// As [`write()`].
pub fn write_from(mesh: &TriangleMesh, source: &str, mut out: impl Write) -> Result<(), ExportError> {
    let count = u32::try_from(mesh.triangles.len())
        .map_err(|_| unfit(format!("{} triangles, more than 4294967295", mesh.triangles.len())))?;
    resolution::check("STL", mesh.vertices.iter().copied(), true)?;
    let mut header = [b' '; 80];
    let title = b"grainrig binary STL, unit mm";
    let named = source.chars().map(|c| if c == ' ' || c.is_ascii_graphic() { c as u8 } else { b'?' });
    let text = title.iter().copied().chain((!source.is_empty()).then_some(b' ')).chain(named);
    header.iter_mut().zip(text).for_each(|(slot, c)| *slot = c);
    let mut bytes = Vec::with_capacity(HEADER + TRIANGLE * mesh.triangles.len());
    bytes.extend(header);
    bytes.extend(count.to_le_bytes());
    for t in 0..mesh.triangles.len() {
        let [a, b, c] = mesh.corners(t);
        let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_default();
        for v in [normal, a.coords, b.coords, c.coords] {
            for x in v.iter() {
                let single = *x as f32;
                if !single.is_finite() {
                    return Err(unfit(format!(
                        "triangle {t} has the coordinate {x} mm, beyond the 3.4e38 of single precision"
                    )));
                }
                bytes.extend(single.to_le_bytes());
            }
        }
        bytes.extend([0, 0]);
    }
    Ok(out.write_all(&bytes)?)
}

fn unfit(what: String) -> ExportError {
    ExportError::Unfit { format: "binary STL", what }
}

/// Reads binary or text STL from bytes; vertices with the same coordinates become one. The unit is the file's own.
///
/// Whether the triangles bound a body is for [`TriangleMesh::check`] to find.
///
/// # Errors
/// [`ExportError::Stl`] where the bytes are not STL: too short for the triangles they announce, text that does not
/// parse, no triangle, a coordinate that is not finite, or a triangle of no extent; [`ExportError::Resolution`] for a body
/// too far from the origin.
pub fn read(bytes: &[u8]) -> Result<TriangleMesh, ExportError> {
    let bad = |what: String| Err(ExportError::Stl(what));
    if let Some(count) = announced(bytes, bytes.len() as u64) {
        let present = (bytes.len() - HEADER) / TRIANGLE;
        if count > present {
            return bad(format!(
                "its header announces {count} triangles, but its {} bytes hold {present}: it is cut short",
                bytes.len()
            ));
        }
    }
    let mut cursor = Cursor::new(bytes);
    let reader = stl_io::create_stl_reader(&mut cursor).map_err(|e| ExportError::Stl(e.to_string()))?;
    let mut mesh = TriangleMesh::default();
    let mut flat = None;
    let mut numbers: HashMap<[u32; 3], u32> = HashMap::new();
    for (i, triangle) in reader.enumerate() {
        let triangle = triangle.map_err(|e| ExportError::Stl(format!("triangle {i}: {e}")))?;
        let mut corners = [0; 3];
        for (corner, vertex) in corners.iter_mut().zip(triangle.vertices) {
            // Adding zero makes -0 and +0 the same vertex.
            let xyz = vertex.0.map(|x| x + 0.0);
            if xyz.iter().any(|x| !x.is_finite()) {
                return bad(format!("triangle {i} has a coordinate that is not a finite number: {xyz:?}"));
            }
            let next = mesh.vertices.len() as u32;
            *corner = *numbers.entry(xyz.map(f32::to_bits)).or_insert(next);
            if *corner == next {
                mesh.vertices.push(Point::from(xyz.map(f64::from)));
            }
        }
        let [a, b, c] = corners;
        if a == b || b == c || c == a {
            flat.get_or_insert(i);
        }
        mesh.triangles.push(corners);
    }
    if mesh.triangles.is_empty() {
        return bad("it has no triangle".to_owned());
    }
    // First, since it is what makes corners fall together.
    resolution::check("STL", mesh.vertices.iter().copied(), true)?;
    if let Some(i) = flat {
        return bad(format!("triangle {i} has two equal corners"));
    }
    Ok(mesh)
}

/// The number of triangles that a binary file's header announces, by its first bytes and its length; `None` for text.
pub fn announced(start: &[u8], length: u64) -> Option<usize> {
    // Some programs write binary files that begin with `solid` too: those have exactly the announced length.
    let count = start.get(80..HEADER)?;
    let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]) as usize;
    let is_text = start.starts_with(b"solid") && length != (HEADER + TRIANGLE * count) as u64;
    (!is_text).then_some(count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: [[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [0., 0., 1.]].map(Point::from).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]],
        }
    }

    fn written() -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&tetrahedron(), &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read_again() {
        let bytes = written();
        assert_eq!(bytes.len(), 84 + 4 * 50);
        assert_eq!(read(&bytes).unwrap(), tetrahedron());
        assert_eq!(tetrahedron().check(), Ok(()));
    }

    #[test]
    fn text_is_read_too() {
        use std::fmt::Write as _;
        let mut text = String::from("solid grain\n");
        let mesh = tetrahedron();
        for t in 0..4 {
            text += "facet normal 0 0 0\nouter loop\n";
            for p in mesh.corners(t) {
                writeln!(text, "vertex {} {} {}", p.x, p.y, p.z).unwrap();
            }
            text += "endloop\nendfacet\n";
        }
        text += "endsolid grain\n";
        assert_eq!(read(text.as_bytes()).unwrap(), mesh);
        let broken = text.replace("vertex 0 1 0", "vertex 0 1");
        assert!(matches!(read(broken.as_bytes()), Err(ExportError::Stl(_))));
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        let fails = |bytes: &[u8], what: &str| {
            let e = read(bytes).unwrap_err().to_string();
            assert!(e.contains(what), "{e}");
        };
        fails(&written()[..200], "cut short");
        let mut absurd = written();
        absurd[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        fails(&absurd, "4294967295");
        let mut nan = written();
        nan[84 + 12..84 + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        fails(&nan, "not a finite");
        let mut none = written();
        none[80..84].copy_from_slice(&0u32.to_le_bytes());
        none.truncate(84);
        fails(&none, "no triangle");
        assert!(read(b"").is_err());
        assert!(read(b"solid").is_err());
        fails(b"solid nothing\nendsolid nothing\n", "");
    }

    #[test]
    fn a_coordinate_too_large_for_the_format_is_refused() {
        let mut mesh = tetrahedron();
        mesh.vertices[0].x = 1e39;
        assert!(matches!(write(&mesh, Vec::new()), Err(ExportError::Unfit { .. })));
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400), solid: bool) {
            let mut all = if solid { b"solid a\n".to_vec() } else { Vec::new() };
            all.extend(bytes);
            let _ = read(&all);
        }
        #[test]
        fn no_damage_makes_it_panic(at in 0usize..284, to: u8, keep in 0usize..284) {
            let mut bytes = written();
            bytes[at] = to;
            bytes.truncate(keep);
            let _ = read(&bytes);
        }
    }
}
