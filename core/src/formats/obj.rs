//! Wavefront OBJ: surfaces as text, vertices by number.

use super::{ExportError, Format, Reads, Writes, resolution};
use crate::geometry::{Point, TriangleMesh};
use std::fmt::Write as _;
use std::io::Write;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "Wavefront",
    endings: &["obj"],
    media_type: "model/obj",
    reads: Some(Reads::Surface(read)),
    writes: Some(Writes::Surface(|surface, provenance, out| write(surface, provenance, out))),
};

/// The most corners of a face that is read.
const MOST_CORNERS: usize = 1_000_000;

/// Writes a surface, in mm, each coordinate with the digits that tell it from every other double; `provenance` as comments.
///
/// # Errors
/// [`ExportError::Io`]; [`ExportError::Unfit`] without triangles, or for a coordinate that is not finite.
pub fn write(surface: &TriangleMesh, provenance: &[String], mut out: impl Write) -> Result<(), ExportError> {
    let unfit = |what: String| Err(ExportError::Unfit { format: "a Wavefront file", what });
    if surface.triangles.is_empty() {
        return unfit("the surface has no triangle".to_owned());
    }
    if let Some(i) = surface.vertices.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return unfit(format!("vertex {} is at {:?}, not finite", i + 1, surface.vertices[i]));
    }
    let mut text = String::from("# unit mm\n");
    for line in provenance {
        // A backslash at its end would take the next line into the comment.
        let _ = writeln!(text, "# {}", line.replace(['\n', '\r', '\\'], " "));
    }
    text += "o grain\n";
    for p in &surface.vertices {
        let _ = writeln!(text, "v {} {} {}", p.x, p.y, p.z);
    }
    for t in &surface.triangles {
        let [a, b, c] = t.map(|v| u64::from(v) + 1);
        let _ = writeln!(text, "f {a} {b} {c}");
    }
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Reads the vertices and faces of a file, of all its objects together; faces with more than three corners become fans of
/// triangles, everything else is passed over. The unit is the file's own. Whether it bounds a body is for
/// [`TriangleMesh::check`] to find.
///
/// # Errors
/// [`ExportError::Read`] with the line: a vertex without three finite coordinates, a face of fewer than three corners or one
/// that names a vertex that is not there, no triangle; [`ExportError::Resolution`] for a body too far from the origin.
pub fn read(bytes: &[u8]) -> Result<TriangleMesh, ExportError> {
    // Names and comments may be in any encoding; numbers are ASCII.
    let text = String::from_utf8_lossy(bytes);
    let mut mesh = TriangleMesh::default();
    let mut corners: Vec<u32> = Vec::new();
    let mut lines = text.lines().zip(1..);
    let mut joined = String::new();
    while let Some((line, number)) = lines.next() {
        let mut line = line;
        if line.ends_with('\\') {
            // It goes on in the next line.
            joined.clear();
            let mut part = Some(line);
            while let Some(now) = part {
                joined += now.trim_end_matches('\\');
                joined.push(' ');
                part = if now.ends_with('\\') { lines.next().map(|(next, _)| next) } else { None };
            }
            line = &joined;
        }
        let mut words = line.split('#').next().unwrap_or("").split_ascii_whitespace();
        match words.next() {
            Some("v") => mesh.vertices.push(vertex(words).map_err(|what| bad(number, &what))?),
            Some("f") => {
                corners.clear();
                for word in words {
                    if corners.len() == MOST_CORNERS {
                        return Err(bad(number, &format!("a face with more than {MOST_CORNERS} corners")));
                    }
                    let corner = corner(word, mesh.vertices.len()).ok_or_else(|| {
                        let there = mesh.vertices.len();
                        bad(number, &format!("a face names the vertex `{word:.40}`, of {there} before it"))
                    })?;
                    corners.push(corner);
                }
                if corners.len() < 3 {
                    return Err(bad(number, &format!("a face with {} corners", corners.len())));
                }
                let fan = (2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]);
                mesh.triangles.extend(fan);
            }
            _ => {}
        }
    }
    if mesh.triangles.is_empty() {
        return Err(ExportError::Read { format: FORMAT.name, what: "it has no face".into() });
    }
    resolution::check("Wavefront", mesh.vertices.iter().copied(), false)?;
    Ok(mesh)
}

fn bad(line: usize, what: &str) -> ExportError {
    ExportError::Read { format: FORMAT.name, what: format!("line {line} has {what}") }
}

/// A vertex's coordinates; a weight or a colour after them is passed over.
fn vertex<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Point, String> {
    let mut at = [0.0; 3];
    for x in &mut at {
        let word = words.next().ok_or("a vertex with fewer than three coordinates")?;
        let number = word.parse().ok().filter(|x: &f64| x.is_finite());
        *x = number.ok_or_else(|| format!("the coordinate `{word:.40}`, which is not a finite number"))?;
    }
    Ok(Point::from(at))
}

/// The vertex that a face's corner names, from 0; `7/2/3` names the seventh, −1 the last of those before the face.
fn corner(word: &str, there: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let index = if number < 0 { i64::try_from(there).ok()?.checked_add(number)? } else { number - 1 };
    let index = usize::try_from(index).ok().filter(|i| *i < there)?;
    u32::try_from(index).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: [[0., 0., 0.], [0., 1., 0.], [1., 0., 0.], [0., 0., 1.0 / 3.0]]
                .map(Point::from)
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3], [2, 1, 3], [1, 0, 3]],
        }
    }

    fn written() -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&tetrahedron(), &["from\na C:\\test\\".to_owned()], &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read_again_to_the_last_digit() {
        assert_eq!(read(&written()).unwrap(), tetrahedron());
        assert!(written().starts_with(b"# unit mm\n# from a C: test \no grain\nv 0 0 0\n"));
    }

    #[test]
    fn squares_textures_numbers_from_the_end_and_lines_that_go_on_are_read_too() {
        let text = "mtllib a.mtl\no roof\nv 0 0 0 0.5 0.5 0.5\nv 1 0 0\r\nv 1 1 \\\n 0\nv 0 1 0\nvn 0 0 1\nvt 0 0\nv 5e-1 .5 1\n\
                    usemtl stone\nf 4/1/1 3/1/1 2/1/1 1/1/1 # the floor\nf 1//1 2//1 5//1\nf -4 -3 -1\nf 3/1 4/1 5/1\nf 4 1 5\n";
        let pyramid = read(text.as_bytes()).unwrap();
        assert_eq!(pyramid.check(), Ok(()));
        assert!((pyramid.volume_mm3() - 1.0 / 3.0).abs() < 1e-12);
        assert_eq!(pyramid.triangles.len(), 6);
    }

    #[test]
    fn bad_files_are_refused_with_the_line() {
        let fails = |text: &str, what: &str| {
            let e = read(text.as_bytes()).unwrap_err().to_string();
            assert!(e.contains(what), "{e}");
        };
        let three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        fails("", "no face");
        fails(three, "no face");
        fails("v 0 0\n", "line 1 has a vertex with fewer");
        fails("v 0 0 nan\n", "line 1 has the coordinate `nan`");
        fails("v 0 0 1e999\n", "not a finite");
        for corner in ["0", "4", "-4", "1.5", "x", "99999999999999999999", "-9223372036854775808", ""] {
            fails(&format!("{three}f 1 2 {corner}\n"), "line 4 has a face");
        }
        let far = "v 1e9 0 0\nv 1000000000.00001 0 0\nv 1e9 0.00001 0\nf 1 2 3\n";
        assert!(matches!(read(far.as_bytes()), Err(ExportError::Resolution { .. })));
    }

    #[test]
    fn what_the_format_cannot_hold_is_refused() {
        let mut mesh = tetrahedron();
        mesh.vertices[2].y = f64::NAN;
        assert!(write(&mesh, &[], Vec::new()).unwrap_err().to_string().contains("vertex 3"));
        assert!(matches!(write(&TriangleMesh::default(), &[], Vec::new()), Err(ExportError::Unfit { .. })));
    }

    proptest! {
        #[test]
        fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
            let _ = read(&bytes);
        }
        #[test]
        fn no_damage_makes_it_panic(at in 0usize..400, to: u8, keep in 0usize..400) {
            let mut bytes = written();
            let at = at % bytes.len();
            bytes[at] = to;
            bytes.truncate(keep);
            let _ = read(&bytes);
        }
        #[test]
        fn lines_of_its_own_words_make_none_panic(text in "([vf#o]( -?[0-9/]{1,20}){0,5}\\\\?\n){0,12}") {
            let _ = read(text.as_bytes());
        }
    }
}
