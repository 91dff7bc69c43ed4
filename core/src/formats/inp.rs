//! Abaqus input decks: the grain's nodes, elements, sets and surfaces, for a deck that includes them.
//!
//! Read by Abaqus and `CalculiX`. Lengths are mm; with forces in N, stresses in `MPa`, masses in tonne and times in s a
//! deck is consistent. Node and element ids start at 1. Lines have at most 80 characters, all ASCII.
//!
//! | name | what |
//! | --- | --- |
//! | `GRAIN` | element set: all elements (C3D4 or C3D10) |
//! | `GRAIN_NODES` | node set: all nodes |
//! | `GRAIN_SURFACE_NODES` | node set: nodes on the surface |
//! | `GRAIN_SURFACE` | surface: all outer faces |
//! | `TOP`, `BOTTOM` | node sets: surface nodes within one band of the highest, of the lowest node |
//! | `TOP_SURFACE`, `BOTTOM_SURFACE` | surfaces: outer faces with at least one corner in the set |
//! | `TOP_ELEMENTS`, `BOTTOM_ELEMENTS` | element sets: the elements of these faces |
//! | `FOOT`, `FOOT_SURFACE`, `FOOT_ELEMENTS` | the same where a pedestal hid the grain, if one did: [`write_standing`] |

use super::{ExportError, Format, Reads, Writes, inp_read, resolution};
use crate::mesh::{SecondOrder, Surface, TetMesh};
use std::fmt::Display;
use std::io::Write;

/// The longest line, in characters: Abaqus takes 256, `CalculiX` 132, older pre-processors 80.
const LINE: usize = 80;

/// The format in the table.
pub(super) static FORMAT: Format = Format {
    name: "Abaqus",
    endings: &["inp"],
    media_type: "text/plain; charset=utf-8",
    reads: Some(Reads::Volume(inp_read::read)),
    writes: Some(Writes::Volume(|mesh, p, out| write_order(mesh, p.order, p.provenance, p.band_mm, out))),
};

/// Nodes of an element.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Order {
    /// Four: C3D4.
    #[default]
    First,
    /// Ten, edges straight: C3D10.
    Second,
}

/// Writes a grain's part of a deck in four-node elements. `provenance` lines (where the mesh comes from) become
/// comments, cut into lines; characters outside ASCII become `?`. `band_mm` is how far from the highest and lowest node
/// the sets `TOP` and `BOTTOM` reach, usually one surface size.
///
/// # Errors
/// [`ExportError::Io`]; [`ExportError::Unfit`] for a mesh without elements, a coordinate or band that is not finite,
/// or a band that is negative.
pub fn write(
    mesh: &TetMesh,
    provenance: &[String],
    band_mm: f64,
    out: impl Write,
) -> Result<(), ExportError> {
    write_order(mesh, Order::First, provenance, band_mm, out)
}

/// The same of a grain that stood on a pedestal, which hid it up to a height in the mesh's frame, mm: with the sets of that part.
///
/// # Errors
/// As [`write()`].
pub fn write_standing(
    mesh: &TetMesh,
    provenance: &[String],
    band_mm: f64,
    hidden_mm: Option<f64>,
    out: impl Write,
) -> Result<(), ExportError> {
    write_sets(mesh, Order::First, provenance, band_mm, hidden_mm, out)
}

/// The same in elements of either order.
///
/// # Errors
/// As [`write()`].
pub fn write_order(
    mesh: &TetMesh,
    order: Order,
    provenance: &[String],
    band_mm: f64,
    out: impl Write,
) -> Result<(), ExportError> {
    write_sets(mesh, order, provenance, band_mm, None, out)
}

fn write_sets(
    mesh: &TetMesh,
    order: Order,
    provenance: &[String],
    band_mm: f64,
    hidden_mm: Option<f64>,
    mut out: impl Write,
) -> Result<(), ExportError> {
    let unfit = |what: String| Err(ExportError::Unfit { format: "an Abaqus deck", what });
    if mesh.tets.is_empty() {
        return unfit("the mesh has no element".to_owned());
    }
    if !(band_mm.is_finite() && band_mm >= 0.0) {
        return unfit(format!("the band of TOP and BOTTOM is {band_mm} mm, not zero or more"));
    }
    if let Some(i) = mesh.nodes.iter().position(|p| !p.iter().all(|x| x.is_finite())) {
        return unfit(format!("node {} is at {:?}, not finite", i + 1, mesh.nodes[i]));
    }
    let decimals = resolution::decimals("Abaqus", &mesh.nodes)?;
    let second = (order == Order::Second).then(|| mesh.second_order());
    let nodes = second.as_ref().map_or(&mesh.nodes, |s| &s.nodes);
    let surface = mesh.surface();
    writeln!(out, "*HEADING")?;
    let (n, e) = (nodes.len(), mesh.tets.len());
    writeln!(out, "A grain, {n} nodes, {e} elements; units mm, N, MPa, tonne, s")?;
    for line in provenance {
        comment(&mut out, line)?;
    }
    writeln!(out, "*NODE, NSET=GRAIN_NODES")?;
    for (i, p) in nodes.iter().enumerate() {
        writeln!(out, "{}, {:.decimals$e}, {:.decimals$e}, {:.decimals$e}", i + 1, p.x, p.y, p.z)?;
    }
    if let Some(second) = &second {
        writeln!(out, "*ELEMENT, TYPE=C3D10, ELSET=GRAIN")?;
        for (i, t) in second.tets.iter().enumerate() {
            // A data line that ends with a comma goes on in the next.
            let all = t.map(|n| (n + 1).to_string());
            writeln!(out, "{}, {},\n{}", i + 1, all[..5].join(", "), all[5..].join(", "))?;
        }
    } else {
        writeln!(out, "*ELEMENT, TYPE=C3D4, ELSET=GRAIN")?;
        for (i, t) in mesh.tets.iter().enumerate() {
            let [a, b, c, d] = t.map(|n| n + 1);
            writeln!(out, "{}, {a}, {b}, {c}, {d}", i + 1)?;
        }
    }
    let middles = Middles { second: second.as_ref(), surface: &surface };
    node_set(&mut out, "GRAIN_SURFACE_NODES", middles.with(surface.nodes.clone()).into_iter())?;
    faces(&mut out, "GRAIN_SURFACE", surface.faces.iter().copied())?;
    let heights = surface.nodes.iter().map(|&n| mesh.nodes[n as usize].z);
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
    band(&mut out, &middles, "TOP", |n| mesh.nodes[n as usize].z >= high - band_mm)?;
    band(&mut out, &middles, "BOTTOM", |n| mesh.nodes[n as usize].z <= low + band_mm)?;
    let hidden = |n: u32| hidden_mm.is_some_and(|mm| mesh.nodes[n as usize].z < mm);
    if surface.nodes.iter().any(|&n| hidden(n)) {
        band(&mut out, &middles, "FOOT", hidden)?;
    }
    Ok(out.flush()?)
}

/// Which nodes lie in the middles of the surface's edges.
struct Middles<'a> {
    second: Option<&'a SecondOrder>,
    surface: &'a Surface,
}

impl Middles<'_> {
    /// Corners of the surface, rising, and the middles of its edges between two of them.
    fn with(&self, mut nodes: Vec<u32>) -> Vec<u32> {
        let Some(second) = self.second else { return nodes };
        let chosen = |n: u32| nodes.binary_search(&n).is_ok();
        let mut ends: Vec<[u32; 2]> = self
            .surface
            .triangles
            .triangles
            .iter()
            .map(|t| t.map(|v| self.surface.nodes[v as usize]))
            .flat_map(|[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .filter(|[a, b]| chosen(*a) && chosen(*b))
            .collect();
        ends.sort_unstable();
        ends.dedup();
        let number = |e: &[u32; 2]| second.edges.binary_search(e).map(|i| (second.corners + i) as u32);
        nodes.extend(ends.iter().filter_map(|e| number(e).ok()));
        nodes
    }
}

/// A node set of the surface nodes that are `within`, the surface of their faces, and the set of its elements.
fn band(
    out: &mut impl Write,
    middles: &Middles,
    name: &str,
    within: impl Fn(u32) -> bool,
) -> std::io::Result<()> {
    let surface = middles.surface;
    let nodes: Vec<u32> = surface.nodes.iter().copied().filter(|&n| within(n)).collect();
    node_set(out, name, middles.with(nodes).into_iter())?;
    let triangles = surface.triangles.triangles.iter();
    let near: Vec<(u32, u8)> = triangles
        .zip(&surface.faces)
        .filter(|(t, _)| t.iter().any(|&v| within(surface.nodes[v as usize])))
        .map(|(_, f)| *f)
        .collect();
    faces(out, &format!("{name}_SURFACE"), near.iter().copied())?;
    let mut elements: Vec<u32> = near.iter().map(|(t, _)| t + 1).collect();
    elements.dedup();
    writeln!(out, "*ELSET, ELSET={name}_ELEMENTS")?;
    list(out, elements.into_iter())
}

fn node_set(out: &mut impl Write, name: &str, nodes: impl Iterator<Item = u32>) -> std::io::Result<()> {
    writeln!(out, "*NSET, NSET={name}")?;
    list(out, nodes.map(|n| n + 1))
}

/// Numbers separated by commas, as many a line as fit, at most the format's sixteen.
fn list(out: &mut impl Write, items: impl Iterator<Item = impl Display>) -> std::io::Result<()> {
    let mut line = String::new();
    let mut on_line = 0;
    for item in items {
        let item = item.to_string();
        if on_line == 16 || line.len() + 2 + item.len() > LINE {
            writeln!(out, "{line}")?;
            line.clear();
            on_line = 0;
        }
        if on_line > 0 {
            line += ", ";
        }
        line += &item;
        on_line += 1;
    }
    writeln!(out, "{line}")
}

/// Faces by element and side; [`crate::mesh::FACES`] has the sides in the order S1 to S4.
fn faces(out: &mut impl Write, name: &str, faces: impl Iterator<Item = (u32, u8)>) -> std::io::Result<()> {
    writeln!(out, "*SURFACE, TYPE=ELEMENT, NAME={name}")?;
    for (tet, face) in faces {
        writeln!(out, "{}, S{}", tet + 1, face + 1)?;
    }
    Ok(())
}

/// A comment of as many lines as it needs, broken between words: a number in two parts reads as another.
fn comment(out: &mut impl Write, text: &str) -> std::io::Result<()> {
    let clean: Vec<char> =
        text.chars().map(|c| if c == ' ' || c.is_ascii_graphic() { c } else { '?' }).collect();
    let mut rest = &clean[..];
    loop {
        let most = rest.len().min(LINE - 3);
        // A word longer than a line is cut, behind a comma or the like where it has one: a number stays whole.
        let space = || rest[..most].iter().rposition(|c| *c == ' ').filter(|at| *at > 0);
        let mark = || rest[..most].iter().rposition(|c| ",;:".contains(*c)).map(|at| at + 1);
        let end =
            if most < rest.len() && rest[most] != ' ' { space().or_else(mark).unwrap_or(most) } else { most };
        writeln!(out, "** {}", rest[..end].iter().collect::<String>().trim())?;
        rest = &rest[end..];
        if rest.iter().all(|c| *c == ' ') {
            return Ok(());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    fn text(provenance: &[String], band_mm: f64) -> String {
        let nodes =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]].map(Point::from).to_vec();
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]]);
        let mut bytes = Vec::new();
        write(&mesh, provenance, band_mm, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    #[test]
    fn what_a_pedestal_hid_is_a_set() {
        let nodes = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(Point::from).to_vec();
        let mesh = TetMesh::new(nodes, vec![[0, 1, 2, 3]]);
        let deck = |hidden_mm| {
            let mut bytes = Vec::new();
            write_standing(&mesh, &[], 0.0, hidden_mm, &mut bytes).unwrap();
            String::from_utf8(bytes).unwrap()
        };
        let foot = "*NSET, NSET=FOOT\n1, 2, 3\n*SURFACE, TYPE=ELEMENT, NAME=FOOT_SURFACE\n\
                    1, S1\n1, S2\n1, S3\n1, S4\n*ELSET, ELSET=FOOT_ELEMENTS\n1\n";
        let [none, below, all] = [None, Some(-0.1), Some(0.1)].map(deck);
        assert_eq!(none, below);
        let sorted = |text: &str| {
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            lines.sort_unstable();
            lines
        };
        assert_eq!(sorted(all.strip_prefix(&none).unwrap()), sorted(foot));
    }

    #[test]
    fn two_elements_make_a_deck_known_by_hand() {
        let expected = "\
*HEADING
A grain, 5 nodes, 2 elements; units mm, N, MPa, tonne, s
** made by hand
*NODE, NSET=GRAIN_NODES
1, 0.000000000e0, 0.000000000e0, 0.000000000e0
2, 1.000000000e0, 0.000000000e0, 0.000000000e0
3, 0.000000000e0, 1.000000000e0, 0.000000000e0
4, 0.000000000e0, 0.000000000e0, 1.000000000e0
5, 1.000000000e0, 1.000000000e0, 1.000000000e0
*ELEMENT, TYPE=C3D4, ELSET=GRAIN
1, 1, 2, 3, 4
2, 2, 3, 4, 5
*NSET, NSET=GRAIN_SURFACE_NODES
1, 2, 3, 4, 5
*SURFACE, TYPE=ELEMENT, NAME=GRAIN_SURFACE
1, S1
1, S2
1, S4
2, S2
2, S3
2, S4
*NSET, NSET=TOP
4, 5
*SURFACE, TYPE=ELEMENT, NAME=TOP_SURFACE
1, S2
1, S4
2, S2
2, S3
2, S4
*ELSET, ELSET=TOP_ELEMENTS
1, 2
*NSET, NSET=BOTTOM
1, 2, 3
*SURFACE, TYPE=ELEMENT, NAME=BOTTOM_SURFACE
1, S1
1, S2
1, S4
2, S2
2, S3
2, S4
*ELSET, ELSET=BOTTOM_ELEMENTS
1, 2
";
        assert_eq!(text(&["made by hand".to_owned()], 0.1), expected);
    }

    #[test]
    fn no_provenance_can_break_a_line_or_make_a_keyword() {
        let nasty = ["*STEP\n*END STEP".to_owned(), "7.2° ".repeat(60), String::new()];
        let deck = text(&nasty, 0.1);
        assert!(deck.is_ascii() && deck.lines().all(|l| l.len() <= 80));
        assert!(!deck.lines().any(|l| l.starts_with("*STEP") || l.starts_with("*END")));
        assert!(deck.contains("** *STEP?*END STEP\n"));
    }

    #[test]
    fn a_number_stays_in_one_line() {
        for shift in 0..40 {
            let line = format!(
                "{} approach 0.004360714 mm, half by each plate; {}",
                "x".repeat(40 + shift),
                "y".repeat(90)
            );
            let deck = text(&[line], 0.1);
            assert!(deck.contains("0.004360714") && deck.lines().all(|l| l.len() <= 80), "{deck}");
        }
    }

    #[test]
    fn lists_break_before_eighty_characters() {
        let mut bytes = Vec::new();
        list(&mut bytes, 19_999_990..20_000_010).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        assert!(text.lines().all(|l| l.len() <= 80 && !l.ends_with([',', ' '])), "{text}");
        let mut bytes = Vec::new();
        list(&mut bytes, 0..40).unwrap();
        assert!(String::from_utf8(bytes).unwrap().lines().all(|l| l.split(',').count() <= 16));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let point = |x: f64| Point::new(x, 0.0, 0.0);
        let mesh = |x| TetMesh::new(vec![point(0.0), point(x), point(1.0), point(2.0)], vec![[0, 1, 2, 3]]);
        assert!(matches!(write(&TetMesh::default(), &[], 0.1, Vec::new()), Err(ExportError::Unfit { .. })));
        assert!(matches!(write(&mesh(f64::NAN), &[], 0.1, Vec::new()), Err(ExportError::Unfit { .. })));
        assert!(matches!(write(&mesh(1.0), &[], -0.1, Vec::new()), Err(ExportError::Unfit { .. })));
    }
}
