//! Robust least squares over rigid motions (Levenberg 1944; weights of Huber 1964).

use super::Motion;
use crate::geometry::{Point, Vector};
use nalgebra::{Matrix6, Vector6};

/// A residual (mm) and how it changes with a step of the motion: a turn about the fit's centre, and a shift.
pub(super) struct Term {
    pub residual: f64,
    pub slope: Vector6<f64>,
}

impl Term {
    /// Of a point of the frame that moves with the motion, seen from `about`, in a field of this gradient.
    pub fn moving(residual: f64, p: &Point, about: &Point, gradient: &Vector) -> Self {
        let turn = (p - about).cross(gradient);
        let slope = Vector6::new(turn.x, turn.y, turn.z, gradient.x, gradient.y, gradient.z);
        Self { residual, slope }
    }
}

/// What a fit does.
#[derive(Clone, Copy)]
pub(super) struct Control {
    /// The point that turns are about.
    pub about: Point,
    /// A turn of one radian moves the body by about this much, mm.
    pub reach_mm: f64,
    /// Residuals above this count as their size, not as their square, mm.
    pub knee_mm: f64,
    /// The most steps.
    pub steps: usize,
}

/// A motion and what it costs: the mean of Huber's function over the terms, mm².
#[derive(Debug, Clone, Copy)]
pub(super) struct Fitted {
    pub motion: Motion,
    pub cost: f64,
}

/// A step below this share of the reach ends a fit.
const SMALLEST_STEP: f64 = 1e-5;
/// Damping at first, and at which no step is left that helps.
const DAMPING: f64 = 1e-3;
const MOST_DAMPING: f64 = 1e4;

/// Improves a motion until it stands still.
pub(super) fn fit(start: Motion, control: &Control, terms: &dyn Fn(&Motion) -> Vec<Term>) -> Fitted {
    let reach = control.reach_mm;
    let scale = Vector6::new(1.0 / reach, 1.0 / reach, 1.0 / reach, 1.0, 1.0, 1.0);
    let mut now = terms(&start);
    let mut best = Fitted { motion: start, cost: cost(&now, control.knee_mm) };
    let mut damping = DAMPING;
    for _ in 0..control.steps {
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for t in &now {
            let weight = (control.knee_mm / t.residual.abs().max(control.knee_mm)) / now.len() as f64;
            let slope = t.slope.component_mul(&scale);
            normal += slope * slope.transpose() * weight;
            right -= slope * (t.residual * weight);
        }
        // A body of revolution leaves a turn open: there the damping alone holds the motion.
        let floor = damping * (normal.trace() / 6.0).max(f64::MIN_POSITIVE);
        let damped = normal + Matrix6::identity() * floor;
        let Some(step) = damped.cholesky().map(|c| c.solve(&right)) else { break };
        let motion = best.motion.stepped(&step.component_mul(&scale), &control.about);
        let next = terms(&motion);
        let cost = cost(&next, control.knee_mm);
        if cost < best.cost {
            (best, now) = (Fitted { motion, cost }, next);
            damping *= 0.2;
        } else {
            damping *= 8.0;
        }
        if step.norm() < SMALLEST_STEP * reach || damping > MOST_DAMPING {
            break;
        }
    }
    best
}

fn cost(terms: &[Term], knee: f64) -> f64 {
    let one = |t: &Term| {
        let r = t.residual.abs();
        if r <= knee { 0.5 * r * r } else { knee * (r - 0.5 * knee) }
    };
    terms.iter().map(one).sum::<f64>() / terms.len().max(1) as f64
}
