//! Bays of the grain that the other views hold: shade as dark as the background, or facets too faint to be found alone.

use super::faint::Open;
use super::mask::{Connect, Mask};

/// A bay as dark as the background that the other views hold is the grain's shade when this share of what is around it, within so many
/// pixels, is the grain or the pedestal; a hollow that one view looks through is open, and a strip beside the outline is open all along. Half
/// the width of the narrowest bay, pixels and as a share of the grain's radius: the hull of fewer views has a strip all around.
const ENCLOSED: f64 = 0.65;
const AROUND_BAY: usize = 4;
const HALF_BAY: (usize, f64) = (3, 0.025);
/// Of a bay that is not enclosed that is the grain's which differs from the background beyond it, so many pixels around, by so many of its standard
/// deviations, and sixteenths of a grey level, where that is this share of the bay. Gaps and specks are no wider than so many pixels.
const BEYOND_BAY: usize = 12;
const DIFFERS: (f64, f64) = (3.0, 24.0);
const MOSTLY: f64 = 0.4;
const SPECK: usize = 2;
/// Least number of pixels that say what is beyond a bay, or what in it is no blurred edge.
const ENOUGH: usize = 24;

/// Bays of the grain that the other views hold: shade, and what differs from the background beyond.
pub(super) fn bays(
    grain: &Mask,
    around: &Mask,
    (held, smooth): (&Mask, &[i16]),
    open: &Open<impl Fn(usize, usize) -> bool>,
    least: usize,
) -> Mask {
    let (w, h) = (grain.width, grain.height);
    let radius = (grain.area() as f64 / std::f64::consts::PI).sqrt();
    let half = HALF_BAY.0.max((HALF_BAY.1 * radius).round() as usize);
    let mut clear = held.clone();
    clear.bits.iter_mut().zip(&grain.bits).for_each(|(bit, grain)| *bit &= 1 - grain);
    open.keep(&mut clear);
    let clear = clear.eroded(half).dilated(half);
    let (runs, components) = clear.components(Connect::Sides);
    let mut found = Mask::empty(w, h);
    for k in (0..components.len()).filter(|k| components[*k].area >= least) {
        let bay = clear.select(&runs, |other| other == k);
        let near = bay.dilated(AROUND_BAY);
        let (mut all, mut closed) = (0_usize, 0_usize);
        for i in (0..w * h).filter(|i| near.bits[*i] != 0 && bay.bits[*i] == 0) {
            all += 1;
            closed += usize::from(grain.bits[i] != 0 || !open.holds(i % w, i / w));
        }
        if closed as f64 >= ENCLOSED * all as f64 {
            found.add(&bay);
        } else if let Some(part) = differing(&bay, (held, around), smooth, open) {
            found.add(&part);
        }
    }
    found
}

/// What of a bay differs from the background beyond it; `None` where that is little, or no background is there.
fn differing(
    bay: &Mask,
    (held, around): (&Mask, &Mask),
    smooth: &[i16],
    open: &Open<impl Fn(usize, usize) -> bool>,
) -> Option<Mask> {
    let (w, near) = (bay.width, bay.dilated(BEYOND_BAY));
    let beyond: Vec<f64> = (0..smooth.len())
        .filter(|&k| {
            near.bits[k] != 0 && held.bits[k] == 0 && around.bits[k] == 0 && open.holds(k % w, k / w)
        })
        .map(|k| f64::from(smooth[k]))
        .collect();
    let n = beyond.len() as f64;
    if beyond.len() < ENOUGH {
        return None;
    }
    let mean = beyond.iter().sum::<f64>() / n;
    let deviation = (beyond.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
    let limit = (DIFFERS.0 * deviation).max(DIFFERS.1);
    let mut part = bay.clone();
    let (mut all, mut differ) = (0_usize, 0_usize);
    for (k, bit) in part.bits.iter_mut().enumerate().filter(|(_, bit)| **bit != 0) {
        // What the grain's own blurred edge differs by says nothing, and parts nothing.
        let is_other = (f64::from(smooth[k]) - mean).abs() > limit;
        let is_edge = around.bits[k] != 0;
        all += usize::from(!is_edge);
        differ += usize::from(!is_edge && is_other);
        *bit = u8::from(is_edge || is_other);
    }
    let mut part = part.closed(SPECK).eroded(SPECK).dilated(SPECK);
    part.bits.iter_mut().zip(&bay.bits).for_each(|(bit, bay)| *bit &= bay);
    (all >= ENOUGH && differ as f64 >= MOSTLY * all as f64).then_some(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 60;

    fn square(from: usize, to: usize) -> Mask {
        let inside = |k: usize| (from..to).contains(&(k % SIDE)) && (from..to).contains(&(k / SIDE));
        Mask { bits: (0..SIDE * SIDE).map(|k| u8::from(inside(k))).collect(), ..Mask::empty(SIDE, SIDE) }
    }

    #[test]
    fn of_a_bay_that_is_which_differs_from_the_background_beyond_it() {
        let (bay, nothing) = (square(20, 40), Mask::empty(SIDE, SIDE));
        let open = Open { rows: SIDE, at: |_, _| true };
        // Its first columns differ by so much, sixteenths of a grey level; noise of 5 everywhere.
        for (columns, level, is_part) in
            [(20, 60, true), (12, 60, true), (12, -60, true), (5, 60, false), (20, 12, false)]
        {
            let smooth: Vec<i16> = (0..SIDE * SIDE)
                .map(|k| {
                    let noise = ((k % SIDE * 7 + k / SIDE * 13) % 17) as i16 - 8;
                    noise + if bay.bits[k] != 0 && k % SIDE < 20 + columns { level } else { 0 }
                })
                .collect();
            let part = differing(&bay, (&bay, &nothing), &smooth, &open);
            assert_eq!(part.is_some(), is_part, "{columns} columns of {level}");
            if let Some(part) = part {
                assert!(part.area().abs_diff(20 * columns) <= 20, "{} of {columns} columns", part.area());
                assert!(part.bits.iter().zip(&bay.bits).all(|(part, bay)| part <= bay));
            }
            // Where all around is held there is no background to differ from.
            assert!(differing(&bay, (&square(0, SIDE), &nothing), &smooth, &open).is_none());
        }
    }
}
