//! Material laws: how elements answer to their deformation.
//!
//! A law is one file here, with a line in [`LAWS`]. Its [`Law`] says what it is called and which parameters it takes; its
//! [`MaterialLaw`] computes, a chunk of elements at a call. All else reads the table: the checks of a [`Material`], checkpoints,
//! decks, `compress --material`, the daemon's requests, and the conformance suite that every law has to pass (`tests/contact/laws.rs`).

mod drucker_prager;
mod elastic;
mod plastic;
mod radial_return;

use super::body::Chunk;
use super::instructions::Instructions;
use super::lanes::{Lane, Local, Matrix, W};
use super::{ContactError, Material};
use crate::plausible::Quantity;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use std::fmt::{self, Debug};
use std::sync::Arc;

/// All laws; the first is the usual one.
pub static LAWS: [&Law; 3] = [&elastic::LAW, &plastic::LAW, &drucker_prager::LAW];

/// What is known of a law without a material.
pub struct Law {
    /// What it is called where it is asked for, and folders of results after it.
    pub name: &'static str,
    /// What it is called beside a curve.
    pub legend: &'static str,
    /// What it is, in a line for a help text.
    pub what: &'static str,
    /// Whether it takes a yield stress: what yields follows neither Hertz' law nor the two-plate form.
    pub yields: bool,
    /// The parameters that it takes beside those that [`Material`] has a field for.
    pub parameters: &'static [Parameter],
    /// The law with a material's parameters.
    pub(super) of: fn(&Material) -> Arc<dyn MaterialLaw>,
}

/// A parameter of a law's own.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Its name, its unit, and what it is in any laboratory.
    pub quantity: Quantity,
    /// Its option on a command line.
    pub option: &'static str,
    /// What it is where nobody says.
    pub usual: f64,
    /// The least and the most with which the law can be computed.
    pub limits: [f64; 2],
    /// These limits in words.
    pub limit: &'static str,
    /// What it is, in a line for a help text.
    pub what: &'static str,
}

impl Law {
    /// The law of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        LAWS.into_iter().find(|law| law.name == name)
    }

    /// Whether the law takes these parameters.
    pub(super) fn check(&self, material: &Material) -> Result<(), ContactError> {
        if self.yields != material.yield_mpa.is_some() {
            let (name, value) = ("yield_mpa", material.yield_mpa.unwrap_or(f64::NAN));
            let limit = if self.yields { "given" } else { "left out" };
            let remedy = "a law that yields takes a yield stress, an elastic one takes none";
            return Err(ContactError::Setting { name, value, unit: "MPa", limit, remedy });
        }
        for (name, &value) in &material.parameters {
            let Some(known) = self.parameters.iter().find(|p| p.quantity.name == name) else {
                let known: Vec<&str> = self.parameters.iter().map(|p| p.quantity.name).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                return Err(ContactError::Parameter { name: name.clone(), law: self.name, known });
            };
            let [least, most] = known.limits;
            if !(least..=most).contains(&value) {
                let Quantity { name, unit, .. } = known.quantity;
                let (limit, remedy) = (known.limit, "leave it out for the usual one");
                return Err(ContactError::Setting { name, value, unit, limit, remedy });
            }
        }
        Ok(())
    }
}

impl Debug for Law {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl PartialEq for Law {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Serialize for Law {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name)
    }
}

impl<'de> Deserialize<'de> for &'static Law {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Law::named(&name).ok_or_else(|| {
            let known = LAWS.map(|law| format!("`{}`", law.name)).join(" or ");
            de::Error::custom(format!("unknown material `{name}`, expected {known}"))
        })
    }
}

/// A program that a deck is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Program {
    /// Abaqus/Explicit.
    Abaqus,
    /// `CalculiX`, a static analysis.
    Calculix,
}

/// Lamé's parameters, MPa.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moduli {
    pub lambda: f64,
    pub shear: f64,
}

impl From<&Material> for Moduli {
    fn from(material: &Material) -> Self {
        Self { lambda: material.lambda_mpa(), shear: material.shear_mpa() }
    }
}

/// What the elements of a chunk carry from step to step.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChunkState {
    /// Volume ratios at the last step, batch by batch.
    pub volume_ratio: Vec<Lane>,
    /// History variables: so many lanes for each batch as the law has. A checkpoint holds them as they lie here.
    pub history: Vec<Lane>,
}

/// Where the nodes of a chunk are in a step, side by side in the chunk's order.
#[derive(Debug)]
pub(super) struct ChunkStep<'a> {
    pub instructions: Instructions,
    pub chunk: &'a Chunk,
    /// Their positions, mm.
    pub positions: &'a Local,
    /// Their positions half a step ago, mm; for a law with history variables.
    pub half_positions: &'a Local,
    /// Their pressures (tension positive), MPa; for a law whose nodes have one.
    pub pressures: &'a [f64],
    /// The step that led here, s; infinite before the first.
    pub step_s: f64,
}

/// The output of a chunk of elements for one step: energies that it took, N·mm, and its first broken element.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ChunkOutput {
    pub viscous: f64,
    pub plastic: f64,
    pub broken: Option<(usize, &'static str)>,
}

impl ChunkOutput {
    /// Notes the first element whose volume is not positive.
    #[inline(always)]
    fn check_volumes(&mut self, volume_ratio: &Lane, first: usize) {
        let mut broken = false;
        for l in 0..W {
            broken |= !(volume_ratio[l] > 0.0 && volume_ratio[l] <= f64::MAX);
        }
        if broken && self.broken.is_none() {
            self.broken = first_broken(volume_ratio).map(|(l, what)| (first + l, what));
        }
    }
}

/// The first lane whose volume is not positive, and what it is then. Apart, as no kernel gets here.
#[cold]
#[inline(never)]
fn first_broken(volume_ratio: &Lane) -> Option<(usize, &'static str)> {
    let l = volume_ratio.iter().position(|j| !(*j > 0.0 && *j <= f64::MAX))?;
    Some((l, if volume_ratio[l] <= 0.0 { "is inside out" } else { "is no number" }))
}

/// A law with its parameters, as it is computed.
pub(super) trait MaterialLaw: Debug + Send + Sync {
    /// The moduli of the stiffest answer there is: they bound the speed of waves, and so an element's time step.
    fn stiffest(&self) -> Moduli;

    /// Lanes of history variables of a batch, all nought at the beginning.
    fn history_lanes(&self) -> usize {
        0
    }

    /// The bulk modulus κ by which nodes have a pressure κ ln J/J of the volume around them, MPa; none where the elements have
    /// their own.
    fn nodal_bulk_mpa(&self) -> Option<f64> {
        None
    }

    /// Adds the forces of a chunk's elements to its nodes after a step, bulk viscosity with them, and takes the history along.
    fn step(&self, at: &ChunkStep, state: &mut ChunkState, forces: &mut Local) -> ChunkOutput;

    /// Adds the forces by which a chunk answers elastically to small displacements of its nodes; what it bears without any may be
    /// among them.
    fn response(
        &self,
        instructions: Instructions,
        chunk: &Chunk,
        positions: &Local,
        displacements: &Local,
        forces: &mut Local,
    );

    /// The elastic energy that a chunk stores, but for that of its nodes' pressures, N·mm.
    fn stored_n_mm(&self, chunk: &Chunk, positions: &Local, state: &ChunkState) -> f64;

    /// Cauchy's stress of the element in a lane of a batch, MPa: its deformation gradient F = R U, the mean of its nodes' pressures,
    /// the batch's history.
    fn cauchy_mpa(&self, f: &Matrix, r: &Matrix, pressure_mpa: f64, history: &[Lane], lane: usize) -> Matrix;

    /// The equivalent plastic strain of the element in a lane of a batch.
    fn plastic_strain(&self, _history: &[Lane], _lane: usize) -> f64 {
        0.0
    }

    /// The lines of a deck's material that say how it answers, each with its end; none where the program has no such law.
    fn deck(&self, program: Program) -> Option<String>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_law_is_found_by_its_name_and_no_two_have_the_same() {
        for (i, law) in LAWS.into_iter().enumerate() {
            assert_eq!(LAWS.iter().position(|other| other.name == law.name), Some(i));
            let text = serde_json::to_string(law).unwrap();
            assert_eq!(serde_json::from_str::<&Law>(&text).unwrap(), law);
            for p in law.parameters {
                assert!(
                    (p.limits[0]..=p.limits[1]).contains(&p.usual) && p.quantity.doubt(p.usual).is_none()
                );
            }
        }
        let error = serde_json::from_str::<&Law>("\"rubber\"").unwrap_err().to_string();
        assert!(error.contains("rubber") && error.contains("`elastic` or `plastic`"), "{error}");
    }

    #[test]
    fn a_parameter_that_a_law_does_not_take_is_refused_by_name() {
        let parameters = [("slope".to_owned(), 1.0)].into();
        let error = Material { parameters, ..Material::default() }.check().unwrap_err().to_string();
        assert!(error.starts_with("slope") && error.contains("elastic"), "{error}");
        let error = Material { law: Some(&plastic::LAW), ..Material::default() }.check().unwrap_err();
        assert!(error.to_string().starts_with("yield_mpa"), "{error}");
    }
}
