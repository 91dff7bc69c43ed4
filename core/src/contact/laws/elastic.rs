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
    Batch, GROUP, Lane, Local, Matrices, Matrix, W, cofactors, edges, gradients, ln, nodal_forces, pick, put,
    scatter, sum, times_transposed,
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

    fn step(&self, at: &ChunkStep, state: &mut ChunkState, forces: &mut Local) -> ChunkOutput {
        at.instructions.run(Step { moduli: &self.moduli, at, volume_ratios: &mut state.volume_ratio, forces })
    }

    fn response(
        &self,
        instructions: Instructions,
        chunk: &Chunk,
        positions: &Local,
        displacements: &Local,
        forces: &mut Local,
    ) {
        let mut moved = Local::default();
        moved.fill(
            (positions.nodes().zip(displacements.nodes())).map(|(x, u)| [0, 1, 2].map(|k| x[k] + u[k])),
        );
        instructions.run(Response { moduli: &self.moduli, chunk, moved: &moved, forces });
    }

    fn stored_n_mm(&self, chunk: &Chunk, positions: &Local, _state: &ChunkState) -> f64 {
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
    forces: &'a mut Local,
}

impl Kernel for Step<'_> {
    type Output = ChunkOutput;

    #[inline(always)]
    fn run(self) -> ChunkOutput {
        let Self { moduli, at, volume_ratios, forces } = self;
        let mut output = ChunkOutput::default();
        let mut work = Work::default();
        let groups = at.chunk.batches.chunks(GROUP).zip(volume_ratios.chunks_mut(GROUP));
        for (g, (group, before)) in groups.enumerate() {
            let viscous = Some((&mut *before, at.step_s));
            output.viscous += add_forces(moduli, group, at.positions, viscous, &mut work, forces);
            for (b, ratio) in before.iter().enumerate() {
                output.check_volumes(ratio, at.chunk.first + (g * GROUP + b) * W);
            }
        }
        output
    }
}

/// The answer of a chunk whose nodes have moved.
struct Response<'a> {
    moduli: &'a Moduli,
    chunk: &'a Chunk,
    moved: &'a Local,
    forces: &'a mut Local,
}

impl Kernel for Response<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut work = Work::default();
        for group in self.chunk.batches.chunks(GROUP) {
            add_forces(self.moduli, group, self.moved, None, &mut work, self.forces);
        }
    }
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

/// What the passes over a group of batches hand on.
#[derive(Default)]
struct Work {
    /// Edges, then deformation gradients, then nodal forces.
    matrices: [Matrices; GROUP],
    volume_ratio: [Lane; GROUP],
    log: [Lane; GROUP],
}

/// Adds the forces of a group of batches. With their volume ratios one step ago, and how long that is, the change of the volume is
/// resisted, and the ratios become what is now. What this took, N·mm.
#[inline(always)]
fn add_forces(
    moduli: &Moduli,
    group: &[Batch],
    positions: &Local,
    viscous: Option<(&mut [Lane], f64)>,
    work: &mut Work,
    forces: &mut Local,
) -> f64 {
    let Work { matrices, volume_ratio, log } = work;
    for (batch, edges_of) in group.iter().zip(&mut *matrices) {
        *edges_of = edges(batch, positions);
    }
    for ((batch, f), determinant) in group.iter().zip(&mut *matrices).zip(&mut *volume_ratio) {
        *f = gradients(batch, f);
        *determinant = all_cofactors(f).1;
    }
    for (log, determinant) in log.iter_mut().zip(&*volume_ratio) {
        for l in 0..W {
            log[l] = ln(determinant[l]);
        }
    }
    let (mut before, step_s) = viscous.map_or((None, 1.0), |(before, step_s)| (Some(before), step_s));
    let mut taken = 0.0;
    for (b, ((batch, f), log)) in group.iter().zip(&mut *matrices).zip(&*log).enumerate() {
        let (cofactor, determinant) = all_cofactors(f);
        let mut stress = [[0.0; W]; 9];
        let mut q = [0.0; W];
        if let Some(before) = before.as_mut().map(|all| &mut all[b]) {
            let mut lost = [0.0; W];
            for l in 0..W {
                let grown = determinant[l] - before[l];
                q[l] = batch.viscosity[l] * grown / (step_s * determinant[l]);
                lost[l] = q[l] * grown * batch.volume[l];
            }
            *before = determinant;
            taken += sum(&lost);
        }
        for l in 0..W {
            let spherical = (moduli.lambda * log[l] - moduli.shear) / determinant[l] + q[l];
            for k in 0..9 {
                stress[k][l] = moduli.shear * f[k][l] + spherical * cofactor[k][l];
            }
        }
        *f = nodal_forces(batch, &stress);
    }
    for (batch, of) in group.iter().zip(&*matrices) {
        scatter(batch, of, forces);
    }
    taken
}

/// The energy stored in a batch, N·mm.
fn energy(moduli: &Moduli, batch: &Batch, positions: &Local) -> f64 {
    let f = gradients(batch, &edges(batch, positions));
    let (_, determinant) = all_cofactors(&f);
    (0..W)
        .map(|l| {
            let mut square = -3.0;
            for k in 0..9 {
                square += f[k][l] * f[k][l];
            }
            let log = ln(determinant[l]);
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
        s[k] += moduli.lambda * ln(determinant) - moduli.shear;
    }
    s.map(|x| x / determinant)
}
