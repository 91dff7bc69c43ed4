//! Abaqus input decks read back: their nodes and tetrahedra.

use super::ExportError;
use super::msh::gathered;
use crate::geometry::Point;
use crate::mesh::TetMesh;
use std::collections::HashMap;

/// What a data line is for.
enum Section {
    Nodes,
    /// Elements of so many nodes.
    Tetrahedra(usize),
    Other,
}

/// Reads the elements C3D4 and C3D10 (of these the corners) of a deck, and their nodes; everything else is passed over.
/// The unit is the file's own. Whether they are a mesh is for [`TetMesh::check`] to find.
///
/// # Errors
/// [`ExportError::Read`] with the line that can't be understood, for an element type that is not read, an `*INCLUDE`, and
/// a deck without tetrahedra.
pub fn read(bytes: &[u8]) -> Result<TetMesh, ExportError> {
    let text = std::str::from_utf8(bytes).map_err(|_| bad("it is not text".into()))?;
    let mut section = Section::Other;
    let mut points: HashMap<u64, Point> = HashMap::new();
    let mut tets: Vec<[u64; 4]> = Vec::new();
    // The numbers of an element so far: its lines may go on.
    let mut element: Vec<u64> = Vec::new();
    for (i, line) in text.lines().enumerate().map(|(i, l)| (i + 1, l.trim())) {
        if line.is_empty() || line.starts_with("**") {
            continue;
        }
        if let Some(keyword) = line.strip_prefix('*') {
            if !element.is_empty() {
                return Err(bad(format!("the element before line {i} has too few nodes")));
            }
            let keyword = keyword.to_ascii_uppercase().replace(' ', "");
            let name = keyword.split(',').next().unwrap_or("");
            section = match name {
                "NODE" => Section::Nodes,
                "ELEMENT" => match keyword.split(',').find_map(|p| p.strip_prefix("TYPE=")) {
                    Some("C3D4") => Section::Tetrahedra(4),
                    Some("C3D10" | "C3D10M" | "C3D10HS") => Section::Tetrahedra(10),
                    other => {
                        let kind = other.unwrap_or("none");
                        return Err(bad(format!(
                            "line {i} has elements of type {kind}, only C3D4 and C3D10 are read"
                        )));
                    }
                },
                "INCLUDE" => {
                    return Err(bad(format!("line {i} includes another file, which is not followed")));
                }
                _ => Section::Other,
            };
            continue;
        }
        let words = line.split(',').map(str::trim).filter(|w| !w.is_empty());
        match section {
            Section::Nodes => {
                let all: Option<Vec<f64>> = words.map(|w| w.parse().ok()).collect();
                let Some([tag, x, y, z]) = all.as_deref().and_then(|a| a.first_chunk::<4>()) else {
                    return Err(bad(format!("line {i} is no node: a number and three coordinates")));
                };
                if !(tag.fract() == 0.0 && *tag > 0.0) {
                    return Err(bad(format!("line {i} has the node number {tag}")));
                }
                points.insert(*tag as u64, Point::new(*x, *y, *z));
            }
            Section::Tetrahedra(nodes) => {
                let all: Option<Vec<u64>> = words.map(|w| w.parse().ok()).collect();
                element.extend(all.ok_or_else(|| bad(format!("line {i} is no element: whole numbers")))?);
                if element.len() > nodes + 1 {
                    return Err(bad(format!("the element at line {i} has more than {nodes} nodes")));
                }
                if element.len() == nodes + 1 {
                    tets.push([element[1], element[2], element[3], element[4]]);
                    element.clear();
                }
            }
            Section::Other => {}
        }
    }
    if !element.is_empty() {
        return Err(bad("it ends within an element".into()));
    }
    gathered("Abaqus", &points, &tets)
}

fn bad(what: String) -> ExportError {
    ExportError::Read { format: "Abaqus", what }
}

#[cfg(test)]
mod tests {
    use super::super::inp::{Order, write_order};
    use super::*;
    use proptest::prelude::*;

    fn two() -> TetMesh {
        let nodes =
            [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [1., 1., 1.]].map(Point::from).to_vec();
        TetMesh::new(nodes, vec![[0, 1, 2, 3], [1, 2, 3, 4]])
    }

    fn written(order: Order) -> Vec<u8> {
        let mut bytes = Vec::new();
        write_order(&two(), order, &["made by hand".to_owned()], 0.1, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn what_is_written_is_read_again_in_either_order() {
        for order in [Order::First, Order::Second] {
            assert_eq!(read(&written(order)).unwrap(), two(), "{order:?}");
        }
        let deck = String::from_utf8(written(Order::Second)).unwrap();
        assert!(deck.contains("TYPE=C3D10") && deck.lines().all(|l| l.len() <= 80));
        // The top is nodes 4 and 5 and the middle of the edge between them.
        assert!(deck.contains("*NSET, NSET=TOP\n4, 5, 14\n"), "{deck}");
    }

    #[test]
    fn decks_that_are_none_are_refused_with_the_line() {
        let fails = |text: &str, what: &str| {
            let e = read(text.as_bytes()).unwrap_err().to_string();
            assert!(e.contains(what), "{e}");
        };
        fails("", "no tetrahedron");
        fails("*ELEMENT, TYPE=C3D8\n", "type C3D8");
        fails("*NODE\n1, 0, zero, 0\n", "line 2");
        fails("*NODE\n1, 0, 0, 0\n*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4\n", "node 2");
        fails("*ELEMENT, TYPE=C3D4\n1, 1, 2\n*STEP\n", "too few");
        fails("*INCLUDE, INPUT=mesh.inp\n", "includes");
    }

    proptest! {
        #[test]
        fn no_damage_makes_it_panic(at in 0usize..900, to: u8, keep in 0usize..900) {
            let mut bytes = written(Order::Second);
            let at = at % bytes.len();
            bytes[at] = to;
            bytes.truncate(keep);
            let _ = read(&bytes);
        }
    }
}
