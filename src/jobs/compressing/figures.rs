//! What a compression is made of and what comes out of it, as files and callers have it.

use super::{FootResult, RockingResult};
use grainrig_core::contact::experiment::Reading;
use grainrig_core::contact::{
    Agreement, Contact, CurvePoint, Energy, HertzFit, Loading, Material, QuasiStatic, Sample, Transition,
};
use serde::{Deserialize, Serialize};

/// What was asked, as `run.json` keeps it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CompressSettings {
    /// Where the mesh is from.
    pub source: String,
    /// The material.
    pub material: Material,
    /// Coulomb's friction between plates and grain.
    pub friction: f64,
    /// How the plates move.
    pub loading: Loading,
    /// Height of the middle between the plates, mm, in the mesh's frame.
    pub middle_mm: f64,
    /// The plates' distance where the finite elements begin, mm: at the approach nought, or where the plates hold a grain that
    /// they turned.
    pub gap_mm: f64,
    /// The radius, where the body is a sphere, mm.
    pub sphere_radius_mm: Option<f64>,
    /// How the body was turned to come to rest, about x, then y, then z, degrees: what `--rotate-deg` takes.
    pub placed_deg: [f64; 3],
    /// How the plates turned it from there as a rigid body, before the finite elements begin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rocking: Option<RockingResult>,
    /// What its pedestal hid of it, and what of that touches a plate; none of a body all of which is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot: Option<FootResult>,
    /// The force at which `δ_i` is read, N.
    pub transition_n: f64,
    /// The force asked for, N, where the run goes on past it, to four times `transition_n`, so that `δ_i` is known to be the last
    /// crossing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub goes_on_from_n: Option<f64>,
    /// Whether figures that look like slips of unit are meant so.
    #[serde(default)]
    pub as_given: bool,
    /// Which of them were taken so.
    #[serde(default)]
    pub taken_as_given: Vec<String>,
}

impl CompressSettings {
    /// The approach of the plates that went into turning the grain before the finite elements begin, mm.
    pub fn rocked_mm(&self) -> f64 {
        self.rocking.map_or(0.0, |r| r.approach_mm)
    }

    /// What a person should know of a run that goes on past the force asked for.
    pub fn goes_on(&self) -> Option<String> {
        let (asked_n, to_n) = self.goes_on_from_n.zip(self.loading.to_force_n)?;
        Some(format!(
            "pressed past the {asked_n} N asked for to {to_n} N, four times the transition's {} N: from there on the force counts as \
             known not to fall below it again (--to-approach-mm stops anywhere)",
            self.transition_n
        ))
    }
}

/// The figures of a compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompressResult {
    /// The version of this form, 1; 0 of results from before it was numbered.
    #[serde(default)]
    pub schema: u32,
    /// The program and version that wrote it; empty where that was not stated yet.
    #[serde(default)]
    pub software: String,
    /// What was asked.
    pub settings: CompressSettings,
    /// Whether the force or the approach asked for was reached.
    pub finished: bool,
    /// Force against the approach of the plates.
    pub curve: Vec<CurvePoint>,
    /// The approach at which the force passes `settings.transition_n` for the last time, mm; `transition` says whether it is known
    /// that it is the last.
    pub delta_i_mm: Option<f64>,
    /// What of it came after the plates held the grain, mm: `delta_i_mm` is this and `settings.rocking.approach_mm`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deformation_mm: Option<f64>,
    /// How `delta_i_mm` was read.
    #[serde(default)]
    pub transition: Option<Transition>,
    /// Hertz' law fitted after `δ_i`; an elastic grain's alone.
    pub hertz: Option<HertzFit>,
    /// For an elastic sphere that both plates carry, the last force over that of the two-plate form.
    pub over_two_plate_form: Option<f64>,
    /// Tetrahedra.
    pub elements: usize,
    /// Nodes.
    pub nodes: usize,
    /// Steps done.
    pub steps: u64,
    /// The last time step, s.
    pub step_s: f64,
    /// Mass that scaling added, over the grain's.
    pub added_mass: f64,
    /// Computing time, of all parts of an interrupted run, s.
    pub wall_s: f64,
    /// The energies at the end, N·mm.
    pub energy: EnergyResult,
    /// The share of motion.
    pub quasi_static: Option<QuasiStatic>,
    /// How far the grain has turned, degrees.
    pub rotation_deg: f64,
    /// How far nodes are beyond a plate, mm: contact is exact.
    pub overclosure_mm: f64,
    /// The laboratory's test, where one was given: how it was read, and how well the computed curve agrees with it.
    #[serde(default)]
    pub experiment: Option<ExperimentResult>,
    /// Every contact that there was.
    pub contacts: Vec<Contact>,
    /// What a person should know.
    pub warnings: Vec<String>,
    /// What is in the folder.
    pub files: Vec<String>,
}

/// Energies, N·mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct EnergyResult {
    /// Of motion.
    #[serde(rename = "kinetic_n_mm", alias = "kinetic")]
    pub kinetic: f64,
    /// Stored and taken by plastic flow.
    #[serde(rename = "internal_n_mm", alias = "internal")]
    pub internal: f64,
    /// Work of the plates.
    #[serde(rename = "external_n_mm", alias = "external")]
    pub external: f64,
    /// Unaccounted energy over the plates' work; none before the contacts have formed, when there is hardly any.
    pub balance_error: Option<f64>,
    /// Taken by plastic flow.
    #[serde(rename = "plastic_n_mm", alias = "plastic")]
    pub plastic: f64,
    /// Taken by bulk viscosity.
    #[serde(rename = "viscous_n_mm", alias = "viscous")]
    pub viscous: f64,
    /// Taken by damping.
    #[serde(rename = "damping_n_mm", alias = "damping")]
    pub damping: f64,
    /// Taken by friction.
    #[serde(rename = "friction_n_mm", alias = "friction")]
    pub friction: f64,
    /// Lost by nodes that met a plate.
    #[serde(rename = "impact_n_mm", alias = "impact")]
    pub impact: f64,
}

impl EnergyResult {
    /// The energies at the end of a compression whose contacts have formed or not.
    pub(super) fn of(e: &Energy, formed: bool) -> Self {
        Self {
            kinetic: e.kinetic,
            internal: e.internal(),
            external: e.external,
            balance_error: formed.then(|| e.balance_error()),
            plastic: e.plastic,
            viscous: e.viscous,
            damping: e.damping,
            friction: e.friction,
            impact: e.impact,
        }
    }
}

/// A laboratory's test beside a compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExperimentResult {
    /// The export's file.
    pub file: String,
    /// What was read off it, and how.
    #[serde(flatten)]
    pub reading: Reading,
    /// How well the computed curve agrees with it; none where they have no approach in common.
    pub agreement: Option<Agreement>,
}

/// A curve to be drawn beside the computed one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OtherCurve {
    /// Its name.
    pub name: String,
    /// The curve.
    pub points: Vec<CurvePoint>,
    /// Where it was measured: the file, and how it was read.
    pub measured: Option<(String, Reading)>,
}

/// How far a compression is.
#[derive(Debug, Clone, Copy)]
pub struct CompressProgress<'a> {
    /// From 0 to 1.
    pub done: f64,
    /// About how much longer, s.
    pub left_s: Option<f64>,
    /// The newest sample.
    pub sample: &'a Sample,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energies_of_a_result_from_before_forms_were_numbered_are_read() {
        let keys = ["kinetic", "internal", "external", "plastic", "viscous", "damping", "friction", "impact"];
        let of = |unit: &str| {
            let named = keys.iter().zip(1..).map(|(key, value)| (format!("{key}{unit}"), value.into()));
            serde_json::Value::Object(named.chain([("balance_error".to_owned(), 0.25.into())]).collect())
        };
        let [old, new] = ["", "_n_mm"].map(|unit| serde_json::from_value::<EnergyResult>(of(unit)).unwrap());
        assert_eq!(old, new);
        assert_eq!((old.kinetic, old.impact, old.balance_error), (1.0, 8.0, Some(0.25)));
    }
}
