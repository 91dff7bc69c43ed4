//! The finite element model: tetrahedra in the order and the batches in which they are computed, lumped masses.

use super::instructions::Instructions;
use super::lanes::{Batch, Local, Node, PLACES, W};
use super::laws::{MaterialLaw, Moduli};
use super::{ContactError, Material, element, order};
use crate::mesh::TetMesh;
use rayon::prelude::*;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Tetrahedra of a chunk: its nodes' positions and forces (about 20 kB) stay in a core's nearest cache.
const CHUNK: usize = 1024;
/// Nodes of a block, over which sums are made one after another.
pub(super) const BLOCK: usize = 1024;
/// The least and the most that a body may be long, mm: beyond them no figure that follows is worth anything.
const SIZE_MM: [f64; 2] = [1e-6, 1e6];
/// Share of the critical damping of an element's highest mode that bulk viscosity gives (Abaqus' and LS-DYNA's b₁).
pub(super) const BULK_VISCOSITY: f64 = 0.06;

/// Elements that are computed one after another by one thread.
#[derive(Debug, Clone)]
pub(super) struct Chunk {
    /// Nodes of these elements.
    pub nodes: Vec<u32>,
    /// The elements, eight by eight.
    pub batches: Vec<Batch>,
    /// Index of the first element in the order of computation.
    pub first: usize,
    /// How many elements.
    pub count: usize,
}

/// A meshed grain ready to be computed.
#[derive(Debug, Clone)]
pub struct Body {
    pub(super) material: Material,
    pub(super) law: Arc<dyn MaterialLaw>,
    /// What the kernels are computed with; no figure depends on it.
    pub instructions: Instructions,
    pub(super) chunks: Vec<Chunk>,
    /// Slots for nodal figures that each chunk has in the common list.
    pub(super) stride: usize,
    /// For each node where its slots in that list begin in `slots`.
    pub(super) slot_starts: Vec<u32>,
    pub(super) slots: Vec<u32>,
    /// Reference configuration: the nodes' positions as meshed, mm, in the order of computation.
    pub(super) reference: Vec<Node>,
    /// Masses of the nodes, t, with what scaling added.
    pub(super) mass: Vec<f64>,
    /// Volumes of the nodes, mm³: a quarter of each element's.
    pub(super) volume: Vec<f64>,
    /// The mesh's node number of each node of the computation.
    node_of: Vec<u32>,
    /// The mesh's tetrahedron number of each element.
    element_of: Vec<u32>,
    /// The critical time step of each element by itself, in the order of computation, s.
    element_time_step_s: Vec<f64>,
    /// Mass that scaling added, t.
    added_t: f64,
    scaled_to_s: Option<f64>,
}

impl Body {
    /// Takes a mesh in mm.
    ///
    /// # Errors
    /// [`ContactError`]: a material or a mesh that cannot be computed, one in pieces, a size that is no grain's.
    pub fn new(mesh: &TetMesh, material: &Material) -> Result<Self, ContactError> {
        material.check()?;
        mesh.check()?;
        check_size(mesh)?;
        check_pieces(mesh)?;
        Ok(Self::of(mesh, material))
    }

    /// From a checked mesh.
    pub(super) fn of(mesh: &TetMesh, material: &Material) -> Self {
        let law = (material.law().of)(material);
        let (moduli, density) = (law.stiffest(), material.density_t_mm3);
        let element_of = order::elements(mesh);
        let node_of = order::nodes(mesh, &element_of);
        let mut new = vec![0u32; mesh.nodes.len()];
        for (i, &n) in node_of.iter().enumerate() {
            new[n as usize] = i as u32;
        }
        let reference: Vec<Node> = node_of.iter().map(|&n| mesh.nodes[n as usize].coords.into()).collect();
        let tets: Vec<[u32; 4]> =
            element_of.iter().map(|&t| mesh.tets[t as usize].map(|n| new[n as usize])).collect();
        let limits: Vec<f64> = tets
            .par_iter()
            .map(|t| element::critical_time_step_s(&moduli, density, &corners(&reference, t)))
            .collect();
        let chunks: Vec<Chunk> = chunk_ranges(&tets, reference.len())
            .into_par_iter()
            .map(|r| chunk(&moduli, density, &reference, &tets[r.clone()], &limits[r.clone()], r.start))
            .collect();
        let stride = chunks.iter().map(|c| c.nodes.len()).max().unwrap_or(0);
        let mut slots_of: Vec<Vec<u32>> = vec![Vec::new(); reference.len()];
        for (i, chunk) in chunks.iter().enumerate() {
            for (k, &n) in chunk.nodes.iter().enumerate() {
                slots_of[n as usize].push((i * stride + k) as u32);
            }
        }
        let mut slot_starts = vec![0];
        let mut slots = Vec::new();
        for list in slots_of {
            slots.extend(list);
            slot_starts.push(slots.len() as u32);
        }
        let mut volume = vec![0.0; reference.len()];
        for t in &tets {
            let quarter = 0.25 * element::tet_volume(&corners(&reference, t));
            t.iter().for_each(|&n| volume[n as usize] += quarter);
        }
        let mass = volume.iter().map(|v| density * v).collect();
        Self {
            material: material.clone(),
            law,
            instructions: Instructions::best(),
            chunks,
            stride,
            slot_starts,
            slots,
            reference,
            mass,
            volume,
            node_of,
            element_of,
            element_time_step_s: limits,
            added_t: 0.0,
            scaled_to_s: None,
        }
    }

    /// The material.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// How many elements.
    pub fn elements(&self) -> usize {
        self.element_of.len()
    }

    /// Memory that the body takes, bytes.
    pub fn bytes(&self) -> usize {
        let chunks =
            self.chunks.iter().map(|c| 4 * c.nodes.len() + size_of_val(c.batches.as_slice())).sum::<usize>();
        // Of a node: position, mass, volume, number, start of its slots; of an element: number, stable step.
        chunks + 4 * self.slots.len() + 48 * self.nodes() + 12 * self.elements()
    }

    /// How many nodes.
    pub fn nodes(&self) -> usize {
        self.reference.len()
    }

    /// The mesh's number of a node of the computation.
    pub fn mesh_node(&self, node: usize) -> usize {
        self.node_of[node] as usize
    }

    /// The mesh's number of an element of the computation.
    pub fn mesh_element(&self, element: usize) -> usize {
        self.element_of[element] as usize
    }

    /// The mass, t, with what scaling added.
    pub fn mass_t(&self) -> f64 {
        self.mass.iter().sum()
    }

    /// What mass scaling added, over the mass before it.
    pub fn added_mass(&self) -> f64 {
        self.added_t / (self.mass_t() - self.added_t)
    }

    /// The least critical time step of any element by itself, s: a lower bound of the body's.
    pub fn least_element_time_step_s(&self) -> f64 {
        self.element_time_step_s.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The stable step, s, up to which elements of a smaller one were given mass; none where no mass was added.
    pub fn scaled_to_s(&self) -> Option<f64> {
        self.scaled_to_s
    }

    /// Adds mass to the elements whose own stable step is the smallest, as much as `most` of the body's mass in all, so
    /// that their step is that of the others. Nodes only grow heavier, so forces at rest stay what they are.
    pub fn scale_mass(&mut self, most: f64) {
        let total: f64 = self.material.density_t_mm3 * self.volume.iter().sum::<f64>();
        let element_t: Vec<f64> = {
            let mut out = vec![0.0; self.elements()];
            for chunk in &self.chunks {
                for e in 0..chunk.count {
                    out[chunk.first + e] = self.material.density_t_mm3 * chunk.batches[e / W].volume[e % W];
                }
            }
            out
        };
        // A step of `dt` asks of an element for (dt / its own)² of its mass.
        let extra =
            |e: usize, dt: f64| element_t[e] * ((dt / self.element_time_step_s[e]).powi(2) - 1.0).max(0.0);
        let added = |dt: f64| (0..element_t.len()).map(|e| extra(e, dt)).sum::<f64>();
        let mut low = self.least_element_time_step_s();
        let mut high = self.element_time_step_s.iter().copied().fold(0.0, f64::max);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if added(middle) > most * total {
                high = middle;
            } else {
                low = middle;
            }
        }
        self.scaled_to_s = Some(low);
        for chunk in &self.chunks {
            for e in 0..chunk.count {
                let quarter = 0.25 * extra(chunk.first + e, low);
                for k in 0..4 {
                    let node = chunk.nodes[chunk.batches[e / W].nodes[k][e % W] as usize];
                    self.mass[node as usize] += quarter;
                }
                self.added_t += 4.0 * quarter;
            }
        }
    }

    /// The forces by which the nodes answer elastically to small displacements from these positions, N; what they bear without
    /// any may be among them.
    pub(super) fn response(
        &self,
        positions: &[Node],
        displacements: &[Node],
        slots: &mut [Node],
        out: &mut [Node],
    ) {
        self.chunks.par_iter().zip(slots.par_chunks_mut(self.stride)).for_each_init(
            <(Local, Local, Local)>::default,
            |(local, moved, forces), (chunk, slots)| {
                chunk.fetch(positions, local);
                chunk.fetch(displacements, moved);
                chunk.clear(forces);
                self.law.response(self.instructions, chunk, local, moved, forces);
                chunk.put(forces, slots);
            },
        );
        out.par_iter_mut().enumerate().with_min_len(1024).for_each(|(n, f)| *f = self.gathered(n, slots));
    }

    /// A node's slots, in the chunks' order.
    #[inline(always)]
    fn slots_of(&self, node: usize) -> &[u32] {
        &self.slots[self.slot_starts[node] as usize..self.slot_starts[node + 1] as usize]
    }

    /// The sum of a node's slots of volumes.
    #[inline(always)]
    pub(super) fn gathered_volume(&self, node: usize, volumes: &[f64]) -> f64 {
        let mut sum = 0.0;
        for &s in self.slots_of(node) {
            sum += volumes[s as usize];
        }
        sum
    }

    /// The sum of a node's slots.
    #[inline(always)]
    pub(super) fn gathered(&self, node: usize, slots: &[Node]) -> Node {
        let mut sum = [0.0; 3];
        for &s in self.slots_of(node) {
            for k in 0..3 {
                sum[k] += slots[s as usize][k];
            }
        }
        sum
    }

    /// Slots for nodal figures of all chunks.
    pub(super) fn all_slots<T: Clone>(&self, empty: T) -> Vec<T> {
        vec![empty; self.stride * self.chunks.len()]
    }
}

impl Chunk {
    /// Copies figures of this chunk's nodes side by side.
    #[inline]
    pub(super) fn fetch(&self, all: &[Node], local: &mut Local) {
        local.fill(self.nodes.iter().map(|&n| all[n as usize]));
    }

    /// Makes the figures of this chunk's nodes nought.
    pub(super) fn clear(&self, local: &mut Local) {
        local.fill(self.nodes.iter().map(|_| [0.0; 3]));
    }

    /// Puts the figures of this chunk's nodes into its slots.
    pub(super) fn put(&self, local: &Local, slots: &mut [Node]) {
        slots[..self.nodes.len()].iter_mut().zip(local.nodes()).for_each(|(slot, node)| *slot = node);
    }
}

fn corners(nodes: &[Node], tet: &[u32; 4]) -> [Node; 4] {
    tet.map(|n| nodes[n as usize])
}

/// The elements of each chunk: as many as a chunk takes, and no more than have nodes for its places.
fn chunk_ranges(tets: &[[u32; 4]], nodes: usize) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    let mut last_chunk = vec![usize::MAX; nodes];
    let (mut start, mut count) = (0, 0);
    for (e, tet) in tets.iter().enumerate() {
        if e == start + CHUNK || count + tet.len() > PLACES {
            out.push(start..e);
            (start, count) = (e, 0);
        }
        for &n in tet {
            let of = std::mem::replace(&mut last_chunk[n as usize], out.len());
            count += usize::from(of != out.len());
        }
    }
    out.push(start..tets.len());
    out
}

fn chunk(
    moduli: &Moduli,
    density_t_mm3: f64,
    reference: &[Node],
    tets: &[[u32; 4]],
    limits: &[f64],
    first: usize,
) -> Chunk {
    let mut nodes: Vec<u32> = Vec::new();
    let mut local: HashMap<u32, u16> = HashMap::new();
    let c = ((moduli.lambda + 2.0 * moduli.shear) / density_t_mm3).sqrt();
    let batches = tets
        .chunks(W)
        .enumerate()
        .map(|(b, group)| {
            let mut batch =
                Batch { gradients: [[0.0; W]; 9], volume: [0.0; W], viscosity: [0.0; W], nodes: [[0; W]; 4] };
            for l in 0..W {
                // An empty lane repeats the group's last element without its volume.
                let at = l.min(group.len() - 1);
                let p = corners(reference, &group[at]);
                super::lanes::put(&mut batch.gradients, l, &element::shape_gradients(&p));
                for k in 0..4 {
                    let next = nodes.len() as u16;
                    let n = group[at][k];
                    batch.nodes[k][l] = *local.entry(n).or_insert_with(|| {
                        nodes.push(n);
                        next
                    });
                }
                if l == at {
                    batch.volume[l] = element::tet_volume(&p);
                    // The length that a pressure wave crosses in the element's own stable step.
                    let h = c * limits[b * W + l];
                    batch.viscosity[l] = BULK_VISCOSITY * density_t_mm3 * c * h;
                }
            }
            batch
        })
        .collect();
    Chunk { nodes, batches, first, count: tets.len() }
}

fn check_size(mesh: &TetMesh) -> Result<(), ContactError> {
    let size_mm = (0..3)
        .map(|k| {
            let (low, high) = mesh
                .nodes
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[k]), h.max(p[k])));
            high - low
        })
        .fold(0.0, f64::max);
    let [least, most] = SIZE_MM;
    if (least..=most).contains(&size_mm) {
        return Ok(());
    }
    let guess = if size_mm < least { "metres" } else { "micrometres" };
    Err(ContactError::Size { size_mm, least, most, guess })
}

/// The number that stands for a node's piece.
fn root(parent: &mut [u32], mut n: u32) -> u32 {
    while parent[n as usize] != n {
        parent[n as usize] = parent[parent[n as usize] as usize];
        n = parent[n as usize];
    }
    n
}

/// Whether one piece holds all elements.
fn check_pieces(mesh: &TetMesh) -> Result<(), ContactError> {
    let mut parent: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    for t in &mesh.tets {
        let r = root(&mut parent, t[0]);
        for &n in &t[1..] {
            let other = root(&mut parent, n);
            parent[other as usize] = r;
        }
    }
    let mut size: HashMap<u32, usize> = HashMap::new();
    for t in &mesh.tets {
        *size.entry(root(&mut parent, t[0])).or_insert(0) += 1;
    }
    if size.len() == 1 {
        return Ok(());
    }
    let largest = size.values().copied().max().unwrap_or(0);
    let elements = mesh.tets.len();
    Err(ContactError::Detached { pieces: size.len(), detached: elements - largest, elements })
}
