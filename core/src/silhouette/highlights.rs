//! Specular highlights on the grain that are brighter than the bright background.
//!
//! A mirroring facet saturates the camera: what is brighter than the background is not background either. Inside the
//! grain such a spot is an opening, which is filled; on its edge it would be a bite out of the outline.

use super::Source;
use super::mask::{Connect, Mask};
use super::plane::Plane;
use super::rect::Rect;

/// A pixel is saturated from this grey level on, in every channel.
const SATURATED: u8 = 250;
/// Least area of a spot, square pixels, and half the width of what it must hold: the bright fringe that a camera's
/// sharpening draws around a dark grain is thinner.
const LEAST_AREA: usize = 9;
const LEAST_HALF_WIDTH: usize = 1;
/// Pixels around a spot in which it blends into the grain.
const RIM: usize = 3;
/// Least share of the pixels around a spot that are grain.
const LEAST_SHARE: f64 = 0.3;

/// Without what no spot fits into.
fn opened(mask: &Mask) -> Mask {
    mask.eroded(LEAST_HALF_WIDTH).dilated(LEAST_HALF_WIDTH)
}

/// The saturated pixels of a mask in the plane that lies within `window`.
fn saturated(plane: &Plane, picture: &dyn Source, mask: &Mask, window: &Rect) -> Mask {
    let (r, channels) = (plane.rect, picture.shape()[2]);
    let pixels = picture.part(&(r.x0 + window.x0..r.x0 + window.x1), &(r.y0 + window.y0..r.y0 + window.y1));
    let mut out = Mask::empty(mask.width, mask.height);
    for (y, row) in (window.y0..).zip(pixels.chunks_exact(window.width() * channels)) {
        for (x, pixel) in (window.x0..).zip(row.chunks_exact(channels)) {
            let k = y * mask.width + x;
            out.bits[k] = mask.bits[k] & u8::from(pixel.iter().all(|&v| v >= SATURATED));
        }
    }
    out
}

/// Gives the spots at the grain the grain's level `grain_level` in the plane, rim and all; `limit` (both in the plane's
/// units) separates a pixel from the background. Whether there were any.
pub(super) fn darken(
    plane: &mut Plane,
    picture: &dyn Source,
    grain: &Mask,
    smooth: &[i16],
    limit: i16,
    grain_level: i16,
) -> bool {
    let w = plane.width;
    let bits: Vec<u8> = smooth.iter().map(|&v| u8::from(v < -limit)).collect();
    if !bits.contains(&1) {
        return false;
    }
    let brighter = opened(&Mask { width: w, height: plane.height, bits });
    let Some(window) = brighter.bounds() else { return false };
    let spots = opened(&saturated(plane, picture, &brighter, &window));
    let (runs, components) = spots.components(Connect::Corners);
    let mut around = vec![[0_usize; 2]; components.len()];
    for run in &runs {
        let y = run.row;
        for j in y.saturating_sub(RIM)..(y + RIM + 1).min(plane.height) {
            for i in run.start.saturating_sub(RIM)..(run.end + RIM).min(w) {
                let k = j * w + i;
                // Each pixel as often as runs reach it: shares are what counts.
                if spots.bits[k] == 0 && smooth[k].abs() > limit {
                    around[run.component][0] += usize::from(grain.bits[k] != 0);
                }
                around[run.component][1] += usize::from(spots.bits[k] == 0);
            }
        }
    }
    let kept = |k: usize| {
        components[k].area >= LEAST_AREA && around[k][0] as f64 >= LEAST_SHARE * around[k][1].max(1) as f64
    };
    let spots = spots.select(&runs, kept);
    if !spots.bits.contains(&1) {
        return false;
    }
    // The spot's own level becomes the grain's, so that its edge stays half-way to the background; where it blends
    // into the grain, the values between are the grain's too.
    let deepest =
        (spots.bits.iter().zip(smooth)).filter(|(b, _)| **b != 0).map(|(_, v)| *v).min().unwrap_or(-1);
    let scale = f64::from(grain_level) / f64::from(deepest);
    let near_spot = spots.dilated(RIM);
    let near_grain = grain.dilated(RIM);
    let mut both = spots.clone();
    both.bits.iter_mut().zip(&grain.bits).for_each(|(b, g)| *b |= g);
    let both = both.closed(RIM);
    for k in 0..plane.values.len() {
        let value = &mut plane.values[k];
        if near_spot.bits[k] != 0 && *value < 0 {
            *value = (f64::from(*value) * scale).min(f64::from(i16::MAX)) as i16;
        }
        let rim = near_spot.bits[k] & near_grain.bits[k] & both.bits[k] & (1 - spots.bits[k]);
        if rim != 0 {
            *value = (*value).max(grain_level);
        }
    }
    true
}
