//! One round of linearising: reaches as the rays known so far see them, the equations, and what solves them.
//!
//! Rays that rise or are not parallel see a rim at another height and another size than it has at the axis. What the rounds before
//! know of rays and rims is taken out of the reaches exactly, by where they are read and how wide they are, and its first order is put
//! back: so the equations are of the first order in what is left alone, and the rounds end at the pinhole itself.

use super::fit::{Prior, Priors, Sample};
use super::frontier::{TopElevation, top_elevation};
use super::profile::{AxisLine, Profiles};
use super::support::{Grid, Hyper, Sums};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// Nobody mounts a camera worse: roll and elevation (radians), and how far a camera is (grain heights away).
const ROLL_SIGMA_RAD: f64 = 0.2;
const ELEVATION_SIGMA_RAD: f64 = 0.1;
const NEAREST_HEIGHTS: f64 = 2.0;
/// The axis' column before it is measured, and the pedestal's eccentricity, pixels.
const COLUMN_SIGMA_PX: f64 = 1e3;
const PEDESTAL_ECCENTRICITY_PX: f64 = 50.0;
/// How far a tube is from parallel to the axis, and the least scatter of its lean that is believed, radians.
const PEDESTAL_TILT_RAD: f64 = 0.01;
const LEAST_LEAN_SIGMA_RAD: f64 = 1e-4;
/// What a straight edge may be off by at either end, pixels (standard deviation).
const EDGE_PX: f64 = 0.03;
/// Indices of the parameters: c, roll, q, p, the step size's excess as a share of it, then every view's shift, then every
/// view's angle.
pub(super) const ROLL: usize = 1;
pub(super) const RECIPROCAL: usize = 2;
pub(super) const ELEVATION: usize = 3;
pub(super) const STEP: usize = 4;
pub(super) const SHARED: usize = 5;
/// The least radial runout believed, pixels: with a pedestal to see it by, and without.
const LEAST_RUNOUT_PX: [f64; 2] = [0.02, 0.25];
/// The step size is held as tight as this: it is a parameter only for the others' change with it. Where it was free, the
/// likelihood took a grain's corners for angles: on 24 misread rigs (`tests/calibration`) the last view's angle was off by up
/// to 2.1°, with a standard deviation of 0.2°.
const STEP_HELD: f64 = 1e-7;
/// Noise that is taken off the slopes that shape the equations, pixels (standard deviation).
const FOLLOWED_PX: f64 = 0.1;
/// Fewest pedestals that are used.
const LEAST_PEDESTALS: usize = 6;
/// Rounds of a search for the spreads.
const SEARCH_ROUNDS: usize = 6;

/// Reciprocal distance and elevation that reaches were read with.
pub(super) type Rays = [f64; 2];

/// How far behind the axis the rim lies that a sample sees, pixels: `[sample, height]`.
#[derive(Clone)]
pub(super) struct Depths {
    pub z_px: Vec<f64>,
    pub px: DMatrix<f64>,
}

impl Depths {
    /// At a height; beyond the first and the last that of the nearest.
    pub(super) fn at(&self, sample: usize, z: f64) -> f64 {
        let last = self.z_px.len() - 1;
        let pitch = (self.z_px[last] - self.z_px[0]) / last as f64;
        let place = ((z - self.z_px[0]) / pitch).clamp(0.0, last as f64);
        let k = (place as usize).min(last - 1);
        let share = place - k as f64;
        self.px[(sample, k)] * (1.0 - share) + self.px[(sample, k + 1)] * share
    }
}

/// Reaches, and what they were read with.
pub(super) struct Read<'a> {
    pub profiles: &'a Profiles,
    pub rays: Rays,
    /// Of the round before.
    pub depths: Option<&'a Depths>,
}

/// One round's equations.
pub(super) struct Round<'a> {
    pub grid: Grid,
    /// −1 for reaches to the left, 1 to the right.
    pub side: Vec<f64>,
    y: DMatrix<f64>,
    regressors: Vec<DMatrix<f64>>,
    /// Both as the grid wants them for its sums.
    rotated: (DMatrix<f64>, Vec<DMatrix<f64>>),
    /// Pedestals' positions right of the line, and their leans beyond the line's, by view.
    pedestals: Vec<(usize, f64, f64)>,
    /// What the outlines' upper sides say of the rays.
    top: Option<TopElevation>,
    /// Standard deviation of a lean, radians: a view's own, and what all share.
    lean_sigma_rad: [f64; 2],
    angles: &'a [f64],
    /// Of the shared parameters.
    priors: [Prior; SHARED],
    /// Standard deviation of a view's own angle, radians.
    view_sigma_rad: f64,
}

/// One of the spreads, to be changed.
type Entry = fn(&mut Hyper) -> &mut f64;

pub(super) struct Solved {
    pub parameters: DVector<f64>,
    /// Of the inverse of their covariance.
    pub cholesky: Cholesky<f64, Dyn>,
    /// Logarithm of the marginal likelihood, but for a constant.
    log_likelihood: f64,
}

impl<'a> Round<'a> {
    pub(super) fn new(
        views: &[Sample],
        angles: &'a [f64],
        priors: &Priors,
        line: &AxisLine,
        read: &Read,
        parameters: &DVector<f64>,
        hyper: &Hyper,
    ) -> Option<Self> {
        let profiles = read.profiles;
        let (n, m) = (views.len(), profiles.z_px.len());
        let t: Vec<f64> =
            angles.iter().map(|a| a + std::f64::consts::PI).chain(angles.iter().copied()).collect();
        let side: Vec<f64> = (0..2 * n).map(|i| if i < n { -1.0 } else { 1.0 }).collect();
        let grid = Grid::new(t, profiles.z_px.clone());
        let depth = DMatrix::from_fn(2 * n, m, |i, k| read.depths.map_or(0.0, |d| d.at(i, profiles.z_px[k])));
        let wider = depth.map(|depth| 1.0 + read.rays[0] * depth);
        let exact = DMatrix::from_row_slice(2 * n, m, &profiles.reach_px).component_mul(&wider);
        // How much higher than the height that was sought the point lies that was read.
        let higher = DMatrix::from_fn(2 * n, m, |i, k| {
            profiles.seen_px[i * m + k] * wider[(i, k)] + read.rays[1] * depth[(i, k)] - profiles.z_px[k]
        });
        let mut round = Self {
            grid,
            side,
            y: exact.clone(),
            regressors: Vec::new(),
            rotated: (DMatrix::zeros(0, 0), Vec::new()),
            pedestals: Vec::new(),
            top: top_elevation(&views.iter().map(|v| v.top).collect::<Vec<_>>(), angles, line),
            lean_sigma_rad: [LEAST_LEAN_SIGMA_RAD; 2],
            angles,
            priors: [Prior { value: 0.0, sigma: 1.0 }; SHARED],
            view_sigma_rad: priors.view_sigma_rad(),
        };
        // The slopes of the shape as it is known so far shape the equations.
        // An edge that moved is better followed than smoothed away: it would flatten the slopes.
        let close = Hyper { edge_px: FOLLOWED_PX, noise_px: FOLLOWED_PX, ..*hyper };
        let [h, along] = round.grid.smoothed(&round.y, &close)?;
        let up = round.regress(&h, &along, &profiles.z_px);
        let linear = |round: &Self, up: &DMatrix<f64>| {
            &exact - up.component_mul(&higher)
                + &round.regressors[RECIPROCAL] * read.rays[0]
                + &round.regressors[ELEVATION] * read.rays[1]
        };
        round.y = linear(&round, &up);
        // What the line has taken up is no longer in the reaches.
        let mut known = parameters.clone();
        (known[0], known[ROLL]) = (0.0, 0.0);
        if known.iter().any(|x| *x != 0.0) {
            let [h, along] = round.grid.smoothed(&round.shape(&known), &close)?;
            let up = round.regress(&h, &along, &profiles.z_px);
            round.y = linear(&round, &up);
        }
        round.rotated =
            (round.grid.rotated(&round.y), round.regressors.iter().map(|x| round.grid.rotated(x)).collect());
        let height = profiles.height_px;
        let open = |sigma: f64| Prior { value: 0.0, sigma };
        let shifted = |p: Prior, by: f64| Prior { value: p.value - by, ..p };
        round.priors = [
            priors.column_px.map_or(open(COLUMN_SIGMA_PX), |p| shifted(p, line.column_px)),
            priors.roll_rad.map_or(open(ROLL_SIGMA_RAD), |p| shifted(p, line.roll_rad)),
            priors.reciprocal.unwrap_or(open(1.0 / (NEAREST_HEIGHTS * height))),
            open(ELEVATION_SIGMA_RAD),
            open(STEP_HELD),
        ];
        let seen = views.iter().enumerate().filter_map(|(i, v)| v.pedestal.map(|p| (i, p)));
        round.pedestals =
            seen.map(|(i, p)| (i, line.coordinates(p.top_px)[0], p.lean_rad - line.roll_rad)).collect();
        if round.pedestals.len() < LEAST_PEDESTALS {
            round.pedestals.clear();
        }
        let mut jumps: Vec<f64> = round.pedestals.windows(2).map(|w| (w[1].2 - w[0].2).abs()).collect();
        jumps.sort_by(f64::total_cmp);
        // Of neighbours' differences, whose median is 0.954 standard deviations.
        let scatter = jumps.get(jumps.len() / 2).map_or(0.0, |j| j / 0.954);
        let length =
            views.iter().filter_map(|v| v.pedestal).map(|p| p.length_px).fold(f64::INFINITY, f64::min);
        round.lean_sigma_rad =
            [scatter, 2.0 * EDGE_PX / length.max(0.01)].map(|s| s.max(LEAST_LEAN_SIGMA_RAD));
        Some(round)
    }

    /// The regressors of all parameters, from the shape `h` and its derivative along t; its derivative along z.
    fn regress(&mut self, h: &DMatrix<f64>, along: &DMatrix<f64>, z: &[f64]) -> DMatrix<f64> {
        let (rows, m) = h.shape();
        let n = rows / 2;
        let pitch = (z[m - 1] - z[0]) / (m - 1) as f64;
        let up = DMatrix::from_fn(rows, m, |i, k| {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(m - 1));
            (h[(i, b)] - h[(i, a)]) / ((b - a) as f64 * pitch)
        });
        self.grid.incline(&up);
        let side = &self.side;
        let of = |f: &dyn Fn(usize, usize) -> f64| DMatrix::from_fn(rows, m, f);
        self.regressors = vec![
            of(&|i, _| side[i]),
            of(&|i, k| -side[i] * (z[k] + h[(i, k)] * up[(i, k)])),
            of(&|i, k| side[i] * along[(i, k)] * (h[(i, k)] - z[k] * up[(i, k)])),
            of(&|i, k| -side[i] * along[(i, k)] * up[(i, k)]),
            of(&|i, k| (self.angles[i % n] - self.angles[0]) * along[(i, k)]),
        ];
        for v in 0..n {
            self.regressors.push(of(&|i, _| if i % n == v { side[i] } else { 0.0 }));
        }
        for v in 0..n {
            self.regressors.push(of(&|i, k| if i % n == v { along[(i, k)] } else { 0.0 }));
        }
        up
    }

    /// The reaches, freed of everything but the shape.
    pub(super) fn shape(&self, parameters: &DVector<f64>) -> DMatrix<f64> {
        let mut shape = self.y.clone();
        for (x, p) in self.regressors.iter().zip(parameters.iter()) {
            shape -= x * *p;
        }
        shape
    }

    fn prior(&self, k: usize, hyper: &Hyper) -> Prior {
        let n = self.angles.len();
        match k {
            _ if k < SHARED => self.priors[k],
            _ if k < SHARED + n => Prior { value: 0.0, sigma: hyper.runout_px },
            _ => Prior { value: 0.0, sigma: self.view_sigma_rad },
        }
    }

    fn sums(&self, hyper: &Hyper) -> Option<Sums> {
        self.grid.sums(&self.rotated.0, &self.rotated.1, hyper)
    }

    pub(super) fn solve(&self, hyper: &Hyper) -> Option<Solved> {
        self.solved(self.sums(hyper)?, hyper)
    }

    /// With the sums of the reaches (whatever the views' shifts and the pedestal scatter by), all that is known beforehand.
    fn solved(&self, mut all: Sums, hyper: &Hyper) -> Option<Solved> {
        let mut log_prior = 0.0;
        for k in 0..all.right.len() {
            let Prior { value, sigma } = self.prior(k, hyper);
            let weight = sigma.powi(-2);
            all.normal[(k, k)] += weight;
            all.right[k] += weight * value;
            all.square += weight * value * value;
            log_prior += weight.ln();
        }
        self.add_pedestals(&mut all, hyper)?;
        self.add_top(&mut all)?;
        let cholesky = Cholesky::new(all.normal.clone())?;
        let parameters = cholesky.solve(&all.right);
        let log_det: f64 = 2.0 * cholesky.l().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let log_likelihood =
            -0.5 * (all.square - parameters.dot(&all.right) + all.log_det - log_prior + log_det);
        Some(Solved { parameters, cholesky, log_likelihood })
    }

    /// At the height of the tops the rays rise by ε + q z.
    fn add_top(&self, all: &mut Sums) -> Option<()> {
        let Some(top) = self.top else { return Some(()) };
        let mut x = DMatrix::zeros(1, all.right.len());
        x[(0, ELEVATION)] = 1.0;
        x[(0, RECIPROCAL)] = top.z_px;
        let covariance = DMatrix::from_element(1, 1, top.sigma_rad.powi(2));
        all.add(&x, &DVector::from_element(1, top.rad), covariance)
    }

    /// A pedestal that stands a little off the axis goes round once with the grain; beyond that its positions are the
    /// axis' column and the views' shifts.
    fn add_pedestals(&self, all: &mut Sums, hyper: &Hyper) -> Option<()> {
        let count = self.pedestals.len();
        if count == 0 {
            return Some(());
        }
        let angle = |k: usize| self.angles[self.pedestals[k].0];
        let c = DMatrix::from_fn(count, count, |i, j| {
            let noise = if i == j { hyper.pedestal_px.powi(2) } else { 0.0 };
            noise + PEDESTAL_ECCENTRICITY_PX.powi(2) * (angle(i) - angle(j)).cos()
        });
        let mut x = DMatrix::zeros(count, all.right.len());
        for (k, (view, ..)) in self.pedestals.iter().enumerate() {
            x[(k, 0)] = 1.0;
            x[(k, SHARED + view)] = 1.0;
        }
        let y = DVector::from_iterator(count, self.pedestals.iter().map(|p| p.1));
        all.add(&x, &y, c)?;
        // A tube that is not parallel to the axis leans now to one side, now to the other.
        let c = DMatrix::from_fn(count, count, |i, j| {
            let noise = if i == j { self.lean_sigma_rad[0].powi(2) } else { 0.0 };
            noise + self.lean_sigma_rad[1].powi(2) + PEDESTAL_TILT_RAD.powi(2) * (angle(i) - angle(j)).cos()
        });
        let mut x = DMatrix::zeros(count, all.right.len());
        x.column_mut(ROLL).fill(1.0);
        let y = DVector::from_iterator(count, self.pedestals.iter().map(|p| p.2));
        all.add(&x, &y, c)
    }

    /// The spreads that make the data most likely: one after another, by steps that shrink.
    pub(super) fn search(&self, start: Hyper) -> Hyper {
        let with_pedestals = !self.pedestals.is_empty();
        let least_runout = LEAST_RUNOUT_PX[usize::from(!with_pedestals)];
        let likelihood = |sums: Option<Sums>, h: &Hyper| {
            sums.and_then(|s| self.solved(s, h)).map_or(f64::NEG_INFINITY, |s| s.log_likelihood)
        };
        let entries: [(Entry, f64, f64); 6] = [
            (|h| &mut h.curvature_px, 0.1, 1e4),
            (|h| &mut h.edge_px, 0.02, 10.0),
            (|h| &mut h.noise_px, 0.01, 5.0),
            (|h| &mut h.runout_px, least_runout, 20.0),
            (|h| &mut h.alike, 0.02, 3.0),
            (|h| &mut h.pedestal_px, 0.03, 5.0),
        ];
        let open = if with_pedestals { 6 } else { 5 };
        let mut steps = [1.6f64; 6];
        let mut best = Hyper { runout_px: start.runout_px.max(least_runout), ..start };
        let mut sums = self.sums(&best);
        let mut greatest = likelihood(sums.clone(), &best);
        for _ in 0..SEARCH_ROUNDS {
            for (k, (entry, least, most)) in entries.iter().take(open).enumerate() {
                let mut moved = false;
                for factor in [steps[k], 1.0 / steps[k]] {
                    let mut next = best;
                    let value = entry(&mut next);
                    *value = (*value * factor).clamp(*least, *most);
                    if next == best {
                        continue;
                    }
                    // What the views' shifts and the pedestal scatter by is no matter of the reaches.
                    let beside = Hyper { runout_px: best.runout_px, pedestal_px: best.pedestal_px, ..next };
                    let next_sums = if beside == best { sums.clone() } else { self.sums(&next) };
                    let l = likelihood(next_sums.clone(), &next);
                    if l > greatest + 1e-3 {
                        (best, sums, greatest, moved) = (next, next_sums, l, true);
                        break;
                    }
                }
                if !moved {
                    steps[k] = steps[k].powf(0.6);
                }
            }
        }
        best
    }
}
