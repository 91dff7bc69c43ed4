//! The cases of an ensemble that are computed by finite elements, a core each, and what is kept of them.

use super::JobError;
use crate::jobs::compressing::{Alone, CompressInput, CompressSettings, Placing, alone};
use crate::jobs::{Context, FootBy};
use crate::session::{read_inside, to_json, write_whole};
use grainrig_core::contact::{CurvePoint, Drawn, transition};
use grainrig_core::geometry::TriangleMesh;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

/// Longest case that is read back, bytes.
const LIMIT: u64 = 64 << 20;

/// A case as it is computed: the whole file says that it was.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Case {
    /// Which of the surfaces.
    pub surface: usize,
    /// Coulomb's friction.
    pub friction: f64,
    /// Young's modulus, MPa.
    pub young_mpa: f64,
    /// How it was laid, about x, then y, then z, degrees.
    pub rotate_deg: [f64; 3],
    /// How far the plates came while they turned it, mm.
    pub rocking_mm: f64,
    /// How far they then sank in, as the shape says, mm.
    pub guess_mm: f64,
    /// The same as it was computed, mm; none where it failed.
    pub computed_mm: Option<f64>,
    /// Why it failed.
    pub failed: Option<String>,
    /// Tetrahedra.
    pub elements: usize,
    /// Force against the approach of the plates.
    pub curve: Vec<CurvePoint>,
    /// Computing time, s.
    pub wall_s: f64,
}

impl Case {
    /// As it is asked for.
    pub(super) fn new(drawn: &Drawn, guess_mm: f64) -> Self {
        let (x, y, z) = drawn.laid.euler_angles();
        Self {
            surface: drawn.surface,
            friction: drawn.friction,
            young_mpa: drawn.young_mpa,
            rotate_deg: [x, y, z].map(f64::to_degrees),
            rocking_mm: drawn.approach_mm,
            guess_mm,
            computed_mm: None,
            failed: None,
            elements: 0,
            curve: Vec::new(),
            wall_s: 0.0,
        }
    }

    /// `δ_i` as it was computed, mm.
    pub(super) fn delta_i_mm(&self) -> Option<f64> {
        self.computed_mm.map(|mm| self.rocking_mm + mm)
    }

    /// How far the plates had come when the force was passed for the last time, without what turned the grain, mm.
    pub(super) fn sunk_mm(&self, force_n: f64) -> Option<f64> {
        transition(&self.curve, force_n).map(|t| t.delta_i_mm - self.rocking_mm).filter(|mm| *mm > 0.0)
    }

    /// Whether it was computed from the same.
    fn is_of(&self, asked: &Self) -> bool {
        let figures = |c: &Self| [&c.rotate_deg[..], &[c.friction, c.young_mpa, c.rocking_mm]].concat();
        let pairs = figures(self).into_iter().zip(figures(asked));
        self.surface == asked.surface
            && pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-9 * (1.0 + b.abs()))
    }
}

fn name(number: usize) -> String {
    format!("case-{number:03}.json")
}

/// What all cases have in common.
pub(super) struct Common<'a> {
    pub surfaces: &'a [TriangleMesh],
    pub placing: &'a Placing,
    pub settings: &'a CompressSettings,
    pub folder: &'a Path,
}

impl Common<'_> {
    /// Computes what is not there yet, on every core one, and keeps each as it ends; all of them, or none where somebody stopped it.
    ///
    /// # Errors
    /// [`JobError`] where the disk fails. A case that can't be computed says so itself.
    pub(super) fn computed(
        &self,
        asked: Vec<Case>,
        context: &Context,
    ) -> Result<Option<Vec<Case>>, JobError> {
        let mut cases: Vec<(Case, bool)> = (asked.into_iter().enumerate())
            .map(|(k, case)| match self.kept(k + 1, &case) {
                Some(kept) => (kept, true),
                None => (case, false),
            })
            .collect();
        let open: Vec<usize> = (0..cases.len()).filter(|k| !cases[*k].1).collect();
        let next = AtomicUsize::new(0);
        let (news, told) = mpsc::channel();
        let workers = std::thread::available_parallelism().map_or(1, usize::from).min(open.len());
        let asked: Vec<Case> = cases.iter().map(|(case, _)| case.clone()).collect();
        let mut outcome = Ok(());
        std::thread::scope(|scope| {
            for _ in 0..workers {
                let (news, next, open, asked) = (news.clone(), &next, &open, &asked);
                scope.spawn(move || {
                    while let Some(&k) = open.get(next.fetch_add(1, Ordering::Relaxed)) {
                        let done = |share| drop(news.send((k, News::Done(share))));
                        let ended = self.case(&asked[k], context, &done);
                        let Some(case) = ended else { return };
                        drop(news.send((k, News::Ended(Box::new(case)))));
                    }
                });
            }
            // The workers have the others: it ends with the last of them.
            drop(news);
            let mut done: Vec<f64> =
                cases.iter().map(|(_, is_there)| f64::from(u8::from(*is_there))).collect();
            let tell = |done: &[f64]| {
                let ended = done.iter().filter(|share| **share >= 1.0).count();
                let stage = format!("{ended} of {} cases computed", done.len());
                context.working(&stage, done.iter().sum::<f64>() / done.len() as f64);
            };
            tell(&done);
            for (k, what) in told {
                match what {
                    // The last sample is not the end.
                    News::Done(share) => done[k] = share.min(0.999),
                    News::Ended(case) => {
                        done[k] = 1.0;
                        if let Err(e) = self.keep(k + 1, &case) {
                            context.stop.store(true, Ordering::Relaxed);
                            outcome = Err(e);
                        }
                        cases[k] = (*case, true);
                    }
                }
                tell(&done);
            }
        });
        outcome?;
        let all = cases.iter().all(|(_, is_there)| *is_there);
        Ok(all.then(|| cases.into_iter().map(|(case, _)| case).collect()))
    }

    /// Computes one on this thread alone; none where somebody stopped it.
    fn case(&self, asked: &Case, context: &Context, done: &(dyn Fn(f64) + Sync)) -> Option<Case> {
        let start = Instant::now();
        let mut case = asked.clone();
        match self.pressed(asked, context, done) {
            Ok(None) => return None,
            Ok(Some(alone)) => {
                case.elements = alone.elements;
                case.rocking_mm = alone.rocked_mm;
                case.curve = alone.curve;
                case.computed_mm = case.sunk_mm(self.settings.transition_n);
                if case.computed_mm.is_none() {
                    case.failed = Some(format!("the force does not pass {} N", self.settings.transition_n));
                }
            }
            Err(e) => case.failed = Some(e.to_string()),
        }
        case.wall_s = start.elapsed().as_secs_f64();
        Some(case)
    }

    fn pressed(
        &self,
        asked: &Case,
        context: &Context,
        done: &(dyn Fn(f64) + Sync),
    ) -> Result<Option<Alone>, JobError> {
        let surface = self.surfaces[asked.surface].clone();
        // Its foot is closed already.
        let input = CompressInput::Surface { surface, name: String::new(), hidden_mm: None };
        let placing =
            Placing { rotate_deg: Some(asked.rotate_deg), rest: None, foot: FootBy::Flat, ..*self.placing };
        let mut settings = self.settings.clone();
        settings.friction = asked.friction;
        settings.material.young_mpa = asked.young_mpa;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|e| JobError::Content(format!("no thread can be started: {e}")))?;
        pool.install(|| alone(&input, &placing, settings, &context.stop, done))
    }

    fn kept(&self, number: usize, asked: &Case) -> Option<Case> {
        let text = read_inside(self.folder, &name(number), LIMIT).ok()?;
        serde_json::from_slice(&text).ok().filter(|case: &Case| case.is_of(asked))
    }

    fn keep(&self, number: usize, case: &Case) -> Result<(), JobError> {
        write_whole(self.folder, &name(number), &to_json(case)?)?;
        Ok(())
    }
}

enum News {
    Done(f64),
    Ended(Box<Case>),
}
