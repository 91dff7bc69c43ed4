//! The bright rim of a glossy or clear grain: how far outside of the half-way level its edge is.
//!
//! At grazing incidence any smooth face mirrors (Fresnel), so that towards its limb a glossy grain takes on the light of the
//! background behind it: the level falls from the background's in a step of a part of the contrast and then over some pixels
//! more. Half-way between background and grain lies inside of the edge. What the rim does not change is the tail of the lens's
//! blur outside of the step:
//!
//! ```text
//! p(z) = s Φ((z − z₀)/σ)    for small p      p: share of the way from background to grain, z: pixels inwards
//! ```
//!
//! With the blur σ of the sharpest edges known, two points of the tail give the step s and the edge z₀.

use super::ToneCurve;
use super::backdrop::median;
use super::symmetry::{EdgePoint, Surroundings};

/// The tail's two points and half-way, shares of the way from background to grain.
const SHARES: [f64; 3] = [0.04, 0.12, 0.5];
/// A rim of less than this many standard deviations of the blur, and pixels for a noise as great as the contrast, which makes the
/// outline waver, cannot be told from none. What outlines lie inside of the edge was 0.4 to 1.4 times the rim that is found, on
/// twelve sets of glossy and clear grains of the benchmark.
const LEAST: (f64, f64) = (0.3, 3.0);
/// Of the views' blurs the one that this share of them are sharper than is the lens's.
const SHARPER: f64 = 0.2;
/// What a rim leaves differs along an outline: the mean profile over this many standard deviations of the blur shows it at every so many
/// places, where it is of so many edges at least.
const RADIUS: f64 = 7.0;
const EVERY: usize = 4;
const LEAST_LOCAL: f64 = 8.0;
/// A step of this share and more has no rim; less than the other is no step.
const STEP: [f64; 2] = [0.25, 0.98];

/// Where a mean profile reaches the shares 0.04, 0.12 and 0.5 of the way from background to grain, pixels inwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeTail {
    /// The three places.
    pub reached_px: [f64; 3],
    /// Standard deviation of the blur of the sharpest edges, pixels.
    pub sharpest_px: f64,
    /// Standard deviation of the noise over the contrast.
    pub noise: f64,
}

/// How far the placed outline lies inside of the edge at a place, beyond what it does on the view's average.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalRim {
    /// Column and row in the picture.
    pub at: [f64; 2],
    /// Pixels outwards.
    pub px: f64,
}

impl LocalRim {
    /// Along an outline of which the sharpest edges' blur is known; places in a part of the picture that begins at `first`.
    pub(super) fn along(
        around: &Surroundings,
        points: &[EdgePoint],
        (curve, blur_px, first): (ToneCurve, f64, [usize; 2]),
    ) -> Vec<Self> {
        let means = around.mean_profiles(points, curve, (blur_px, RADIUS * blur_px, EVERY));
        let mut rims: Vec<Self> = (means.iter())
            .filter_map(|(at, profile)| {
                let tail = EdgeTail::of(|share| profile.reaches(share, LEAST_LOCAL), [blur_px, 0.0])?;
                let at = [0, 1].map(|k| at[k] + first[k] as f64);
                Some(Self { at, px: -tail.step_and_edge().1 })
            })
            .collect();
        let mean = rims.iter().map(|rim| rim.px).sum::<f64>() / rims.len().max(1) as f64;
        rims.iter_mut().for_each(|rim| rim.px -= mean);
        rims
    }
}

impl EdgeTail {
    /// Of a profile that tells where it reaches a share; `None` where it does not reach all.
    pub(super) fn of(at: impl Fn(f64) -> Option<f64>, [sharpest_px, noise]: [f64; 2]) -> Option<Self> {
        let [low, high, half] = SHARES.map(at);
        Some(Self { reached_px: [low?, high?, half?], sharpest_px, noise })
    }

    /// The middle of several views' tails, with the blur of the sharper views: where a view's edges all are glossy, none shows it. `None` of
    /// none.
    pub fn middle(views: &[Self]) -> Option<Self> {
        let of = |figure: &dyn Fn(&Self) -> f64| median(&mut views.iter().map(figure).collect::<Vec<_>>());
        let mut blurs: Vec<f64> = views.iter().map(|view| view.sharpest_px).collect();
        blurs.sort_by(f64::total_cmp);
        (!views.is_empty()).then(|| Self {
            reached_px: [0, 1, 2].map(|k| of(&|view| view.reached_px[k])),
            sharpest_px: blurs[(SHARPER * blurs.len() as f64) as usize],
            noise: of(&|view| view.noise),
        })
    }

    /// How far half-way lies inside of the edge, pixels; 0 where no rim shows.
    pub fn rim_px(&self) -> f64 {
        let (step, edge) = self.step_and_edge();
        let rim = self.reached_px[2] - edge;
        if step >= STEP[1] || rim < LEAST.0 * self.sharpest_px + LEAST.1 * self.noise { 0.0 } else { rim }
    }

    /// The step s of the tail, a share of the contrast, and where its edge z₀ lies, pixels inwards.
    fn step_and_edge(&self) -> (f64, f64) {
        let EdgeTail { reached_px: [low, high, _], sharpest_px, .. } = *self;
        let width = (high - low) / sharpest_px;
        // The smaller the step, the further apart the two points.
        let between = |step: f64| quantile(SHARES[1] / step) - quantile(SHARES[0] / step);
        let [mut least, mut greatest] = STEP;
        if width <= between(greatest) {
            least = greatest;
        } else if width >= between(least) {
            greatest = least;
        }
        for _ in 0..40 {
            let middle = 0.5 * (least + greatest);
            if between(middle) > width { least = middle } else { greatest = middle }
        }
        (least, high - sharpest_px * quantile(SHARES[1] / least))
    }
}

/// The standard normal quantile, to 4.5·10⁻⁴ (Abramowitz and Stegun 1964, 26.2.23).
fn quantile(p: f64) -> f64 {
    let (tail, sign) = if p < 0.5 { (p, -1.0) } else { (1.0 - p, 1.0) };
    let t = (-2.0 * tail.max(1e-12).ln()).sqrt();
    let over = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let under = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    sign * (t - over / under)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the profile of a step and a rim that falls off over `fall` pixels, blurred by σ, reaches a share.
    fn reached(share: f64, step: f64, fall: f64, sigma: f64) -> f64 {
        let value = |z: f64| {
            let parts = 4000;
            let blurred = (0..parts).map(|k| {
                let away = 10.0 * sigma * ((f64::from(k) + 0.5) / f64::from(parts) - 0.5);
                let weight = (-0.5 * (away / sigma).powi(2)).exp();
                let at = z - away;
                let level = if at < 0.0 { 0.0 } else { step + (1.0 - step) * (1.0 - (-at / fall).exp()) };
                [weight * level, weight]
            });
            let [sum, all] = blurred.fold([0.0, 0.0], |[a, b], [c, d]| [a + c, b + d]);
            sum / all
        };
        let (mut low, mut high) = (-6.0, 12.0);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if value(middle) < share { low = middle } else { high = middle }
        }
        low
    }

    #[test]
    fn the_edge_of_a_rim_is_found_to_half_of_what_it_is_off_and_a_plain_edge_stays() {
        let told = |step, fall, sigma| {
            EdgeTail::of(|p| Some(reached(p, step, fall, sigma)), [sigma, 0.01]).unwrap().rim_px()
        };
        for sigma in [0.8, 1.2] {
            assert_eq!(told(1.0, 1.0, sigma).to_bits(), 0.0_f64.to_bits());
            for (step, fall) in [(0.5, 3.0), (0.4, 3.0), (0.3, 2.0)] {
                let off = reached(0.5, step, fall, sigma);
                let rim = told(step, fall, sigma);
                assert!(off > 0.4 && (rim - off).abs() < 0.5 * off, "{step} {fall} {sigma}: {rim} for {off}");
            }
        }
        assert!(EdgeTail::of(|_| None, [1.0, 0.0]).is_none() && EdgeTail::middle(&[]).is_none());
    }
}
