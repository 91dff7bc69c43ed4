//! PLY (Stanford's polygon format): surfaces written in binary, read in binary or text.

use super::numbers::Kind;
use super::{ExportError, Format, Reads, Writes, resolution};
use crate::geometry::{Point, TriangleMesh};
use std::io::Write;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "PLY",
    endings: &["ply"],
    media_type: "application/octet-stream",
    reads: Some(Reads::Surface(read)),
    writes: Some(Writes::Surface(|surface, provenance, out| write(surface, provenance, out))),
};

/// Writes binary little-endian PLY with coordinates in double precision, mm; `provenance` as comments.
///
/// # Errors
/// [`ExportError::Io`].
pub fn write(surface: &TriangleMesh, provenance: &[String], mut out: impl Write) -> Result<(), ExportError> {
    writeln!(out, "ply\nformat binary_little_endian 1.0\ncomment unit mm")?;
    for line in provenance {
        writeln!(out, "comment {}", line.replace(['\n', '\r'], " "))?;
    }
    let (v, f) = (surface.vertices.len(), surface.triangles.len());
    writeln!(out, "element vertex {v}\nproperty double x\nproperty double y\nproperty double z")?;
    writeln!(out, "element face {f}\nproperty list uchar uint vertex_indices\nend_header")?;
    let mut bytes = Vec::with_capacity(24 * v + 13 * f);
    surface.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).for_each(|x| bytes.extend(x.to_le_bytes()));
    for t in &surface.triangles {
        bytes.push(3);
        t.iter().for_each(|n| bytes.extend(n.to_le_bytes()));
    }
    out.write_all(&bytes)?;
    Ok(out.flush()?)
}

/// How numbers follow the header.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Coding {
    Text,
    Little,
    Big,
}

struct Property {
    name: String,
    /// The type of its count where it is a list.
    list: Option<Kind>,
    kind: Kind,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// Numbers one after the other.
struct Numbers<'a> {
    rest: &'a [u8],
    coding: Coding,
}

impl Numbers<'_> {
    fn next(&mut self, kind: Kind) -> Result<f64, ExportError> {
        if self.coding == Coding::Text {
            let start = self.rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or_else(cut_short)?;
            let rest = &self.rest[start..];
            let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
            let word = String::from_utf8_lossy(&rest[..end]).into_owned();
            self.rest = &rest[end..];
            return word.parse().map_err(|_| bad(format!("`{word:.40}` is no number")));
        }
        let number = kind.read(self.rest, self.coding == Coding::Big).ok_or_else(cut_short)?;
        self.rest = &self.rest[kind.size()..];
        Ok(number)
    }
}

/// Reads a surface; faces with more than three corners become fans of triangles, other elements and properties are
/// passed over. The unit is the file's own. Whether it bounds a body is for [`TriangleMesh::check`] to find.
///
/// # Errors
/// [`ExportError::Read`]: no PLY header, a coordinate that is not finite, a face that names a vertex that is not there,
/// fewer bytes than announced, no triangle; [`ExportError::Resolution`] for a body too far from the origin.
pub fn read(bytes: &[u8]) -> Result<TriangleMesh, ExportError> {
    let (coding, elements, rest) = header(bytes)?;
    let mut numbers = Numbers { rest, coding };
    let mut mesh = TriangleMesh::default();
    let mut corners: Vec<u32> = Vec::new();
    let mut single = false;
    for element in &elements {
        for i in 0..element.count {
            let mut xyz = [0.0; 3];
            for p in &element.properties {
                let Some(count) = p.list else {
                    let value = numbers.next(p.kind)?;
                    if let Some(k) = ["x", "y", "z"].iter().position(|n| *n == p.name) {
                        xyz[k] = value;
                        single |= coding != Coding::Text && p.kind == Kind::F32;
                    }
                    continue;
                };
                let count = numbers.next(count)?;
                if !(0.0..=1e6).contains(&count) {
                    return Err(bad(format!("a list of {} {i} has the length {count}", element.name)));
                }
                corners.clear();
                for _ in 0..count as usize {
                    let n = numbers.next(p.kind)?;
                    if n.fract() != 0.0 || !(0.0..f64::from(u32::MAX)).contains(&n) {
                        return Err(bad(format!("{} {i} names the vertex {n}", element.name)));
                    }
                    corners.push(n as u32);
                }
                if element.name == "face" && p.name.starts_with("vertex_ind") {
                    for k in 2..corners.len() {
                        mesh.triangles.push([corners[0], corners[k - 1], corners[k]]);
                    }
                }
            }
            if element.name == "vertex" {
                if xyz.iter().any(|x| !x.is_finite()) {
                    return Err(bad(format!(
                        "vertex {i} has a coordinate that is not a finite number: {xyz:?}"
                    )));
                }
                mesh.vertices.push(Point::from(xyz));
            }
        }
    }
    if mesh.triangles.is_empty() {
        return Err(bad("it has no triangle".into()));
    }
    resolution::check("PLY", mesh.vertices.iter().copied(), single)?;
    let n = mesh.vertices.len();
    if let Some(t) = mesh.triangles.iter().position(|t| t.iter().any(|v| *v as usize >= n)) {
        return Err(bad(format!("triangle {t} names a vertex beyond the {n} that there are")));
    }
    Ok(mesh)
}

/// The header, and what follows it.
fn header(bytes: &[u8]) -> Result<(Coding, Vec<Element>, &[u8]), ExportError> {
    let mut rest = bytes;
    let mut coding = None;
    let mut elements: Vec<Element> = Vec::new();
    for number in 0.. {
        let end = rest.iter().position(|b| *b == b'\n').ok_or_else(cut_short)?;
        let line = String::from_utf8_lossy(&rest[..end]).into_owned();
        rest = &rest[end + 1..];
        let words: Vec<&str> = line.split_whitespace().collect();
        let unknown = || bad(format!("its header has the line `{line:.60}`"));
        match words[..] {
            ["ply"] if number == 0 => {}
            _ if number == 0 => return Err(bad("it does not begin with `ply`".into())),
            ["format", how, _] => {
                coding = Some(match how {
                    "ascii" => Coding::Text,
                    "binary_little_endian" => Coding::Little,
                    "binary_big_endian" => Coding::Big,
                    _ => return Err(unknown()),
                });
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| unknown())?;
                // An element without bytes could be announced any number of times.
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", "list", count, kind, name] => {
                let list = Some(Kind::named(count).ok_or_else(unknown)?);
                let property =
                    Property { name: name.to_owned(), list, kind: Kind::named(kind).ok_or_else(unknown)? };
                elements.last_mut().ok_or_else(unknown)?.properties.push(property);
            }
            ["property", kind, name] => {
                let property = Property {
                    name: name.to_owned(),
                    list: None,
                    kind: Kind::named(kind).ok_or_else(unknown)?,
                };
                elements.last_mut().ok_or_else(unknown)?.properties.push(property);
            }
            ["end_header"] => {
                if elements.iter().any(|e| e.count > rest.len()) {
                    return Err(cut_short());
                }
                return Ok((coding.ok_or_else(|| bad("its header has no format".into()))?, elements, rest));
            }
            ["comment" | "obj_info", ..] | [] => {}
            _ => return Err(unknown()),
        }
    }
    Err(cut_short())
}

fn bad(what: String) -> ExportError {
    ExportError::Read { format: "PLY", what }
}

fn cut_short() -> ExportError {
    bad("it is cut short: it has fewer bytes than its header announces".into())
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
        write(&tetrahedron(), &["from\na test".to_owned()], &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read_again() {
        assert_eq!(read(&written()).unwrap(), tetrahedron());
    }

    #[test]
    fn text_big_endian_colours_and_squares_are_read_too() {
        let text = "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
                    property uchar red\nelement face 5\nproperty list uchar int vertex_indices\nend_header\n\
                    0 0 0 9\n1 0 0 9\n1 1 0 9\n0 1 0 9\n0.5 0.5 1 9\n4 3 2 1 0\n3 0 1 4\n3 1 2 4\n3 2 3 4\n3 3 0 4\n";
        let pyramid = read(text.as_bytes()).unwrap();
        assert_eq!(pyramid.check(), Ok(()));
        assert!((pyramid.volume_mm3() - 1.0 / 3.0).abs() < 1e-12);
        let mut big = b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty short x\nproperty short y\n\
                        property short z\nelement face 1\nproperty list uchar ushort vertex_index\nend_header\n".to_vec();
        [0i16, 0, 0, 256, 0, 0, 0, 256, 0].iter().for_each(|x| big.extend(x.to_be_bytes()));
        big.push(3);
        [0u16, 1, 2].iter().for_each(|x| big.extend(x.to_be_bytes()));
        let one = read(&big).unwrap();
        assert_eq!((one.vertices[1].x, one.triangles[0]), (256.0, [0, 1, 2]));
    }

    #[test]
    fn bad_files_are_refused_with_a_reason() {
        let fails = |bytes: &[u8], what: &str| {
            let e = read(bytes).unwrap_err().to_string();
            assert!(e.contains(what), "{e}");
        };
        fails(b"", "cut short");
        fails(b"solid\n", "begin with `ply`");
        fails(&written()[..written().len() - 3], "cut short");
        let text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\nnan\n";
        fails(text.as_bytes(), "not a finite");
        fails(text.replace("vertex 1", "vertex 99999999999").as_bytes(), "cut short");
        fails(text.replace("nan", "1").as_bytes(), "no triangle");
    }

    proptest! {
        #[test]
        fn no_damage_makes_it_panic(at in 0usize..400, to: u8, keep in 0usize..400) {
            let mut bytes = written();
            let at = at % bytes.len();
            bytes[at] = to;
            bytes.truncate(keep);
            let _ = read(&bytes);
        }
    }
}
