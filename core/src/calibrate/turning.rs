//! Change detection in the angles: slips, lost steps, a wrong step size.
//!
//! *How much* is measured by views that see the same outline (see [`super::closing`]). *Where* is located by the slices'
//! curvature: the outline's reach in three neighbouring directions gives the mean radius of curvature of the convex
//! slice between them, which is never negative and, for a grain with corners and facets, is alike or jumps from one
//! direction to the next. With wrong angles nearly all of them are off. So a Cauchy likelihood of its steps, and of what
//! is negative, locates where the angles went wrong (Huber and Ronchetti, Robust Statistics, 2009, on why not squares).

use super::closing::{Closing, closings, near_closings};
use super::fit::{Fit, MODEST, Priors, Sample, Spreads, Start, fit};
use super::profile::AxisLine;
use nalgebra::DMatrix;

/// The evidence that a change must have: what the curvatures' likelihood gains for every height, weighed against what
/// closing views gain or lose (natural logarithms). Where nothing was wrong, a change of [`LEAST_RAD`] had none in all
/// but one of 200 rigs as they stand in the laboratory, which had 6.1; where a degree, a step or a hundredth of each step
/// was, most of 72 had 7 to 90 and three less than 6 (`tests/calibration`).
const LEAST_EVIDENCE: f64 = 6.5;
const GAIN_WEIGHT: f64 = 3.0;
/// The closing views' standard deviations are too small by this much, and by this many radians.
const CLOSING_MODEST: f64 = 1.5;
const CLOSING_RAD: f64 = 0.1 * RAD_PER_DEG;
/// What a change that closing views measure may be off by, as a share of it: slopes between views are not known.
const CLOSING_SHARE: f64 = 0.12;
/// The change must matter, radians at the end of the turn.
const LEAST_RAD: f64 = 0.62 * RAD_PER_DEG;
/// And so many pixels of the outline at its mean reach: blur, pixels and a file's blocks move the outline of a small grain by as much in
/// several views alike, which nothing tells from a turn.
const LEAST_PX: f64 = 0.6;
const RAD_PER_DEG: f64 = std::f64::consts::PI / 180.0;
/// Grids on which changes are tried: pitch and count to either side.
const GRIDS: [(f64, i32); 2] = [(0.1 * RAD_PER_DEG, 25), (1.5 * RAD_PER_DEG, 20)];
const FINE: (f64, i32) = (0.02 * RAD_PER_DEG, 25);
/// Beyond this closing views cannot measure how much, radians; then the curvatures must gain more.
const LINEAR_RAD: f64 = 2.5 * RAD_PER_DEG;
const LARGE_GAIN: f64 = 5.0;
/// How well the curvature alone measures a change, radians (standard deviation), where it gains so much by it.
const CURVATURE_RAD: f64 = 0.15 * RAD_PER_DEG;
const CURVATURE_GAIN: f64 = 3.0;
/// How far every step of a stage may be off, as a share (standard deviation): a belt's or a worm's pitch, a gear's teeth.
pub(super) const STEP_SIZE: f64 = 0.006;
/// From here on it is asked of the views that see the same outline once a change is mended how much it is: rounds, the share of
/// [`CLOSING_RAD`] that is near enough, how far they may differ, squared (1 is expected), and how many standard deviations a
/// change must be.
const SETTLED_RAD: f64 = 2.0 * RAD_PER_DEG;
const SETTLING: usize = 14;
const SETTLED_SHARE: f64 = 0.5;
const AGREE: f64 = 6.0;
const SURE_SIGMAS: f64 = 3.5;
const SURE_STEP_SIGMAS: f64 = 12.0;
/// What they may be off by, as a share of the angle between their directions.
const GAP_SHARE: f64 = 0.1;
/// How many candidates are worked out in full.
const WORKED_OUT: usize = 4;
/// A candidate whose evidence is no more than this below the best one's is as good.
const AS_GOOD: f64 = 2.0;
/// What speaks for a slip must be this much more than what speaks for a step size that is a little wrong, or it may be
/// either: of 120 random rigs with a wrong step size five looked like a slip, three by 3.1 at most, two by 6.5, and of 16
/// with a slip none by less than 4.3. As far as whole steps of the motor it is not by chance.
const SURELY_SLIPPED: f64 = 3.5;
const SURELY_LOST: f64 = 1.0;
/// And the closing views by themselves must give so much evidence for it, or the curvatures gain as much as for a large change.
const SURELY_CLOSES: f64 = 4.0;
/// What closing views speak against by so much has not happened, whatever else speaks for it: where views are few, the
/// curvatures like a turn that is wrong by a whole view best of all.
const REFUTED: f64 = 4.0;
/// A slip is whole steps of the motor if it is that near: standard deviations, radians at least, a share of a step at most.
const WHOLE_SIGMAS: f64 = 3.2;
const WHOLE_RAD: f64 = 0.04 * RAD_PER_DEG;
const WHOLE_SHARE: f64 = 0.25;
/// Most changes that are detected in one session.
const MOST_CHANGES: usize = 3;
/// Directions closer than this are one, radians, or closer than this share of the usual angle between views: between directions
/// at half that angle the curvature is four times less sure, which would speak against every change that puts them there.
const SAME_RAD: f64 = 0.05;
const SAME_SHARE: f64 = 0.55;
/// Curvature's steps of this share of their median are ordinary, and what a negative curvature costs beside a step.
const ORDINARY: f64 = 0.5;
const NEGATIVE: f64 = 2.0;
/// Most directions that the evidence is stated for: those of half a turn's usual views. Between more the curvature is less sure.
const MOST_DIRECTIONS: f64 = 50.0;
/// Rounds of working a candidate out.
const ROUNDS: usize = 2;

/// A change of all later angles, or of all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Change {
    /// From this view on.
    From(usize),
    /// Of every step.
    Step,
}

impl Change {
    /// The angle errors that one radian (at the last view) of it makes.
    fn pattern(self, angles: &[f64]) -> Vec<f64> {
        let n = angles.len();
        match self {
            Self::From(view) => (0..n).map(|i| f64::from(i >= view)).collect(),
            Self::Step => {
                let span = Self::span(angles);
                angles.iter().map(|a| (a - angles[0]) / span).collect()
            }
        }
    }

    /// How far the grain turns in all, radians.
    fn span(angles: &[f64]) -> f64 {
        angles.iter().map(|a| (a - angles[0]).abs()).fold(1e-9, f64::max)
    }
}

/// A change that was detected.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DetectedChange {
    pub change: Change,
    /// Radians ahead; for [`Change::Step`] at the farthest view.
    pub rad: f64,
    pub sigma_rad: f64,
    /// First and last view that are as good, for [`Change::From`].
    pub between: [usize; 2],
    /// How many whole steps of the motor it is behind; 0 where it is not.
    pub lost_steps: u32,
    /// Whether every step being a little wrong explains it nearly as well.
    pub or_step: bool,
}

/// The changes, and the fit with the angles that they lead to.
pub(super) struct Turning {
    pub found: Vec<DetectedChange>,
    pub angles: Vec<f64>,
    /// What an angle may be off by because one of two changes happened and nothing shows which, radians.
    pub unsure_rad: Vec<f64>,
    pub fit: Fit,
}

impl Turning {
    /// The angles as the stage reports them.
    pub(super) fn nominal(angles: &[f64], fit: Fit) -> Self {
        Self { found: Vec::new(), angles: angles.to_vec(), unsure_rad: vec![0.0; angles.len()], fit }
    }

    /// What every step may be off by beyond what was found, as a share of it (standard deviation): what was known
    /// beforehand, and what the closing views measure. It is not corrected, so that what they measure counts as well.
    pub(super) fn step_sigma(&self, views: &[Sample]) -> f64 {
        let sigma_rad = MODEST * self.found.iter().map(|f| f.sigma_rad.powi(2)).sum::<f64>().sqrt();
        let span = Change::span(&self.angles);
        if self.found.iter().any(|f| f.change == Change::Step) {
            return sigma_rad / span;
        }
        let pattern = Change::Step.pattern(&self.angles);
        let mut weights = (STEP_SIZE * span).powi(-2);
        let mut sum = 0.0;
        for c in closings(views, &self.angles, &self.fit.line) {
            let share = pattern[c.views[1]] - pattern[c.views[0]];
            let weight = 1.0 / (variance(&c, 0.0) + sigma_rad.powi(2));
            weights += weight * share * share;
            sum += weight * share * c.rad;
        }
        (sum / weights).hypot(weights.sqrt().recip()) / span
    }
}

/// Looks for changes until none is left; `first` is the fit at `angles`.
pub(super) fn look(views: &[Sample], angles: &[f64], priors: &Priors, first: Fit) -> Turning {
    let mut now = Turning::nominal(angles, first);
    // After a large change the angles are not known well enough to detect small ones.
    while now.found.len() < MOST_CHANGES && !now.found.iter().any(|f| f.or_step || f.rad.abs() > SETTLED_RAD)
    {
        let Some(next) = one(views, priors, &now) else { break };
        now = next;
    }
    now
}

/// A change with the cost of the curvatures that it leads to.
#[derive(Debug, Clone, Copy)]
struct Tried {
    change: Change,
    rad: f64,
    cost: f64,
    /// How much it is, with its standard deviation, where views that see the same outline once it is corrected measured it.
    measured: Option<[f64; 2]>,
}

/// What changes are held against.
struct Search<'a> {
    angles: &'a [f64],
    /// Heights whose curvatures the cost is summed over.
    heights: f64,
    /// How many directions the cost is stated for.
    directions: f64,
    /// An ordinary step of the curvature, pixels.
    ordinary: f64,
    closings: Vec<Closing>,
    /// Cost of the curvatures, and how unlikely the closing views are, if nothing changed.
    unchanged: f64,
    nothing: f64,
}

impl<'a> Search<'a> {
    fn new(views: &[Sample], now: &'a Turning) -> Self {
        let before = curvatures(&now.angles, &now.fit.shape);
        let ordinary = ordinary_step(&before);
        let mut search = Self {
            angles: &now.angles,
            heights: now.fit.shape.ncols() as f64,
            directions: (before.len() as f64).min(MOST_DIRECTIONS),
            ordinary,
            closings: closings(views, &now.angles, &now.fit.line),
            unchanged: cost(&before, ordinary),
            nothing: 0.0,
        };
        search.nothing = search.amiss(Change::Step, 0.0);
        search
    }

    fn moved(&self, change: Change, rad: f64) -> Vec<f64> {
        self.angles.iter().zip(change.pattern(self.angles)).map(|(a, p)| a + rad * p).collect()
    }

    fn tried(&self, change: Change, rad: f64, shape: &DMatrix<f64>) -> Tried {
        Tried {
            change,
            rad,
            measured: None,
            cost: cost(&curvatures(&self.moved(change, rad), shape), self.ordinary),
        }
    }

    /// What a change must make of a pair of closing views: its own share of them, radians for each radian.
    fn shares(&self, change: Change) -> impl Iterator<Item = (&Closing, f64)> {
        let pattern = change.pattern(self.angles);
        self.closings.iter().map(move |c| (c, pattern[c.views[1]] - pattern[c.views[0]]))
    }

    /// How unlikely it makes what the closing views measure: minus the logarithm of the likelihood.
    fn amiss(&self, change: Change, rad: f64) -> f64 {
        let large = rad.abs() > LINEAR_RAD;
        // How much a large change makes of a pair is not known, but not that it brings the same outline back.
        let rad = rad.clamp(-LINEAR_RAD, LINEAR_RAD);
        let one = |(c, share): (&Closing, f64)| {
            let (expected, variance) = (rad * share, variance(c, rad * share));
            let off = if large { (expected.abs() - c.rad.abs()).max(0.0) } else { c.rad - expected };
            0.5 * (off.powi(2) / variance + variance.ln())
        };
        self.shares(change).map(one).sum()
    }

    /// What the curvatures' likelihood gains by a change, natural logarithms for each height.
    fn gain(&self, t: &Tried) -> f64 {
        self.directions * (self.unchanged - t.cost) / self.heights
    }

    /// What speaks for a change, natural logarithms.
    fn evidence(&self, t: &Tried) -> f64 {
        let gain = self.gain(t);
        let closes = self.closes(t);
        let refuted =
            t.rad.abs() > LINEAR_RAD && self.shares(t.change).any(|(c, share)| c.refutes(t.rad * share));
        if refuted || closes < -REFUTED || (t.rad.abs() > LINEAR_RAD && gain < LARGE_GAIN) {
            return 0.0;
        }
        GAIN_WEIGHT * gain + closes
    }

    /// Evidence of the closing views for a change, natural logarithms.
    fn closes(&self, t: &Tried) -> f64 {
        self.nothing - self.amiss(t.change, t.rad)
    }

    /// A large change as measured by the views that see the same outline once it is corrected. None where they do not agree
    /// that it happened; as it is where there are none at all.
    fn settled(&self, t: Tried, views: &[Sample], line: &AxisLine) -> Option<Tried> {
        if t.rad.abs() < SETTLED_RAD {
            return Some(t);
        }
        let pattern = t.change.pattern(self.angles);
        let (mut rad, mut before, mut part) = (t.rad, 0.0_f64, 1.0);
        for _ in 0..SETTLING {
            let (mut weights, mut sum, mut squares, mut met) = (0.0, 0.0, 0.0, 0);
            for c in near_closings(views, &self.moved(t.change, rad), line) {
                let share = pattern[c.views[1]] - pattern[c.views[0]];
                let weight = 1.0 / (variance(&c, 0.0) + (GAP_SHARE * c.gap_rad).powi(2));
                weights += weight * share * share;
                sum += weight * share * c.rad;
                squares += weight * c.rad * c.rad;
                met += 1;
            }
            if weights == 0.0 {
                // Where others see the same outline as it is, they would have to when it is mended.
                let measured = Some([rad, LINEAR_RAD]);
                return self.closings.is_empty().then_some(Tried { rad, measured, ..t });
            }
            let more = sum / weights;
            // Midway between two directions now the one, now the other is nearer, and each is off the other way.
            if more * before < 0.0 && more.abs().max(before.abs()) < LINEAR_RAD {
                part *= 0.5;
            }
            before = more;
            if part * more.abs() < SETTLED_SHARE * CLOSING_RAD {
                let sigma = weights.sqrt().recip().hypot(more);
                // A gear that was noted wrong is rarer than a grain that slips.
                let sigmas = if t.change == Change::Step { SURE_STEP_SIGMAS } else { SURE_SIGMAS };
                let sure = squares < AGREE * f64::from(met) && rad.abs() > LEAST_RAD.max(sigmas * sigma);
                return sure.then_some(Tried { rad, measured: Some([rad, sigma]), ..t });
            }
            rad += part * more.clamp(-LINEAR_RAD, LINEAR_RAD);
        }
        None
    }

    /// How much, with its standard deviation: what the curvature gives, what the closing views measure, and how far steps are
    /// off at most.
    fn how_much(&self, candidate: &Tried) -> [f64; 2] {
        if let Some(measured) = candidate.measured {
            return measured;
        }
        let certainty = (self.gain(candidate) / CURVATURE_GAIN).clamp(0.1, 1.0);
        let mut weights = (CURVATURE_RAD / certainty).powi(-2);
        let mut sum = weights * candidate.rad;
        if candidate.change == Change::Step && candidate.rad.abs() <= LINEAR_RAD {
            weights += (STEP_SIZE * Change::span(self.angles)).powi(-2);
        }
        if candidate.rad.abs() <= LINEAR_RAD {
            for (c, share) in self.shares(candidate.change) {
                let weight = 1.0 / variance(c, candidate.rad * share);
                weights += weight * share * share;
                sum += weight * share * c.rad;
            }
        }
        [sum / weights, weights.sqrt().recip()]
    }
}

/// Variance of a pair of closing views' measurement of a change of so much, rad².
fn variance(c: &Closing, expected_rad: f64) -> f64 {
    (CLOSING_MODEST * c.sigma_rad).powi(2) + CLOSING_RAD.powi(2) + (CLOSING_SHARE * expected_rad).powi(2)
}

fn one(views: &[Sample], priors: &Priors, now: &Turning) -> Option<Turning> {
    use rayon::prelude::*;
    let search = Search::new(views, now);
    let least_rad = LEAST_RAD.max(LEAST_PX / now.fit.mean_reach_px.max(1.0));
    let n = now.angles.len();
    let likeliest = |change: Change, (pitch, count): (f64, i32)| {
        (-count..=count)
            .map(|k| search.tried(change, f64::from(k) * pitch, &now.fit.shape))
            .map(|t| (search.evidence(&t), t))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    };
    let all: Vec<Change> = (1..n).map(Change::From).chain([Change::Step]).collect();
    let mut tried: Vec<(f64, Tried)> = (all.into_par_iter())
        .flat_map_iter(|change| GRIDS.into_iter().filter_map(move |grid| likeliest(change, grid)))
        .collect();
    tried.sort_by(|a, b| b.0.total_cmp(&a.0));
    // Every step a little wrong leaves no mark at one view: it is always among the likeliest.
    let step = tried.iter().find(|t| t.1.change == Change::Step).map(|t| t.1);
    tried.retain(|t| t.1.rad.abs() > least_rad && t.0 > LEAST_EVIDENCE);
    let best = tried.first()?.0;
    // The equations were written for angles that were wrong: write them again for each of the likeliest.
    let mut candidates: Vec<Tried> = tried.iter().take(WORKED_OUT).map(|t| t.1).collect();
    candidates.extend(step);
    let worked = candidates.into_iter().filter_map(|t| {
        let t = search.settled(t, views, &now.fit.line)?;
        let angles = search.moved(t.change, t.rad);
        let fitted =
            fit(views, &angles, priors, Start::Fit(&now.fit), Spreads::Known(now.fit.hyper), ROUNDS)?;
        let (pitch, count) = if t.measured.is_some() { (0.0, 0) } else { FINE };
        let (score, fine) = (-count..=count)
            .map(|k| search.tried(t.change, t.rad + f64::from(k) * pitch, &fitted.shape))
            .map(|fine| Tried { measured: t.measured, ..fine })
            .map(|t| (search.evidence(&t), t))
            .max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((score, fine, fitted))
    });
    let mut worked: Vec<(f64, Tried, Fit)> = worked.collect();
    worked.sort_by(|a, b| b.0.total_cmp(&a.0));
    let stepped = worked.iter().find(|w| w.1.change == Change::Step).map(|w| (w.0, w.1));
    let sure = |(score, candidate, _): &(f64, Tried, Fit)| {
        let [rad, sigma_rad] = search.how_much(candidate);
        *score > LEAST_EVIDENCE && rad.abs() > least_rad.max(SURE_SIGMAS * sigma_rad)
    };
    let (score, candidate, fitted) = worked.into_iter().find(sure)?;
    let [rad, sigma_rad] = search.how_much(&candidate);
    let mut angles = search.moved(candidate.change, rad);
    let lost_steps = lost_steps(&candidate, [rad, sigma_rad], &search, priors);
    let surely = if lost_steps > 0 { SURELY_LOST } else { SURELY_SLIPPED };
    let supported = search.gain(&candidate) > LARGE_GAIN || search.closes(&candidate) > SURELY_CLOSES;
    let stepped =
        stepped.filter(|s| candidate.change != Change::Step && (s.0 > score - surely || !supported));
    let mut unsure_rad = vec![0.0; angles.len()];
    if let Some((_, stepped)) = stepped {
        // In the middle between the two, and as unsure as they are apart.
        let [rad, _] = search.how_much(&stepped);
        for ((a, other), unsure) in
            angles.iter_mut().zip(search.moved(Change::Step, rad)).zip(&mut unsure_rad)
        {
            *unsure = 0.5 * (*a - other).abs();
            *a = 0.5 * (*a + other);
        }
    }
    let fit = fit(views, &angles, priors, Start::Fit(&fitted), Spreads::SoughtFrom(fitted.hyper), ROUNDS)?;
    let mut found = now.found.clone();
    found.push(DetectedChange {
        change: candidate.change,
        rad,
        sigma_rad,
        between: between(&tried, &candidate, best),
        lost_steps,
        or_step: stepped.is_some(),
    });
    Some(Turning { found, angles, unsure_rad, fit })
}

/// How many whole steps of the motor were lost; 0 where that is not what happened.
fn lost_steps(candidate: &Tried, [rad, sigma_rad]: [f64; 2], search: &Search, priors: &Priors) -> u32 {
    let travel = search.angles[search.angles.len() - 1] - search.angles[0];
    let step = priors.full_step_rad;
    let steps = (rad.abs() / step).round();
    let off = (rad.abs() - steps * step).abs();
    let near = (WHOLE_SIGMAS * sigma_rad).max(WHOLE_RAD).min(WHOLE_SHARE * step);
    let lost = candidate.change != Change::Step && rad * travel < 0.0 && steps >= 1.0 && off < near;
    if lost { steps as u32 } else { 0 }
}

/// The first and last view that are as good as the one chosen.
fn between(tried: &[(f64, Tried)], chosen: &Tried, best: f64) -> [usize; 2] {
    let Change::From(candidate) = chosen.change else { return [0, 0] };
    let near = tried.iter().filter(|(evidence, t)| *evidence > best - AS_GOOD && t.rad * chosen.rad > 0.0);
    near.fold([candidate, candidate], |[a, b], (_, t)| match t.change {
        Change::From(k) => [a.min(k), b.max(k)],
        Change::Step => [a, b],
    })
}

/// Mean radius of curvature of the convex slices between neighbouring directions, pixels: `[direction, height]`, in
/// the order of the directions once round.
///
/// h = ∫ρ(s) sin(t − s) ds + a cos t + b sin t: with three directions the free terms cancel.
fn curvatures(angles: &[f64], shape: &DMatrix<f64>) -> Vec<Vec<f64>> {
    use std::f64::consts::{PI, TAU};
    let t = angles.iter().map(|a| a + PI).chain(angles.iter().copied());
    let mut order: Vec<(f64, usize)> = t.enumerate().map(|(i, t)| (t.rem_euclid(TAU), i)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    let m = shape.ncols();
    let mut between: Vec<f64> = angles.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let middle = between.len() / 2;
    let usual =
        if between.is_empty() { 0.0 } else { *between.select_nth_unstable_by(middle, f64::total_cmp).1 };
    let same = SAME_RAD.max(SAME_SHARE * usual);
    let mut merged: Vec<(f64, Vec<f64>)> = Vec::new();
    let join = |into: &mut (f64, Vec<f64>), t: f64, h: &[f64]| {
        into.0 = 0.5 * (into.0 + t);
        into.1.iter_mut().zip(h).for_each(|(a, b)| *a = 0.5 * (*a + b));
    };
    for (t, i) in order {
        let h: Vec<f64> = shape.row(i).iter().copied().collect();
        match merged.last_mut() {
            Some(last) if t - last.0 < same => join(last, t, &h),
            _ => merged.push((t, h)),
        }
    }
    if merged.len() > 3
        && merged[0].0 + TAU - merged[merged.len() - 1].0 < same
        && let Some((t, h)) = merged.pop()
    {
        join(&mut merged[0], t - TAU, &h);
    }
    let n = merged.len();
    (0..n)
        .map(|i| {
            let (before, at, after) = (&merged[(i + n - 1) % n], &merged[i], &merged[(i + 1) % n]);
            let back = (at.0 - before.0).rem_euclid(TAU);
            let ahead = (after.0 - at.0).rem_euclid(TAU);
            let (a, b, c) = (ahead.sin(), back.sin(), (ahead + back).sin());
            let weight = 4.0 * (0.5 * ahead).sin() * (0.5 * back).sin() * (0.5 * (ahead + back)).sin();
            (0..m).map(|k| (before.1[k] * a + after.1[k] * b - at.1[k] * c) / weight).collect()
        })
        .collect()
}

/// Steps of the curvature from each direction to the next.
fn steps(curvatures: &[Vec<f64>]) -> impl Iterator<Item = f64> + '_ {
    let n = curvatures.len();
    (0..n).flat_map(move |i| curvatures[i].iter().zip(&curvatures[(i + 1) % n]).map(|(a, b)| b - a))
}

fn ordinary_step(curvatures: &[Vec<f64>]) -> f64 {
    let mut all: Vec<f64> = steps(curvatures).map(f64::abs).collect();
    let middle = all.len() / 2;
    if all.is_empty() {
        1.0
    } else {
        ORDINARY * all.select_nth_unstable_by(middle, f64::total_cmp).1.max(1e-6)
    }
}

/// What a direction costs in the mean, summed over the heights: minus a logarithm of the likelihood.
fn cost(curvatures: &[Vec<f64>], ordinary: f64) -> f64 {
    let jumps: f64 = steps(curvatures).map(|d| 0.5 * (d / ordinary).powi(2).ln_1p()).sum();
    let negative: f64 = curvatures.iter().flatten().map(|r| (-r).max(0.0)).sum();
    // A mean, however many directions have been joined.
    (jumps + NEGATIVE * negative / ordinary) / curvatures.len() as f64
}
