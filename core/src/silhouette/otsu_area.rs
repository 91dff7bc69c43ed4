//! Area of the mask that Otsu's threshold alone gives, to compare the outline with.

use super::Silhouette;
use super::plane::{PER_LEVEL, Plane};

/// Pixels this near to the outline count: what lies further off is another object.
const NEAR_PX: f32 = 6.0;

/// Square pixels of the plane above a threshold (grey levels), in the outline and near it, where `counts` holds for a
/// pixel in the plane: the published method's mask of the same object, counted.
pub(super) fn area_px(
    plane: &Plane,
    silhouette: &Silhouette,
    threshold: f64,
    counts: impl Fn(f64, f64) -> bool,
) -> f64 {
    let limit = (threshold * f64::from(PER_LEVEL)).clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16;
    let [width, _] = silhouette.size;
    let first = [silhouette.origin[0] - plane.rect.x0, silhouette.origin[1] - plane.rect.y0];
    let mut count = 0_usize;
    for (j, row) in silhouette.distance_px.chunks_exact(width).enumerate() {
        let y = first[1] + j;
        let values = &plane.values[y * plane.width + first[0]..][..width];
        for (i, (d, v)) in row.iter().zip(values).enumerate() {
            count += usize::from(*d < NEAR_PX && *v > limit && counts((first[0] + i) as f64, y as f64));
        }
    }
    count as f64
}
