//! Contact patches: connected sets of boundary nodes on a plate, each tracked from its birth to its death.

use super::Body;
use super::lanes::Node;
use crate::mesh::TetMesh;
use serde::{Deserialize, Serialize};

/// Plate of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Plate {
    /// The one below.
    Lower,
    /// The one above.
    Upper,
}

/// A contact at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Touch {
    /// The contact's number.
    pub id: usize,
    /// Where on the plate its force acts, mm.
    #[serde(rename = "place_mm")]
    pub position_mm: [f64; 2],
    /// Its area: that of the surface nodes which touch, mm².
    pub area_mm2: f64,
    /// What presses, N.
    pub force_n: f64,
}

/// The life of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Contact {
    /// Its number, in the order of birth.
    pub id: usize,
    /// The plate.
    pub plate: Plate,
    /// The plates' approach when it was first seen, mm.
    pub born_mm: f64,
    /// The plates' approach when it was last seen; none while it lasts, mm.
    pub died_mm: Option<f64>,
    /// The largest force that it carried, N.
    pub most_n: f64,
    /// How it was last seen.
    pub last: Touch,
}

/// The boundary facets of the mesh, by the nodes of the computation, and which nodes neighbour which.
#[derive(Debug, Clone)]
pub(super) struct BoundaryFacets {
    triangles: Vec<[u32; 3]>,
    /// For each node where its neighbours begin in `neighbours`.
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    /// Nodes of the surface, rising.
    nodes: Vec<u32>,
}

impl BoundaryFacets {
    pub(super) fn new(mesh: &TetMesh, body: &Body) -> Self {
        let mut index = vec![0u32; body.nodes()];
        for i in 0..body.nodes() {
            index[body.mesh_node(i)] = i as u32;
        }
        let surface = mesh.surface();
        let of = |v: u32| index[surface.nodes[v as usize] as usize];
        let triangles: Vec<[u32; 3]> = surface.triangles.triangles.iter().map(|t| t.map(of)).collect();
        let mut lists: Vec<Vec<u32>> = vec![Vec::new(); body.nodes()];
        for t in &triangles {
            for k in 0..3 {
                lists[t[k] as usize].extend([t[(k + 1) % 3], t[(k + 2) % 3]]);
            }
        }
        let mut starts = vec![0];
        let mut neighbours = Vec::new();
        let mut nodes = Vec::new();
        for (n, mut list) in lists.into_iter().enumerate() {
            list.sort_unstable();
            list.dedup();
            if !list.is_empty() {
                nodes.push(n as u32);
            }
            neighbours.extend(list);
            starts.push(neighbours.len() as u32);
        }
        Self { triangles, starts, neighbours, nodes }
    }

    fn around(&self, node: u32) -> &[u32] {
        &self.neighbours[self.starts[node as usize] as usize..self.starts[node as usize + 1] as usize]
    }

    /// Nodes of the surface, rising.
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// A third of the area of the triangles around each node, mm².
    fn areas(&self, positions: &[Node]) -> Vec<f64> {
        let mut out = vec![0.0; positions.len()];
        for t in &self.triangles {
            let [a, b, c] = t.map(|n| positions[n as usize]);
            let (u, v) = ([0, 1, 2].map(|k| b[k] - a[k]), [0, 1, 2].map(|k| c[k] - a[k]));
            let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            let third = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt() / 6.0;
            t.iter().for_each(|&n| out[n as usize] += third);
        }
        out
    }
}

/// Follows the contacts.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Tracker {
    /// All contacts that there ever were.
    pub(super) contacts: Vec<Contact>,
    /// Nodes of those that last, by contact.
    alive: Vec<(usize, Vec<u32>)>,
}

impl Tracker {
    /// Whether each contact is in its place, and what touches is a contact, at nodes of a body with so many.
    pub(super) fn fits(&self, nodes: usize) -> bool {
        let is_there = |(id, at): &(usize, Vec<u32>)| {
            *id < self.contacts.len() && at.iter().all(|n| (*n as usize) < nodes)
        };
        self.contacts.iter().enumerate().all(|(i, c)| c.id == i && c.last.id == i)
            && self.alive.iter().all(is_there)
    }

    /// Looks at the nodes that touch a plate now, with what presses on each (node, plate, N), by rising node. The patches that
    /// are there: nodes with a touching neighbour, or one a node further, are one contact; a patch that shares or neighbours a
    /// node of an earlier contact is that contact.
    pub(super) fn look(
        &mut self,
        boundary: &BoundaryFacets,
        positions: &[Node],
        touching: &[(u32, Plate, f64)],
        approach_mm: f64,
    ) -> Vec<Touch> {
        let areas = if touching.is_empty() { Vec::new() } else { boundary.areas(positions) };
        let find = |n: u32| touching.binary_search_by_key(&n, |t| t.0).ok();
        let mut patch_of = vec![usize::MAX; touching.len()];
        let mut patches: Vec<Vec<usize>> = Vec::new();
        for seed in 0..touching.len() {
            if patch_of[seed] != usize::MAX {
                continue;
            }
            let mut patch = vec![seed];
            patch_of[seed] = patches.len();
            let mut next = 0;
            while next < patch.len() {
                let node = touching[patch[next]].0;
                next += 1;
                for &near in boundary.around(node) {
                    for &n in std::iter::once(&near).chain(boundary.around(near)) {
                        if let Some(i) = find(n)
                            && patch_of[i] == usize::MAX
                            && touching[i].1 == touching[seed].1
                        {
                            patch_of[i] = patches.len();
                            patch.push(i);
                        }
                    }
                }
            }
            patches.push(patch);
        }
        let before = std::mem::take(&mut self.alive);
        let mut taken = vec![false; before.len()];
        let mut seen = Vec::new();
        for patch in patches {
            let plate = touching[patch[0]].1;
            let mut nodes: Vec<u32> = patch.iter().map(|&i| touching[i].0).collect();
            nodes.sort_unstable();
            let near = |n: &u32| {
                nodes.binary_search(n).is_ok()
                    || boundary.around(*n).iter().any(|m| nodes.binary_search(m).is_ok())
            };
            let heir = (0..before.len()).find(|&b| {
                !taken[b] && self.contacts[before[b].0].plate == plate && before[b].1.iter().any(near)
            });
            let mut touch = Touch { id: 0, position_mm: [0.0; 2], area_mm2: 0.0, force_n: 0.0 };
            let mut plain = [0.0; 2];
            for &i in &patch {
                let (node, _, force) = touching[i];
                let p = positions[node as usize];
                touch.area_mm2 += areas[node as usize];
                touch.force_n += force;
                for k in 0..2 {
                    touch.position_mm[k] += force * p[k];
                    plain[k] += p[k] / patch.len() as f64;
                }
            }
            touch.position_mm =
                if touch.force_n > 0.0 { touch.position_mm.map(|x| x / touch.force_n) } else { plain };
            touch.id = if let Some(b) = heir {
                taken[b] = true;
                before[b].0
            } else {
                let id = self.contacts.len();
                let born =
                    Contact { id, plate, born_mm: approach_mm, died_mm: None, most_n: 0.0, last: touch };
                self.contacts.push(born);
                id
            };
            let contact = &mut self.contacts[touch.id];
            contact.most_n = contact.most_n.max(touch.force_n);
            contact.last = touch;
            self.alive.push((touch.id, nodes));
            seen.push(touch);
        }
        for (b, (id, _)) in before.iter().enumerate() {
            if !taken[b] {
                self.contacts[*id].died_mm = Some(approach_mm);
            }
        }
        seen.sort_by_key(|t| t.id);
        seen
    }
}
