//! Rigid registration of two captures of one grain, another side down in the second.
//!
//! Each pose's hull is an upper bound of the grain, too fat elsewhere than the other's: their surfaces need not
//! agree. What must agree is that both together still fill every silhouette. So the turns of all space are tried
//! coarsely by the surfaces, the best followed by them, and the best of these by the outlines alone: the ray through
//! an outline touches the grain, so some point on it belongs to both hulls (`rims.rs`). The result is refused where the
//! silhouettes are not filled, and where another turn fills them about as well.

mod error;
mod field;
mod fit;
mod motion;
mod open;
mod pose;
mod rims;
mod search;
mod view;

pub use error::RegisterError;
pub use motion::Motion;
pub use open::Cut;
pub use pose::Pose;
pub use view::PoseView;

use crate::geometry::{ImplicitBody as _, Point};
use serde::Serialize;

/// A silhouette that two hulls of one grain fill is unfilled by no more than this, pixels along its outline, in the
/// median view, beyond what its own pose leaves unfilled …
const MOST_UNFILLED_PX: f64 = 0.5;
/// … or than this share of the grain's size: cameras and scale are never perfect.
const MOST_UNFILLED_SHARE: f64 = 0.002;
/// Another turn, at least this far off, is as good where it leaves less than so many times as much unfilled, or less
/// than so much more, pixels.
const RIVAL_RAD: f64 = 0.15;
const RIVAL_RATIO: f64 = 1.5;
const RIVAL_PX: f64 = 0.1;

/// How far silhouettes are not filled: the mean depth along the outline, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unfilled {
    /// Over all rays.
    pub mean_px: f64,
    /// The median view's.
    pub median_view_px: f64,
    /// The worst view's.
    pub worst_view_px: f64,
}

/// The next best turn.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rival {
    /// How far it is from the best one, degrees.
    pub apart_deg: f64,
    /// What it leaves unfilled, pixels (mean depth along all outlines).
    pub mean_px: f64,
}

/// How a pose lies to another, and how well they agree.
#[derive(Debug, Clone, PartialEq)]
pub struct Registration {
    /// From the second pose's frame to the first's.
    pub motion: Motion,
    /// Root mean square over all rays through outlines of what both hulls together leave unfilled, pixels.
    pub residual_px: f64,
    /// What both hulls together leave unfilled of all views' silhouettes.
    pub unfilled: Unfilled,
    /// What each pose's hull leaves unfilled of its own silhouettes.
    pub alone: Unfilled,
    /// The same of both together, each view of the first pose …
    pub views_a_px: Vec<f64>,
    /// … and of the second.
    pub views_b_px: Vec<f64>,
    /// What the unfilled part may be in the median view, pixels.
    pub limit_px: f64,
    /// The next best turn, where there is one.
    pub rival: Option<Rival>,
}

/// Finds the motion that takes the second pose into the frame of the first. Costs about as much as one carving of each
/// hull; the same on any number of threads. `progress` is called with the part done, from 0 to 1.
///
/// # Errors
/// [`RegisterError::Poor`] and [`RegisterError::Ambiguous`].
pub fn register(a: &Pose, b: &Pose, progress: &mut dyn FnMut(f64)) -> Result<Registration, RegisterError> {
    let found = search::candidates(a, b, progress);
    let measured: Vec<Registration> = found.iter().map(|motion| measure(a, b, motion)).collect();
    let first = (0..measured.len())
        .min_by(|i, j| measured[*i].unfilled.mean_px.total_cmp(&measured[*j].unfilled.mean_px));
    let Some(mut best) = first.map(|k| measured[k].clone()) else { return Err(RegisterError::NoTurn) };
    best.rival = (measured.iter())
        .filter(|m| m.motion.apart_rad(&best.motion) > RIVAL_RAD)
        .min_by(|x, y| x.unfilled.mean_px.total_cmp(&y.unfilled.mean_px))
        .map(|m| Rival {
            apart_deg: m.motion.apart_rad(&best.motion).to_degrees(),
            mean_px: m.unfilled.mean_px,
        });
    // A hull that is larger all round fills the other's silhouettes: the worse of both poses counts.
    let unfilled_px = [&best.views_a_px, &best.views_b_px].map(|v| unfilled(v).median_view_px);
    let unfilled_px = unfilled_px[0].max(unfilled_px[1]);
    if unfilled_px > best.limit_px {
        return Err(RegisterError::Poor {
            unfilled_px,
            limit_px: best.limit_px,
            alone_px: best.alone.median_view_px,
        });
    }
    if let Some(rival) = best.rival {
        let limit_px = (RIVAL_RATIO * best.unfilled.mean_px).max(best.unfilled.mean_px + RIVAL_PX);
        if rival.mean_px < limit_px {
            return Err(RegisterError::Ambiguous {
                apart_deg: rival.apart_deg,
                best_px: best.unfilled.mean_px,
                rival_px: rival.mean_px,
                limit_px,
            });
        }
    }
    Ok(best)
}

/// How well a motion fits, by the exact hulls.
fn measure(a: &Pose, b: &Pose, motion: &Motion) -> Registration {
    let back = motion.inverse();
    let nothing = |_: &Point| f64::NEG_INFINITY;
    let rays_a = rims::unfilled_px(&a.rims, &|p| b.body().value(&back.transform(p)));
    let rays_b = rims::unfilled_px(&b.rims, &|p| a.body().value(&motion.transform(p)));
    let views_a_px = rims::by_view(a.views().len(), &a.rims, &rays_a);
    let views_b_px = rims::by_view(b.views().len(), &b.rims, &rays_b);
    let own =
        |pose: &Pose| rims::by_view(pose.views().len(), &pose.rims, &rims::unfilled_px(&pose.rims, &nothing));
    let alone = unfilled(&[own(a), own(b)].concat());
    let rays = rays_a.len() + rays_b.len();
    let squares = rays_a.iter().chain(&rays_b).map(|v| v * v).sum::<f64>();
    let size_px = 0.5 * (a.size_mm * a.px_per_mm + b.size_mm * b.px_per_mm);
    Registration {
        motion: *motion,
        residual_px: (squares / rays as f64).sqrt(),
        unfilled: unfilled(&[&views_a_px[..], &views_b_px].concat()),
        alone,
        views_a_px,
        views_b_px,
        limit_px: alone.median_view_px + MOST_UNFILLED_PX.max(MOST_UNFILLED_SHARE * size_px),
        rival: None,
    }
}

fn unfilled(views: &[f64]) -> Unfilled {
    let mut sorted = views.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    Unfilled {
        mean_px: sorted.iter().sum::<f64>() / n as f64,
        median_view_px: 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
        worst_view_px: sorted[n - 1],
    }
}
