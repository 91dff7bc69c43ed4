//! The elastic element: a compressible neo-Hookean solid, Hooke's law where strains are small.
//!
//! ```text
//! ψ = μ/2 (tr FᵀF − 3) − μ ln J + λ/2 (ln J)²,   J = det F
//! P = ∂ψ/∂F = μ (F − F⁻ᵀ) + λ ln J F⁻ᵀ          first Piola–Kirchhoff
//! σ = P Fᵀ/J = (μ (F Fᵀ − 1) + λ ln J 1)/J      Cauchy
//! q = b ρ c h (J − J₀)/(Δt J)                   bulk viscosity, added to σ as q 1; J₀: one step ago
//! f_a = −V P ∇N_a                               force on node a
//! ```
//!
//! (Simo and Pister, Comput. Meth. Appl. Mech. Engng 46, 201, 1984; b, the share of critical damping, and h = c Δt of the element
//! as in Abaqus/Explicit and LS-DYNA, linear term only.) Being total the law neither drifts nor remembers a path;
//! a rotation leaves it without stress, whatever its size; no volume can be pressed to nothing. Unlike the law of St. Venant
//! and Kirchhoff it does not soften in compression, which matters under a contact, where the strain reaches a fifth: in one
//! direction it answers between a nominal stress in proportion to the stretch and Hencky's law.

use super::{ChunkOutput, ChunkState, ChunkStep, Law, MaterialLaw, Moduli, Program};
use crate::contact::body::Chunk;
use crate::contact::instructions::{Instructions, Kernel};
use crate::contact::lanes::{
    Batch, Lane, Matrices, Matrix, Node, W, cofactors, edges, gradients, pick, put, scatter, sum,
    times_transposed,
};
use std::sync::Arc;

/// The law in the table.
pub(super) static LAW: Law = Law {
    name: "elastic",
    legend: "elastic",
    what: "Elastic",
    yields: false,
    parameters: &[],
    of: |material| {
        Arc::new(Elastic {
            moduli: material.into(),
            young_mpa: material.young_mpa,
            poisson: material.poisson,
        })
    },
};

/// A neo-Hookean solid.
#[derive(Debug)]
struct Elastic {
    moduli: Moduli,
    young_mpa: f64,
    poisson: f64,
}

impl MaterialLaw for Elastic {
    fn stiffest(&self) -> Moduli {
        self.moduli
    }

    fn step(&self, at: &ChunkStep, state: &mut ChunkState, forces: &mut [Node]) -> ChunkOutput {
        at.instructions.run(Step { moduli: &self.moduli, at, volume_ratios: &mut state.volume_ratio, forces })
    }

    fn response(
        &self,
        instructions: Instructions,
        chunk: &Chunk,
        positions: &[Node],
        displacements: &[Node],
        forces: &mut [Node],
    ) {
        let moved: Vec<Node> =
            (positions.iter().zip(displacements)).map(|(x, u)| [0, 1, 2].map(|k| x[k] + u[k])).collect();
        instructions.run(Response { moduli: &self.moduli, chunk, moved: &moved, forces });
    }

    fn stored_n_mm(&self, chunk: &Chunk, positions: &[Node], _state: &ChunkState) -> f64 {
        chunk.batches.iter().map(|batch| energy(&self.moduli, batch, positions)).sum()
    }

    fn cauchy_mpa(&self, f: &Matrix, _r: &Matrix, _pressure: f64, _history: &[Lane], _lane: usize) -> Matrix {
        cauchy(&self.moduli, f)
    }

    fn deck(&self, _program: Program) -> Option<String> {
        Some(format!("*ELASTIC\n{}, {}\n", self.young_mpa, self.poisson))
    }
}

/// A step of a chunk.
struct Step<'a> {
    moduli: &'a Moduli,
    at: &'a ChunkStep<'a>,
    volume_ratios: &'a mut [Lane],
    forces: &'a mut [Node],
}

impl Kernel for Step<'_> {
    type Output = ChunkOutput;

    #[inline(always)]
    fn run(self) -> ChunkOutput {
        let Self { moduli, at, volume_ratios, forces } = self;
        let mut output = ChunkOutput::default();
        for (b, (batch, before)) in at.chunk.batches.iter().zip(volume_ratios).enumerate() {
            let batch_output = add_forces::<true>(moduli, batch, at.positions, before, at.step_s, forces);
            output.viscous += batch_output.viscous_n_mm;
            output.check_volumes(&batch_output.volume_ratio, at.chunk.first + b * W);
        }
        output
    }
}

/// The answer of a chunk whose nodes have moved.
struct Response<'a> {
    moduli: &'a Moduli,
    chunk: &'a Chunk,
    moved: &'a [Node],
    forces: &'a mut [Node],
}

impl Kernel for Response<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut unused: Lane = [0.0; W];
        for batch in &self.chunk.batches {
            add_forces::<false>(self.moduli, batch, self.moved, &mut unused, 0.0, self.forces);
        }
    }
}

/// The output of a batch of elements beside its forces.
#[derive(Debug, Clone, Copy)]
pub(super) struct BatchOutput {
    /// Volume over that in the mesh.
    pub volume_ratio: Lane,
    /// What bulk viscosity took, N·mm.
    pub viscous_n_mm: f64,
}

/// Cofactors and determinants of deformation gradients.
#[inline(always)]
fn all_cofactors(f: &Matrices) -> (Matrices, Lane) {
    let mut cofactor = [[0.0; W]; 9];
    let mut determinant = [0.0; W];
    for l in 0..W {
        let (c, d) = cofactors(&pick(f, l));
        put(&mut cofactor, l, &c);
        determinant[l] = d;
    }
    (cofactor, determinant)
}

/// Adds the forces of a batch. With `VISCOUS` the change of the volume since `before` over `step_s` is resisted, and
/// `before` becomes what is now.
#[inline(always)]
fn add_forces<const VISCOUS: bool>(
    moduli: &Moduli,
    batch: &Batch,
    positions: &[Node],
    before: &mut Lane,
    step_s: f64,
    out: &mut [Node],
) -> BatchOutput {
    let f = gradients(batch, &edges(batch, positions));
    let (cofactor, determinant) = all_cofactors(&f);
    let log = determinant.map(f64::ln);
    let mut stress = [[0.0; W]; 9];
    let mut viscous = [0.0; W];
    for l in 0..W {
        let mut spherical = (moduli.lambda * log[l] - moduli.shear) / determinant[l];
        if VISCOUS {
            let grown = determinant[l] - before[l];
            let q = batch.viscosity[l] * grown / (step_s * determinant[l]);
            spherical += q;
            viscous[l] = q * grown * batch.volume[l];
            before[l] = determinant[l];
        }
        for k in 0..9 {
            stress[k][l] = moduli.shear * f[k][l] + spherical * cofactor[k][l];
        }
    }
    scatter(batch, &stress, out);
    BatchOutput { volume_ratio: determinant, viscous_n_mm: if VISCOUS { sum(&viscous) } else { 0.0 } }
}

/// The energy stored in a batch, N·mm.
fn energy(moduli: &Moduli, batch: &Batch, positions: &[Node]) -> f64 {
    let f = gradients(batch, &edges(batch, positions));
    let (_, determinant) = all_cofactors(&f);
    (0..W)
        .map(|l| {
            let mut square = -3.0;
            for k in 0..9 {
                square += f[k][l] * f[k][l];
            }
            let log = determinant[l].ln();
            let shear = moduli.shear * (0.5 * square - log);
            batch.volume[l] * (shear + 0.5 * moduli.lambda * log * log)
        })
        .sum()
}

/// Cauchy's stress for F, MPa.
fn cauchy(moduli: &Moduli, f: &Matrix) -> Matrix {
    let (_, determinant) = cofactors(f);
    let mut s = times_transposed(f, f).map(|x| moduli.shear * x);
    for k in [0, 4, 8] {
        s[k] += moduli.lambda * determinant.ln() - moduli.shear;
    }
    s.map(|x| x / determinant)
}
