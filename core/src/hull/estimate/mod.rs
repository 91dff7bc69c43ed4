//! Volume estimate: the grain's volume V from the hull's `V_H = (1 + E) V`, with a 95 % interval.
//!
//! The hull is larger than the grain by an excess E (its volume over the grain's, less 1), which has two parts.
//! Between the tangents of N views a slice is a polygon about the slice's convex hull: (2N/π) tan(π/2N) − 1 for a
//! ball (0.13 % at 25 views), about 1 % for an angular grain. And views that are level never see into a hollow of a
//! slice: the hull fills it. That is most of E, and more views about the same axis do not help.
//!
//! What shows are signs of hollows ([`Signs`]): the outlines are concave, the slices' curvature varies from one
//! direction to the next and along the axis, there are gaps, and a body that lies flat has more of its surface where
//! hollows face up or down. They are uncertain signs, so what is stated is a distribution of E,
//!
//! ```text
//! ln E = a + b·ln(concavity + 0.001) + c·curvature variation + d·ln(axial variation + 0.01) + e·ln(gaps + 0.001)
//!        + f·ln(slenderness) + (g + h·ln(concavity + 0.001))·ln(N/25) ± 0.25 (1 + 0.6 ln² slenderness),
//! ```
//!
//! and ±0.4 % of the volume, one standard deviation each. The number of views N counts less where the outlines are
//! concave, since more views cut off corners, but no hollows. The figures are a regression (least squares, outliers' weight falling off) on 2700 hulls of 8 to 50
//! views, two in three of 25, by ideal silhouettes of 900 grains: particles of ten powders of crushed rock, slag and
//! cement by X-ray tomography (published spherical harmonics, data set `particle_shape_set` of the programs THAMES
//! and VCCTL, Bullard and others, NIST), some smoothed; convex hulls of them; grains cut by planes, ellipsoids and
//! rough boxes. Half are pressed flat, and they lie any way, flat, upright, at rest or tipped. The hulls' figures are
//! in `fit/hulls.csv`, which `benches/volume_fit` makes; `fit/tests.rs` fits to them, and tests that the constants below are
//! what they give.
//!
//! Each powder predicted from all else: the standard deviation of ln E is 0.25 (1.08 over all hulls of 25 views
//! without the signs); 97.6 % of the truths lie in the interval, whose median width is 8.2 % at a median excess of
//! 7.8 %; the median error of the estimate is 1.1 %; of particles that lie flat 97 % lie in it. Of the kinds that are
//! made, likewise predicted from all else, 100 % of convex hulls (median excess 1.3 %) and ellipsoids lie in it, 93 %
//! of rough boxes and 91 % of grains cut by planes: facets make a slice unsteady that has no hollow. With all fitted
//! to, at least 95 % of each kind and pose do. In the median the estimate of rough boxes is then 0.7 % too small and
//! that of the most hollow powder 1.3 % too large; of other kinds and of each pose it is right within 0.5 %. How well it holds through whole captures shows
//! `tests/truth/volume_estimate.rs`, on grains of which none was fitted to (four are of powders whose other particles
//! were).
//!
//! Cameras that are not level, or not all around, show no slices; there only the outlines' concavity stands for the
//! signs, and the interval is more than twice as wide. Signs of a hull twice as large as its grain, or more, show
//! only that nothing can be estimated ([`NoEstimate`]).

mod combine;
mod outlines;
mod signs;
mod tangents;

pub use signs::Signs;

use super::Cone;
use crate::geometry::Aabb;
use combine::Spread;
use tangents::Tangents;

/// a … h of the module's formula.
const COEFFICIENTS: [f64; 8] = [-1.659, 0.351, 1.054, 0.458, 0.153, -0.130, -0.551, 0.242];
/// Standard deviation of ln E about it, of a hull as high as it is broad: 0.22 of those that it was fitted to, and
/// something for grains of another kind.
const SPREAD: f64 = 0.25;
/// By how much more that is with the square of ln(slenderness): of flat grains and of tall ones the signs tell less.
const UNEQUAL: f64 = 0.6;
/// What is added to signs before their logarithm: below this they are noise of the outlines.
const LEAST: [f64; 3] = [0.001, 0.01, 0.001];
/// Numbers of views between which it was fitted.
const FITTED_VIEWS: std::ops::RangeInclusive<f64> = 8.0..=50.0;
/// The greatest signs among those hulls: concavity, curvature variation, axial variation, gaps.
const MOST_FITTED: [f64; 4] = [0.130, 3.34, 0.652, 0.0414];
/// Between which their slenderness is.
const FITTED_SLENDERNESS: std::ops::RangeInclusive<f64> = 0.209..=4.57;
/// The greatest E that the formula is believed: a hull twice as large as its grain. It was fitted to hulls 6.5 % too large
/// in the median; far beyond it is a line extended, not how grains are.
const MOST_EXCESS: f64 = 1.0;
/// ln E = p + q·ln(concavity + 0.001), for any cameras, from the same hulls of 25 views.
const ANY_CAMERAS: [f64; 2] = [-0.769, 0.518];
/// Standard deviation about that, of which 99 % of those hulls lie in the interval: something is for other ways to go around.
const ANY_SPREAD: f64 = 0.70;
/// Standard deviation of E that no sign explains, as a share of the volume: convex bodies have it too.
const UNEXPLAINED: f64 = 0.004;
/// How far an outline is off all round, pixels (standard deviation): outlines of the simulated rig and of rendered
/// photographs, held against the truth.
const OUTLINE_PX: f64 = 0.1;
/// Of the volume of the grain's foot, where its light and the pedestal's mix, this share is uncertain.
const FOOT: f64 = 0.25;
/// Two standard deviations, but exactly 95 %.
const TWO_SIDED: f64 = 1.959_964;

/// What else is known of a hull.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known {
    /// The hull's volume, mm³.
    pub volume_mm3: f64,
    /// Its surface, mm².
    pub surface_mm2: f64,
    /// Its tight box.
    pub bounds: Aabb,
    /// Standard uncertainty of the scale over the scale; `None` where nobody knows it.
    pub scale: Option<f64>,
    /// Standard uncertainty of the volume from where the views look from, as a share of it.
    pub cameras: f64,
    /// The share of the volume that stands in the pedestal's blurred light.
    pub foot: f64,
    /// How far the outlines may be off all round beyond what they always are, pixels (standard deviation).
    pub outline_px: f64,
}

/// The grain's volume as estimated from its views, with a 95 % interval.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeEstimate {
    /// The best estimate, mm³: as likely too large as too small.
    pub volume_mm3: f64,
    /// Where the volume lies with 95 %, mm³.
    pub interval_mm3: [f64; 2],
    /// What the interval is made of.
    pub shares: Vec<Share>,
    /// The signs that it rests on; `None` where the cameras show no slices.
    pub signs: Option<Signs>,
}

/// Why a hull gives no estimate of its grain's volume, not even between which bounds it lies.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoEstimate {
    /// The signs of hollows are far beyond those of the hulls that the method was fitted to.
    #[error(
        "the outlines and slices are those of a hull {percent:.0} % too large, and the method is known to {:.0} %: the grain \
         is flaky, hollow or in pieces, so its volume can't be told from outlines; the hull's is an upper bound. Weigh the \
         grain, or capture it with another side down and merge the two",
        100.0 * MOST_EXCESS
    )]
    TooHollow {
        /// How much larger than the grain the hull would be, per cent of the grain.
        percent: f64,
    },
    /// A figure that the estimate rests on is no number.
    #[error(
        "{what} of the hull is {value}: nothing follows from it for the grain; look at the views' outlines, and give finer \
         voxels where the grain is only a few of them thick"
    )]
    NotANumber {
        /// The figure.
        what: &'static str,
        /// Its value.
        value: f64,
    },
}

/// A figure that must be a positive number, or 0 where that `may` be.
fn sound(what: &'static str, value: f64, may: bool) -> Result<f64, NoEstimate> {
    if value.is_finite() && (value > 0.0 || may && value == 0.0) {
        Ok(value)
    } else {
        Err(NoEstimate::NotANumber { what, value })
    }
}

/// A part of the uncertainty.
#[derive(Debug, Clone, PartialEq)]
pub struct Share {
    /// What is uncertain, in words.
    pub what: String,
    /// What it alone would make of the interval (95 %): per cent below and above the estimate.
    pub percent: [f64; 2],
}

/// Estimates the volume of the grain inside the hull of these views, at least one: of what stands above the pedestal, since below
/// nobody sees it. The cost is that of reading a hundred lines of each silhouette.
///
/// # Errors
/// [`NoEstimate`] where no bound but the hull's can be given. What is returned otherwise is finite, and its figures are in
/// order: 0 < least ≤ estimate ≤ most.
pub fn estimate(cones: &[Cone], known: &Known) -> Result<VolumeEstimate, NoEstimate> {
    sound("the volume", known.volume_mm3, false)?;
    sound("the surface", known.surface_mm2, false)?;
    sound("the scale's uncertainty", known.scale.unwrap_or(0.0), true)?;
    sound("the cameras' uncertainty", known.cameras, true)?;
    sound("the foot's share", known.foot, true)?;
    let silhouettes: Vec<_> = cones.iter().map(Cone::silhouette).collect();
    let concavity = outlines::concavity(&silhouettes);
    let signs = signs_beside(concavity, cones, &known.bounds);
    let beyond = concavity > MOST_FITTED[0] || signs.is_some_and(|s| !is_like_fitted(&s));
    let (log_excess, log_sd) = if let Some(signs) = &signs {
        (log_excess(signs, &COEFFICIENTS), if beyond { ANY_SPREAD } else { spread(signs) })
    } else {
        let [p, q] = ANY_CAMERAS;
        (p + q * (concavity + LEAST[0]).ln(), ANY_SPREAD)
    };
    let excess = sound("the excess", log_excess.exp(), true)?;
    if excess > MOST_EXCESS {
        return Err(NoEstimate::TooHollow { percent: 100.0 * excess });
    }
    let middle = known.bounds.center();
    let sizes: Vec<f64> = cones.iter().filter_map(|c| c.projection().px_per_mm(&middle)).collect();
    let mm_per_px = sound("the size of a pixel", sizes.len() as f64 / sizes.iter().sum::<f64>(), false)?;
    let outline_px = OUTLINE_PX.hypot(known.outline_px);
    let outline = outline_px * mm_per_px * known.surface_mm2 / known.volume_mm3;
    let scale = 3.0 * known.scale.unwrap_or(0.0);
    let foot = FOOT * known.foot;
    let seen = [outline, scale, known.cameras, foot].iter().map(|s| s * s).sum::<f64>().sqrt();
    let spread = Spread { log_excess, log_sd, sd: seen.hypot(UNEXPLAINED) };
    let at = |share: f64| known.volume_mm3 * spread.quantile(share).exp();
    // The grain is within its hull: only what the views themselves may have wrong can take it outside.
    let most = known.volume_mm3 * (TWO_SIDED * seen).exp();
    let volume_mm3 = at(0.5).min(known.volume_mm3);
    let interval_mm3 = [at(0.025), at(0.975).min(most)];
    for value in [interval_mm3[0], volume_mm3, interval_mm3[1]] {
        sound("the estimated volume", value, false)?;
    }

    let alone = Spread { sd: UNEXPLAINED, ..spread };
    let [low, high] = [0.025, 0.975].map(|q| 100.0 * ((alone.quantile(q) - alone.quantile(0.5)).exp() - 1.0));
    let excess = 100.0 * excess;
    let how = if signs.is_some() {
        "as told by how empty the outlines are and how unsteady the slices"
    } else {
        "as told by how empty the outlines are alone, since the cameras show no level slices all around"
    };
    let beyond = if beyond { " (farther than in any grain that this was fitted to)" } else { "" };
    let mut shares = vec![Share {
        what: format!(
            "hollows and corners that no view sees: the hull is about {excess:.1} % too large, {how}{beyond}"
        ),
        percent: [low, high],
    }];
    let mut add = |what: String, sd: f64| {
        let percent = 100.0 * ((TWO_SIDED * sd).exp() - 1.0);
        shares.push(Share { what, percent: [-percent, percent] });
    };
    add(format!("the outlines' place, {outline_px:.1} px all round"), outline);
    match known.scale {
        Some(relative) => {
            add(
                format!("the size of a pixel, {:.2} % and three times that in volume", 100.0 * relative),
                scale,
            );
        }
        None => add("the size of a pixel: taken as exact, since its uncertainty is not known".into(), 0.0),
    }
    if known.cameras > 0.0 {
        add("axis, angles and the views' shifts".into(), known.cameras);
    }
    if known.foot > 0.0 {
        add("the foot, where the grain's light and the pedestal's mix".into(), foot);
    }
    Ok(VolumeEstimate { volume_mm3, interval_mm3, shares, signs })
}

/// The signs that the views show of a hull in this box; `None` where they show no level slices all around, or are fewer
/// or more than the formula was fitted to.
pub fn signs(cones: &[Cone], bounds: &Aabb) -> Option<Signs> {
    let silhouettes: Vec<_> = cones.iter().map(Cone::silhouette).collect();
    signs_beside(outlines::concavity(&silhouettes), cones, bounds)
}

/// The same where the concavity is known already.
fn signs_beside(concavity: f64, cones: &[Cone], bounds: &Aabb) -> Option<Signs> {
    let tangents = Tangents::read(cones, bounds)?;
    let gaps = outlines::gaps(cones.iter().map(Cone::silhouette));
    Signs::of(&tangents, bounds.size().z, [concavity, gaps]).filter(|s| FITTED_VIEWS.contains(&s.views))
}

/// Whether signs are within what the formula was fitted to; beyond, it is drawn out, and the spread is that of no signs.
fn is_like_fitted(signs: &Signs) -> bool {
    let [concavity, curvature_variation, axial_variation, gaps] = MOST_FITTED;
    signs.concavity <= concavity
        && signs.curvature_variation <= curvature_variation
        && signs.axial_variation <= axial_variation
        && signs.gaps <= gaps
        && FITTED_SLENDERNESS.contains(&signs.slenderness)
}

/// The module's formula with these coefficients.
fn log_excess(signs: &Signs, coefficients: &[f64; 8]) -> f64 {
    terms(signs).iter().zip(coefficients).map(|(term, c)| term * c).sum()
}

/// Standard deviation of ln E about it.
fn spread(signs: &Signs) -> f64 {
    SPREAD * (1.0 + UNEQUAL * signs.slenderness.ln().powi(2))
}

/// What the formula's coefficients stand before.
fn terms(signs: &Signs) -> [f64; 8] {
    let concavity = (signs.concavity + LEAST[0]).ln();
    let views = (signs.views / 25.0).ln();
    [
        1.0,
        concavity,
        signs.curvature_variation,
        (signs.axial_variation + LEAST[1]).ln(),
        (signs.gaps + LEAST[2]).ln(),
        signs.slenderness.ln(),
        views,
        concavity * views,
    ]
}

#[cfg(test)]
#[path = "fit/tests.rs"]
mod fit;
#[cfg(test)]
mod tests;
