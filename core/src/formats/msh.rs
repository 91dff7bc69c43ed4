//! Gmsh's mesh format 4.1 (`.msh`), as text: written with tetrahedra and surface triangles, read for its tetrahedra.

use super::inp::Order;
use super::{ExportError, Format, Reads, Writes, resolution};
use crate::geometry::Point;
use crate::mesh::{SecondOrder, TetMesh};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "Gmsh",
    endings: &["msh"],
    media_type: "text/plain; charset=utf-8",
    reads: Some(Reads::Volume(read)),
    writes: Some(Writes::Volume(|mesh, p, out| write(mesh, p.order == Order::Second, p.provenance, out))),
};

/// Gmsh's numbers for a triangle of three and six nodes, and a tetrahedron of four and ten.
const TRIANGLES: [u32; 2] = [2, 9];
const TETRAHEDRA: [u32; 2] = [4, 11];
/// Gmsh lists a tetrahedron's last two middles (1–3 and 2–3) the other way round.
const GMSH: [usize; 10] = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8];

/// Writes the mesh, in ten-node tetrahedra where `second` order is wanted: a volume `GRAIN` and its surface
/// `GRAIN_SURFACE` as physical groups; `provenance` in a section of comments. Lengths are mm.
///
/// # Errors
/// [`ExportError::Io`]; [`ExportError::Unfit`] for a mesh without elements.
pub fn write(
    mesh: &TetMesh,
    second: bool,
    provenance: &[String],
    mut out: impl Write,
) -> Result<(), ExportError> {
    if mesh.tets.is_empty() {
        let what = "the mesh has no element".to_owned();
        return Err(ExportError::Unfit { format: "a Gmsh file", what });
    }
    let order = second.then(|| mesh.second_order());
    let nodes = order.as_ref().map_or(&mesh.nodes, |s| &s.nodes);
    let surface = mesh.surface();
    // The format's first section must come first: readers take the version from it.
    writeln!(out, "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Comments\nunit mm")?;
    for line in provenance {
        // A section ends with a line that begins with a dollar.
        writeln!(out, "{}", line.replace(['\n', '\r', '$'], " "))?;
    }
    writeln!(
        out,
        "$EndComments\n$PhysicalNames\n2\n2 1 \"GRAIN_SURFACE\"\n3 2 \"GRAIN\"\n$EndPhysicalNames"
    )?;
    let fold = |start: f64, least: fn(f64, f64) -> f64| {
        nodes.iter().fold([start; 3], |b, p| [least(b[0], p.x), least(b[1], p.y), least(b[2], p.z)])
    };
    let (low, high) = (fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max));
    let bounds = low.iter().chain(&high).map(|x| format!("{x:e}")).collect::<Vec<_>>().join(" ");
    writeln!(out, "$Entities\n0 0 1 1\n1 {bounds} 1 1 0\n1 {bounds} 1 2 1 1\n$EndEntities")?;
    let n = nodes.len();
    writeln!(out, "$Nodes\n1 {n} 1 {n}\n3 1 0 {n}")?;
    let mut text = String::new();
    (1..=n).for_each(|i| row(&mut text, [i as u32]));
    for p in nodes {
        let _ = writeln!(text, "{:e} {:e} {:e}", p.x, p.y, p.z);
    }
    out.write_all(text.as_bytes())?;
    writeln!(out, "$EndNodes")?;
    let (facets, tets) = (surface.faces.len(), mesh.tets.len());
    let all = facets + tets;
    let k = usize::from(second);
    writeln!(out, "$Elements\n2 {all} 1 {all}\n2 1 {} {facets}", TRIANGLES[k])?;
    text.clear();
    for (i, t) in surface.triangles.triangles.iter().enumerate() {
        let corners = t.map(|v| surface.nodes[v as usize]);
        let more = order.as_ref().map_or(Vec::new(), |second| middles(second, corners));
        let nodes = corners.into_iter().chain(more).map(|n| n + 1);
        row(&mut text, std::iter::once(i as u32 + 1).chain(nodes));
    }
    let _ = writeln!(text, "3 1 {} {tets}", TETRAHEDRA[k]);
    for (i, t) in mesh.tets.iter().enumerate() {
        let number = std::iter::once((facets + i + 1) as u32);
        if let Some(second) = &order {
            row(&mut text, number.chain(GMSH.map(|j| second.tets[i][j] + 1)));
        } else {
            row(&mut text, number.chain(t.map(|n| n + 1)));
        }
    }
    out.write_all(text.as_bytes())?;
    writeln!(out, "$EndElements")?;
    Ok(out.flush()?)
}

/// A line of numbers; writing to a string cannot fail.
fn row(text: &mut String, numbers: impl IntoIterator<Item = u32>) {
    for (i, n) in numbers.into_iter().enumerate() {
        let _ = write!(text, "{}{n}", if i == 0 { "" } else { " " });
    }
    text.push('\n');
}

/// The nodes in the middles of a triangle's edges.
fn middles(second: &SecondOrder, [a, b, c]: [u32; 3]) -> Vec<u32> {
    let of = |p: u32, q: u32| second.edges.binary_search(&[p.min(q), p.max(q)]);
    [of(a, b), of(b, c), of(c, a)].into_iter().flatten().map(|i| (second.corners + i) as u32).collect()
}

/// Reads the tetrahedra of a text file of version 4.1 (of ten-node ones their corners); nodes that none of them uses are
/// left out. The unit is the file's own. Whether they are a mesh is for [`TetMesh::check`] to find.
///
/// # Errors
/// [`ExportError::Read`] with the line where it stops being such a file.
pub fn read(bytes: &[u8]) -> Result<TetMesh, ExportError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|_| bad("it is not text; Gmsh writes text with -format msh41".into()))?;
    let mut lines = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim()));
    let mut points: HashMap<u64, Point> = HashMap::new();
    let mut tets: Vec<[u64; 4]> = Vec::new();
    let mut version = false;
    while let Some((i, line)) = lines.next() {
        match line {
            "$MeshFormat" => {
                let (i, line) = lines.next().ok_or_else(|| cut_short(i))?;
                if !line.starts_with("4.1 0") {
                    return Err(bad(format!(
                        "line {i} is `{line}`, not `4.1 0 8`: save it as text of version 4.1"
                    )));
                }
                version = true;
            }
            "$Nodes" | "$Elements" if !version => {
                return Err(bad(format!("line {i} comes before $MeshFormat")));
            }
            "$Nodes" => {
                let [blocks, ..] = numbers::<4>(lines.next(), i)?;
                for _ in 0..blocks {
                    let [_, _, parametric, count] = numbers::<4>(lines.next(), i)?;
                    if parametric != 0 {
                        return Err(bad(format!(
                            "the nodes after line {i} are parametric, which is not read"
                        )));
                    }
                    let mut tags = Vec::new();
                    for _ in 0..count {
                        let [tag] = numbers::<1>(lines.next(), i)?;
                        tags.push(tag);
                    }
                    for tag in tags {
                        let (i, line) = lines.next().ok_or_else(|| cut_short(i))?;
                        let xyz: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
                        let xyz: [f64; 3] =
                            xyz.try_into().map_err(|_| bad(format!("line {i} has no three coordinates")))?;
                        points.insert(tag, Point::from(xyz));
                    }
                }
            }
            "$Elements" => {
                let [blocks, ..] = numbers::<4>(lines.next(), i)?;
                for _ in 0..blocks {
                    let [_, _, kind, count] = numbers::<4>(lines.next(), i)?;
                    let is_tet = TETRAHEDRA.iter().any(|k| u64::from(*k) == kind);
                    for _ in 0..count {
                        let (i, line) = lines.next().ok_or_else(|| cut_short(i))?;
                        if is_tet {
                            let all: Vec<u64> =
                                line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
                            let [_, a, b, c, d, ..] = all[..] else {
                                return Err(bad(format!("line {i} has no four nodes")));
                            };
                            tets.push([a, b, c, d]);
                        }
                    }
                }
            }
            _ => {}
        }
    }
    gathered("Gmsh", &points, &tets)
}

/// A mesh from tetrahedra by their nodes' own numbers, in rising order of these.
pub(super) fn gathered(
    format: &'static str,
    points: &HashMap<u64, Point>,
    tets: &[[u64; 4]],
) -> Result<TetMesh, ExportError> {
    if tets.is_empty() {
        return Err(ExportError::Read { format, what: "it has no tetrahedron".to_owned() });
    }
    let mut used: Vec<u64> = tets.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let mut nodes = Vec::with_capacity(used.len());
    for tag in &used {
        let Some(point) = points.get(tag) else {
            let what = format!("an element names node {tag}, which it does not have");
            return Err(ExportError::Read { format, what });
        };
        nodes.push(*point);
    }
    resolution::check(format, nodes.iter().copied(), false)?;
    let number = |tag: u64| used.binary_search(&tag).unwrap_or_default() as u32;
    Ok(TetMesh::new(nodes, tets.iter().map(|t| t.map(number)).collect()))
}

fn bad(what: String) -> ExportError {
    ExportError::Read { format: "Gmsh", what }
}

fn cut_short(line: usize) -> ExportError {
    bad(format!("it ends within the section that begins at line {line}"))
}

/// The first whole numbers of a line.
fn numbers<const N: usize>(line: Option<(usize, &str)>, section: usize) -> Result<[u64; N], ExportError> {
    let (i, line) = line.ok_or_else(|| cut_short(section))?;
    let all: Vec<u64> = line.split_whitespace().take(N).filter_map(|w| w.parse().ok()).collect();
    all.try_into()
        .map_err(|_| bad(format!("line {i} should begin with {N} whole numbers, but is `{line:.60}`")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn two() -> TetMesh {
        let nodes =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]].map(Point::from).to_vec();
        TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]])
    }

    fn written(second: bool) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&two(), second, &["sha256 00\n$Nodes".to_owned()], &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read_again_in_either_order() {
        for second in [false, true] {
            assert_eq!(read(&written(second)).unwrap(), two(), "{second}");
        }
        assert!(String::from_utf8(written(true)).unwrap().contains("$Entities\n0 0 1 1\n"));
    }

    #[test]
    fn files_that_are_none_are_refused_with_the_line() {
        let fails = |text: &str, what: &str| {
            let e = read(text.as_bytes()).unwrap_err().to_string();
            assert!(e.contains(what), "{e}");
        };
        fails("", "no tetrahedron");
        fails("$MeshFormat\n2.2 0 8\n", "version 4.1");
        fails("$Nodes\n", "before $MeshFormat");
        let whole = String::from_utf8(written(false)).unwrap();
        fails(&whole.replace("3 1 0 5", "3 1 0 500"), "whole numbers");
    }

    proptest! {
        #[test]
        fn no_damage_makes_it_panic(at in 0usize..600, to: u8, keep in 0usize..900) {
            let mut bytes = written(true);
            let at = at % bytes.len();
            bytes[at] = to;
            bytes.truncate(keep);
            let _ = read(&bytes);
        }
    }
}
