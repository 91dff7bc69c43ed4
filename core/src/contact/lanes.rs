//! SIMD batches of eight elements: the same figure of eight elements lies side by side, so that the compiler works on
//! several in one instruction. What is computed for an element depends on nothing beside it in its batch.

use super::instructions::Kernel;

/// Elements of a batch.
pub(super) const W: usize = 8;
/// A figure of each element of a batch.
pub(super) type Lane = [f64; W];
/// A 3 × 3 matrix, row by row.
pub(super) type Matrix = [f64; 9];
/// A matrix of each element of a batch.
pub(super) type Matrices = [Lane; 9];
/// Three figures of a node.
pub(super) type Node = [f64; 3];

/// Eight elements as they were meshed. A lane that no element fills has the volume zero and another's shape.
#[derive(Debug, Clone)]
pub(super) struct Batch {
    /// Gradients of the shape functions of nodes 1, 2, 3, each (x, y, z); that of node 0 is minus their sum, 1/mm.
    pub gradients: Matrices,
    /// Volumes, mm³.
    pub volume: Lane,
    /// Bulk viscosity b ρ c h of each element, MPa·s.
    pub viscosity: Lane,
    /// Indices of the nodes in their chunk's list.
    pub nodes: [[u16; W]; 4],
}

/// The sum of a batch's lanes, in their order.
#[inline(always)]
pub(super) fn sum(lane: &Lane) -> f64 {
    lane.iter().sum()
}

/// The matrix of one element.
#[inline(always)]
pub(super) fn pick(m: &Matrices, l: usize) -> Matrix {
    [m[0][l], m[1][l], m[2][l], m[3][l], m[4][l], m[5][l], m[6][l], m[7][l], m[8][l]]
}

/// Puts the matrix of one element into its lane.
#[inline(always)]
pub(super) fn put(m: &mut Matrices, l: usize, value: &Matrix) {
    for k in 0..9 {
        m[k][l] = value[k];
    }
}

/// The cofactors of a matrix, and its determinant: the inverse's transpose is the one over the other.
#[inline(always)]
pub(super) fn cofactors(m: &Matrix) -> (Matrix, f64) {
    let c = [
        m[4] * m[8] - m[5] * m[7],
        m[5] * m[6] - m[3] * m[8],
        m[3] * m[7] - m[4] * m[6],
        m[2] * m[7] - m[1] * m[8],
        m[0] * m[8] - m[2] * m[6],
        m[1] * m[6] - m[0] * m[7],
        m[1] * m[5] - m[2] * m[4],
        m[2] * m[3] - m[0] * m[5],
        m[0] * m[4] - m[1] * m[3],
    ];
    (c, m[0] * c[0] + m[1] * c[1] + m[2] * c[2])
}

/// a · b.
#[inline(always)]
pub(super) fn times(a: &Matrix, b: &Matrix) -> Matrix {
    let mut out = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
        }
    }
    out
}

/// aᵀ · b.
#[inline(always)]
pub(super) fn transposed_times(a: &Matrix, b: &Matrix) -> Matrix {
    times(&[a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8]], b)
}

/// a · bᵀ.
#[inline(always)]
pub(super) fn times_transposed(a: &Matrix, b: &Matrix) -> Matrix {
    times(a, &[b[0], b[3], b[6], b[1], b[4], b[7], b[2], b[5], b[8]])
}

/// The edges from node 0 of each element, as columns of a matrix: entry (i, k) is the component i of edge k.
#[inline(always)]
pub(super) fn edges(batch: &Batch, positions: &[Node]) -> Matrices {
    let mut out = [[0.0; W]; 9];
    for l in 0..W {
        let p0 = positions[batch.nodes[0][l] as usize];
        for k in 0..3 {
            let p = positions[batch.nodes[k + 1][l] as usize];
            for i in 0..3 {
                out[3 * i + k][l] = p[i] - p0[i];
            }
        }
    }
    out
}

/// The deformation gradients F: edges times the gradients of the shape functions.
#[inline(always)]
pub(super) fn gradients(batch: &Batch, edges: &Matrices) -> Matrices {
    let mut out = [[0.0; W]; 9];
    for l in 0..W {
        put(&mut out, l, &times(&pick(edges, l), &pick(&batch.gradients, l)));
    }
    out
}

/// A rotation that moves by less than this in an iteration is final: the next one's change is half its square.
const ROTATION_DONE: f64 = 1e-8;
/// Iterations that no element with a positive volume needs.
const MOST_ITERATIONS: usize = 16;

/// The rotations R of F = R U, by Newton's iteration X ← (X + X⁻ᵀ)/2 (Higham 1986), with what its first step needs: the
/// cofactors of F and its determinant.
#[inline(always)]
pub(super) fn rotations(f: &Matrices) -> (Matrices, Matrices, Lane) {
    let mut r = *f;
    let mut cofactor = [[0.0; W]; 9];
    let mut determinant = [0.0; W];
    let mut change = [0.0; W];
    for l in 0..W {
        let m = pick(f, l);
        let (c, d) = cofactors(&m);
        put(&mut cofactor, l, &c);
        determinant[l] = d;
        let half = 0.5 / d;
        let mut most = 0.0;
        for k in 0..9 {
            let new = 0.5 * m[k] + half * c[k];
            let by = new - m[k];
            most += by * by;
            r[k][l] = new;
        }
        change[l] = most;
    }
    for _ in 0..MOST_ITERATIONS {
        if change.iter().all(|c| c.is_nan() || *c < ROTATION_DONE * ROTATION_DONE) {
            break;
        }
        for l in 0..W {
            let m = pick(&r, l);
            let (c, d) = cofactors(&m);
            let half = 0.5 / d;
            let mut most = 0.0;
            for k in 0..9 {
                let new = 0.5 * m[k] + half * c[k];
                let by = new - m[k];
                most += by * by;
                r[k][l] = new;
            }
            change[l] = most;
        }
    }
    (r, cofactor, determinant)
}

/// Adds the elements' nodal forces −V P·∇N to their nodes' slots, element by element.
#[inline(always)]
pub(super) fn scatter(batch: &Batch, stress: &Matrices, forces: &mut [Node]) {
    let mut out = [[0.0; W]; 9];
    for l in 0..W {
        // Row k of the gradients is node k + 1: the force's component i is −V Σ_j P_ij g_kj.
        let f = times_transposed(&pick(stress, l), &pick(&batch.gradients, l));
        for k in 0..9 {
            out[k][l] = -batch.volume[l] * f[k];
        }
    }
    for l in 0..W {
        for k in 0..3 {
            let node = &mut forces[batch.nodes[k + 1][l] as usize];
            for i in 0..3 {
                node[i] += out[3 * i + k][l];
            }
        }
        let node = &mut forces[batch.nodes[0][l] as usize];
        for i in 0..3 {
            node[i] -= out[3 * i][l] + out[3 * i + 1][l] + out[3 * i + 2][l];
        }
    }
}

/// Adds a quarter of each element's volume in a chunk to its nodes' slots.
pub(super) struct NodalVolumes<'a> {
    pub batches: &'a [Batch],
    pub positions: &'a [Node],
    pub volumes: &'a mut [f64],
}

impl Kernel for NodalVolumes<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for batch in self.batches {
            let f = gradients(batch, &edges(batch, self.positions));
            let mut quarter = [0.0; W];
            for l in 0..W {
                quarter[l] = 0.25 * batch.volume[l] * cofactors(&pick(&f, l)).1;
            }
            for l in 0..W {
                for k in 0..4 {
                    self.volumes[batch.nodes[k][l] as usize] += quarter[l];
                }
            }
        }
    }
}
