//! Element fields: Cauchy stress (MPa), von Mises' and principal stress, equivalent plastic strain.

use super::lanes::{Local, W, edges, gradients, pick, rotations};
use super::{Body, Dynamics};
use nalgebra::{Matrix3, SymmetricEigen};
use rayon::prelude::*;

/// What is known of each tetrahedron of the mesh, in the mesh's order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Fields {
    /// Cauchy's stress: xx, yy, zz, yz, xz, xy, MPa; tension is positive.
    pub stress_mpa: Vec<[f64; 6]>,
    /// Equivalent plastic strain; zero where the material is elastic.
    pub plastic_strain: Vec<f64>,
}

impl Fields {
    /// Von Mises' equivalent stress of each tetrahedron, MPa.
    pub fn mises_mpa(&self) -> Vec<f64> {
        self.stress_mpa.iter().map(mises).collect()
    }

    /// The least principal stress (the greatest pressure is the most negative) of each tetrahedron, MPa.
    pub fn least_principal_mpa(&self) -> Vec<f64> {
        (self.stress_mpa.par_iter())
            .map(|s| {
                let m = Matrix3::new(s[0], s[5], s[4], s[5], s[1], s[3], s[4], s[3], s[2]);
                SymmetricEigen::new(m).eigenvalues.min()
            })
            .collect()
    }
}

fn mises(s: &[f64; 6]) -> f64 {
    let mean = (s[0] + s[1] + s[2]) / 3.0;
    let (a, b, c) = (s[0] - mean, s[1] - mean, s[2] - mean);
    (1.5 * (a * a + b * b + c * c) + 3.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5])).sqrt()
}

impl Dynamics {
    /// Stresses and plastic strains of the elements now.
    pub fn fields(&self, body: &Body) -> Fields {
        fields(body, self)
    }
}

fn fields(body: &Body, dynamics: &Dynamics) -> Fields {
    let law = &body.law;
    let lanes = law.history_lanes();
    let parts: Vec<Vec<([f64; 6], f64)>> = (body.chunks.par_iter())
        .zip(&dynamics.chunks)
        .map_init(Local::default, |local, (chunk, state)| {
            chunk.fetch(&dynamics.positions, local);
            let mut out = Vec::with_capacity(chunk.count);
            for (b, batch) in chunk.batches.iter().enumerate() {
                let f = gradients(batch, &edges(batch, local));
                let mut r = [f];
                rotations(&[f], &mut r);
                for l in 0..W.min(chunk.count - b * W) {
                    let node = |k: usize| chunk.nodes[batch.nodes[k][l] as usize] as usize;
                    let pressure = match law.nodal_bulk_mpa() {
                        Some(_) => (0..4).map(|k| dynamics.pressures[node(k)]).sum::<f64>() / 4.0,
                        None => 0.0,
                    };
                    let history = &state.history[lanes * b..lanes * (b + 1)];
                    let s = law.cauchy_mpa(&pick(&f, l), &pick(&r[0], l), pressure, history, l);
                    let strain = law.plastic_strain(history, l);
                    out.push(([s[0], s[4], s[8], s[5], s[2], s[1]], strain));
                }
            }
            out
        })
        .collect();
    let mut fields =
        Fields { stress_mpa: vec![[0.0; 6]; body.elements()], plastic_strain: vec![0.0; body.elements()] };
    for (e, (stress, strain)) in parts.into_iter().flatten().enumerate() {
        fields.stress_mpa[body.mesh_element(e)] = stress;
        fields.plastic_strain[body.mesh_element(e)] = strain;
    }
    fields
}
