//! One view's cone: everything that projects into its silhouette.

use crate::geometry::{Point, Projection, Vector};
use crate::silhouette::Silhouette;
use std::sync::Arc;

/// The value of a place that the camera can't see at all, mm: outside, whatever the other views say.
const BEHIND_MM: f64 = 1e6;

/// How much the interpolated distance field may differ from a true distance, pixels: bilinear interpolation of
/// a distance errs by less than the pixel's half diagonal where the outline's skeleton runs.
const FIELD_SLACK_PX: f64 = 0.75;

/// A view's camera and silhouette.
#[derive(Debug, Clone)]
pub struct Cone {
    projection: Projection,
    silhouette: Arc<Silhouette>,
    /// Pixels per mm where that is the same everywhere (orthographic views).
    uniform_px_per_mm: Option<f64>,
}

/// Where a ball lies with respect to a cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The whole ball is inside.
    Inside,
    /// The whole ball is outside.
    Outside,
    /// The outline may pass through the ball.
    Across,
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

    fn scale(&self, p: &Point) -> Option<f64> {
        self.uniform_px_per_mm.or_else(|| self.projection.px_per_mm(p))
    }

    /// Signed distance to the cone, mm: the distance in the picture over the local scale. Negative inside;
    /// places outside the picture or behind the camera are outside.
    #[inline]
    pub fn value_mm(&self, p: &Point) -> f64 {
        let (Some(q), Some(scale)) = (self.projection.project(p), self.scale(p)) else { return BEHIND_MM };
        self.silhouette.signed_distance_px(q) / scale
    }

    /// Raises each value to the signed distance (mm) at its place where that is greater. The places lie on a line
    /// along x, `pitch_mm` apart, the first at `first`: before parallel rays the picture moves by the same step.
    pub(super) fn carve_row(&self, first: &Point, pitch_mm: f64, values: &mut [f32]) {
        let Some(scale) = self.uniform_px_per_mm else {
            for (i, value) in values.iter_mut().enumerate() {
                let p = first + Vector::x() * (i as f64 * pitch_mm);
                *value = value.max(self.value_mm(&p) as f32);
            }
            return;
        };
        let m = &self.projection.matrix;
        let (w, mm_per_px) = (m[(2, 3)], 1.0 / scale);
        let row = |r: usize| {
            let at = m[(r, 0)] * first.x + m[(r, 1)] * first.y + m[(r, 2)] * first.z + m[(r, 3)];
            (at / w, m[(r, 0)] * pitch_mm / w)
        };
        let ((u, du), (v, dv)) = (row(0), row(1));
        for (i, value) in values.iter_mut().enumerate() {
            let i = i as f64;
            let d = self.silhouette.signed_distance_px([u + i * du, v + i * dv]) * mm_per_px;
            *value = value.max(d as f32);
        }
    }

    /// Where the ball of `radius_mm` about `center` lies: sound, not sharp (`Across` may be said too often).
    #[inline]
    pub fn side_of_ball(&self, center: &Point, radius_mm: f64) -> Side {
        let (Some(q), Some(scale)) = (self.projection.project(center), self.scale(center)) else {
            return Side::Across;
        };
        let mut reach = radius_mm * scale;
        if self.uniform_px_per_mm.is_none() {
            // Nearer to the camera the picture grows: bound it by the ball's nearest depth.
            let m = &self.projection.matrix;
            let w = m[(2, 0)] * center.x + m[(2, 1)] * center.y + m[(2, 2)] * center.z + m[(2, 3)];
            let fall = radius_mm * (m[(2, 0)].powi(2) + m[(2, 1)].powi(2) + m[(2, 2)].powi(2)).sqrt();
            if fall >= 0.9 * w {
                return Side::Across;
            }
            reach *= (w / (w - fall)).powi(2);
        }
        reach += FIELD_SLACK_PX;
        let d = self.silhouette.signed_distance_px(q);
        if d > reach {
            Side::Outside
        } else if d < -reach {
            Side::Inside
        } else {
            Side::Across
        }
    }
}
