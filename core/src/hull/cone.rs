//! Viewing cone of one view: all points that project into its silhouette.

use crate::geometry::{Point, Projection, Vector};
use crate::silhouette::Silhouette;
use std::sync::Arc;

/// The value of a point that the camera can't see at all, mm: outside, whatever the other views.
const BEHIND_MM: f64 = 1e6;

/// How much the interpolated distance field may differ from a true distance, pixels: bilinear interpolation of
/// a distance errs by less than the pixel's half diagonal where the outline's skeleton runs.
const FIELD_SLACK_PX: f64 = 0.75;

/// The nearest part of a box may be at this part of its centre's depth: nearer, its picture bounds little.
const LEAST_DEPTH: f64 = 0.1;

/// A view's camera and silhouette.
#[derive(Debug, Clone)]
pub struct Cone {
    projection: Projection,
    silhouette: Arc<Silhouette>,
    /// Pixels per mm where that is the same everywhere (orthographic views).
    uniform_px_per_mm: Option<f64>,
}

/// Where a box lies with respect to a cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    /// The whole box is inside.
    Inside,
    /// The whole box is outside.
    Outside,
    /// The outline may pass through the box.
    Across,
}

/// A box's picture.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Column and row of the picture of its centre.
    pub(super) center_px: [f64; 2],
    /// No point of the box is seen farther from the centre's picture than this, pixels.
    pub(super) reach_px: f64,
}

impl Cone {
    /// A view from its camera and silhouette.
    pub fn new(projection: Projection, silhouette: Arc<Silhouette>) -> Self {
        let uniform_px_per_mm =
            if projection.is_orthographic() { projection.px_per_mm(&Point::origin()) } else { None };
        Self { projection, silhouette, uniform_px_per_mm }
    }

    /// The view's camera.
    pub fn projection(&self) -> &Projection {
        &self.projection
    }

    /// The view's silhouette.
    pub fn silhouette(&self) -> &Silhouette {
        &self.silhouette
    }

    /// The most pixels that 1 mm at `p` can be seen as; `None` at or behind the camera.
    pub(super) fn px_per_mm(&self, p: &Point) -> Option<f64> {
        self.uniform_px_per_mm.or_else(|| self.projection.px_per_mm(p))
    }

    /// Signed distance to the cone, mm: the distance in the picture over the local scale. Negative inside;
    /// points outside the picture or behind the camera are outside.
    #[inline]
    pub fn value_mm(&self, p: &Point) -> f64 {
        let (Some(q), Some(scale)) = (self.projection.project(p), self.px_per_mm(p)) else {
            return BEHIND_MM;
        };
        self.silhouette.signed_distance_px(q) / scale
    }

    /// The picture of the box about `center`: its centre's and how far it reaches from there. `None` where the box
    /// comes close to the camera or reaches behind it.
    ///
    /// A displacement s moves the picture by A s/(w + m₃·s), where row i of A is mᵢ − uᵢ m₃, w is the centre's depth
    /// and mᵢ are the rows of the camera's matrix: greatest at a corner, over the least depth.
    #[inline]
    pub(super) fn spot(&self, center: &Point, half: &Vector) -> Option<Spot> {
        let m = &self.projection.matrix;
        let at = |r: usize| m[(r, 0)] * center.x + m[(r, 1)] * center.y + m[(r, 2)] * center.z + m[(r, 3)];
        let w = at(2);
        let fall = m[(2, 0)].abs() * half.x + m[(2, 1)].abs() * half.y + m[(2, 2)].abs() * half.z;
        let least = w - fall;
        if !(w > 0.0 && least > LEAST_DEPTH * w) {
            return None;
        }
        let center_px = [at(0) / w, at(1) / w];
        let row = |r: usize| [0, 1, 2].map(|k| (m[(r, k)] - center_px[r] * m[(2, k)]) * half[k]);
        let (a, b) = (row(0), row(1));
        let corner = |s: f64, t: f64| {
            let (x, y) = (a[0] + s * a[1] + t * a[2], b[0] + s * b[1] + t * b[2]);
            x * x + y * y
        };
        let farthest = corner(1.0, 1.0).max(corner(1.0, -1.0)).max(corner(-1.0, 1.0)).max(corner(-1.0, -1.0));
        Some(Spot { center_px, reach_px: farthest.sqrt() / least })
    }

    /// Where the box of half edges `half` about `center` lies: sound, not sharp (`Across` may be returned too often).
    #[inline]
    pub(super) fn side_of_box(&self, center: &Point, half: &Vector) -> Side {
        let Some(spot) = self.spot(center, half) else { return Side::Across };
        let reach = spot.reach_px + FIELD_SLACK_PX;
        let d = self.silhouette.signed_distance_px(spot.center_px);
        if d > reach {
            Side::Outside
        } else if d < -reach {
            Side::Inside
        } else {
            Side::Across
        }
    }
}
