//! The surfaces that a grain may have.

use super::super::compressing::{hull_of, surface_center};
use super::JobError;
use grainrig_core::contact::{Foot, Rests, normal_vector, perturbed};
use grainrig_core::geometry::TriangleMesh;

/// How deep a foot may be, over what is the most likely: the middles of five parts that are as likely, of a depth known to a factor of
/// two (2 to the power of a normal deviate). The most likely stands first.
const FOOT_SHARES: [f64; 5] = [1.0, 0.411, 2.431, 0.695, 1.438];
/// Surfaces of a hull that is not known exactly, with each foot or without one; the first is the surface as it is.
const HULLS: usize = 20;
/// The length over which an outline's error stays the same, over the cube root of the grain's volume: two to three views.
const LENGTH: f64 = 0.12;
/// The standard deviation of the centre of mass along each axis, over the hull's share that is hollow and the cube root of its volume:
/// chosen after a few captures whose truth is known.
const CENTER: f64 = 0.1;

/// What is not known of a hull.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::jobs) struct Unknown {
    /// Standard deviation of its outline, mm.
    pub outline_mm: f64,
    /// The share of it that is hollows which no view shows: where they are moves the centre of mass.
    pub hollows: f64,
}

/// A grain as it may be.
pub(in crate::jobs) struct Variants {
    /// One as likely as the other; the first is the most likely one.
    pub surfaces: Vec<TriangleMesh>,
    /// How each can lie.
    pub rests: Vec<Rests>,
    /// The depths to which its foot was closed, mm; empty where it has none, or it was left flat.
    pub foot_depths_mm: Vec<f64>,
}

impl Variants {
    /// Of a surface as it was carved, its foot where that is to be closed, what is not known of the hull, and the least lift of a rest
    /// (mm), the usual one where it is none.
    ///
    /// # Errors
    /// [`ContactError::Flat`](grainrig_core::contact::ContactError::Flat).
    pub(in crate::jobs) fn new(
        carved: &TriangleMesh,
        foot: Option<&Foot>,
        unknown: &Unknown,
        least_lift_mm: Option<f64>,
    ) -> Result<Self, JobError> {
        let foot = foot.filter(|f| f.depth_mm.is_some());
        let shares: &[f64] = if foot.is_some() { &FOOT_SHARES } else { &[1.0] };
        let is_known = unknown.outline_mm <= 0.0 && unknown.hollows <= 0.0;
        let count = if is_known { shares.len() } else { HULLS };
        let size_mm = carved.volume_mm3().abs().cbrt();
        let surface = |k: usize| {
            let closed = foot.map_or_else(|| carved.clone(), |f| f.closed(carved, shares[k % shares.len()]));
            if k == 0 { closed } else { perturbed(&closed, unknown.outline_mm, LENGTH * size_mm, k) }
        };
        let surfaces: Vec<TriangleMesh> = (0..count).map(surface).collect();
        let rests = surfaces.iter().enumerate().map(|(k, s)| {
            // The first is as it is.
            let share = if k == 0 { 0.0 } else { CENTER * unknown.hollows * size_mm };
            let center = surface_center(s) + normal_vector(k).0 * share;
            Ok(Rests::new(hull_of(&s.vertices)?, &center, least_lift_mm))
        });
        let rests = rests.collect::<Result<_, JobError>>()?;
        let depth_mm = foot.and_then(|f| f.depth_mm);
        let foot_depths_mm = depth_mm.map_or_else(Vec::new, |mm| shares.iter().map(|s| s * mm).collect());
        Ok(Self { surfaces, rests, foot_depths_mm })
    }
}
