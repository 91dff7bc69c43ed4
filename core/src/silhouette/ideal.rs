//! Silhouettes from computed coverage rather than a photograph.

use super::distance;
use super::field::Silhouette;
use super::outline::Field;

impl Silhouette {
    /// From the share of each pixel that the body covers, 0 to 1, `[row, column]` of a whole picture: the outline lies
    /// where half would be covered. `None` where the values are not `size[0]` × `size[1]`, or none.
    pub fn of_coverage(size: [usize; 2], coverage: &[f32]) -> Option<Self> {
        let [width, height] = size;
        if coverage.is_empty() || coverage.len() != width * height {
            return None;
        }
        let values = coverage.iter().map(|c| 1.0 - 2.0 * c).collect();
        let distance_px = distance::signed(&Field { width, height, values });
        Some(Self { picture: size, origin: [0, 0], size, distance_px })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_covered_pixel_is_half_of_it() {
        // A bar from 2.25 to 6.5 across five rows.
        let row = [0.0, 0.0, 0.25, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0];
        let coverage: Vec<f32> = (0..5).flat_map(|_| row).collect();
        let s = Silhouette::of_coverage([9, 5], &coverage).unwrap();
        let ends = s.extents_px()[2].unwrap();
        assert!((ends[0] - 2.333).abs() < 0.01 && (ends[1] - 6.5).abs() < 0.01, "{ends:?}");
        assert!(Silhouette::of_coverage([9, 4], &coverage).is_none());
    }
}
