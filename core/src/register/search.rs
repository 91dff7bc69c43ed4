//! Global search over rigid motions: all turns coarsely, then refinement of the best candidates.

use super::field;
use super::fit::{Control, Fitted, Term, fit};
use super::rims::{self, Seen};
use super::{Motion, Pose};
use crate::geometry::{ImplicitBody, Point};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion};
use rayon::prelude::*;

/// Turns of the coarse search: about 12° apart.
const TURNS: usize = 5000;
/// Of the samples, every so many is used by the coarse search.
const COARSE_STRIDE: usize = 3;
/// A sample that is off by more than this share of the size counts as this much.
const COARSE_CAP: f64 = 0.08;
/// Turns nearer to a better one than this are not followed: before the surfaces are fitted, and after.
const SAME_BEFORE_RAD: f64 = 0.14;
const SAME_AFTER_RAD: f64 = 0.07;
/// Candidates that are followed: by the surfaces, by the outlines, and by the outlines with the exact hulls.
const BY_SURFACES: usize = 60;
const BY_OUTLINES: usize = 16;
const EXACTLY: usize = 3;
/// Of the last, those that cost no more than this many times the best: any other is no rival, however exactly.
const CLOSE: f64 = 6.0;
/// Knee of the loss, as a share of the size, for surfaces and for outlines during the search; in pixels at last.
const SURFACE_KNEE: f64 = 0.01;
const OUTLINE_KNEE: f64 = 0.01;
const LAST_KNEE_PX: f64 = 1.0;
/// Steps of each fit, at most.
const STEPS: [usize; 3] = [12, 25, 25];

/// The motions of `b` into the frame of `a` that fit best.
pub(super) fn candidates(a: &Pose, b: &Pose, progress: &mut dyn FnMut(f64)) -> Vec<Motion> {
    let turns = turns(a, b);
    let start = |turn| Motion::taking(turn, &b.moments.centre, &a.moments.centre);
    let scored: Vec<Fitted> = turns
        .par_iter()
        .map(|turn| {
            let motion = start(*turn);
            Fitted { motion, cost: coarse_cost(a, b, &motion) }
        })
        .collect();
    progress(0.2);
    let kept = distinct(scored, SAME_BEFORE_RAD, BY_SURFACES);
    let control = |knee_mm, phase: usize| Control {
        about: a.moments.centre,
        reach_mm: 0.5 * a.size_mm,
        knee_mm,
        steps: STEPS[phase],
    };
    let size = 0.5 * (a.size_mm + b.size_mm);
    let surfaces = control(SURFACE_KNEE * size, 0);
    let fitted = (kept.par_iter())
        .map(|c| fit(c.motion, &surfaces, &|m| surface_terms(a, b, m, &surfaces.about)))
        .collect();
    progress(0.4);
    let kept = distinct(fitted, SAME_AFTER_RAD, BY_OUTLINES);
    let outlines = control(OUTLINE_KNEE * size, 1);
    let (of_a, of_b) = (Seen { rims: &a.rims, body: &a.field }, Seen { rims: &b.rims, body: &b.field });
    let fitted = (kept.par_iter())
        .map(|c| {
            let step = 0.004 * size;
            fit(c.motion, &outlines, &|m| rims::terms(of_a, of_b, m, &outlines.about, step))
        })
        .collect();
    progress(0.6);
    let kept = distinct(fitted, SAME_AFTER_RAD, EXACTLY);
    let (of_a, of_b) = (Seen { rims: &a.rims, body: a.body() }, Seen { rims: &b.rims, body: b.body() });
    let last = control(LAST_KNEE_PX / a.px_per_mm, 2);
    let close = CLOSE * kept.first().map_or(0.0, |best| best.cost);
    let mut out = Vec::new();
    for (k, c) in kept.iter().enumerate() {
        let step = 0.25 / a.px_per_mm;
        let exactly = || fit(c.motion, &last, &|m| rims::terms(of_a, of_b, m, &last.about, step)).motion;
        out.push(if c.cost <= close { exactly() } else { c.motion });
        progress(0.6 + 0.4 * (k + 1) as f64 / kept.len() as f64);
    }
    out
}

/// The cheapest, each farther from the cheaper ones than `same_rad`.
fn distinct(mut all: Vec<Fitted>, same_rad: f64, most: usize) -> Vec<Fitted> {
    all.sort_by(|x, y| x.cost.total_cmp(&y.cost));
    let mut kept: Vec<Fitted> = Vec::new();
    for c in all {
        if kept.len() < most && kept.iter().all(|k| k.motion.apart_rad(&c.motion) >= same_rad) {
            kept.push(c);
        }
    }
    kept
}

/// Turns from everywhere: those that lay principal axis on principal axis, and an even spread of all.
fn turns(a: &Pose, b: &Pose) -> Vec<UnitQuaternion<f64>> {
    let (from, to) = (axes(&b.moments.spread), axes(&a.moments.spread));
    let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    let mut out: Vec<UnitQuaternion<f64>> = (signs.iter())
        .map(|[x, y]| {
            let turned =
                Matrix3::from_columns(&[to.column(0) * *x, to.column(1) * *y, to.column(2) * (x * y)]);
            let matrix = Rotation3::from_matrix_unchecked(turned * from.transpose());
            UnitQuaternion::from_rotation_matrix(&matrix)
        })
        .collect();
    out.extend((0..TURNS).map(even));
    out
}

/// The principal axes as columns of a right-handed frame, the longest first.
fn axes(spread: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| eigen.eigenvalues[*j].total_cmp(&eigen.eigenvalues[*i]));
    let [x, y] = [0, 1].map(|k| eigen.eigenvectors.column(order[k]).into_owned());
    Matrix3::from_columns(&[x, y, x.cross(&y)])
}

/// The `i`-th of [`TURNS`] evenly spread turns: super-Fibonacci spirals (Alexa, CVPR 2022, algorithm 1).
fn even(i: usize) -> UnitQuaternion<f64> {
    const PSI: f64 = 1.533_751_168_755_204_3;
    let s = i as f64 + 0.5;
    let t = s / TURNS as f64;
    let d = std::f64::consts::TAU * s;
    let (r, big) = (t.sqrt(), (1.0 - t).sqrt());
    let (alpha, beta) = (d / std::f64::consts::SQRT_2, d / PSI);
    let q = nalgebra::Quaternion::new(big * beta.cos(), r * alpha.sin(), r * alpha.cos(), big * beta.sin());
    UnitQuaternion::from_quaternion(q)
}

fn coarse_cost(a: &Pose, b: &Pose, motion: &Motion) -> f64 {
    let back = motion.inverse();
    let cap = COARSE_CAP * a.size_mm;
    let every = |samples: &[Point], value: &dyn Fn(&Point) -> f64| {
        let picked = samples.iter().step_by(COARSE_STRIDE);
        let count = picked.len().max(1) as f64;
        picked.map(|p| value(p).abs().min(cap)).sum::<f64>() / count
    };
    every(&b.samples, &|p| a.field.value(&motion.transform(p)))
        + every(&a.samples, &|p| b.field.value(&back.transform(p)))
}

/// How far the samples of each surface lie from the other.
fn surface_terms(a: &Pose, b: &Pose, motion: &Motion, about: &Point) -> Vec<Term> {
    let back = motion.inverse();
    let step = 0.006 * a.size_mm;
    let of_b = b.samples.iter().map(|p| {
        let q = motion.transform(p);
        Term::moving(a.field.value(&q), &q, about, &field::gradient(&a.field, &q, step))
    });
    let of_a = a.samples.iter().map(|p| {
        let q = back.transform(p);
        let gradient = motion.rotation * field::gradient(&b.field, &q, step);
        Term::moving(b.field.value(&q), p, about, &-gradient)
    });
    of_b.chain(of_a).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_even_turns_leave_no_gap() {
        let all: Vec<_> = (0..TURNS).map(even).collect();
        let worst = (0..300)
            .map(|i| {
                let x = f64::from(i);
                let turn = UnitQuaternion::from_euler_angles(x * 1.7, (x * 0.61).sin() * 1.5, x * 0.9);
                all.iter().map(|t| t.angle_to(&turn)).fold(f64::INFINITY, f64::min)
            })
            .fold(0.0, f64::max);
        assert!(worst.to_degrees() < 14.0, "{}°", worst.to_degrees());
    }
}
