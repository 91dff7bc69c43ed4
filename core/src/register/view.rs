//! One view of a pose: camera, outline, and where the pedestal's light begins.

use super::Cut;
use crate::geometry::{Point, Projection};
use crate::hull::Cone;
use crate::silhouette::Silhouette;
use std::sync::Arc;

/// A view of a pose.
#[derive(Debug, Clone)]
pub struct PoseView {
    /// The camera.
    pub projection: Projection,
    /// The outline.
    pub silhouette: Arc<Silhouette>,
    /// Where the view stops to show the grain by itself; absent where it shows all of it.
    pub cut: Option<Cut>,
}

impl PoseView {
    /// The view's cone, which leaves alone what the view does not show.
    pub(super) fn open(&self) -> Cone {
        let silhouette = match &self.cut {
            Some(cut) => Arc::new(cut.opened(&self.silhouette)),
            None => Arc::clone(&self.silhouette),
        };
        Cone::new(self.projection.clone(), silhouette)
    }

    /// Whether the view shows this point's surroundings, `margin_px` above its cut.
    pub(super) fn shows(&self, p: &Point, margin_px: f64) -> bool {
        let Some(cut) = &self.cut else { return true };
        self.projection.project(p).is_some_and(|q| cut.above_px(q) > margin_px)
    }
}
