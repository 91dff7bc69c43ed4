//! Convolution of a log-normal excess with a normal error: quantiles of the volume's distribution.

/// Half the width of what is integrated over, standard deviations, and the steps in it.
const REACH: f64 = 5.0;
const STEPS: usize = 200;

/// The distribution of the logarithm of the grain's volume over the hull's, −ln(1 + E) + s·y: ln E is normal, and so is y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spread {
    /// Mean of ln E.
    pub log_excess: f64,
    /// Its standard deviation.
    pub log_sd: f64,
    /// s.
    pub sd: f64,
}

impl Spread {
    /// The value below which this share of the distribution lies. s must not be small against what a step in x changes
    /// of ln(1 + E).
    pub(super) fn quantile(&self, share: f64) -> f64 {
        // ln(1 + E) and its weight, over what E may be.
        let excesses: Vec<[f64; 2]> = (0..=STEPS)
            .map(|k| {
                let x = REACH * (2.0 * k as f64 / STEPS as f64 - 1.0);
                [(self.log_excess + x * self.log_sd).exp().ln_1p(), (-0.5 * x * x).exp()]
            })
            .collect();
        let weights = excesses.iter().map(|[_, weight]| weight).sum::<f64>();
        let below = |value: f64| {
            let parts = excesses.iter().map(|[excess, weight]| weight * normal((value + excess) / self.sd));
            parts.sum::<f64>() / weights
        };
        // ln V is between these but for a part in a million.
        let (mut low, mut high) = (-excesses[STEPS][0] - REACH * self.sd, REACH * self.sd);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if below(middle) < share { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }
}

/// The normal distribution's function, within 1.5e-7 (Abramowitz and Stegun 1964, 7.1.26).
fn normal(x: f64) -> f64 {
    let z = x.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * z);
    let series = [1.061_405_429, -1.453_152_027, 1.421_413_741, -0.284_496_736, 0.254_829_592];
    let tail = 0.5 * series.iter().fold(0.0, |sum, c| (sum + c) * t) * (-z * z).exp();
    if x < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn either_spread_alone_has_its_own_quantiles() {
        // exp(-40) is no excess.
        let even = Spread { log_excess: -40.0, log_sd: 0.3, sd: 0.01 };
        assert!((even.quantile(0.975) - 0.019_599_64).abs() < 1e-6, "{}", even.quantile(0.975));
        assert!(even.quantile(0.5).abs() < 1e-6);
        let skewed = Spread { log_excess: 0.05_f64.ln(), log_sd: 0.3, sd: 1e-3 };
        for (share, x) in [(0.025, 1.959_964), (0.5, 0.0), (0.975, -1.959_964)] {
            let expected = -(0.05 * f64::exp(0.3 * x)).ln_1p();
            assert!((skewed.quantile(share) - expected).abs() < 2e-4, "{share}: {}", skewed.quantile(share));
        }
    }

    #[test]
    fn together_they_are_wider_than_either() {
        let both = Spread { log_excess: 0.05_f64.ln(), log_sd: 0.3, sd: 0.01 };
        let width = |s: &Spread| s.quantile(0.975) - s.quantile(0.025);
        let alone = [Spread { sd: 1e-3, ..both }, Spread { log_sd: 1e-6, ..both }].map(|s| width(&s));
        let quadrature = alone[0].hypot(alone[1]);
        assert!((width(&both) / quadrature - 1.0).abs() < 0.03, "{} {quadrature}", width(&both));
    }
}
