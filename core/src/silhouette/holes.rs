//! Openings inside the outline: shading and highlights are filled, a real gap may stay open.

use super::mask::{Component, Connect, Mask, Run};
use super::plane::Plane;

/// A gap smaller than this, square pixels, cannot be distinguished from a speck.
const LEAST_GAP_PX: usize = 30;
/// The same as a share of the grain's area.
const LEAST_GAP_SHARE: f64 = 2e-4;
/// A gap looks like the background when its mean is within this many standard deviations of it …
const GAP_SIGMAS: f64 = 3.0;
/// … or within this share of the contrast.
const GAP_SHARE: f64 = 0.15;

/// What a gap is compared with.
pub(super) struct Background {
    /// Standard deviation of the background, grey levels.
    pub noise: f64,
    /// Mean distance of the grain from it, grey levels.
    pub contrast: f64,
}

/// Fills the openings of a mask; with `open` those stay that are large and look like the background. Gives
/// how many stayed.
pub(super) fn fill(mask: &mut Mask, plane: &Plane, open: Option<&Background>) -> usize {
    let clear = mask.complement();
    let (runs, components) = clear.components(Connect::Sides);
    let least = LEAST_GAP_PX.max((LEAST_GAP_SHARE * mask.area() as f64) as usize);
    let mut means = vec![0f64; components.len()];
    for run in runs.iter().filter(|_| open.is_some()) {
        let row = &plane.values[run.row * plane.width + run.start..run.row * plane.width + run.end];
        means[run.component] += row.iter().map(|&v| f64::from(v)).sum::<f64>();
    }
    let stays = |k: usize| {
        let Some(background) = open else { return false };
        let mean = means[k] / (components[k].area as f64 * f64::from(super::plane::PER_LEVEL));
        let limit = (GAP_SIGMAS * background.noise).max(GAP_SHARE * background.contrast);
        components[k].area >= least && mean.abs() <= limit
    };
    let kept: Vec<bool> = (0..components.len()).map(|k| outside(&components[k], mask) || stays(k)).collect();
    fill_runs(mask, &runs, |k| !kept[k]);
    (0..components.len()).filter(|&k| kept[k] && !outside(&components[k], mask)).count()
}

/// Fills all openings of a mask.
pub(super) fn fill_all(mask: &mut Mask) {
    let (runs, components) = mask.complement().components(Connect::Sides);
    let is_opening: Vec<bool> = components.iter().map(|c| !outside(c, mask)).collect();
    fill_runs(mask, &runs, |k| is_opening[k]);
}

/// Whether a clear component reaches the end of the rectangle: it is the world outside, not an opening.
fn outside(c: &Component, mask: &Mask) -> bool {
    c.least[0] == 0 || c.least[1] == 0 || c.greatest[0] + 1 == mask.width || c.greatest[1] + 1 == mask.height
}

fn fill_runs(mask: &mut Mask, runs: &[Run], fill: impl Fn(usize) -> bool) {
    for run in runs.iter().filter(|run| fill(run.component)) {
        let start = run.row * mask.width;
        mask.bits[start + run.start..start + run.end].fill(1);
    }
}
