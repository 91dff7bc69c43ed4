//! Medians and twentieths.

use serde::{Deserialize, Serialize};

/// Where nine of ten values lie.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Interval {
    /// As many are below this as above, mm.
    #[serde(rename = "median")]
    pub median_mm: f64,
    /// One in twenty is below this, mm.
    #[serde(rename = "p05")]
    pub p05_mm: f64,
    /// One in twenty is above this, mm.
    #[serde(rename = "p95")]
    pub p95_mm: f64,
}

impl Interval {
    /// Of values (mm) with their weights; nought where there are none.
    pub(in crate::jobs) fn of(mut all: Vec<(f64, f64)>) -> Self {
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        let whole: f64 = all.iter().map(|(_, weight)| weight).sum();
        let quantile = |share: f64| {
            let mut below = 0.0;
            let reached = all.iter().find(|(_, weight)| {
                below += weight;
                below >= share * whole
            });
            reached.or(all.last()).map_or(0.0, |(mm, _)| *mm)
        };
        Self { median_mm: quantile(0.5), p05_mm: quantile(0.05), p95_mm: quantile(0.95) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_go_by_weight() {
        let even = Interval::of((0..=100).map(|k| (f64::from(100 - k), 1.0)).collect());
        assert_eq!((even.p05_mm, even.median_mm, even.p95_mm), (5.0, 50.0, 95.0));
        let heavy = Interval::of(vec![(7.0, 0.9), (1.0, 0.04), (9.0, 0.06)]);
        assert_eq!((heavy.p05_mm, heavy.median_mm, heavy.p95_mm), (7.0, 7.0, 9.0));
        assert_eq!(Interval::of(Vec::new()), Interval::of(vec![(0.0, 1.0)]));
    }
}
