//! Rim rays, which touch the grain: whether two hulls together still fill a silhouette up to its outline.
//!
//! The ray through a point on an outline touches the grain, so some point on it belongs to every hull of the grain.
//! Where two hulls are put together wrongly, all of the ray lies outside of one or the other: what is missing at the
//! best point of the ray is how far the silhouette is not filled there.

use super::fit::Term;
use super::view::PoseView;
use super::{Motion, RegisterError, field};
use crate::geometry::{Aabb, ImplicitBody, Point, Vector};
use crate::hull::{HullError, VisualHull};
use rayon::prelude::*;

/// Rays of one view.
const PER_VIEW: usize = 44;
/// Points looked at along the whole ray, and kept along the part of it that matters.
const ALONG: usize = 64;
const KEPT: usize = 16;
/// The part that matters: where the own hull is no farther than this share of its size.
const NEAR: f64 = 0.03;
/// Outlines are used this far above a view's cut, pixels.
const ABOVE_CUT_PX: f64 = 1.0;

/// The part of a ray that is near the own hull, with the own hull's values (mm).
#[derive(Debug, Clone)]
pub(super) struct Rim {
    /// Number of the view.
    pub view: usize,
    first: Point,
    step: Vector,
    own: [f64; KEPT],
    /// What is missing already without any other hull, mm.
    pub lacks_mm: f64,
    /// Pixels per mm there.
    pub px_per_mm: f64,
}

/// What is missing on a ray.
struct Gap {
    /// The least, along the ray, of the greater of both values, mm.
    value: f64,
    point: Point,
    /// How much of a change of the other hull's value changes this one.
    share: f64,
}

impl Rim {
    fn at(&self, k: f64) -> Point {
        self.first + self.step * k
    }

    /// What is missing where the other hull has these values.
    fn gap(&self, other: impl Fn(&Point) -> f64) -> Gap {
        let values: [f64; KEPT] = std::array::from_fn(|k| other(&self.at(k as f64)));
        let mut best = (f64::INFINITY, 0.0, 0.0);
        for k in 0..KEPT {
            let off = values[k] - self.own[k];
            if values[k].max(self.own[k]) < best.0 {
                best = (values[k].max(self.own[k]), k as f64, if off > 0.0 { 1.0 } else { 0.0 });
            }
            if k + 1 < KEPT && (off < 0.0) != (values[k + 1] - self.own[k + 1] < 0.0) {
                let (rise, others) = (self.own[k + 1] - self.own[k], values[k + 1] - values[k]);
                let part = off / (rise - others);
                let value = self.own[k] + part * rise;
                // Where one falls as the other rises, the least greater value moves with both, by their slopes.
                if value < best.0 && rise * others < 0.0 {
                    best = (value, k as f64 + part, rise / (rise - others));
                }
            }
        }
        Gap { value: best.0, point: self.at(best.1), share: best.2 }
    }

    /// What the other hull takes away beyond what is missing already, mm.
    pub fn unfilled_mm(&self, other: impl Fn(&Point) -> f64) -> f64 {
        self.gap(other).value.max(0.0)
    }
}

/// The rays of all views.
pub(super) fn rims(views: &[PoseView], body: &VisualHull) -> Result<Vec<Rim>, RegisterError> {
    let bounds = body.bounds.grown(0.02 * body.bounds.size().max());
    let of_view = |(number, view): (usize, &PoseView)| {
        let middle = |[a, b]: &[[f64; 2]; 2]| [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let points: Vec<[f64; 2]> = (view.silhouette.segments().iter().map(middle))
            .filter(|q| view.cut.is_none_or(|cut| cut.above_px(*q) > ABOVE_CUT_PX))
            .collect();
        let each = (points.len() as f64 / PER_VIEW as f64).max(1.0);
        let picked =
            (0_u32..).map(|k| ((f64::from(k) + 0.5) * each) as usize).take_while(|n| *n < points.len());
        picked.filter_map(|n| rim(number, view, points[n], body, &bounds)).collect::<Vec<_>>()
    };
    let all: Vec<Vec<Rim>> = views.par_iter().enumerate().map(of_view).collect();
    if all.iter().any(Vec::is_empty) {
        return Err(RegisterError::Hull(HullError::Empty { views: views.len() }));
    }
    Ok(all.concat())
}

fn rim(number: usize, view: &PoseView, q: [f64; 2], body: &VisualHull, bounds: &Aabb) -> Option<Rim> {
    let (start, direction) = view.projection.line_of_sight(q)?;
    let [near, far] = clipped(bounds, &start, &direction)?;
    let step = (far - near) / (ALONG - 1) as f64;
    let values: Vec<f64> =
        (0..ALONG).map(|k| body.value(&(start + direction * (near + k as f64 * step)))).collect();
    let best = (0..ALONG).min_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    let limit = values[best].max(0.0) + NEAR * bounds.size().max();
    let low = (0..=best).rev().take_while(|k| values[*k] <= limit).last()?;
    let high = (best..ALONG).take_while(|k| values[*k] <= limit).last()?;
    // Half a step more: a lone point needs surroundings too.
    let from = near + (low as f64 - 0.5) * step;
    let part = (high - low + 1) as f64 * step / (KEPT - 1) as f64;
    let (first, step) = (start + direction * from, direction * part);
    let own: [f64; KEPT] = std::array::from_fn(|k| body.value(&(first + step * k as f64)));
    let px_per_mm = view.projection.px_per_mm(&first)?;
    let lacks_mm = own.iter().copied().fold(f64::INFINITY, f64::min).max(0.0);
    Some(Rim { view: number, first, step, own, lacks_mm, px_per_mm })
}

/// The part of a line within a box, as distances along it; `None` where it passes by.
fn clipped(bounds: &Aabb, start: &Point, direction: &Vector) -> Option<[f64; 2]> {
    let mut part = [f64::NEG_INFINITY, f64::INFINITY];
    for k in 0..3 {
        let (a, b) = (bounds.min[k] - start[k], bounds.max[k] - start[k]);
        if direction[k] == 0.0 {
            if a > 0.0 || b < 0.0 {
                return None;
            }
            continue;
        }
        let (a, b) = (a / direction[k], b / direction[k]);
        part = [part[0].max(a.min(b)), part[1].min(a.max(b))];
    }
    (part[0] < part[1]).then_some(part)
}

/// A pose's rays and its hull's function: exact, or as a lattice for the search.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub rims: &'a [Rim],
    pub body: &'a dyn ImplicitBody,
}

/// What the second pose, moved, takes off the rays of the first, and the first off those of the second.
pub(super) fn terms(a: Seen, b: Seen, motion: &Motion, about: &Point, step_mm: f64) -> Vec<Term> {
    let back = motion.inverse();
    let of_a = |rim: &Rim| {
        let gap = rim.gap(|p| b.body.value(&back.transform(p)));
        let residual = (gap.value - rim.lacks_mm).max(0.0);
        let gradient = if residual > 0.0 && gap.share > 0.0 {
            motion.rotation * field::gradient(b.body, &back.transform(&gap.point), step_mm) * -gap.share
        } else {
            Vector::zeros()
        };
        Term::moving(residual, &gap.point, about, &gradient)
    };
    let of_b = |rim: &Rim| {
        let gap = rim.gap(|p| a.body.value(&motion.transform(p)));
        let residual = (gap.value - rim.lacks_mm).max(0.0);
        let point = motion.transform(&gap.point);
        let gradient = if residual > 0.0 && gap.share > 0.0 {
            field::gradient(a.body, &point, step_mm) * gap.share
        } else {
            Vector::zeros()
        };
        Term::moving(residual, &point, about, &gradient)
    };
    let mut all: Vec<Term> = a.rims.par_iter().map(of_a).collect();
    all.par_extend(b.rims.par_iter().map(of_b));
    all
}

/// The depth, pixels, to which the silhouette is not filled at each ray.
pub(super) fn unfilled_px(rims: &[Rim], other: &(dyn Fn(&Point) -> f64 + Sync)) -> Vec<f64> {
    rims.par_iter().map(|r| r.unfilled_mm(other) * r.px_per_mm).collect()
}

/// Each view's mean over its rays.
pub(super) fn by_view(views: usize, rims: &[Rim], each: &[f64]) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0); views];
    for (rim, value) in rims.iter().zip(each) {
        sums[rim.view].0 += value;
        sums[rim.view].1 += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}
