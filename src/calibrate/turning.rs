//! Whether the grain turned as the stage did: slips, lost steps, a wrong step size.
//!
//! *How much* is in the equations of [`super::fit`], the closing view above all. *Where* is told by the slices'
//! curvature: the outline's reach in three neighbouring directions gives the mean radius of curvature of the convex
//! slice between them, which is never negative and, for a grain with corners and facets, is alike or jumps from one
//! place to the next. With wrong angles nearly all of them are off. So a Cauchy likelihood of its steps, and of what
//! is negative, tells where the angles went wrong (Huber and Ronchetti, Robust Statistics, 2009, on why not squares).

use super::fit::{Fit, Priors, Sample, Spreads, fit};
use super::profile::Line;
use nalgebra::DMatrix;

/// A change of the angles by this many standard deviations is no accident …
const SURE_SIGMAS: f64 = 6.0;
/// … and one below this, radians (at the end of the turn), is none that matters.
const LEAST_RAD: f64 = 0.35 * std::f64::consts::PI / 180.0;
/// Changes beyond this are looked for on a grid, radians: the equations are linear.
const LARGE_RAD: f64 = 2.5 * std::f64::consts::PI / 180.0;
/// The grid's reach and pitch, degrees.
const GRID_DEG: (i32, f64) = (30, 1.5);
/// How many places are worked out in full.
const WORKED_OUT: usize = 4;
/// A place whose cost is no more than this above the best one's is as good.
const AS_GOOD: f64 = 40.0;
/// Most changes that are told in one session.
const MOST_CHANGES: usize = 3;
/// Directions closer than this are one, radians.
const SAME_RAD: f64 = 0.05;
/// Curvature's steps of this share of their median are ordinary, and what a negative curvature costs beside a step.
const ORDINARY: f64 = 0.5;
const NEGATIVE: f64 = 2.0;
/// Rounds of working a place out.
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
                let whole = (angles.iter().map(|a| a - angles[0])).fold(0.0, |m: f64, a| if a.abs() > m.abs() { a } else { m });
                angles.iter().map(|a| (a - angles[0]) / whole.abs().max(1e-9)).collect()
            }
        }
    }
}

/// A change that was found.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub change: Change,
    /// Radians ahead; for [`Change::Step`] at the farthest view.
    pub rad: f64,
    pub sigma_rad: f64,
    /// The places that are as good, for [`Change::From`].
    pub between: [usize; 2],
}

/// The changes, and the fit with the angles that they lead to.
pub(super) struct Turning {
    pub found: Vec<Found>,
    pub angles: Vec<f64>,
    pub fit: Fit,
}

/// Looks for changes until none is left; `first` is the fit at `angles`.
pub(super) fn look(views: &[Sample], angles: &[f64], priors: &Priors, first: Fit) -> Turning {
    let mut now = Turning { found: Vec::new(), angles: angles.to_vec(), fit: first };
    while now.found.len() < MOST_CHANGES {
        let Some(next) = one(views, priors, &now) else { break };
        now = next;
    }
    now
}

/// All changes that could be.
fn changes(n: usize) -> Vec<Change> {
    (1..n).map(Change::From).chain([Change::Step]).collect()
}

fn one(views: &[Sample], priors: &Priors, now: &Turning) -> Option<Turning> {
    let (fitted, angles) = (&now.fit, &now.angles);
    let sure = |(rad, sigma): (f64, f64)| rad.abs() > LEAST_RAD && rad.abs() > SURE_SIGMAS * sigma;
    let all: Vec<(Change, f64, f64)> = (changes(angles.len()).into_iter())
        .map(|c| {
            let (rad, sigma) = fitted.pattern(&c.pattern(angles));
            (c, rad, sigma)
        })
        .collect();
    if !all.iter().any(|a| sure((a.1, a.2))) {
        return None;
    }
    let moved = |change: Change, rad: f64| -> Vec<f64> {
        angles.iter().zip(change.pattern(angles)).map(|(a, p)| a + rad * p).collect()
    };
    let ordinary = ordinary_step(&curvatures(angles, &fitted.shape));
    let cost = |angles: &[f64], shape: &DMatrix<f64>| cost(&curvatures(angles, shape), ordinary);
    let large = all.iter().any(|a| a.1.abs() > LARGE_RAD && sure((a.1, a.2)));
    let mut tried: Vec<(f64, Change, f64)> = (all.iter())
        .map(|&(change, rad, _)| {
            let sizes: Vec<f64> = if large {
                (-GRID_DEG.0..=GRID_DEG.0).map(|k| (f64::from(k) * GRID_DEG.1).to_radians()).chain([rad]).collect()
            } else {
                vec![rad]
            };
            (sizes.into_iter())
                .map(|rad| (cost(&moved(change, rad), &fitted.shape), change, rad))
                .min_by(|a, b| a.0.total_cmp(&b.0))
                .unwrap_or((f64::INFINITY, change, rad))
        })
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let spread = |change: Change| -> [usize; 2] {
        let Change::From(best) = change else { return [0, 0] };
        let at = tried.iter().find(|t| t.1 == change).map_or(0.0, |t| t.0);
        let near = tried.iter().filter(|t| t.0 <= at + AS_GOOD);
        near.fold([best, best], |[a, b], t| match t.1 {
            Change::From(k) => [a.min(k), b.max(k)],
            Change::Step => [a, b],
        })
    };
    // The equations were written for angles that were wrong: write them again for each of the likeliest.
    let mut places: Vec<(Change, f64)> = tried.iter().take(WORKED_OUT).map(|t| (t.1, t.2)).collect();
    if let Some(step) = tried.iter().skip(WORKED_OUT).find(|t| t.1 == Change::Step) {
        places.push((Change::Step, step.2));
    }
    let worked = places.into_iter().filter_map(|(change, first)| {
        let pattern = change.pattern(angles);
        let mut rad = first;
        let mut fitted = work_out(views, &moved(change, rad), priors, &fitted.line, Spreads::SoughtFrom(fitted.hyper))?;
        for _ in 0..if large { 3 } else { 1 } {
            rad += fitted.pattern(&pattern).0;
            fitted = work_out(views, &moved(change, rad), priors, &fitted.line, Spreads::Known(fitted.hyper))?;
        }
        let (rest, sigma_rad) = fitted.pattern(&pattern);
        rad += rest;
        let angles = moved(change, rad);
        let cost = cost(&angles, &fitted.shape);
        Some((cost, change, rad, sigma_rad, angles))
    });
    let (_, change, rad, sigma_rad, angles) = worked.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let fit = work_out(views, &angles, priors, &fitted.line, Spreads::SoughtFrom(fitted.hyper))?;
    let mut found = now.found.clone();
    found.push(Found { change, rad, sigma_rad, between: spread(change) });
    Some(Turning { found, angles, fit })
}

fn work_out(views: &[Sample], angles: &[f64], priors: &Priors, line: &Line, spreads: Spreads) -> Option<Fit> {
    fit(views, angles, priors, line, spreads, ROUNDS)
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
    let mut merged: Vec<(f64, Vec<f64>)> = Vec::new();
    let join = |into: &mut (f64, Vec<f64>), t: f64, h: &[f64]| {
        into.0 = 0.5 * (into.0 + t);
        into.1.iter_mut().zip(h).for_each(|(a, b)| *a = 0.5 * (*a + b));
    };
    for (t, i) in order {
        let h: Vec<f64> = shape.row(i).iter().copied().collect();
        match merged.last_mut() {
            Some(last) if t - last.0 < SAME_RAD => join(last, t, &h),
            _ => merged.push((t, h)),
        }
    }
    if merged.len() > 3 && merged[0].0 + TAU - merged[merged.len() - 1].0 < SAME_RAD
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
    (0..n).flat_map(move |i| {
        curvatures[i].iter().zip(&curvatures[(i + 1) % n]).map(|(a, b)| b - a)
    })
}

fn ordinary_step(curvatures: &[Vec<f64>]) -> f64 {
    let mut all: Vec<f64> = steps(curvatures).map(f64::abs).collect();
    let middle = all.len() / 2;
    if all.is_empty() { 1.0 } else { ORDINARY * all.select_nth_unstable_by(middle, f64::total_cmp).1.max(1e-6) }
}

fn cost(curvatures: &[Vec<f64>], ordinary: f64) -> f64 {
    let jumps: f64 = steps(curvatures).map(|d| 0.5 * (d / ordinary).powi(2).ln_1p()).sum();
    let negative: f64 = curvatures.iter().flatten().map(|r| (-r).max(0.0)).sum();
    jumps + NEGATIVE * negative / ordinary
}
