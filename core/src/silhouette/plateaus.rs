//! How much of a picture is even: what another threshold would add or take away that is no blurred edge.

use super::plane::PER_LEVEL;

/// Grey levels above the background that are told apart, and the greatest difference within an even neighbourhood: a sharp edge's is several
/// times as great.
const LEVELS: usize = 256;
const SPREADS: usize = 32;

/// Pixels by the least and the greatest value of the 3×3 around them, grey levels away from the background.
///
/// Between two thresholds lies a part of every blurred edge, and no outline is placed by it. A facet, or another object, is wider: all nine
/// pixels lie there.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plateaus {
    /// `[least, greatest − least]`, row-major; empty of nothing.
    counts: Vec<u32>,
}

impl Plateaus {
    /// Of the first `rows` rows of smoothed values, `[row, column]`, sixteenths of a grey level.
    pub(super) fn of(smooth: &[i16], width: usize, rows: usize) -> Self {
        let mut counts = vec![0; LEVELS * SPREADS];
        let unit = PER_LEVEL as i16;
        let (mut low, mut high) = (vec![0_i16; width], vec![0_i16; width]);
        let rows: Vec<&[i16]> = smooth.chunks_exact(width).take(rows).collect();
        for three in rows.windows(3) {
            for (((low, high), a), (b, c)) in
                low.iter_mut().zip(&mut high).zip(three[0]).zip(three[1].iter().zip(three[2]))
            {
                (*low, *high) = (*a.min(b).min(c), *a.max(b).max(c));
            }
            for (low, high) in low.windows(3).zip(high.windows(3)) {
                let least = low[0].min(low[1]).min(low[2]).max(0) / unit;
                let greatest = high[0].max(high[1]).max(high[2]) / unit;
                let spread = greatest - least;
                if (0..SPREADS as i16).contains(&spread) && (0..LEVELS as i16).contains(&least) {
                    counts[least as usize * SPREADS + spread as usize] += 1;
                }
            }
        }
        Self { counts }
    }

    /// How many pixels lie, with those around them, between two levels; whole levels, rounded outwards.
    pub fn between_px(&self, low: f64, high: f64) -> u64 {
        let first = low.max(0.0) as usize;
        let last = high.max(0.0).ceil() as usize;
        (self.counts.chunks_exact(SPREADS).enumerate().take(last).skip(first))
            .map(|(least, spreads)| spreads.iter().take(last - least).map(|n| u64::from(*n)).sum::<u64>())
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_facet_counts_where_it_lies_between_and_an_edge_never() {
        // A ramp of ten levels a pixel, from 0 to 200; below it a facet of 20 × 10 px at level 60.
        let width = 24;
        let mut smooth: Vec<i16> = (0..8 * width).map(|k| 16 * (10 * (k % width) as i16).min(200)).collect();
        assert_eq!(Plateaus::of(&smooth, width, 8).between_px(40.0, 60.0), 0);
        smooth.extend((0..14 * width).map(|k| {
            let (x, y) = (k % width, k / width);
            if (2..22).contains(&x) && (2..12).contains(&y) { 16 * 60 + 8 } else { 0 }
        }));
        let all = Plateaus::of(&smooth, width, 22);
        assert_eq!(all.between_px(55.0, 65.0), 18 * 8);
        assert_eq!(all.between_px(60.2, 60.8), 18 * 8);
        assert_eq!((all.between_px(61.0, 78.0), all.between_px(45.0, 60.0)), (0, 0));
        assert_eq!(Plateaus::of(&smooth, width, 8).between_px(55.0, 65.0), 0);
        assert_eq!(Plateaus::default().between_px(0.0, 255.0), 0);
    }
}
