//! The critical time step of central differences: 2/ω of the mesh's highest mode.
//!
//! Of one element by itself the highest mode is known in closed form but for an eigenvalue; the mesh's highest mode is lower
//! (its nodes are heavier and its elements hold one another), and is found by Lanczos' iteration on the body as it is deformed.

use super::Body;
use super::lanes::Node;
use rayon::prelude::*;

/// Lanczos' iteration ends where this many steps changed the eigenvalue by less than a thousandth.
const STEADY: usize = 8;
/// Most steps of Lanczos' iteration.
const MOST_STEPS: usize = 120;
/// The displacement, over the mesh's smallest extent, by which the forces' derivative is taken.
const NUDGE: f64 = 1e-7;

/// The critical time step of the whole body at these positions, s: 2/ω of its highest mode, found from below to about a thousandth.
pub(super) fn critical_time_step_s(body: &Body, positions: &[Node]) -> f64 {
    let mut stiffness = Stiffness::new(body, positions);
    let length = body.volume.iter().copied().fold(f64::INFINITY, f64::min).cbrt();
    let root: Vec<f64> = body.mass.iter().map(|m| m.sqrt()).collect();
    let mut moved = vec![[0.0; 3]; body.nodes()];
    let mut q = noise(body.nodes());
    let norm = dot(&q, &q).sqrt();
    scale(&mut q, 1.0 / norm);
    let mut before = vec![[0.0; 3]; body.nodes()];
    let (mut alphas, mut betas): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    let mut found = Vec::new();
    for _ in 0..MOST_STEPS.min(3 * body.nodes()) {
        // p = M^(-1/2) q, and M^(-1/2) K p from the change of the forces.
        let most = q.iter().zip(&root).flat_map(|(q, r)| q.map(|c| (c / r).abs())).fold(0.0, f64::max);
        let by = NUDGE * length / most;
        for n in 0..moved.len() {
            for k in 0..3 {
                moved[n][k] = by * q[n][k] / root[n];
            }
        }
        let forces = stiffness.times(&moved);
        let mut next: Vec<Node> =
            (0..q.len()).map(|n| [0, 1, 2].map(|k| -forces[n][k] / (by * root[n]))).collect();
        let alpha = dot(&next, &q);
        let beta = betas.last().copied().unwrap_or(0.0);
        for n in 0..next.len() {
            for k in 0..3 {
                next[n][k] -= alpha * q[n][k] + beta * before[n][k];
            }
        }
        alphas.push(alpha);
        let norm = dot(&next, &next).sqrt();
        found.push(largest_eigenvalue(&alphas, &betas));
        let now = found[found.len() - 1];
        let steady = found.len() > STEADY && now <= found[found.len() - 1 - STEADY] * 1.001;
        if steady || norm.is_nan() || norm <= 1e-9 * now.abs() {
            break;
        }
        betas.push(norm);
        scale(&mut next, 1.0 / norm);
        before = std::mem::replace(&mut q, next);
    }
    2.0 / found.last().copied().unwrap_or(f64::NAN).sqrt()
}

/// How the body answers small displacements from where it is.
struct Stiffness<'a> {
    body: &'a Body,
    positions: &'a [Node],
    slots: Vec<Node>,
    undisturbed: Vec<Node>,
    out: Vec<Node>,
}

impl<'a> Stiffness<'a> {
    fn new(body: &'a Body, positions: &'a [Node]) -> Self {
        let mut slots = body.all_slots([0.0; 3]);
        let none = vec![[0.0; 3]; body.nodes()];
        let mut undisturbed = none.clone();
        body.response(positions, &none, &mut slots, &mut undisturbed);
        Self { body, positions, slots, undisturbed, out: none }
    }

    /// The forces that small displacements add.
    fn times(&mut self, displacements: &[Node]) -> &[Node] {
        self.body.response(self.positions, displacements, &mut self.slots, &mut self.out);
        for (f, before) in self.out.iter_mut().zip(&self.undisturbed) {
            for k in 0..3 {
                f[k] -= before[k];
            }
        }
        &self.out
    }
}

/// Numbers without order, the same each time.
fn noise(count: usize) -> Vec<Node> {
    let mut x = 1u64;
    let mut next = || {
        x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (x >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    (0..count).map(|_| [next(), next(), next()]).collect()
}

/// The sum over pieces of a fixed length, in their order: the same on any number of threads.
fn dot(a: &[Node], b: &[Node]) -> f64 {
    let parts: Vec<f64> = a
        .par_chunks(4096)
        .zip(b.par_chunks(4096))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).sum())
        .collect();
    parts.iter().sum()
}

fn scale(a: &mut [Node], by: f64) {
    a.iter_mut().flatten().for_each(|x| *x *= by);
}

/// The largest eigenvalue of a symmetric tridiagonal matrix, by bisection on the count of negative pivots.
fn largest_eigenvalue(diagonal: &[f64], beside: &[f64]) -> f64 {
    let reach = |i: usize| {
        let left = if i > 0 { beside[i - 1].abs() } else { 0.0 };
        let right = beside.get(i).filter(|_| i + 1 < diagonal.len()).map_or(0.0, |b| b.abs());
        left + right
    };
    let n = diagonal.len();
    let mut low = diagonal.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut high = (0..n).map(|i| diagonal[i] + reach(i)).fold(f64::NEG_INFINITY, f64::max);
    for _ in 0..60 {
        let x = 0.5 * (low + high);
        // All pivots of T − x negative: no eigenvalue above x.
        let mut pivot = diagonal[0] - x;
        let mut above = pivot > 0.0;
        for i in 1..n {
            pivot = diagonal[i] - x - beside[i - 1].powi(2) / if pivot == 0.0 { -1e-300 } else { pivot };
            above |= pivot > 0.0;
        }
        if above { low = x } else { high = x }
    }
    high
}
