//! Area, first and second moments of polygons.

use super::cut::{Corner, cross};

/// Moments of a plane figure about the axis: area (mm²), first (mm³) and second (mm⁴) moments.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Moments {
    pub area: f64,
    /// ∫x, ∫y.
    pub first: [f64; 2],
    /// ∫x², ∫y², ∫xy.
    pub second: [f64; 3],
}

impl Moments {
    /// Of a polygon, counter-clockwise: exact (the divergence theorem on a fan of triangles about the first corner).
    pub(super) fn of(polygon: &[Corner]) -> Self {
        let mut m = Self::default();
        let Some(o) = polygon.first().map(|c| c.at) else { return m };
        let from = |c: &Corner| [c.at[0] - o[0], c.at[1] - o[1]];
        for pair in polygon[1..].windows(2) {
            let (a, b) = (from(&pair[0]), from(&pair[1]));
            let w = cross(a, b);
            m.area += w;
            m.first[0] += w * (a[0] + b[0]);
            m.first[1] += w * (a[1] + b[1]);
            m.second[0] += w * (a[0] * a[0] + a[0] * b[0] + b[0] * b[0]);
            m.second[1] += w * (a[1] * a[1] + a[1] * b[1] + b[1] * b[1]);
            m.second[2] += w * (a[0] * a[1] + b[0] * b[1] + 0.5 * (a[0] * b[1] + b[0] * a[1]));
        }
        m.area /= 2.0;
        m.first = m.first.map(|x| x / 6.0);
        m.second = m.second.map(|x| x / 12.0);
        m.moved(o)
    }

    /// About an origin that lies at −`by`.
    fn moved(&self, by: [f64; 2]) -> Self {
        let (a, [fx, fy], [xx, yy, xy]) = (self.area, self.first, self.second);
        Self {
            area: a,
            first: [fx + a * by[0], fy + a * by[1]],
            second: [
                xx + by[0] * (2.0 * fx + a * by[0]),
                yy + by[1] * (2.0 * fy + a * by[1]),
                xy + by[0] * fy + by[1] * (fx + a * by[0]),
            ],
        }
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            area: self.area + other.area,
            first: [0, 1].map(|k| self.first[k] + other.first[k]),
            second: [0, 1, 2].map(|k| self.second[k] + other.second[k]),
        }
    }

    /// The centre of area; `None` where there is none.
    pub(super) fn centroid(&self) -> Option<[f64; 2]> {
        (self.area > 0.0).then(|| self.first.map(|x| x / self.area))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_has_the_textbook_moments_wherever_it_stands() {
        // Base b along x, height h: about its centroid b h³/36, h b³/36, and b² h²/72 for a right angle, with a minus.
        let (b, h) = (3.0, 2.0);
        for o in [[0.0, 0.0], [10.0, -7.0]] {
            let corners = [[0.0, 0.0], [b, 0.0], [0.0, h]];
            let polygon = corners.map(|c| Corner { at: [c[0] + o[0], c[1] + o[1]], edge: 0 });
            let m = Moments::of(&polygon);
            let c = m.centroid().unwrap();
            assert!((m.area - 3.0).abs() < 1e-12);
            assert!((c[0] - o[0] - b / 3.0).abs() < 1e-12 && (c[1] - o[1] - h / 3.0).abs() < 1e-12);
            let own = m.moved([-c[0], -c[1]]).second;
            let expected = [h * b.powi(3) / 36.0, b * h.powi(3) / 36.0, -b * b * h * h / 72.0];
            for k in 0..3 {
                assert!((own[k] - expected[k]).abs() < 1e-11, "{k}: {} {}", own[k], expected[k]);
            }
        }
    }
}
