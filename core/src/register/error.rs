//! Errors of registration.

use crate::hull::HullError;

/// Why there is no motion between two poses.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegisterError {
    /// No motion fills the silhouettes.
    #[error(
        "the two hulls together leave {unfilled_px:.2} px of the silhouettes unfilled (mean depth along the outline, \
         median view), the limit is {limit_px:.2} px, each pose alone leaves {alone_px:.2} px: check that both sessions \
         show the same grain, that both scales are right and that both name the true sense of rotation"
    )]
    Poor {
        /// What the best motion leaves unfilled, pixels.
        unfilled_px: f64,
        /// What it may.
        limit_px: f64,
        /// What the poses alone leave unfilled.
        alone_px: f64,
    },
    /// Two clearly different motions are about equally good.
    #[error(
        "how the two poses lie to one another is ambiguous: a turn {apart_deg:.0}° from the best one leaves \
         {rival_px:.2} px of the silhouettes unfilled, the best {best_px:.2} px, and to be told apart it must leave at \
         least {limit_px:.2} px: the grain is symmetric or nearly so; use the hull of one pose, or capture at a larger \
         magnification"
    )]
    Ambiguous {
        /// The angle between the two turns, degrees.
        apart_deg: f64,
        /// What the best leaves unfilled, pixels (mean depth along the outlines).
        best_px: f64,
        /// What the other leaves unfilled.
        rival_px: f64,
        /// What the other would have to leave unfilled to be distinguished.
        limit_px: f64,
    },
    /// The search has found nothing at all.
    #[error(
        "no motion takes one hull onto the other: a silhouette or camera holds values that are not finite"
    )]
    NoTurn,
    /// A pose has no hull.
    #[error(transparent)]
    Hull(#[from] HullError),
}
