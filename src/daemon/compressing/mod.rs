//! A compression as a job: its folder, its checkpoints, its results.
//!
//! The folder holds `run.json` (what was asked), `mesh.bin` (the very mesh), `state.bin` (the checkpoint), and the results.
//! What follows from the mesh and what was asked is computed again on resuming, so a resumed run goes on with the same bits.

mod body;
mod files;

pub use body::{CompressInput, Placing};

use super::DaemonError;
use crate::contact::{
    Contact, ContactError, CurvePoint, Energy, HertzFit, Loading, Material, Press, QuasiStatic, Sample,
    fit_hertz, hertz, quasi_static, transition_mm,
};
use crate::mesh::TetMesh;
use crate::session::write_whole;
use body::{mesh_bytes, mesh_from};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const RUN: &str = "run.json";
const MESH: &str = "mesh.bin";
const STATE: &str = "state.bin";
/// The name of the file with all figures.
const RESULT: &str = "result.json";
/// `kill -9` loses at most this much computing, and a sample.
const CHECKPOINT_EACH: Duration = Duration::from_secs(20);
/// How many moments of the compression are kept as `.vtu` and as a picture.
const STAGES: usize = 8;

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
    /// The plates' distance at the approach nought, mm.
    pub gap_mm: f64,
    /// The radius, where the body is a sphere, mm.
    pub sphere_radius_mm: Option<f64>,
    /// How the body was turned to come to rest, as a rotation vector, degrees.
    pub placed_deg: [f64; 3],
    /// The force at which `δ_i` is read, N.
    pub transition_n: f64,
}

/// The figures of a compression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CompressResult {
    /// What was asked.
    pub settings: CompressSettings,
    /// Whether the force or the approach asked for was reached.
    pub finished: bool,
    /// Force against the approach of the plates.
    pub curve: Vec<CurvePoint>,
    /// The approach at which the force passes `settings.transition_n`, mm.
    pub delta_i_mm: Option<f64>,
    /// Hertz' law fitted after `δ_i`.
    pub hertz: Option<HertzFit>,
    /// For a sphere the last force over that of the two-plate form.
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
    pub kinetic: f64,
    /// Stored and taken by plastic flow.
    pub internal: f64,
    /// Work of the plates.
    pub external: f64,
    /// Unaccounted energy over the plates' work.
    pub balance_error: f64,
    /// Taken by plastic flow.
    pub plastic: f64,
    /// Taken by bulk viscosity.
    pub viscous: f64,
    /// Taken by damping.
    pub damping: f64,
    /// Taken by friction.
    pub friction: f64,
    /// Lost by nodes that met a plate.
    pub impact: f64,
}

impl From<Energy> for EnergyResult {
    fn from(e: Energy) -> Self {
        Self {
            kinetic: e.kinetic,
            internal: e.internal(),
            external: e.external,
            balance_error: e.balance_error(),
            plastic: e.plastic,
            viscous: e.viscous,
            damping: e.damping,
            friction: e.friction,
            impact: e.impact,
        }
    }
}

/// A curve to be drawn beside the computed one.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherCurve {
    /// Its name.
    pub name: String,
    /// The curve.
    pub points: Vec<CurvePoint>,
    /// Measured rather than computed.
    pub measured: bool,
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

/// A compression in its folder.
pub struct Compression {
    folder: PathBuf,
    settings: CompressSettings,
    mesh: TetMesh,
    press: Press,
    /// Computing time of the parts before this one.
    earlier_s: f64,
}

impl Compression {
    /// Begins a compression in a folder that is empty or does not exist.
    ///
    /// # Errors
    /// [`DaemonError`]: a body, a material or plates that cannot be computed, a folder that is not free or cannot be written.
    pub fn begin(
        folder: &Path,
        input: &CompressInput,
        placing: &Placing,
        mut settings: CompressSettings,
        told: &mut dyn FnMut(f64),
    ) -> Result<Self, DaemonError> {
        super::merging::check_free(folder)?;
        settings.material.check()?;
        settings.loading.check()?;
        let placed = body::placed(input, placing, told)?;
        settings.source = input.name();
        settings.middle_mm = placed.middle_mm;
        settings.gap_mm = placed.gap_mm;
        settings.sphere_radius_mm = placed.sphere_radius_mm;
        settings.placed_deg = placed.turned_deg;
        let press = press(&placed.mesh, &settings)?;
        std::fs::create_dir_all(folder)
            .map_err(|source| DaemonError::Write { path: folder.into(), source })?;
        let text = serde_json::to_vec_pretty(&settings).map_err(|e| DaemonError::Encode(e.to_string()))?;
        write_whole(folder, RUN, &text)?;
        write_whole(folder, MESH, &mesh_bytes(&placed.mesh))?;
        Ok(Self { folder: folder.into(), settings, mesh: placed.mesh, press, earlier_s: 0.0 })
    }

    /// Goes on with an interrupted one.
    ///
    /// # Errors
    /// [`DaemonError::Resume`] where the folder holds none, or a damaged one.
    pub fn resume(folder: &Path) -> Result<Self, DaemonError> {
        let no = |reason: String| DaemonError::Resume { path: folder.into(), reason };
        let read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| no(format!("{name}: {e}")));
        let settings: CompressSettings =
            serde_json::from_slice(&read(RUN)?).map_err(|e| no(format!("{RUN}: {e}")))?;
        let mesh = mesh_from(&read(MESH)?).ok_or_else(|| no(format!("{MESH} is damaged")))?;
        let mut press = press(&mesh, &settings)?;
        let mut earlier_s = 0.0;
        if folder.join(STATE).exists() {
            let bytes = read(STATE)?;
            let (head, state) =
                bytes.split_first_chunk::<8>().ok_or_else(|| no(format!("{STATE} is damaged")))?;
            earlier_s = f64::from_le_bytes(*head);
            press.restore(state).map_err(|e| no(e.to_string()))?;
        }
        Ok(Self { folder: folder.into(), settings, mesh, press, earlier_s })
    }

    /// What was asked.
    pub fn settings(&self) -> &CompressSettings {
        &self.settings
    }

    /// Elements, nodes and the time step in s.
    pub fn size(&self) -> (usize, usize, f64) {
        (self.press.body().elements(), self.press.body().nodes(), self.press.step_s())
    }

    /// Computes to the end, or until `stop` is set, and writes the results either way.
    ///
    /// # Errors
    /// [`DaemonError`]: a file that cannot be written; [`DaemonError::Contact`] where an element fails, after the results up to
    /// there have been written.
    pub fn run(
        &mut self,
        others: &[OtherCurve],
        stop: &AtomicBool,
        told: &mut dyn FnMut(CompressProgress),
    ) -> Result<CompressResult, DaemonError> {
        let start = Instant::now();
        let done_before = self.press.done();
        let mut last_kept = Instant::now();
        let mut failed: Option<ContactError> = None;
        while !self.press.finished() && !stop.load(Ordering::Relaxed) {
            let stages = self.stages().len();
            let sample = match self.press.next_sample() {
                Ok(sample) => sample.clone(),
                Err(e) => {
                    failed = Some(e);
                    break;
                }
            };
            if self.stages().len() > stages {
                files::stage(&self.folder, self.stages().len(), &self.mesh, &self.press)?;
            }
            if last_kept.elapsed() >= CHECKPOINT_EACH {
                self.keep(start)?;
                last_kept = Instant::now();
            }
            let done = self.press.done();
            let spent = start.elapsed().as_secs_f64();
            let left_s = (done > done_before + 1e-3).then(|| spent * (1.0 - done) / (done - done_before));
            told(CompressProgress { done, left_s, sample: &sample });
        }
        if failed.is_none() {
            self.keep(start)?;
        }
        let wall_s = self.earlier_s + start.elapsed().as_secs_f64();
        let result = self.results(wall_s, others)?;
        failed.map_or(Ok(result), |e| Err(e.into()))
    }

    /// The samples at which a stage was passed.
    fn stages(&self) -> Vec<usize> {
        stages(&self.settings.loading, self.press.samples())
    }

    fn keep(&self, start: Instant) -> Result<(), DaemonError> {
        let mut bytes = (self.earlier_s + start.elapsed().as_secs_f64()).to_le_bytes().to_vec();
        bytes.extend(self.press.save());
        write_whole(&self.folder, STATE, &bytes)?;
        Ok(())
    }

    fn results(&self, wall_s: f64, others: &[OtherCurve]) -> Result<CompressResult, DaemonError> {
        let press = &self.press;
        let (samples, settings) = (press.samples(), &self.settings);
        let curve: Vec<CurvePoint> = samples.iter().map(CurvePoint::from).collect();
        let delta_i_mm = transition_mm(&curve, settings.transition_n);
        let fit = delta_i_mm.and_then(|d| fit_hertz(&curve, d, &settings.material, settings.gap_mm));
        let over_two_plate_form = settings.sphere_radius_mm.zip(curve.last()).map(|(r, last)| {
            last.force_n / hertz::two_plate_force_n(&settings.material, r, 0.5 * last.approach_mm)
        });
        let quasi = quasi_static(samples);
        let energy = samples.last().map(|s| s.energy).unwrap_or_default();
        let mut warnings = Vec::new();
        warnings.extend(quasi.and_then(|q| q.warning()));
        if energy.balance_error().abs() > 0.01 {
            warnings.push(format!(
                "the energy balance is off by {:.2} % of the plates' work: above 1 % the result is not to be trusted",
                100.0 * energy.balance_error()
            ));
        }
        if !press.finished() {
            warnings
                .push("the compression was interrupted: `grainrig compress --resume` goes on with it".into());
        }
        let rotation_deg = samples
            .last()
            .map_or(0.0, |s| s.rotation_rad.iter().map(|x| x * x).sum::<f64>().sqrt().to_degrees());
        let mut result = CompressResult {
            settings: settings.clone(),
            finished: press.finished(),
            curve,
            delta_i_mm,
            hertz: fit,
            over_two_plate_form,
            elements: press.body().elements(),
            nodes: press.body().nodes(),
            steps: press.dynamics().steps,
            step_s: press.step_s(),
            added_mass: press.body().added_mass(),
            wall_s,
            energy: energy.into(),
            quasi_static: quasi,
            rotation_deg,
            overclosure_mm: press.overclosure_mm(),
            contacts: press.contacts().to_vec(),
            warnings,
            files: Vec::new(),
        };
        result.files = files::write(&self.folder, &self.mesh, press, &result, &self.stages(), others)?;
        let text = serde_json::to_vec_pretty(&result).map_err(|e| DaemonError::Encode(e.to_string()))?;
        write_whole(&self.folder, RESULT, &text)?;
        Ok(result)
    }
}

fn press(mesh: &TetMesh, s: &CompressSettings) -> Result<Press, ContactError> {
    Press::new(mesh, &s.material, s.middle_mm, s.gap_mm, s.friction, &s.loading)
}

/// The samples at which another eighth of the way was passed.
fn stages(loading: &Loading, samples: &[Sample]) -> Vec<usize> {
    let mut out = Vec::new();
    for (i, s) in samples.iter().enumerate() {
        if loading.done_at(s) * STAGES as f64 >= (out.len() + 1) as f64 {
            out.push(i);
        }
    }
    out
}
