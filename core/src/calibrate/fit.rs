//! Generalised least squares over all views: the parameters of the rig that make the grain's slices most likely.
//!
//! A view at angle θ reaches to the right as far as the slice's support function h(t) at t = θ, to the left as far as
//! h(θ + π); h′ is how deep the rim lies (nearer the camera to the right where it is positive). To the first order the
//! reach is changed by the axis' column c and the view's own shift b (±1), the roll (∓(z + h·∂h/∂z)), the reciprocal
//! camera distance q (±h′(h − z·∂h/∂z): rays that are not parallel see the rim elsewhere), the rays' elevation p
//! (∓h′·∂h/∂z) and the view's own angle (h′). The slices are random functions (see [`super::support`]), so all these
//! are generalised least squares with a prior for what a motor and a bearing do.

use super::profile::{AxisLine, Profiles};
use super::round::{Depths, ELEVATION, RECIPROCAL, ROLL, Rays, Read, Round, SHARED, STEP};
use super::support::Hyper;
use crate::silhouette::Silhouette;
use nalgebra::{DMatrix, DVector};

/// Heights that are compared, and samples in all: more cost more than they add.
const HEIGHTS: usize = 48;
const SAMPLES: usize = 6000;
/// Standard deviation of one view's angle: a stepper's ±5 % of a full step, evenly spread, as a share of the step.
pub(super) const VIEW_SIGMA_STEPS: f64 = 0.05 / 1.732_050_8;
/// The slices of a real grain are not quite what the random functions are: uncertainties are this much larger than
/// the equations give (measured over many simulated rigs: see `tests/calibration`).
pub(super) const MODEST: f64 = 1.6;
/// Rounds of linearising in which the spreads are sought.
const SEARCHED_ROUNDS: usize = 2;
/// More rounds while the rays change by more than this, radians.
const MORE_ROUNDS: usize = 9;
const SETTLED_RAD: f64 = 2e-4;
/// They lead away where one changes them by more than this many times the least change.
const DIVERGING: f64 = 3.0;

/// A view for the fit.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample<'a> {
    pub silhouette: &'a Silhouette,
    /// The pedestal, where it was seen.
    pub pedestal: Option<PedestalObservation>,
    /// The outline's upper side (see [`super::frontier`]).
    pub top: &'a [[f64; 2]],
}

/// The pedestal observed in one picture: position of its top, lean of its sides.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PedestalObservation {
    /// Column and row of the middle of its top.
    pub top_px: [f64; 2],
    /// How far it leans to smaller columns towards its top, radians.
    pub lean_rad: f64,
    /// Length of the sides that the lean was read off, pixels; 0 where it is not to be relied on.
    pub length_px: f64,
}

/// What holds a parameter before the pictures are asked: value and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Prior {
    pub value: f64,
    pub sigma: f64,
}

/// What is known beforehand; `None` where nothing is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Priors {
    pub column_px: Option<Prior>,
    pub roll_rad: Option<Prior>,
    /// mm per pixel over the distance: 1/pixels.
    pub reciprocal: Option<Prior>,
    /// A full step of the motor, radians.
    pub full_step_rad: f64,
}

impl Priors {
    /// Standard deviation of one view's angle, radians.
    pub(super) fn view_sigma_rad(&self) -> f64 {
        VIEW_SIGMA_STEPS * self.full_step_rad
    }
}

/// The parameters, and how sure they are.
#[derive(Clone)]
pub(super) struct Fit {
    pub line: AxisLine,
    /// All parameters; the first two are corrections that `line` has taken up.
    pub parameters: DVector<f64>,
    /// Their covariance, with the step size as it is held.
    pub covariance: DMatrix<f64>,
    /// What the step size may be off by, as a share of it (standard deviation).
    pub step_sigma: f64,
    pub hyper: Hyper,
    /// Whole height of the grain, pixels.
    pub height_px: f64,
    /// The reaches, freed of everything but the grain's shape, `[sample, height]`.
    pub shape: DMatrix<f64>,
    /// Where the rims lie.
    pub depths: Depths,
    /// Residual of every view, pixels.
    pub residuals_px: Vec<f64>,
    /// Mean reach, pixels.
    pub mean_reach_px: f64,
}

impl Fit {
    /// Standard deviation of parameter `k`: what the equations give and what the step size makes of it, so many times over.
    pub(super) fn sigma(&self, k: usize, modest: f64) -> f64 {
        modest * self.own_sigma(k).hypot(self.with_step(k) * self.step_sigma)
    }

    /// Parameter `k` where another is taken for a value, its standard deviation then as [`Fit::sigma`] has it, and how much it changes with
    /// the other.
    pub(super) fn given(&self, k: usize, (other, value): (usize, f64), modest: f64) -> (f64, f64, f64) {
        let slope = self.covariance[(k, other)] / self.covariance[(other, other)].max(f64::MIN_POSITIVE);
        let rest = (self.covariance[(k, k)] - slope * self.covariance[(k, other)]).max(0.0);
        let with_step = self.with_step(k) - slope * self.with_step(other);
        let at = self.parameters[k] + slope * (value - self.parameters[other]);
        (at, modest * rest.sqrt().hypot(with_step * self.step_sigma), slope)
    }

    pub(super) fn views(&self) -> usize {
        (self.parameters.len() - SHARED) / 2
    }

    pub(super) fn offset_px(&self, view: usize) -> f64 {
        self.parameters[SHARED + view]
    }

    /// How far the grain is ahead in a view, radians.
    pub(super) fn ahead_rad(&self, view: usize) -> f64 {
        self.parameters[SHARED + self.views() + view]
    }

    /// The standard deviation of a view's whole angle, `turned_rad` from the first view's.
    pub(super) fn ahead_sigma_rad(&self, view: usize, turned_rad: f64) -> f64 {
        let own = SHARED + self.views() + view;
        (MODEST * self.own_sigma(own)).hypot((turned_rad + self.with_step(own)) * self.step_sigma)
    }

    fn own_sigma(&self, k: usize) -> f64 {
        self.covariance[(k, k)].max(0.0).sqrt()
    }

    /// How parameter `k` changes with the step size.
    fn with_step(&self, k: usize) -> f64 {
        self.covariance[(k, STEP)] / self.covariance[(STEP, STEP)]
    }
}

/// What a search for the most likely spreads starts from, or what stands instead of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Spreads {
    /// Sought.
    Sought,
    /// Sought from here.
    SoughtFrom(Hyper),
    /// Known.
    Known(Hyper),
}

/// What linearising starts from.
#[derive(Clone, Copy)]
pub(super) enum Start<'a> {
    /// Level and parallel rays before this line.
    Line(&'a AxisLine),
    /// Line and rays of another fit of the same views.
    Fit(&'a Fit),
}

/// Fits all views at these (signed) angles, in so many rounds of linearising and more where the rays have not settled.
pub(super) fn fit(
    views: &[Sample],
    angles: &[f64],
    priors: &Priors,
    start: Start,
    spreads: Spreads,
    rounds: usize,
) -> Option<Fit> {
    let n = views.len();
    let outlines: Vec<&Silhouette> = views.iter().map(|v| v.silhouette).collect();
    let mut parameters = DVector::zeros(SHARED + 2 * n);
    let (mut line, mut depths) = match start {
        Start::Line(line) => (*line, None),
        Start::Fit(before) => {
            for k in [RECIPROCAL, ELEVATION] {
                parameters[k] = before.parameters[k];
            }
            (before.line, Some(before.depths.clone()))
        }
    };
    let (mut hyper, search) = match spreads {
        Spreads::Sought => (None, true),
        Spreads::SoughtFrom(h) => (Some(h), true),
        Spreads::Known(h) => (Some(h), false),
    };
    let mut fitted: Option<(f64, Fit)> = None;
    let (mut sought_again, mut seeks) = (false, false);
    for round in 0..rounds + MORE_ROUNDS {
        let rays: Rays = [RECIPROCAL, ELEVATION].map(|k| parameters[k]);
        let heights = HEIGHTS.min(SAMPLES / (2 * n)).max(8);
        let seen_at = |sample: usize, z: f64| {
            let depth = depths.as_ref().map_or(0.0, |d| d.at(sample, z));
            (z - rays[1] * depth) / (1.0 + rays[0] * depth)
        };
        let profiles = Profiles::read(&outlines, &line, heights, &seen_at)?;
        let mean_reach_px = profiles.reach_px.iter().sum::<f64>() / profiles.reach_px.len() as f64;
        let mut spread = hyper.unwrap_or(Hyper {
            curvature_px: (0.2 * mean_reach_px).max(1.0),
            alike: 0.3,
            edge_px: 0.1,
            noise_px: 0.1,
            runout_px: 0.3,
            pedestal_px: 0.1,
        });
        let read = Read { profiles: &profiles, rays, depths: depths.as_ref() };
        let equations = Round::new(views, angles, priors, &line, &read, &parameters, &spread)?;
        let sought_now = search && (round < SEARCHED_ROUNDS || seeks);
        if sought_now {
            spread = equations.search(spread);
        }
        hyper = Some(spread);
        let solved = equations.solve(&spread)?;
        parameters = solved.parameters;
        line.column_px += parameters[0];
        line.roll_rad += parameters[ROLL];
        let shape = equations.shape(&parameters);
        let [smooth, along] = equations.grid.smoothed(&shape, &spread)?;
        let px = DMatrix::from_fn(2 * n, along.ncols(), |i, k| -equations.side[i] * along[(i, k)]);
        let rest = &shape - smooth;
        let residuals_px = (0..n)
            .map(|i| {
                let own = rest.row(i).norm_squared() + rest.row(n + i).norm_squared();
                (own / (2 * rest.ncols()) as f64).sqrt()
            })
            .collect();
        let made = Fit {
            line,
            parameters: parameters.clone(),
            covariance: solved.cholesky.inverse(),
            step_sigma: 0.0,
            hyper: spread,
            height_px: profiles.height_px,
            shape,
            depths: Depths { z_px: profiles.z_px.clone(), px },
            residuals_px,
            mean_reach_px,
        };
        let by = |k: usize| (made.parameters[k] - rays[usize::from(k == ELEVATION)]).abs();
        let moved = by(RECIPROCAL) * mean_reach_px + by(ELEVATION);
        depths = Some(made.depths.clone());
        seeks = false;
        let is_early = round + 1 < rounds || sought_now;
        let least = fitted.as_ref().map_or(f64::INFINITY, |(least, _)| *least);
        if is_early || moved <= least {
            fitted = Some((if is_early { f64::INFINITY } else { moved }, made));
        } else if moved > DIVERGING * least {
            // Rounds that lead away end where they had come closest.
            break;
        }
        if round + 1 >= rounds && moved < SETTLED_RAD {
            // Where the rays took long to settle, the spreads were sought with others.
            if !search || sought_again || round + 1 == rounds {
                break;
            }
            (sought_again, seeks) = (true, true);
        }
    }
    fitted.map(|(_, fit)| fit)
}
