//! Otsu's thresholds for two and three classes.
//!
//! With p(i) the share of the values in bin i, x(i) its middle, and for a class C of neighbouring bins
//!
//! ```text
//! ω = Σ p(i),   M = Σ p(i) x(i),   μ = M/ω          (i in C);   μ_T, σ_T²: mean and variance of all
//!
//! two classes:    σ_B²(k)    = ω₀ ω₁ (μ₀ − μ₁)²
//! three classes:  σ_B²(j, k) = M₀²/ω₀ + M₁²/ω₁ + M₂²/ω₂ − μ_T²
//! threshold(s)  = arg max σ_B²,   separability η = σ_B²/σ_T²
//! ```
//!
//! Source: N. Otsu, "A threshold selection method from gray-level histograms", IEEE Trans. Syst. Man Cybern. 9(1), 1979, eqs.
//! 5–19 for two classes and 28–30 for three.

/// A histogram of equal bins.
#[derive(Debug, Clone, PartialEq)]
pub struct Histogram {
    pub(super) first: f64,
    pub(super) width: f64,
    pub(super) counts: Vec<u64>,
}

/// The best split into two classes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split2 {
    /// The threshold: values above it are in the upper class.
    pub threshold: f64,
    /// Between-class over total variance, 0 … 1.
    pub separability: f64,
    /// Means of the lower and the upper class.
    pub means: [f64; 2],
    /// Shares of the two classes.
    pub shares: [f64; 2],
}

/// The best split into three classes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Split3 {
    /// The two thresholds, ascending.
    pub thresholds: [f64; 2],
    /// Between-class over total variance, 0 … 1.
    pub separability: f64,
    /// Means of the three classes, ascending.
    pub means: [f64; 3],
    /// Shares of the three classes.
    pub shares: [f64; 3],
}

impl Histogram {
    /// An empty histogram of `bins` bins of `width`, the first one starting at `first`.
    pub fn new(first: f64, width: f64, bins: usize) -> Self {
        Self { first, width, counts: vec![0; bins] }
    }

    /// A histogram of counts that were taken elsewhere.
    pub fn from_counts(first: f64, width: f64, counts: Vec<u64>) -> Self {
        Self { first, width, counts }
    }

    /// Counts a value; one beyond the ends counts in the bin at that end.
    pub fn add(&mut self, value: f64) {
        let last = self.counts.len() - 1;
        let bin = ((value - self.first) / self.width).max(0.0) as usize;
        self.counts[bin.min(last)] += 1;
    }

    /// The same counts in at most this many bins, each a whole number of the bins here.
    #[must_use]
    pub fn coarser(&self, bins: usize) -> Self {
        let merged = self.counts.len().div_ceil(bins.max(1)).max(1);
        let counts = self.counts.chunks(merged).map(|c| c.iter().sum()).collect();
        Self { first: self.first, width: self.width * merged as f64, counts }
    }

    /// Value at the middle of each bin, and how many were counted in it.
    pub fn bins(&self) -> impl Iterator<Item = (f64, u64)> + '_ {
        self.counts.iter().enumerate().map(|(k, n)| (self.middle(k), *n))
    }

    /// How many values were counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Value at the middle of a bin.
    fn middle(&self, bin: usize) -> f64 {
        self.first + (bin as f64 + 0.5) * self.width
    }

    /// Value at the upper end of a bin.
    pub(super) fn end(&self, bin: usize) -> f64 {
        self.first + (bin as f64 + 1.0) * self.width
    }

    /// The value below which a share (0 … 1) of all values `< limit` lies; `None` when there are none.
    pub fn quantile_below(&self, limit: f64, share: f64) -> Option<f64> {
        let bins = (((limit - self.first) / self.width).max(0.0) as usize).min(self.counts.len());
        let all: u64 = self.counts[..bins].iter().sum();
        let wanted = share * all as f64;
        let mut sum = 0.0;
        for (bin, &count) in self.counts[..bins].iter().enumerate() {
            let next = sum + count as f64;
            if count > 0 && next >= wanted {
                let part = ((wanted - sum) / count as f64).clamp(0.0, 1.0);
                return Some(self.first + (bin as f64 + part) * self.width);
            }
            sum = next;
        }
        None
    }

    /// Cumulated shares and first moments: entry `k` covers bins `0..k`.
    fn cumulated(&self) -> (Vec<f64>, Vec<f64>) {
        let total = self.total().max(1) as f64;
        let (mut share, mut moment) = (vec![0.0], vec![0.0]);
        let (mut s, mut m) = (0.0, 0.0);
        for (bin, &count) in self.counts.iter().enumerate() {
            let p = count as f64 / total;
            s += p;
            m += p * self.middle(bin);
            share.push(s);
            moment.push(m);
        }
        (share, moment)
    }

    fn variance(&self, mean: f64) -> f64 {
        let total = self.total().max(1) as f64;
        (self.counts.iter().enumerate())
            .map(|(bin, &count)| count as f64 / total * (self.middle(bin) - mean).powi(2))
            .sum()
    }

    /// The threshold that makes the between-class variance greatest, for two classes; `None` when fewer than
    /// two bins are filled. Where an empty gap between the classes leaves a choice, the middle of the gap.
    pub fn otsu2(&self) -> Option<Split2> {
        let (share, moment) = self.cumulated();
        let bins = self.counts.len();
        let all = moment[bins];
        let between = |k: usize| {
            let (w0, w1) = (share[k], share[bins] - share[k]);
            let (m0, m1) = (moment[k] / w0, (all - moment[k]) / w1);
            w0 * w1 * (m0 - m1).powi(2)
        };
        let filled = |k: usize| share[k] > 1e-12 && share[bins] - share[k] > 1e-12;
        let mut best: Option<(f64, usize, usize)> = None;
        for k in (1..bins).filter(|&k| filled(k)) {
            let value = between(k);
            match &mut best {
                Some((greatest, _, last)) if (value - *greatest).abs() <= 1e-12 * *greatest => *last = k,
                Some((greatest, ..)) if value <= *greatest => {}
                _ => best = Some((value, k, k)),
            }
        }
        let (value, first, last) = best?;
        let k = usize::midpoint(first, last);
        let variance = self.variance(all);
        (variance > 0.0).then(|| Split2 {
            threshold: self.end(k - 1),
            separability: value / variance,
            means: [moment[k] / share[k], (all - moment[k]) / (share[bins] - share[k])],
            shares: [share[k], share[bins] - share[k]],
        })
    }

    /// The two thresholds that make the between-class variance greatest, for three classes; `None` when fewer
    /// than three bins are filled. Time grows with the square of the number of bins.
    pub fn otsu3(&self) -> Option<Split3> {
        let (share, moment) = self.cumulated();
        let bins = self.counts.len();
        let part = |from: usize, to: usize| {
            let w = share[to] - share[from];
            if w > 1e-12 { (moment[to] - moment[from]).powi(2) / w } else { -1.0 }
        };
        let mut best = (f64::NEG_INFINITY, 0, 0);
        for i in 1..bins {
            let low = part(0, i);
            if low < 0.0 {
                continue;
            }
            for j in i + 1..bins {
                let (middle, high) = (part(i, j), part(j, bins));
                if middle >= 0.0 && high >= 0.0 && low + middle + high > best.0 {
                    best = (low + middle + high, i, j);
                }
            }
        }
        let (sum, i, j) = best;
        let variance = self.variance(moment[bins]);
        (sum.is_finite() && variance > 0.0).then(|| {
            let mean = |from: usize, to: usize| (moment[to] - moment[from]) / (share[to] - share[from]);
            Split3 {
                thresholds: [self.end(i - 1), self.end(j - 1)],
                separability: (sum - moment[bins].powi(2)) / variance,
                means: [mean(0, i), mean(i, j), mean(j, bins)],
                shares: [share[i], share[j] - share[i], share[bins] - share[j]],
            }
        })
    }
}
