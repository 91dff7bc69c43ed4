//! A compression as a job: its folder, its checkpoints, its results.
//!
//! The folder holds `asked.json` (what was asked), `mesh.bin` (the very mesh), `run.json` (what is computed with it),
//! `state.bin` (the checkpoint), `beside.json` (curves that are drawn beside its own), `lock` (held by the one process that computes), and the results. What follows from the mesh
//! and `run.json` is computed again on resuming, so a resumed run goes on with the same bits.

mod alone;
mod asked;
mod body;
mod catalogue;
mod figures;
mod files;
mod host;
mod job;
mod laws;
mod of_session;
mod options;
mod others;
mod reporter;
#[cfg(test)]
mod tests;

pub(in crate::jobs) use alone::{Alone, alone};
pub use asked::{Claim, CompressMaterial, CompressRequest};
pub use body::{CompressInput, FootBy, FootResult, Placing, RockingBy, RockingResult};
pub(in crate::jobs) use body::{doubts, hull_of, on_foot, surface_center};
pub use catalogue::{CompressDetails, CompressFile, CompressLine, CompressState};
pub use figures::{
    CompressProgress, CompressResult, CompressSettings, EnergyResult, ExperimentResult, OtherCurve,
};
pub use files::{experiment_lines, rocking_line, transition_line};
pub use host::CompressHost;
pub use options::CompressOptions;
pub(in crate::jobs) use others::others;

use super::JobError;
use crate::session::{Held, hold, read_inside, to_json, to_json_value, write_whole};
use crate::trace;
use body::{mesh_bytes, mesh_from};
use grainrig_core::contact::{
    ContactError, CurvePoint, Loading, Press, Sample, agreement, fit_hertz, hertz, quasi_static, transition,
};
use grainrig_core::mesh::TetMesh;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const RUN: &str = "run.json";
const MESH: &str = "mesh.bin";
const STATE: &str = "state.bin";
const BESIDE: &str = "beside.json";
/// The name of the file with all figures.
const RESULT: &str = "result.json";
/// Longest text that is read back, bytes: a result with every sample has a few megabytes.
const TEXT_LIMIT: u64 = 256 << 20;
/// Longest mesh or checkpoint that is read back, bytes: ten times that of two million tetrahedra.
const STATE_LIMIT: u64 = 4 << 30;
/// `kill -9` loses at most this much computing, and a piece.
const CHECKPOINT_EACH: Duration = Duration::from_secs(20);
/// Steps between two looks at the clock and at whether to stop: with a million plastic elements on one core two seconds.
const PIECE: u64 = 20;
/// How many moments of the compression are kept as `.vtu` and as a picture.
const STAGES: usize = 8;

/// A compression in its folder.
pub struct Compression {
    folder: PathBuf,
    settings: CompressSettings,
    mesh: TetMesh,
    press: Press,
    /// Computing time of the parts before this one.
    earlier_s: f64,
    /// Curves to be drawn beside its own.
    beside: Vec<OtherCurve>,
    _held: Held,
}

impl Compression {
    /// Goes on with an interrupted one.
    ///
    /// # Errors
    /// [`JobError::Resume`] where the folder holds none, or a damaged one; [`JobError::Session`] where another process
    /// computes it.
    pub fn resume(folder: &Path) -> Result<Self, JobError> {
        if !folder.join(RUN).is_file() {
            let reason = format!("{RUN} is missing");
            return Err(JobError::Resume { path: folder.into(), reason });
        }
        Self::open(folder, hold(folder)?)
    }

    fn open(folder: &Path, held: Held) -> Result<Self, JobError> {
        let no = |reason: String| JobError::Resume { path: folder.into(), reason };
        let read = |name: &str| read_inside(folder, name, STATE_LIMIT).map_err(|e| no(e.to_string()));
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
        let beside = kept_beside(folder)?;
        Ok(Self { folder: folder.into(), settings, mesh, press, earlier_s, beside, _held: held })
    }

    /// Meshes what was claimed.
    fn meshed(claim: Claim, told: &mut dyn FnMut(&str, f64)) -> Result<Self, JobError> {
        let Claim { folder, held, input, placing, mut settings } = claim;
        let placed = body::placed(&input, &placing, settings.friction, told)?;
        settings.source = input.name();
        settings.middle_mm = placed.middle_mm;
        settings.gap_mm = placed.gap_mm;
        settings.sphere_radius_mm = placed.sphere_radius_mm;
        settings.placed_deg = placed.turned_deg;
        settings.rocking = placed.rocking;
        settings.foot = placed.foot;
        told("finding the time step", 0.0);
        let press = press(&placed.mesh, &settings)?;
        let text = to_json(&settings).map_err(|e| JobError::Encode(e.to_string()))?;
        write_whole(&folder, MESH, &mesh_bytes(&placed.mesh))?;
        // The last of the two: where it is, the other is.
        write_whole(&folder, RUN, &text)?;
        let beside = kept_beside(&folder)?;
        Ok(Self { folder, settings, mesh: placed.mesh, press, earlier_s: 0.0, beside, _held: held })
    }

    /// Draws these curves beside its own, also where another process goes on with it.
    ///
    /// # Errors
    /// [`JobError`] where the disk fails.
    pub fn draw_beside(&mut self, curves: Vec<OtherCurve>) -> Result<(), JobError> {
        keep_beside(&self.folder, &curves)?;
        self.beside = curves;
        Ok(())
    }

    /// Its folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What was asked.
    pub fn settings(&self) -> &CompressSettings {
        &self.settings
    }

    /// Elements, nodes and the time step in s.
    pub fn size(&self) -> (usize, usize, f64) {
        (self.press.body().elements(), self.press.body().nodes(), self.press.step_s())
    }

    /// How much of the way to the end is done, 0 to 1; above 0 where it goes on from a checkpoint.
    pub fn done(&self) -> f64 {
        self.press.done()
    }

    /// Force against the approach of the plates, so far.
    pub fn curve(&self) -> Vec<CurvePoint> {
        // While the plates turned the grain there was no force to speak of.
        let ends = [0.0, self.press.begins_mm()].map(|approach_mm| CurvePoint { approach_mm, force_n: 0.0 });
        let turning =
            ends.into_iter().filter(|_| self.settings.rocked_mm() > 0.0 && self.press.begins_mm() > 0.0);
        turning.chain(self.press.samples().iter().map(CurvePoint::from)).collect()
    }

    /// Computes to the end, or until `stop` is set, and writes the results either way.
    ///
    /// # Errors
    /// [`JobError`]: a file that cannot be written; [`JobError::Contact`] where an element fails, after the results up to
    /// there have been written.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        told: &mut dyn FnMut(CompressProgress),
    ) -> Result<CompressResult, JobError> {
        let start = Instant::now();
        let folder = self.folder.clone();
        trace::job_of("compress", &folder, || self.run_by(&|| start.elapsed(), stop, told))
    }

    /// As [`Self::run`], with the time since its beginning as this clock has it.
    fn run_by(
        &mut self,
        now: &dyn Fn() -> Duration,
        stop: &AtomicBool,
        told: &mut dyn FnMut(CompressProgress),
    ) -> Result<CompressResult, JobError> {
        let done_before = self.press.done();
        let mut kept = Duration::ZERO;
        let mut failed: Option<ContactError> = None;
        while !self.press.finished() && !stop.load(Ordering::Relaxed) {
            let stages = self.stages().len();
            let sampled = match self.press.advance(PIECE) {
                Ok(sampled) => sampled,
                Err(e) => {
                    failed = Some(e);
                    break;
                }
            };
            if self.stages().len() > stages {
                files::stage(&self.folder, self.stages().len(), &self.mesh, &self.press)?;
            }
            let spent = now();
            if spent.saturating_sub(kept) >= CHECKPOINT_EACH {
                self.keep(spent)?;
                kept = spent;
            }
            if let Some(sample) = self.press.samples().last().filter(|_| sampled) {
                let done = self.press.done();
                let left_s = (done > done_before + 1e-3)
                    .then(|| spent.as_secs_f64() * (1.0 - done) / (done - done_before));
                told(CompressProgress { done, left_s, sample });
            }
        }
        // Before the first step there is nothing to keep.
        if failed.is_none() && self.press.dynamics().steps > 0 {
            self.keep(now())?;
        }
        let result = self.results(self.earlier_s + now().as_secs_f64())?;
        failed.map_or(Ok(result), |e| Err(e.into()))
    }

    /// The samples at which a stage was passed.
    fn stages(&self) -> Vec<usize> {
        stages(&self.settings.loading, self.press.samples())
    }

    fn keep(&self, spent: Duration) -> Result<(), JobError> {
        let mut bytes = (self.earlier_s + spent.as_secs_f64()).to_le_bytes().to_vec();
        bytes.extend(self.press.save());
        write_whole(&self.folder, STATE, &bytes)?;
        Ok(())
    }

    fn results(&self, wall_s: f64) -> Result<CompressResult, JobError> {
        let press = &self.press;
        let (samples, settings) = (press.samples(), &self.settings);
        let curve = self.curve();
        let transition = transition(&curve, settings.transition_n);
        let delta_i_mm = transition.map(|t| t.delta_i_mm);
        let quasi = quasi_static(samples, settings.transition_n);
        // What yields follows neither law.
        let elastic = !settings.material.law().yields;
        let fit = delta_i_mm
            .filter(|_| elastic)
            .and_then(|d| fit_hertz(&curve, d, &settings.material, settings.gap_mm));
        let over_two_plate_form =
            settings.sphere_radius_mm.zip(curve.last()).filter(|_| elastic && quasi.is_some()).map(
                |(r, last)| {
                    last.force_n / hertz::two_plate_force_n(&settings.material, r, 0.5 * last.approach_mm)
                },
            );
        // A mesh's nodes may stand out of the sphere: then the plates carry it before they come to it.
        let over_two_plate_form = over_two_plate_form.filter(|x| x.is_finite());
        let energy = samples.last().map(|s| s.energy).unwrap_or_default();
        let mut warnings = settings.taken_as_given.clone();
        warnings.extend(settings.foot.and_then(|f| f.warning()));
        warnings.extend(transition.and_then(|t| t.warning()));
        warnings.extend(quasi.and_then(|q| q.warning()));
        if quasi.is_some() && energy.balance_error().abs() > 0.01 {
            warnings.push(format!(
                "the energy balance is off by {:.2} % of the plates' work: above 1 % the result is not to be trusted",
                100.0 * energy.balance_error()
            ));
        }
        if settings.loading.to_approach_mm.is_some_and(|to_mm| to_mm < settings.rocked_mm()) {
            warnings.push(format!(
                "the approach asked for ends while the plates still turn the grain, which takes {:.2} µm of it",
                1e3 * settings.rocked_mm()
            ));
        }
        if !press.finished() {
            warnings
                .push("the compression was interrupted: `grainrig compress --resume` goes on with it".into());
        }
        let rotation_deg = samples
            .last()
            .map_or(0.0, |s| s.rotation_rad.iter().map(|x| x * x).sum::<f64>().sqrt().to_degrees());
        let experiment = self.beside.iter().find_map(|o| {
            let (file, reading) = o.measured.clone()?;
            Some(ExperimentResult { file, reading, agreement: agreement(&curve, &o.points) })
        });
        let mut result = CompressResult {
            schema: 1,
            software: concat!("grainrig ", env!("CARGO_PKG_VERSION")).into(),
            settings: settings.clone(),
            finished: press.finished(),
            curve,
            delta_i_mm,
            deformation_mm: delta_i_mm
                .filter(|_| settings.rocking.is_some())
                .map(|d| d - settings.rocked_mm()),
            transition,
            hertz: fit,
            over_two_plate_form,
            elements: press.body().elements(),
            nodes: press.body().nodes(),
            steps: press.dynamics().steps,
            step_s: press.step_s(),
            added_mass: press.body().added_mass(),
            wall_s,
            energy: EnergyResult::of(&energy, quasi.is_some()),
            quasi_static: quasi,
            rotation_deg,
            overclosure_mm: press.overclosure_mm(),
            experiment,
            contacts: press.contacts().to_vec(),
            warnings,
            files: Vec::new(),
        };
        result.files = files::write(&self.folder, &self.mesh, press, &result, &self.stages(), &self.beside)?;
        let encode = |e: serde_json::Error| JobError::Encode(e.to_string());
        let mut value = to_json_value(&result).map_err(|e| JobError::Encode(e.to_string()))?;
        round(&mut value);
        write_whole(&self.folder, RESULT, &serde_json::to_vec_pretty(&value).map_err(encode)?)?;
        // What callers print is what the file says.
        serde_json::from_value(value).map_err(encode)
    }
}

/// The curves that a compression's folder keeps to be drawn beside its own.
fn kept_beside(folder: &Path) -> Result<Vec<OtherCurve>, JobError> {
    if !folder.join(BESIDE).exists() {
        return Ok(Vec::new());
    }
    let no = |reason: String| JobError::Resume { path: folder.into(), reason };
    let text = read_inside(folder, BESIDE, TEXT_LIMIT).map_err(|e| no(e.to_string()))?;
    serde_json::from_slice(&text).map_err(|e| no(format!("{BESIDE}: {e}")))
}

/// Keeps curves to be drawn beside a compression's own in its folder.
fn keep_beside(folder: &Path, curves: &[OtherCurve]) -> Result<(), JobError> {
    write_whole(folder, BESIDE, &to_json(&curves)?)?;
    Ok(())
}

/// Rounds every number to nine digits, which is more than any of them means.
fn round(value: &mut serde_json::Value) {
    use serde_json::{Number, Value};
    match value {
        Value::Number(n) if n.is_f64() => {
            let short = n.as_f64().and_then(|x| format!("{x:.8e}").parse().ok()).and_then(Number::from_f64);
            if let Some(short) = short {
                *n = short;
            }
        }
        Value::Array(all) => all.iter_mut().for_each(round),
        Value::Object(all) => all.values_mut().for_each(round),
        _ => {}
    }
}

fn press(mesh: &TetMesh, s: &CompressSettings) -> Result<Press, ContactError> {
    let press = Press::new(mesh, &s.material, s.middle_mm, s.gap_mm, s.friction, &s.loading)?;
    Ok(press.rocked(s.rocked_mm()))
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
