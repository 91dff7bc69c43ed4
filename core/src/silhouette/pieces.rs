//! Islands of the mask that a shadow has cut off the grain.
//!
//! Before a black background a shaded part of the grain can be as dark as what stands behind it. What lies
//! beyond the shade is then an island. It belongs to the grain when the strip between them is narrow and
//! nowhere shows clean background. What one view leaves out is carved for good, what one view has too much
//! the others carve: so the strip is added too.

use super::mask::{Connect, Mask};

/// Half the width of a strip of shade, as a share of the grain's longer side.
const STRIP: f64 = 0.03;
/// Least area of a piece, as a share of the grain's: less is dust.
const LEAST_PIECE: f64 = 0.002;

/// Adds to the grain the pieces of `apart` (which holds the grain) that lie behind a strip of shade, with the
/// strip; `shade` gives for a pixel whether it is off the background at all.
pub(super) fn join(grain: &mut Mask, apart: &Mask, shade: impl Fn(usize) -> bool) {
    let least = (LEAST_PIECE * grain.area() as f64).max(1.0) as usize;
    let (runs, components) = apart.components(Connect::Sides);
    let is_grain = |k: usize| grain.bits[k] != 0;
    let mut piece = vec![false; components.len()];
    for run in &runs {
        let own = is_grain(run.row * apart.width + run.start);
        piece[run.component] = !own && components[run.component].area >= least;
    }
    if !piece.contains(&true) {
        return;
    }
    let pieces = apart.select(&runs, |k| piece[k]);
    let mut both = pieces.clone();
    both.bits.iter_mut().zip(&grain.bits).for_each(|(b, g)| *b |= g);
    let (columns, rows) = grain.extents();
    let mut strips = both.closed((STRIP * columns.max(rows) as f64) as usize + 1);
    for (k, bit) in strips.bits.iter_mut().enumerate() {
        *bit &= u8::from(both.bits[k] == 0 && shade(k));
    }
    // A strip counts when it has the grain on one side and a piece on another.
    let (runs, components) = strips.components(Connect::Sides);
    let (near_grain, near_piece) = (grain.dilated(1), pieces.dilated(1));
    let mut touches = vec![[false; 2]; components.len()];
    for run in &runs {
        let along = run.row * apart.width + run.start..run.row * apart.width + run.end;
        let [grain, piece] = &mut touches[run.component];
        *grain |= near_grain.bits[along.clone()].contains(&1);
        *piece |= near_piece.bits[along].contains(&1);
    }
    let strips = strips.select(&runs, |k| touches[k] == [true, true]);
    if !strips.bits.contains(&1) {
        return;
    }
    both.bits.iter_mut().zip(&strips.bits).for_each(|(b, s)| *b |= s);
    *grain = both.largest();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_piece_behind_shade_is_joined_and_one_behind_clean_background_is_not() {
        // A block, a strip four columns wide, and a piece on the right; a speck far off.
        let mut apart = Mask::empty(120, 60);
        for y in 10..50 {
            apart.bits[y * 120 + 10..y * 120 + 80].fill(1);
            if y < 30 {
                apart.bits[y * 120 + 84..y * 120 + 95].fill(1);
            }
        }
        apart.bits[55 * 120 + 110] = 1;
        let block = apart.largest();
        let mut grain = block.clone();
        join(&mut grain, &apart, |_| false);
        assert_eq!(grain, block);
        join(&mut grain, &apart, |k| k % 120 >= 80 && k % 120 < 84);
        assert_eq!(grain.area(), 40 * 70 + 20 * 15);
        assert!(!grain.get(110, 55));
    }
}
