//! A hair or fibre that leads from the grain out of the picture.

use super::mask::{Connect, Mask};

/// The thickest hair, as a share of the grain's longer side, and the thinnest that is cut off, pixels.
const THICKEST: f64 = 0.02;
const THINNEST: usize = 2;
/// A hair is at least so many times as long as thick; the tip of a grain that leads out of the picture is not.
const LONG: usize = 8;

/// Cuts hairs off that lead out through an end of the picture; `at_end` tells which ends of the mask (left, right, top) are ends
/// of the picture. Whether there was one.
pub(super) fn cut(grain: &mut Mask, at_end: [bool; 3]) -> bool {
    let (w, h) = (grain.width, grain.height);
    let ends = |x: usize, y: usize| at_end[0] && x == 0 || at_end[1] && x + 1 == w || at_end[2] && y == 0;
    let (columns, rows) = grain.extents();
    let radius = THINNEST.max((0.5 * THICKEST * columns.max(rows) as f64).ceil() as usize);
    let leads_out = (0..h).any(|y| grain.get(0, y) && ends(0, y) || grain.get(w - 1, y) && ends(w - 1, y))
        || (0..w).any(|x| grain.get(x, 0) && ends(x, 0));
    if !leads_out {
        return false;
    }
    let thick = grain.eroded(radius).dilated(radius + 1);
    let mut thin = grain.clone();
    thin.bits.iter_mut().zip(&thick.bits).for_each(|(thin, thick)| *thin &= 1 - thick);
    let (runs, components) = thin.components(Connect::Corners);
    let mut out = vec![false; components.len()];
    for run in &runs {
        out[run.component] |= ends(run.start, run.row) || ends(run.end - 1, run.row);
    }
    let is_hair: Vec<bool> = (components.iter().zip(out))
        .map(|(c, out)| {
            let longer = (c.greatest[0] - c.least[0]).max(c.greatest[1] - c.least[1]) + 1;
            // Of a hair the area over the length is the thickness, however it bends.
            out && longer * longer >= LONG * c.area
        })
        .collect();
    if !is_hair.contains(&true) {
        return false;
    }
    let hair = thin.select(&runs, |k| is_hair[k]);
    grain.bits.iter_mut().zip(&hair.bits).for_each(|(grain, hair)| *grain &= 1 - hair);
    *grain = grain.largest();
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc_with(extra: impl Fn(f64, f64) -> bool) -> Mask {
        let mut mask = Mask::empty(300, 200);
        for (k, bit) in mask.bits.iter_mut().enumerate() {
            let (x, y) = ((k % 300) as f64, (k / 300) as f64);
            *bit = u8::from((x - 200.0).hypot(y - 100.0) < 60.0 || extra(x, y));
        }
        mask
    }

    #[test]
    fn a_hair_that_leads_out_is_cut_off_and_a_tip_that_does_is_not() {
        let disc = disc_with(|_, _| false);
        let mut with_hair = disc_with(|x, y| x < 160.0 && (y - 60.0 - 0.001 * x * x).abs() < 1.6);
        assert!(cut(&mut with_hair.clone(), [true, true, true]));
        assert!(!cut(&mut with_hair.clone(), [false, true, true]), "it ends in the region");
        cut(&mut with_hair, [true; 3]);
        assert!(with_hair.area().abs_diff(disc.area()) < 20, "{} {}", with_hair.area(), disc.area());
        // A wedge of 20° whose tip is outside.
        let mut tip = disc_with(|x, y| x < 160.0 && (y - 100.0).abs() < 1.0 + 0.18 * x);
        let whole = tip.clone();
        assert!(!cut(&mut tip, [true; 3]));
        assert_eq!(tip, whole);
    }
}
