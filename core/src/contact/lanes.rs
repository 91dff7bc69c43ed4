//! SIMD batches of eight elements: the same figure of eight elements lies side by side, so that the compiler works on
//! several in one instruction. What is computed for an element depends on nothing beside it, but that the rotations of a group of
//! batches take as many iterations as its slowest needs.

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

/// Nodes of a chunk at most: an index among so many needs no check against a bound.
pub(super) const PLACES: usize = 1024;

/// Three figures of each node of a chunk side by side. Each has a fourth place, so that one load or store takes a node.
#[derive(Debug)]
pub(super) struct Local(Box<[Place; PLACES]>);

#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
struct Place([f64; 4]);

impl Default for Local {
    #[allow(clippy::large_stack_arrays)] // 32 kB, a sixtieth of a thread's stack.
    fn default() -> Self {
        Self(Box::new([Place([0.0; 4]); PLACES]))
    }
}

impl Local {
    /// Takes the figures of a chunk's nodes.
    #[inline(always)]
    pub(super) fn fill(&mut self, nodes: impl Iterator<Item = Node>) {
        self.0.iter_mut().zip(nodes).for_each(|(place, [x, y, z])| *place = Place([x, y, z, 0.0]));
    }

    /// The figures in their order.
    pub(super) fn nodes(&self) -> impl Iterator<Item = Node> {
        self.0.iter().map(|Place([x, y, z, _])| [*x, *y, *z])
    }

    #[inline(always)]
    fn at(&self, node: u16) -> &[f64; 4] {
        &self.0[usize::from(node) % PLACES].0
    }

    #[inline(always)]
    fn at_mut(&mut self, node: u16) -> &mut [f64; 4] {
        &mut self.0[usize::from(node) % PLACES].0
    }
}

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

/// Batches that go through each pass of a kernel together. What a pass wrote piece by piece the next one loads as a whole, and a
/// processor waits with that until all pieces are in its cache: after some batches they are.
pub(super) const GROUP: usize = 4;

/// The edges from node 0 of each element, as columns of a matrix: entry (i, k) is the component i of edge k.
#[inline(always)]
pub(super) fn edges(batch: &Batch, positions: &Local) -> Matrices {
    let mut out = [[0.0; W]; 9];
    for l in 0..W {
        let from = positions.at(batch.nodes[0][l]);
        for k in 0..3 {
            let to = positions.at(batch.nodes[k + 1][l]);
            for i in 0..3 {
                out[3 * i + k][l] = to[i] - from[i];
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

/// Bits of √½, the least fraction that [`ln`] makes its series for.
const ROOT_HALF: u64 = 0x3fe6_a09e_667f_3bcd;
/// What lies between there and 1, where exponents begin.
const TO_ONE: u64 = 0x3ff0_0000_0000_0000 - ROOT_HALF;
/// The bits of a double's fraction.
const FRACTION: u64 = 0x000f_ffff_ffff_ffff;
/// A number that shows a small integer in its lowest bits.
const INTEGERS: f64 = 4_503_599_627_370_496.0;
/// ln 2, of which so many bits are here that any exponent's multiple is exact.
const LN_2_HIGH: f64 = f64::from_bits(0x3fe6_2e42_fee0_0000);
/// What ln 2 has beyond.
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// The natural logarithm, to an ulp: what [`f64::ln`] gives, but for the last bit, which there hangs on the machine's library.
/// Without a branch or a table, so that the lanes of a batch go through it together.
///
/// ```text
/// x = 2ᵏ (1 + f),  √½ ≤ 1 + f < √2,  s = f/(2 + f)
/// ln(1 + f) = 2 artanh s = 2s + s R,  R = Σ 2 s²ⁿ/(2n + 1),  n = 1 … 10;  2s = f − s f
/// ```
#[inline(always)]
pub(super) fn ln(x: f64) -> f64 {
    // A subnormal number is made a normal one.
    let (x, less) = if x < f64::MIN_POSITIVE { (x * INTEGERS, 52.0) } else { (x, 0.0) };
    let bits = x.to_bits().wrapping_add(TO_ONE);
    let k = f64::from_bits(INTEGERS.to_bits() | (bits >> 52)) - INTEGERS - 1023.0 - less;
    let f = f64::from_bits((bits & FRACTION) + ROOT_HALF) - 1.0;
    let s = f / (2.0 + f);
    let z = s * s;
    let mut series = 2.0 / 21.0;
    for odd in [19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0] {
        series = series * z + 2.0 / odd;
    }
    // f − (f²/2 − s (f²/2 + R)) rounds less than f − s (f − R) does.
    let half = 0.5 * f * f;
    let sum = k * LN_2_HIGH - ((half - (s * (half + z * series) + k * LN_2_LOW)) - f);
    let beyond = if x == 0.0 { f64::NEG_INFINITY } else { f64::NAN };
    let beyond = if x > 0.0 { x } else { beyond };
    if x > 0.0 && x < f64::INFINITY { sum } else { beyond }
}

/// A rotation that moves by less than this in an iteration is final: the next one's change is half its square.
const ROTATION_DONE: f64 = 1e-8;
/// Iterations that no element with a positive volume needs.
const MOST_ITERATIONS: usize = 16;

/// The rotations R of F = R U of a group's batches, by Newton's iteration X ← (X + X⁻ᵀ)/2 (Higham 1986). The batches take turns, so
/// that none waits for its last iteration.
#[inline(always)]
pub(super) fn rotations(f: &[Matrices], r: &mut [Matrices]) {
    let mut change = [0.0; W];
    for (f, r) in f.iter().zip(&mut *r) {
        *r = *f;
        approach_rotation(r, &mut change);
    }
    for _ in 0..MOST_ITERATIONS {
        if change.iter().all(|c| *c < ROTATION_DONE * ROTATION_DONE) {
            break;
        }
        change = [0.0; W];
        for r in &mut *r {
            approach_rotation(r, &mut change);
        }
    }
}

/// An iteration; `most` grows to the square of what it changes.
#[inline(always)]
fn approach_rotation(r: &mut Matrices, most: &mut Lane) {
    for l in 0..W {
        let m = pick(r, l);
        let (c, d) = cofactors(&m);
        let half = 0.5 / d;
        let mut change = 0.0;
        for k in 0..9 {
            let new = 0.5 * m[k] + half * c[k];
            let by = new - m[k];
            change += by * by;
            r[k][l] = new;
        }
        most[l] = if change > most[l] { change } else { most[l] };
    }
}

/// The elements' forces −V P·∇N on their nodes 1, 2, 3, as columns of a matrix; that on node 0 is minus their sum.
#[inline(always)]
pub(super) fn nodal_forces(batch: &Batch, stress: &Matrices) -> Matrices {
    let mut out = [[0.0; W]; 9];
    for l in 0..W {
        // Row k of the gradients is node k + 1: the force's component i is −V Σ_j P_ij g_kj.
        let f = times_transposed(&pick(stress, l), &pick(&batch.gradients, l));
        for k in 0..9 {
            out[k][l] = -batch.volume[l] * f[k];
        }
    }
    out
}

/// Adds nodal forces to their nodes, element by element.
#[inline(always)]
pub(super) fn scatter(batch: &Batch, of: &Matrices, forces: &mut Local) {
    for l in 0..W {
        let on = [0, 1, 2].map(|k| [of[k][l], of[3 + k][l], of[6 + k][l]]);
        for k in 0..3 {
            let node = forces.at_mut(batch.nodes[k + 1][l]);
            *node = [node[0] + on[k][0], node[1] + on[k][1], node[2] + on[k][2], 0.0];
        }
        let all = [0, 1, 2].map(|i| on[0][i] + on[1][i] + on[2][i]);
        let node = forces.at_mut(batch.nodes[0][l]);
        *node = [node[0] - all[0], node[1] - all[1], node[2] - all[2], 0.0];
    }
}

/// Adds a quarter of each element's volume in a chunk to its nodes' slots.
pub(super) struct NodalVolumes<'a> {
    pub batches: &'a [Batch],
    pub positions: &'a Local,
    pub volumes: &'a mut [f64],
}

impl Kernel for NodalVolumes<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut edges_of = [[[0.0; W]; 9]; GROUP];
        let mut quarters = [[0.0; W]; GROUP];
        for group in self.batches.chunks(GROUP) {
            for (batch, edges_of) in group.iter().zip(&mut edges_of) {
                *edges_of = edges(batch, self.positions);
            }
            for ((batch, edges), quarters) in group.iter().zip(&edges_of).zip(&mut quarters) {
                for l in 0..W {
                    let quarter = cofactors(&pick(edges, l)).1 / 24.0;
                    // A lane that no element fills repeats another's nodes.
                    quarters[l] = if batch.volume[l] > 0.0 { quarter } else { 0.0 };
                }
            }
            for (batch, quarters) in group.iter().zip(&quarters) {
                for l in 0..W {
                    for k in 0..4 {
                        self.volumes[batch.nodes[k][l] as usize] += quarters[l];
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_those_of_the_library_to_its_last_bit() {
        let mut x: Vec<f64> = (0..100_000).map(|i| 0.5 + 1.7e-5 * f64::from(i)).collect();
        // Close to one the logarithm is as small as what the number has beyond.
        x.extend((0..50_000).map(|i| 1.0 + f64::from(i - 25_000) * 2e-12));
        x.extend((0..50_000).map(|i| f64::from_bits(1.0f64.to_bits() - 25_000 + i)));
        let random = |i: u64| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 1;
        x.extend((1..200_000).map(|i| f64::from_bits(random(i))).filter(|x| x.is_finite()));
        for x in x {
            let off = ln(x).to_bits().abs_diff(x.ln().to_bits());
            assert!(off <= 1, "ln {x:e} is off by {off} ulp");
        }
    }

    #[test]
    fn what_has_no_logarithm_gets_what_the_library_gives() {
        let least = f64::from_bits(1);
        let odd = [0.0, -0.0, -1.0, f64::NEG_INFINITY, f64::INFINITY, f64::NAN, least, f64::MIN_POSITIVE];
        for x in odd {
            assert!(
                ln(x).to_bits() == x.ln().to_bits() || (ln(x).is_nan() && x.ln().is_nan()),
                "{x}: {}",
                ln(x)
            );
        }
        assert_eq!(ln(1.0).to_bits(), 0);
    }
}
