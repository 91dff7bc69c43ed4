//! One view's signed distances at the lattice points of a block, mm.

use super::Cone;
use super::grid::{B, POINTS};
use crate::geometry::{Point, Vector};
use crate::silhouette::Silhouette;

/// Lattice points in a plane of a block.
const PLANE: usize = B * B;
/// Added to a number below 2²², this leaves the nearest whole number: a float of that size has no fraction.
const WHOLE: f32 = 12_582_912.0;
/// A block that is seen larger than this is done in double precision, point by point.
const MOST_REACH_PX: f64 = 1000.0;

impl Cone {
    /// Raises each value of a block to this view's signed distance (mm) there, where that is greater.
    ///
    /// `[z, y, x]`, the first at `first`, `pitch_mm` apart. The value of a view at a point depends on the view, the
    /// point and its block alone, so neither the views' order nor the threads change a bit. The distance in the
    /// picture is exact to 1e-4 px where the block is seen smaller than 100 px; the scale varies with the depth and
    /// is otherwise taken at the block's centre, which moves no zero.
    pub(super) fn raise(&self, first: &Point, pitch_mm: f64, values: &mut [f32; POINTS]) {
        let half = Vector::repeat(0.5 * (B - 1) as f64 * pitch_mm);
        let center = first + half;
        let s = self.silhouette();
        if let (Some(spot), Some(scale)) = (self.spot(&center, &half), self.px_per_mm(&center))
            && spot.reach_px < MOST_REACH_PX
            && s.size.iter().all(|n| *n > 1)
        {
            let end = |k: usize| (s.origin[k] + s.size[k] - 1) as f64;
            let middle: [f64; 2] =
                std::array::from_fn(|k| spot.center_px[k].round().clamp(s.origin[k] as f64, end(k)));
            // A pixel more on each side, for what rounding may do.
            let fits = (0..2).all(|k| {
                spot.center_px[k] - spot.reach_px >= s.origin[k] as f64 + 1.0
                    && spot.center_px[k] + spot.reach_px <= end(k) - 1.0
            });
            let rows = Rows::new(self, first, pitch_mm, middle, scale, &center);
            if fits {
                rows.raise::<true>(s, values);
            } else {
                rows.raise::<false>(s, values);
            }
            return;
        }
        for (k, value) in values.iter_mut().enumerate() {
            let p = first + Vector::new((k % B) as f64, (k / B % B) as f64, (k / PLANE) as f64) * pitch_mm;
            raise_to(value, self.value_mm(&p) as f32);
        }
    }
}

/// A block before a view: the picture's numerators and its denominator, each linear in x, y and z, in steps of the
/// pitch, so that a row costs one division a point. Single precision about a pixel in the middle of the block's
/// picture.
struct Rows {
    /// Column and row of the middle pixel.
    middle: [f64; 2],
    /// At the first point.
    start: [f64; 3],
    /// What a step along x, y and z adds.
    steps: [[f64; 3]; 3],
    /// mm per pixel over the depth.
    mm_per_px: f32,
}

impl Rows {
    fn new(
        cone: &Cone,
        first: &Point,
        pitch_mm: f64,
        middle: [f64; 2],
        px_per_mm: f64,
        center: &Point,
    ) -> Self {
        let m = &cone.projection().matrix;
        let form = |r: usize, c: f64| [0, 1, 2, 3].map(|k| m[(r, k)] - c * m[(2, k)]);
        let forms = [form(0, middle[0]), form(1, middle[1]), form(2, 0.0)];
        let at = |f: &[f64; 4], p: &Point| f[0] * p.x + f[1] * p.y + f[2] * p.z + f[3];
        Self {
            middle,
            start: [0, 1, 2].map(|i| at(&forms[i], first)),
            steps: [0, 1, 2].map(|k| [0, 1, 2].map(|i| forms[i][k] * pitch_mm)),
            mm_per_px: (1.0 / (px_per_mm * at(&forms[2], center))) as f32,
        }
    }

    /// The values, a plane at a time. `WITHIN`: the block's picture lies within the silhouette's rectangle, so that
    /// no point needs to be held to it.
    fn raise<const WITHIN: bool>(&self, s: &Silhouette, values: &mut [f32; POINTS]) {
        let width = s.size[0];
        let wide = width as f32;
        let middle: [usize; 2] = std::array::from_fn(|k| self.middle[k] as usize - s.origin[k]);
        let base = middle[1] * width + middle[0];
        // The rectangle, from the middle pixel.
        let low = middle.map(|c| -(c as f32));
        let high: [f32; 2] = std::array::from_fn(|k| (s.size[k] - 1 - middle[k]) as f32);
        let d = &s.distance_px;
        let along_x = self.steps[0].map(|x| x as f32);
        for (z, plane) in values.chunks_exact_mut(PLANE).enumerate() {
            let (mut part_x, mut part_y) = ([0f32; PLANE], [0f32; PLANE]);
            let (mut scale, mut away2) = ([0f32; PLANE], [0f32; PLANE]);
            let mut offset = [0i32; PLANE];
            for y in 0..B {
                let start: [f32; 3] = std::array::from_fn(|i| {
                    (self.start[i] + self.steps[1][i] * y as f64 + self.steps[2][i] * z as f64) as f32
                });
                for x in 0..B {
                    let k = y * B + x;
                    let along = |i: usize| start[i] + x as f32 * along_x[i];
                    let w = along(2);
                    let near = 1.0 / w;
                    let (mut u, mut v) = (along(0) * near, along(1) * near);
                    if !WITHIN {
                        let (cu, cv) = (u.max(low[0]).min(high[0]), v.max(low[1]).min(high[1]));
                        away2[k] = (u - cu) * (u - cu) + (v - cv) * (v - cv);
                        (u, v) = (cu, cv);
                    }
                    // The pixel to the left and above: the whole number nearest to half a pixel less.
                    let (mut i, mut j) = ((u - 0.5 + WHOLE) - WHOLE, (v - 0.5 + WHOLE) - WHOLE);
                    if !WITHIN {
                        (i, j) = (i.max(low[0]).min(high[0] - 1.0), j.max(low[1]).min(high[1] - 1.0));
                    }
                    part_x[k] = u - i;
                    part_y[k] = v - j;
                    offset[k] = (j * wide + i) as i32;
                    scale[k] = w * self.mm_per_px;
                }
            }
            let mut corners = [[0f32; PLANE]; 4];
            for k in 0..PLANE {
                let at = base.wrapping_add_signed(offset[k] as isize);
                let (top, low) = (&d[at..at + 2], &d[at + width..at + width + 2]);
                corners[0][k] = top[0];
                corners[1][k] = top[1];
                corners[2][k] = low[0];
                corners[3][k] = low[1];
            }
            for (k, value) in plane.iter_mut().enumerate() {
                let top = corners[0][k] + part_x[k] * (corners[1][k] - corners[0][k]);
                let low = corners[2][k] + part_x[k] * (corners[3][k] - corners[2][k]);
                let mut inner = top + part_y[k] * (low - top);
                if !WITHIN {
                    let beyond = (away2[k] + inner.max(0.0) * inner.max(0.0)).sqrt();
                    inner = if away2[k] > 0.0 { beyond } else { inner };
                }
                raise_to(value, inner * scale[k]);
            }
        }
    }
}

/// The greater of the two; a zero has no sign, so that the order does not show.
#[inline]
fn raise_to(value: &mut f32, by: f32) {
    let by = by + 0.0;
    *value = if by > *value { by } else { *value };
}
