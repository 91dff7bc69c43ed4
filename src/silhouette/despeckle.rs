//! Takes out single wrong pixels (dead ones, dust, salt and pepper) and leaves all others as they are.

use super::plane::{PER_LEVEL, Plane};
use rayon::prelude::*;

/// Least step that counts as wrong, grey levels.
const LEAST_STEP: f64 = 24.0;
/// The same in standard deviations of the noise.
const SIGMAS: f64 = 8.0;

/// Replaces a pixel by the median of its 3×3 neighbourhood where it is off by more than noise can be.
///
/// A plain median would round every corner; this one touches nothing in a clean picture, because a blurred
/// edge has no pixel that stands off all of its neighbours.
pub(super) fn despeckle(plane: &mut Plane, noise: f64) {
    let (w, h) = (plane.width, plane.height);
    if w < 3 || h < 3 {
        return;
    }
    let step = ((noise * SIGMAS).max(LEAST_STEP) * f64::from(PER_LEVEL)).min(8000.0) as i16;
    let old = std::mem::take(&mut plane.values);
    let mut new = old.clone();
    new.par_chunks_mut(w).enumerate().filter(|(y, _)| (1..h - 1).contains(y)).for_each(|(y, out)| {
        let [a, b, c] = [y - 1, y, y + 1].map(|row| &old[row * w..][..w]);
        for x in 1..w - 1 {
            let middle =
                median9([a[x - 1], a[x], a[x + 1], b[x - 1], b[x], b[x + 1], c[x - 1], c[x], c[x + 1]]);
            if (b[x] - middle).abs() > step {
                out[x] = middle;
            }
        }
    });
    plane.values = new;
}

/// Median of nine by the least number of exchanges (Smith 1996, in Paeth's arrangement): no branches, so the
/// compiler does many pixels at once.
#[inline]
fn median9(mut p: [i16; 9]) -> i16 {
    const EXCHANGES: [(usize, usize); 19] = [
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 1),
        (3, 4),
        (6, 7),
        (1, 2),
        (4, 5),
        (7, 8),
        (0, 3),
        (5, 8),
        (4, 7),
        (3, 6),
        (1, 4),
        (2, 5),
        (4, 7),
        (4, 2),
        (6, 4),
        (4, 2),
    ];
    for (i, j) in EXCHANGES {
        let (low, high) = (p[i].min(p[j]), p[i].max(p[j]));
        (p[i], p[j]) = (low, high);
    }
    p[4]
}
