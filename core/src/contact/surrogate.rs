//! Few computed cases that stand for many guessed ones.

/// How computed values follow from guessed ones: by one ratio, the median of theirs.
#[derive(Debug, Clone, PartialEq)]
pub struct Surrogate {
    /// A computed value over its guess.
    pub ratio: f64,
    /// Of each case the computed value over what the others' ratio says of it; in the order of size.
    pub left_out: Vec<f64>,
}

impl Surrogate {
    /// Of pairs of a guess and what was computed, all positive; none of fewer than three.
    pub fn of(pairs: &[[f64; 2]]) -> Option<Self> {
        if pairs.len() < 3 || !pairs.iter().flatten().all(|x| x.is_finite() && *x > 0.0) {
            return None;
        }
        let logs: Vec<f64> = pairs.iter().map(|[guess, computed]| (computed / guess).ln()).collect();
        let without = |left: usize| {
            let others = logs.iter().enumerate().filter(|(k, _)| *k != left);
            logs[left] - median(others.map(|(_, x)| *x).collect())
        };
        let mut left_out: Vec<f64> = (0..logs.len()).map(|k| without(k).exp()).collect();
        left_out.sort_by(f64::total_cmp);
        Some(Self { ratio: median(logs).exp(), left_out })
    }

    /// What a guess stands for where a case is this far up in the order of the errors, 0 to 1.
    pub fn drawn(&self, guess: f64, place: f64) -> f64 {
        let k = (place * self.left_out.len() as f64) as usize;
        guess * self.ratio * self.left_out[k.min(self.left_out.len() - 1)]
    }

    /// The error of half the cases is at most this, as a share: 0.1 is ten per cent up or down.
    pub fn error(&self) -> f64 {
        median(self.left_out.iter().map(|x| x.ln().abs()).collect()).exp() - 1.0
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ratio_that_all_have_is_found_and_one_that_stands_out_shows_as_an_error() {
        let mut pairs: Vec<[f64; 2]> = (1..9).map(|k| [f64::from(k), 1.5 * f64::from(k)]).collect();
        let all = Surrogate::of(&pairs).unwrap();
        assert!((all.ratio - 1.5).abs() < 1e-12 && all.error() < 1e-12);
        pairs.push([1.0, 15.0]);
        let with = Surrogate::of(&pairs).unwrap();
        assert!((with.ratio - 1.5).abs() < 1e-12 && (with.left_out[8] - 10.0).abs() < 1e-9);
        assert!((with.drawn(2.0, 0.999) - 30.0).abs() < 1e-9 && (with.drawn(2.0, 0.0) - 3.0).abs() < 1e-9);
    }

    #[test]
    fn too_few_or_what_is_nothing_stand_for_nothing() {
        assert_eq!(Surrogate::of(&[[1.0, 1.0], [2.0, 2.0]]), None);
        assert_eq!(Surrogate::of(&[[1.0, 1.0], [2.0, 2.0], [3.0, 0.0]]), None);
        assert_eq!(Surrogate::of(&[[1.0, 1.0], [2.0, 2.0], [3.0, f64::NAN]]), None);
    }
}
