//! The pedestal's blurred light above its top, taken off the grain's.

use super::Pedestal;
use crate::silhouette::plane::{PER_LEVEL, Plane};

/// Takes the pedestal's blurred light off what is above its top, so that a narrow gap between it and the grain
/// stays a gap: there a pixel is a mixture of the pedestal and of what it would be without it.
pub(in crate::silhouette) fn unmix(plane: &mut Plane, pedestal: &Pedestal) {
    for_mixed(plane, pedestal, |value, level, share| (value - share * level) / (1.0 - share));
}

/// The reverse of [`unmix`].
pub(in crate::silhouette) fn mix(plane: &mut Plane, pedestal: &Pedestal) {
    for_mixed(plane, pedestal, |value, level, share| value * (1.0 - share) + share * level);
}

/// Changes the values above the top that the pedestal's blur reaches, each with the pedestal's value and its share.
fn for_mixed(plane: &mut Plane, pedestal: &Pedestal, change: impl Fn(f64, f64, f64) -> f64) {
    let sd = pedestal.blur.max(0.3);
    let first = pedestal.clear_above(plane.width, 4.0 * sd).max(0.0) as usize;
    for y in first..plane.height {
        let [l, r] = pedestal.sides_at(y as f64);
        for x in (l - 3.0 * sd).max(0.0) as usize..((r + 3.0 * sd).max(0.0) as usize).min(plane.width) {
            let above = pedestal.top_at(x as f64) - y as f64;
            if above <= 0.0 || above > 4.0 * sd {
                continue;
            }
            let between = normal((x as f64 - l) / sd) * normal((r - x as f64) / sd);
            let share = (1.0 - normal(above / sd)) * between;
            let value = &mut plane.values[y * plane.width + x];
            let level = pedestal.level_at(x as f64) * f64::from(PER_LEVEL);
            *value = change(f64::from(*value), level, share) as i16;
        }
    }
}

/// The plane's smoothed values; in the last row above the top, those of the row alone: the pedestal stays out of it.
pub(in crate::silhouette) fn smoothed(plane: &Plane, pedestal: &Pedestal) -> Vec<i16> {
    let mut smooth = plane.smoothed();
    let w = plane.width;
    for (x, y) in (0..w).filter_map(|x| {
        let last = (pedestal.top_at(x as f64) - 1e-9).floor();
        (last >= 0.0 && last < plane.height as f64).then_some((x, last as usize))
    }) {
        if pedestal.below_top(x as f64, y as f64).is_some() {
            let at = |x: usize| i32::from(plane.values[y * w + x]);
            smooth[y * w + x] =
                ((at(x.saturating_sub(1)) + 2 * at(x) + at((x + 1).min(w - 1)) + 2) >> 2) as i16;
        }
    }
    smooth
}

/// The normal distribution function, to 8·10⁻⁸ (Abramowitz and Stegun 1964, 26.2.17).
fn normal(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let tail = (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt()
        * t
        * (0.319_381_53
            + t * (-0.356_563_782 + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    if x < 0.0 { tail } else { 1.0 - tail }
}
