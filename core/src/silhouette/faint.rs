//! Faint parts of the grain that a threshold leaves out: a dark half before a black screen, a see-through side before a
//! bright one, a side darker than a background that the lit side is brighter than.
//!
//! A clear face takes a twelfth of the light that passes through it, and no shadow is as dark as nothing: what such a part
//! differs by from the background is little, but more than the background by itself does. It belongs to the grain when it
//! touches the grain, has a sharp edge of its own, and the background shows beyond; a halo, a blurred skirt or a shadow on
//! the background has none.

use super::bays::bays;
use super::holes;
use super::mask::{Connect, Mask, Run};

/// Pixels around all that is seen beyond which everything is background.
const FAR: usize = 12;
/// What differs from the background by this many medians of its values' sizes (four standard deviations) is something else.
const BEYOND: f64 = 4.0 / 0.6745;
/// The least difference, sixteenths of a grey level.
const LEAST: i16 = 40;
/// A threshold that is no greater than this many of these differences finds all there is.
const WORTHWHILE: f64 = 1.25;
/// Half the width of the narrowest part, pixels; what is next to the grain is its own edge's.
const HALF_WIDTH: usize = 1;
const EDGE: usize = 2;
/// Least area, square pixels, and as a share of the grain's.
const LEAST_AREA: (usize, f64) = (24, 5e-4);
/// Between so many pixels beyond a part the background shows …
const BESIDE: [usize; 2] = [2, 5];
/// … which is when this share of the pixels there differ by less than this share of the difference: of all parts, and of those that the other
/// views hold, beyond which only what they do not hold is looked at.
const SHOWS: f64 = 0.75;
const SHOWS_BEYOND_HELD: f64 = 0.5;
const LITTLE: f64 = 0.5;
/// … or than this share of what the part differs by next to its edge: beside a part that stands out, noise and a file's blocks are no halo.
const LITTLE_OF_PART: f64 = 0.15;

/// Where the grain can be: all rows before `rows`, and of the others what `at` (column, row) says.
pub(super) struct Open<F> {
    pub rows: usize,
    pub at: F,
}

impl<F: Fn(usize, usize) -> bool> Open<F> {
    pub(super) fn holds(&self, x: usize, y: usize) -> bool {
        y < self.rows || (self.at)(x, y)
    }

    /// Takes out of a mask what is not open.
    pub(super) fn keep(&self, mask: &mut Mask) {
        for (y, row) in mask.bits.chunks_exact_mut(mask.width).enumerate().skip(self.rows) {
            row.iter_mut().enumerate().for_each(|(x, bit)| *bit &= u8::from((self.at)(x, y)));
        }
    }
}

/// What became of the faint parts.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Added {
    /// The pixels that were added, where there are any, and those of them on which the grain lies on the background's other side.
    pub parts: Option<Mask>,
    pub other_side: Option<Mask>,
    /// Area of the parts that were left out although they touch the grain, as no background shows beyond them.
    pub unsure_px: usize,
    /// Area of the parts that were added because the other views hold them.
    pub held_px: usize,
}

/// Adds the faint parts to the grain. `smooth` are the plane's smoothed values, `seen` is all that a threshold finds,
/// `open` tells where the grain can be (not below the pedestal's top), and `held` where the other views' hull lies, where that is known:
/// parts are looked for within it alone.
pub(super) fn add(
    grain: &mut Mask,
    seen: &Mask,
    smooth: &[i16],
    threshold: i16,
    open: &Open<impl Fn(usize, usize) -> bool>,
    held: Option<impl Fn(usize, usize) -> bool>,
) -> Added {
    let (w, h) = (grain.width, grain.height);
    let mut far = seen.dilated(FAR).complement();
    open.keep(&mut far);
    let Some(noise) = usual(smooth, &far) else { return Added::default() };
    let differs = ((BEYOND * f64::from(noise)) as i16).max(LEAST);
    let others_too = smooth.iter().min().is_some_and(|v| *v < -threshold);
    if f64::from(threshold) < WORTHWHILE * f64::from(differs) && !others_too {
        return Added::default();
    }
    // What a threshold finds is the grain, or another object.
    let around = seen.dilated(EDGE);
    let bits = smooth.iter().zip(&around.bits).map(|(v, a)| u8::from(v.saturating_abs() > differs) & (1 - a));
    let mut faint = Mask { width: w, height: h, bits: bits.collect() };
    open.keep(&mut faint);
    let by_others = held.map(|held| Mask {
        bits: (0..w * h).map(|k| u8::from(held(k % w, k / w))).collect(),
        ..Mask::empty(w, h)
    });
    if let Some(held) = &by_others {
        faint.bits.iter_mut().zip(&held.bits).for_each(|(bit, held)| *bit &= held);
    }
    let faint = faint.eroded(HALF_WIDTH).dilated(HALF_WIDTH);
    let (runs, components) = faint.components(Connect::Sides);
    let least = LEAST_AREA.0.max((LEAST_AREA.1 * grain.area() as f64) as usize);
    if by_others.is_none() && components.iter().all(|c| c.area < least) {
        return Added::default();
    }
    let at_grain = grain.dilated(EDGE + HALF_WIDTH + 1);
    let mut touches = vec![0_usize; components.len()];
    for run in &runs {
        let row = &at_grain.bits[run.row * w + run.start..run.row * w + run.end];
        touches[run.component] += row.iter().map(|b| usize::from(*b)).sum::<usize>();
    }
    let leads_out = leading_out(&runs, components.len(), &faint);
    let large: Vec<bool> = (components.iter().zip(&touches).zip(&leads_out))
        .map(|((c, touches), leads_out)| c.area >= least && *touches > 0 && !leads_out)
        .collect();
    let near_seen = seen.dilated(EDGE + BESIDE[1]);
    let shows = if by_others.is_some() { SHOWS_BEYOND_HELD } else { SHOWS };
    let mut kept = vec![false; components.len()];
    for k in (0..components.len()).filter(|&k| large[k]) {
        let part = faint.select(&runs, |other| other == k);
        let (inner, outer) = (part.dilated(BESIDE[0]), part.dilated(BESIDE[1]));
        // A lit facet or a black one amid the part is not beyond it, nor what is between the part and the pedestal.
        let mut closed = part.clone();
        closed.add(&around);
        if let Some(held) = &by_others {
            closed.add(held);
        }
        let mut closed = closed.closed(BESIDE[1]);
        holes::fill_all(&mut closed);
        let mut rim = part.clone();
        let inside = part.eroded(BESIDE[1]);
        rim.bits.iter_mut().zip(&inside.bits).for_each(|(bit, inside)| *bit &= 1 - inside);
        let by = usual(smooth, &rim).map_or(0.0, f64::from);
        let at_most = (LITTLE * f64::from(differs)).max(LITTLE_OF_PART * by);
        let (mut beyond, mut little) = (0_usize, 0_usize);
        for y in 0..h {
            for x in 0..w {
                let i = y * w + x;
                if outer.bits[i] != 0
                    && [&inner, &near_seen, &closed].iter().all(|m| m.bits[i] == 0)
                    && open.holds(x, y + BESIDE[1])
                {
                    beyond += 1;
                    little += usize::from(f64::from(smooth[i].saturating_abs()) < at_most);
                }
            }
        }
        // A strip as narrow as the grain's surroundings has nothing beyond that is clear of the grain.
        kept[k] = beyond == 0 || little as f64 >= shows * beyond as f64;
    }
    let area = |of: &dyn Fn(usize) -> bool| -> usize {
        (0..components.len()).filter(|k| of(*k)).map(|k| components[k].area).sum()
    };
    let unsure_px = area(&|k| large[k] && !kept[k]);
    if !kept.contains(&true) && by_others.is_none() {
        return Added { unsure_px, ..Added::default() };
    }
    let parts = faint.select(&runs, |k| kept[k]);
    let mut both = parts.clone();
    both.add(grain);
    let gap = EDGE + HALF_WIDTH + 1;
    both.add(&lit_facets(seen, &parts.dilated(gap), open));
    let mut closed = both.closed(gap);
    for y in 0..h {
        for x in 0..w {
            // Beyond the picture's ends there is nothing to close a gap to.
            let inside = x >= gap && y >= gap && x + gap < w && y + gap < h;
            let k = y * w + x;
            closed.bits[k] = u8::from(open.holds(x, y)) & if inside { closed.bits[k] } else { both.bits[k] };
        }
    }
    let before = std::mem::replace(grain, closed.largest());
    if let Some(held) = &by_others {
        grain.add(&bays(grain, &around, (held, smooth), open, least));
    }
    let added = grain.bits.iter().zip(&before.bits).map(|(after, before)| after & (1 - before));
    let parts = Mask { bits: added.collect(), ..before };
    let held_px = if by_others.is_some() { parts.area() } else { 0 };
    let bits = parts.bits.iter().zip(smooth).map(|(part, v)| part & u8::from(*v < 0)).collect();
    let other_side = Mask { bits, ..parts };
    let some = |mask: Mask| mask.bits.contains(&1).then_some(mask);
    Added { parts: some(parts), other_side: some(other_side), unsure_px, held_px }
}

/// Median size of the values in a mask; `None` where it is empty.
fn usual(values: &[i16], mask: &Mask) -> Option<i16> {
    let mut counts = vec![0_usize; 1 << 15];
    for (v, bit) in values.iter().zip(&mask.bits) {
        counts[v.saturating_abs() as usize] += usize::from(*bit);
    }
    let all: usize = counts.iter().sum();
    let mut passed = 0;
    let middle = counts.iter().position(|count| {
        passed += count;
        2 * passed > all
    });
    middle.map(|size| size as i16)
}

/// What a threshold finds at the parts: facets of the grain that its dark side cuts off.
fn lit_facets(seen: &Mask, at_parts: &Mask, open: &Open<impl Fn(usize, usize) -> bool>) -> Mask {
    let w = seen.width;
    let mut above = seen.clone();
    open.keep(&mut above);
    let (runs, components) = above.components(Connect::Sides);
    let leads_out = leading_out(&runs, components.len(), &above);
    let mut touches = vec![false; components.len()];
    for run in &runs {
        touches[run.component] |= at_parts.bits[run.row * w + run.start..run.row * w + run.end].contains(&1);
    }
    above.select(&runs, |k| touches[k] && !leads_out[k])
}

/// Which components lead out of the picture: they hold or light the grain.
fn leading_out(runs: &[Run], components: usize, mask: &Mask) -> Vec<bool> {
    let mut out = vec![false; components];
    for run in runs {
        out[run.component] |= run.row <= HALF_WIDTH
            || run.row + 1 + HALF_WIDTH >= mask.height
            || run.start <= HALF_WIDTH
            || run.end + HALF_WIDTH >= mask.width;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A block of a level on noise, with a faint part at its right and a halo at its left.
    fn scene(faint: i16, is_gradual: bool) -> (Mask, Vec<i16>) {
        let (w, h) = (160, 100);
        let mut smooth = vec![0i16; w * h];
        let mut grain = Mask::empty(w, h);
        for y in 0..h {
            for x in 0..w {
                let k = y * w + x;
                smooth[k] = ((x * 7 + y * 13) % 17) as i16 - 8;
                let inside = (30..70).contains(&y);
                if inside && (50..90).contains(&x) {
                    smooth[k] = 1600;
                    grain.bits[k] = 1;
                } else if inside && (90..110).contains(&x) {
                    let fall = if is_gradual { (110 - x) as i16 } else { 20 };
                    smooth[k] += faint * fall / 20;
                }
            }
        }
        (grain, smooth)
    }

    const NOBODY: Option<fn(usize, usize) -> bool> = None;

    fn anywhere() -> Open<impl Fn(usize, usize) -> bool> {
        Open { rows: 0, at: |_, _| true }
    }

    #[test]
    fn a_faint_part_is_added_on_either_side_of_the_background_and_a_halo_is_not() {
        for (faint, is_gradual, added) in
            [(100, false, true), (-100, false, true), (100, true, false), (20, false, false)]
        {
            let (mut grain, smooth) = scene(faint, is_gradual);
            let seen = grain.clone();
            let other = add(&mut grain, &seen, &smooth, 480, &anywhere(), NOBODY);
            let reaches = grain.get(107, 50);
            assert_eq!(reaches, added, "{faint} {is_gradual}");
            assert_eq!(other.other_side.is_some(), faint < 0);
            assert!(!grain.get(118, 50), "{faint} {is_gradual}");
            assert_eq!(grain.get(92, 50), added, "{faint} {is_gradual}");
        }
    }

    #[test]
    fn a_part_before_something_else_is_unsure_until_the_other_views_hold_it() {
        let (mut grain, mut smooth) = scene(100, false);
        let seen = grain.clone();
        // Something too dim to be a part, and no background either.
        for k in (28..60).flat_map(|y| (110..122).map(move |x| y * 160 + x)) {
            smooth[k] = 30;
        }
        let before = grain.clone();
        let alone = add(&mut grain, &seen, &smooth, 480, &anywhere(), NOBODY);
        assert!(alone.unsure_px > 300 && alone.held_px == 0, "{alone:?}");
        assert_eq!(grain, before);
        let held = |x: usize, y: usize| (50..110).contains(&x) && (30..70).contains(&y);
        let together = add(&mut grain, &seen, &smooth, 480, &anywhere(), Some(held));
        assert!(together.held_px > 300 && together.unsure_px == 0, "{together:?}");
        assert!(grain.get(107, 50) && !grain.get(114, 50));
    }

    #[test]
    fn a_bay_that_the_other_views_hold_is_shade_and_a_hollow_that_is_open_is_not() {
        for (bay, is_shade) in [((78..90, 44..56), true), ((80..90, 32..68), false)] {
            let (mut grain, mut smooth) = scene(0, false);
            let (columns, rows): (std::ops::Range<usize>, std::ops::Range<usize>) = bay;
            for k in rows.flat_map(|y| columns.clone().map(move |x| y * 160 + x)) {
                (grain.bits[k], smooth[k]) = (0, 0);
            }
            let seen = grain.clone();
            let held = |x: usize, y: usize| (50..90).contains(&x) && (30..70).contains(&y);
            assert_eq!(add(&mut grain.clone(), &seen, &smooth, 480, &anywhere(), NOBODY), Added::default());
            let added = add(&mut grain, &seen, &smooth, 480, &anywhere(), Some(held));
            assert_eq!(grain.get(84, 50), is_shade);
            assert_eq!(added.held_px > 80, is_shade, "{added:?}");
        }
    }

    #[test]
    fn a_lit_facet_and_a_black_one_amid_a_faint_part_belong_to_it() {
        let (mut grain, mut smooth) = scene(100, false);
        let mut seen = grain.clone();
        let (lit, black) = ((97..103, 40..46), (96..106, 52..60));
        for ((columns, rows), level) in [(&lit, 1600), (&black, 0)] {
            for k in rows.clone().flat_map(|y| columns.clone().map(move |x| y * 160 + x)) {
                smooth[k] = level;
                seen.bits[k] = u8::from(level > 480);
            }
        }
        add(&mut grain, &seen, &smooth, 480, &anywhere(), NOBODY);
        holes::fill_all(&mut grain);
        for (x, y) in [(107, 50), (100, 43), (100, 56)] {
            assert!(grain.get(x, y), "{x} {y}");
        }
        assert!(!grain.get(118, 50));
    }
}
