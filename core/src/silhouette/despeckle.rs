//! Conditional 3×3 median filter: takes out single wrong pixels (dead ones, dust, salt and pepper) and leaves all others.

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
    let values = &plane.values;
    let wrong: Vec<Vec<(usize, i16)>> = (1..h - 1)
        .into_par_iter()
        .map_init(
            || vec![0i16; w - 2],
            |off, y| {
                let [a, b, c] = [y - 1, y, y + 1].map(|row| &values[row * w..][..w]);
                stand_off([a, b, c], off);
                let mut wrong = Vec::new();
                for (piece, off) in off.chunks(PIECE).enumerate() {
                    if off.iter().fold(0, |most: i16, o| most.max(*o)) <= step {
                        continue;
                    }
                    let beside = (1 + piece * PIECE..).zip(off).filter(|(_, off)| **off > step);
                    for (x, _) in beside {
                        let near =
                            [a[x - 1], a[x], a[x + 1], b[x - 1], b[x], b[x + 1], c[x - 1], c[x], c[x + 1]];
                        let middle = median9(near);
                        if (b[x] - middle).abs() > step {
                            wrong.push((y * w + x, middle));
                        }
                    }
                }
                wrong
            },
        )
        .collect();
    for (k, middle) in wrong.into_iter().flatten() {
        plane.values[k] = middle;
    }
}

/// Pixels of a row looked at together.
const PIECE: usize = 32;

/// By how much each pixel of a row but its ends differs at most from a neighbour on a side. One that is far off the
/// median of its nine differs as much from five of its neighbours, one of which is on a side.
fn stand_off([above, row, below]: [&[i16]; 3], out: &mut [i16]) {
    let n = out.len();
    let (left, middle, right) = (&row[..n], &row[1..][..n], &row[2..][..n]);
    let (above, below) = (&above[1..][..n], &below[1..][..n]);
    for x in 0..n {
        let low = left[x].min(right[x]).min(above[x]).min(below[x]);
        let high = left[x].max(right[x]).max(above[x]).max(below[x]);
        out[x] = middle[x].saturating_sub(low).max(high.saturating_sub(middle[x]));
    }
}

/// Median of nine by the least number of exchanges (Smith 1996, in Paeth's arrangement).
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
