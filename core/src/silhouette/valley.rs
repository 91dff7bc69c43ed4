//! The valley threshold of a histogram (mode method): where the outline hardly moves when the threshold does.
//!
//! Otsu's threshold halves the way between two means. On a grain that lies half in shadow it cuts the shadow
//! off, and on one of several colours it cuts the paler ones off, because both lie nearer to the background
//! than half-way. What separates them from the background is the valley between: thresholds that few pixels lie
//! near (Prewitt & Mendelsohn 1966, the mode method), taken here on a scale of shares, because a shadow
//! scales the grain's grey values and the blur of its edge alike.

use super::Histogram;

/// Pixels lie near a threshold t when their values are in t/REACH … t·REACH.
const REACH: f64 = 1.4;
/// Share of the grain's pixels that any threshold is taken to have near it: below that, emptiness is chance.
const CHANCE: f64 = 1e-3;

/// A threshold in the valley between the modes: few pixels lie near it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Valley {
    /// The threshold, in the histogram's unit.
    pub threshold: f64,
    /// Pixels near it, as a share of those above it.
    pub unsure: f64,
}

impl Histogram {
    /// The deepest valley in `low..=high` (both positive): the count near it, over the square root of
    /// itself. A fixed count per share of the threshold would favour low thresholds, a count per grey level
    /// high ones; the root is the mean of both. `None` where no end of a bin lies in the range.
    pub(super) fn valley(&self, low: f64, high: f64) -> Option<Valley> {
        // Entry k: pixels in the bins before k.
        let mut below = vec![0.0];
        below.extend(self.counts.iter().scan(0.0, |sum, &count| {
            *sum += count as f64;
            Some(*sum)
        }));
        let bins = self.counts.len();
        let total = below[bins];
        let count = |value: f64| {
            let position = ((value - self.first) / self.width).clamp(0.0, bins as f64);
            let k = (position as usize).min(bins - 1);
            below[k] + (position - k as f64) * (below[k + 1] - below[k])
        };
        let chance = CHANCE * (total - count(high)).max(1.0);
        let near = |t: f64| count(t * REACH) - count(t / REACH);
        let mut best: Option<(f64, f64)> = None;
        for bin in 0..bins {
            let t = self.end(bin);
            if t < low || t > high || t <= 0.0 {
                continue;
            }
            let cost = (near(t) + chance) / t.sqrt();
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, t));
            }
        }
        best.map(|(_, threshold)| Valley {
            threshold,
            unsure: (near(threshold) / (total - count(threshold)).max(1.0)).min(1.0),
        })
    }
}

/// The threshold that separates grain and background in all of these histograms together (each of a view, grey levels away
/// from the background), at least `clear`; `None` where they have fewer than two modes.
pub fn joint_threshold(views: &[&Histogram], clear: f64) -> Option<f64> {
    const LEVELS: usize = 512;
    let mut all = Histogram::new(-128.0, 1.0, LEVELS);
    for (value, count) in views.iter().flat_map(|view| view.bins()) {
        let bin = (value + 128.0).clamp(0.0, (LEVELS - 1) as f64) as usize;
        all.counts[bin] += count;
    }
    let otsu = all.otsu2()?.threshold;
    Some(all.valley(clear, otsu.max(clear))?.threshold)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A histogram from 0 to 256 of some humps: middle, standard deviation, pixels.
    fn humps(humps: &[(f64, f64, f64)]) -> Histogram {
        let counts = (0..256).map(|k| {
            let x = f64::from(k) + 0.5;
            let hump = |&(m, s, n): &(f64, f64, f64)| n / s * (-0.5 * ((x - m) / s).powi(2)).exp();
            (humps.iter().map(hump).sum::<f64>() + 0.5) as u64
        });
        Histogram::from_counts(0.0, 1.0, counts.collect())
    }

    #[test]
    fn a_grain_with_a_shaded_side_keeps_it() {
        // Background, shade, light: Otsu cuts between shade and light.
        let h = humps(&[(2.0, 1.5, 60e3), (60.0, 10.0, 8e3), (190.0, 15.0, 40e3)]);
        let otsu = h.otsu2().unwrap().threshold;
        assert!(otsu > 80.0, "{otsu}");
        let quiet = h.valley(9.0, otsu).unwrap();
        assert!((9.0..32.0).contains(&quiet.threshold), "{quiet:?}");
        assert!(quiet.unsure < 0.02, "{quiet:?}");
    }

    #[test]
    fn where_nothing_lies_between_it_is_as_high_as_may_be() {
        let h = humps(&[(0.0, 0.5, 50e3), (120.0, 0.5, 50e3)]);
        assert!((h.valley(4.0, 60.0).unwrap().threshold - 60.0).abs() < 1e-9);
        assert!(h.valley(60.2, 60.8).is_none());
        assert!(Histogram::from_counts(0.0, 1.0, vec![0; 4]).valley(1.0, 3.0).is_some());
    }
}
