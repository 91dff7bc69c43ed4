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
//! With the blur σ known, of the pedestal's sides or else of the sharpest edges, two points of the tail give the step s and the edge z₀.

use super::ToneCurve;
use super::backdrop::median;
use super::symmetry::{EdgePoint, Surroundings};

/// The tail's two points and half-way, shares of the way from background to grain.
const SHARES: [f64; 3] = [0.04, 0.12, 0.5];
/// Reading light between pixels along a straight line widens an edge by this, pixels, on average: √(1/6).
const READ_PX: f64 = 0.41;
/// By the blur of the sharpest edges a rim of less than this many standard deviations of it, and pixels for a noise as great as the contrast,
/// which makes the outline waver, cannot be told from none.
const LEAST: (f64, f64) = (0.3, 3.0);
/// The pedestal's sides tell the lens's blur where it is no more than this many times that of the sharpest edges: those of a mirror, or out
/// of focus, are softer.
const SOFTER: f64 = 1.2;
/// Of the views' blurs the one that this share of them are sharper than is the lens's.
const SHARPER: f64 = 0.2;
/// What a rim leaves differs along an outline: the mean profile over this many standard deviations of the blur shows it at every so many
/// places, where it is of so many edges at least.
const RADIUS: f64 = 7.0;
const EVERY: usize = 4;
const LEAST_LOCAL: f64 = 8.0;
/// Steps between which two points are told apart.
const STEPS: [f64; 2] = [0.25, 0.98];
/// By the lens's blur a step of this share and less has a rim, one of the other share and more has none, and between them a part of one: set
/// between the matt and the glossy and clear grains of the benchmark of pictures.
const RIM: [f64; 2] = [0.8, 0.9];

/// The blur of edges in a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeBlur {
    /// Standard deviation of the blur of the sharpest edges, as read between pixels, pixels.
    pub sharpest_px: f64,
    /// Standard deviation of the blur of lens and pixel, where the pedestal's sides show it, pixels.
    pub lens_px: Option<f64>,
}

impl EdgeBlur {
    /// The lens's, where it is told.
    fn told(&self) -> Option<f64> {
        self.lens_px.map(|px| px.hypot(READ_PX)).filter(|px| *px <= SOFTER * self.sharpest_px)
    }

    /// Standard deviation of the blur of an edge that is read between pixels, pixels.
    pub(super) fn px(&self) -> f64 {
        self.told().unwrap_or(self.sharpest_px)
    }
}

/// Where a mean profile reaches the shares 0.04, 0.12 and 0.5 of the way from background to grain, pixels inwards.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeTail {
    /// The three places.
    pub reached_px: [f64; 3],
    /// The edges' blur.
    pub blur: EdgeBlur,
    /// Standard deviation of the noise over the contrast.
    pub noise: f64,
    /// Whether the grain is the brighter side.
    pub is_bright: bool,
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
    /// Along an outline; places in a part of the picture that begins at `first`.
    pub(super) fn along(
        around: &Surroundings,
        points: &[EdgePoint],
        (curve, blur, first): (ToneCurve, EdgeBlur, [usize; 2]),
    ) -> Vec<Self> {
        let blur_px = blur.px();
        let means = around.mean_profiles(points, curve, (blur_px, RADIUS * blur_px, EVERY));
        let mut rims: Vec<Self> = (means.iter())
            .filter_map(|(at, profile)| {
                let tail = EdgeTail::of(|share| profile.reaches(share, LEAST_LOCAL), (blur, 0.0, false))?;
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
    pub(super) fn of(
        at: impl Fn(f64) -> Option<f64>,
        (blur, noise, is_bright): (EdgeBlur, f64, bool),
    ) -> Option<Self> {
        let [low, high, half] = SHARES.map(at);
        Some(Self { reached_px: [low?, high?, half?], blur, noise, is_bright })
    }

    /// The middle of several views' tails, with the middle of the lens's blurs, or else the blur of the sharper views: where a view's
    /// edges all are glossy, none shows it. `None` of none.
    pub fn middle(views: &[Self]) -> Option<Self> {
        let of = |figure: &dyn Fn(&Self) -> f64| median(&mut views.iter().map(figure).collect::<Vec<_>>());
        let mut blurs: Vec<f64> = views.iter().map(|view| view.blur.sharpest_px).collect();
        blurs.sort_by(f64::total_cmp);
        let mut lens: Vec<f64> = views.iter().filter_map(|view| view.blur.lens_px).collect();
        let lens_px = (2 * lens.len() >= views.len() && !lens.is_empty()).then(|| median(&mut lens));
        (!views.is_empty()).then(|| Self {
            reached_px: [0, 1, 2].map(|k| of(&|view| view.reached_px[k])),
            blur: EdgeBlur { sharpest_px: blurs[(SHARPER * blurs.len() as f64) as usize], lens_px },
            noise: of(&|view| view.noise),
            is_bright: views[0].is_bright,
        })
    }

    /// How far the placed outline lies inside of the edge, pixels; 0 where no rim shows.
    pub fn rim_px(&self) -> f64 {
        let (step, edge) = self.step_and_edge();
        let by_lens = self.blur.told().is_some();
        // A bright grain's outline is placed by the shape of its edge, whatever the light does further inside; a dark one's half-way, too.
        let from = if self.is_bright && by_lens { 0.0 } else { self.reached_px[2] };
        let rim = from - edge;
        if by_lens {
            let [whole, none] = RIM;
            rim.max(0.0) * ((none - step) / (none - whole)).clamp(0.0, 1.0)
        } else if step >= STEPS[1] || rim < LEAST.0 * self.blur.px() + LEAST.1 * self.noise {
            0.0
        } else {
            rim
        }
    }

    /// The step s of the tail, a share of the contrast, and where its edge z₀ lies, pixels inwards.
    fn step_and_edge(&self) -> (f64, f64) {
        let EdgeTail { reached_px: [low, high, _], blur, .. } = *self;
        let blur_px = blur.px();
        let width = (high - low) / blur_px;
        // The smaller the step, the further apart the two points.
        let between = |step: f64| quantile(SHARES[1] / step) - quantile(SHARES[0] / step);
        let [mut least, mut greatest] = STEPS;
        if width <= between(greatest) {
            least = greatest;
        } else if width >= between(least) {
            greatest = least;
        }
        for _ in 0..40 {
            let middle = 0.5 * (least + greatest);
            if between(middle) > width { least = middle } else { greatest = middle }
        }
        (least, high - blur_px * quantile(SHARES[1] / least))
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
        for (sigma, lens) in [(0.8, false), (1.2, false), (0.8, true), (1.2, true)] {
            let lens_px = lens.then(|| (sigma * sigma - READ_PX * READ_PX).sqrt());
            let blur = EdgeBlur { sharpest_px: sigma, lens_px };
            let told = |step, fall, sigma| {
                EdgeTail::of(|p| Some(reached(p, step, fall, sigma)), (blur, 0.01, false)).unwrap().rim_px()
            };
            assert_eq!(told(1.0, 1.0, sigma).to_bits(), 0.0_f64.to_bits());
            for (step, fall) in [(0.5, 3.0), (0.4, 3.0), (0.3, 2.0)] {
                let off = reached(0.5, step, fall, sigma);
                let rim = told(step, fall, sigma);
                assert!(off > 0.4 && (rim - off).abs() < 0.5 * off, "{step} {fall} {sigma}: {rim} for {off}");
            }
        }
        let blur = EdgeBlur { sharpest_px: 1.0, lens_px: None };
        assert!(EdgeTail::of(|_| None, (blur, 0.0, false)).is_none() && EdgeTail::middle(&[]).is_none());
    }
}
