//! How the grain turned, and from where it was seen: the fit of all views with what was noted of the distance, and slips looked for.

use super::fit::{Fit, Prior, Priors, Sample, Spreads, Start, fit};
use super::refine::SeenView;
use super::round::RECIPROCAL;
use super::turning::{self, Turning};

/// Rounds of linearising.
const ROUNDS: usize = 3;
/// What a near camera's reciprocal distance must be of its standard uncertainty to count as seen, and with it the sense of rotation: now
/// and then a grain's shape looks like one. Before a telecentric lens two of the first forty of the simulated rig's grains came to just
/// above four (`tests/calibration`, `a_telecentric_lens_…`).
pub(super) const NEAR_SIGMAS: f64 = 5.0;
/// How far a distance that somebody noted may be off, as a share of its reciprocal (standard deviation): it is measured
/// to the lens' front, to the camera's back, or was another lens'.
const NOTED_DISTANCE: f64 = 0.5;
/// The same where the outlines alone would rather have parallel views, but do not speak against what was noted by more than so many
/// standard uncertainties: then it is believed.
const BELIEVED_DISTANCE: f64 = 0.1;
const AGAINST_NOTED: f64 = 3.0;
/// What of an outline's error a near camera may be taken for, pixels (standard deviation).
const NEAR_PX: f64 = 0.03;
/// Outlines that contradict one another by more than this, pixels and as a share of the grain's mean reach, are none to find slips by,
/// nor to rely on: of opaque grains of 300 pixels they do by up to 0.6, where something is amiss with the light by 1.1 and more.
const UNSURE: (f64, f64) = (0.9, 0.006);
/// Widest gap between views over which slips can be detected, degrees.
const WIDEST_GAP_DEG: f64 = 20.0;
/// What [`super::fit::MODEST`] is for the reciprocal distance.
pub(super) const MODEST_RECIPROCAL: f64 = 2.2;

/// What the angles and the rays are sought with.
pub(super) struct Rig<'a> {
    pub views: &'a [SeenView<'a>],
    /// But for the distance.
    pub priors: Priors,
    /// Reciprocal distance that somebody noted, 1/pixels.
    pub noted: Option<f64>,
}

/// Angles and rays.
pub(super) struct RigFit {
    pub turning: Turning,
    /// Reciprocal distance from the pictures alone, and its standard uncertainty, 1/pixels.
    pub reciprocal: (f64, f64),
}

impl Rig<'_> {
    /// The angles and the rays, with what was noted of the distance where the outlines do not speak against it.
    pub(super) fn worked_out(&self, samples: &[Sample], sense: f64, start: Start) -> Option<RigFit> {
        let angles: Vec<f64> = self.views.iter().map(|v| sense * v.angle.rad()).collect();
        let alone = fit(samples, &angles, &self.priors, start, Spreads::Sought, ROUNDS)?;
        let reciprocal = reciprocal_of(&alone);
        let Some(noted) = self.noted.filter(|noted| is_possible(*noted, reciprocal)) else {
            let turning = self.turned(samples, &angles, &self.priors, alone);
            let reciprocal = reciprocal_of(&turning.fit);
            return Some(RigFit { turning, reciprocal });
        };
        let priors = |share: f64| {
            // The equations think themselves surer than they are: as much surer must they think what was noted.
            let reciprocal = Some(Prior { value: noted, sigma: share * noted / MODEST_RECIPROCAL });
            Priors { reciprocal, ..self.priors }
        };
        let with = |share: f64, angles: &[f64], from: &Fit| {
            fit(samples, angles, &priors(share), Start::Fit(from), Spreads::SoughtFrom(from.hyper), ROUNDS)
        };
        let first = with(NOTED_DISTANCE, &angles, &alone)?;
        let mut turning = self.turned(samples, &angles, &priors(NOTED_DISTANCE), first);
        let spreads = Spreads::Known(turning.fit.hyper);
        let alone = fit(samples, &turning.angles, &self.priors, Start::Fit(&turning.fit), spreads, ROUNDS)?;
        let alone = Fit { step_sigma: turning.fit.step_sigma, ..alone };
        let reciprocal = reciprocal_of(&alone);
        let is_near = turning.fit.parameters[RECIPROCAL] > turning.fit.sigma(RECIPROCAL, MODEST_RECIPROCAL);
        if !is_possible(noted, reciprocal) {
            turning.fit = alone;
        } else if !is_near && (reciprocal.0 - noted).abs() < AGAINST_NOTED * reciprocal.1 {
            let step_sigma = turning.fit.step_sigma;
            let believed = with(BELIEVED_DISTANCE, &turning.angles, &turning.fit)?;
            turning.fit = Fit { step_sigma, ..believed };
        }
        Some(RigFit { turning, reciprocal })
    }

    /// Slips and lost steps, where they can be told.
    fn turned(&self, samples: &[Sample], angles: &[f64], priors: &Priors, first: Fit) -> Turning {
        let mut turning = if blind(self.views).is_some() {
            Turning::nominal(angles, first)
        } else {
            let nominal = first.clone();
            let found = turning::look(samples, angles, priors, first);
            let is_unsure = residual_px(&found.fit) > unsure_px(&found.fit);
            if is_unsure { Turning::nominal(angles, nominal) } else { found }
        };
        turning.fit.step_sigma = turning.step_sigma(samples);
        turning
    }
}

/// Reciprocal distance and its standard uncertainty, 1/pixels. A near camera moves the outline in proportion to the square of its
/// reach: of a small grain that is less than what the outline may be off by.
fn reciprocal_of(fit: &Fit) -> (f64, f64) {
    let sigma = fit.sigma(RECIPROCAL, MODEST_RECIPROCAL);
    (fit.parameters[RECIPROCAL], sigma.hypot(NEAR_PX / fit.mean_reach_px.powi(2)))
}

/// Whether the outlines do not speak against a reciprocal distance that was noted.
fn is_possible(noted: f64, (reciprocal, sigma): (f64, f64)) -> bool {
    (reciprocal - noted).abs() < NEAR_SIGMAS * sigma.hypot(NOTED_DISTANCE * noted)
}

/// By how much the outlines contradict one another, pixels (standard deviation).
pub(super) fn residual_px(fit: &Fit) -> f64 {
    fit.hyper.noise_px.hypot(fit.hyper.edge_px)
}

/// By how much they may.
pub(super) fn unsure_px(fit: &Fit) -> f64 {
    UNSURE.0.max(UNSURE.1 * fit.mean_reach_px)
}

/// Why slips cannot be detected, where they cannot: the outlines must be right, and reach round the grain.
pub(super) fn blind(views: &[SeenView]) -> Option<String> {
    if let Some(bad) = views.iter().find(|v| v.bad) {
        return Some(format!(
            "slips and lost steps were not looked for, as view {} is bad: take it again",
            bad.index
        ));
    }
    // The outline's two sides look half a turn apart.
    let mut directions: Vec<f64> = views
        .iter()
        .flat_map(|v| [0.0, 180.0].map(|side| (v.angle.deg() + side).rem_euclid(360.0)))
        .collect();
    directions.sort_by(f64::total_cmp);
    let wrapped = directions.first().map(|first| first + 360.0);
    let gaps = directions.iter().zip(directions.iter().skip(1).copied().chain(wrapped)).map(|(a, b)| b - a);
    let widest = gaps.fold(0.0, f64::max);
    (widest > WIDEST_GAP_DEG).then(|| {
        format!(
            "slips and lost steps were not looked for: {widest:.0}° lie between two neighbouring views, {WIDEST_GAP_DEG}° \
             at most would do"
        )
    })
}
