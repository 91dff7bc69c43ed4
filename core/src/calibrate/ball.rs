//! Circle fit to a ball's outline: centre and radius by geometric least squares, with their standard uncertainty, pixels.

use crate::silhouette::{PedestalOutline, Silhouette};
use nalgebra::{DMatrix, DVector};

/// Outlines of a smaller radius determine too little of the size of a pixel, pixels.
pub const LEAST_RADIUS_PX: f64 = 20.0;
/// Root mean square distance of the outline from its circle above which a body is no ball, as a share of its radius.
pub const MOST_UNROUND: f64 = 0.01;
/// Difference of the axes above which a body is no ball, or its pixels are no squares, as a share of the radius.
pub const MOST_ELLIPTIC: f64 = 0.02;
/// Least share of the directions, all round, in which the outline must show.
const LEAST_SHOWN: f64 = 0.5;
/// Above the pedestal's top by less than this, pixels, an outline is the cut's, not the ball's.
const OFF_CUT_PX: f64 = 4.0;
/// Columns beside the pedestal that its blur reaches, pixels.
const BESIDE_PX: f64 = 8.0;
/// Over the pedestal the wedge between it and the ball ends at this height, as a share of the outline's half width.
const WEDGE: f64 = 0.35;
/// Residuals beyond this many robust standard deviations count for nothing (Tukey's biweight, 95 % efficient).
const TUKEY: f64 = 4.685;
/// Residuals are believed no better than this, pixels.
const LEAST_SPREAD_PX: f64 = 0.005;
/// Iterations of the fit; it converges in five or six.
const ITERATIONS: usize = 40;
/// Rounds begin with a circle through the extents, which dust may have moved.
const SETTLED_PX: f64 = 1e-7;

/// The circle of a ball's outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Column and row of the centre, pixels.
    pub center_px: [f64; 2],
    /// Radius, pixels.
    pub radius_px: f64,
    /// Standard uncertainty of the radius from the outline's own scatter, neighbours' likeness allowed for, pixels.
    pub sigma_px: f64,
    /// Root mean square distance of the outline from the circle, without what was left out as dust, pixels.
    pub residual_px: f64,
    /// Length of the greater axis over the smaller less 1, from an ellipse's first order.
    pub ellipticity: f64,
    /// Standard uncertainty of the ellipticity.
    pub ellipticity_sigma: f64,
    /// Direction of the greater axis, radians from the row's direction towards greater rows, −π/2 … π/2.
    pub greater_axis_rad: f64,
    /// Points of the outline that were used.
    pub points: usize,
    /// How many of them are independent of each other.
    pub independent: f64,
}

/// Why a picture shows no ball.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum BallError {
    /// Too little of the outline is seen.
    #[error(
        "the outline shows in {shown:.0} % of the directions, {least:.0} % are needed; set the ball on a narrower \
         pedestal, or free of its surroundings",
        shown = 100.0 * shown,
        least = 100.0 * LEAST_SHOWN
    )]
    TooLittle {
        /// Share of the directions.
        shown: f64,
    },
    /// The picture is too coarse.
    #[error(
        "the outline's radius is {radius_px:.1} px, at least {LEAST_RADIUS_PX} px are needed; use a larger ball"
    )]
    TooSmall {
        /// Its radius, pixels.
        radius_px: f64,
    },
    /// No circle.
    #[error(
        "the body is not round: its outline is {share:.2} % of the radius off its circle (root mean square), {limit} % \
         is the limit; use a clean ball, and see that nothing touches it but the pedestal",
        share = 100.0 * share,
        limit = 100.0 * MOST_UNROUND
    )]
    NotRound {
        /// Root mean square distance over the radius.
        share: f64,
    },
    /// An ellipse.
    #[error(
        "the body is not round: one axis of its outline is {share:.2} % longer than the other, {limit} % is the limit; \
         use a ball, and see that the picture was not stretched",
        share = 100.0 * share,
        limit = 100.0 * MOST_ELLIPTIC
    )]
    Elliptic {
        /// Difference of the axes over the radius.
        share: f64,
    },
}

/// The circle of a ball's outline.
///
/// Geometric least squares over every point where the outline crosses a line between neighbouring pixel centres,
/// without those that the pedestal spoils: near its top, and in the wedge between it and the ball. Dust is held off
/// by Tukey's biweight. The cost is that of one look at each pixel.
///
/// # Errors
/// [`BallError`] where the body is too small, hidden too far, or not round.
pub fn fit_disc(silhouette: &Silhouette, pedestal: Option<&PedestalOutline>) -> Result<Disc, BallError> {
    let points = seen(silhouette, pedestal);
    let shown = shown(&points);
    if shown < LEAST_SHOWN {
        return Err(BallError::TooLittle { shown });
    }
    let circle = Fit::of(&points, Shape::Circle);
    let [column, row, radius_px] = [circle.x[0], circle.x[1], circle.x[2]];
    if radius_px.is_nan() || radius_px < LEAST_RADIUS_PX {
        return Err(BallError::TooSmall { radius_px });
    }
    let all = circle.residuals.iter().map(|e| e * e).sum::<f64>() / points.len() as f64;
    let share = all.sqrt() / radius_px;
    let ellipse = Fit::of(&points, Shape::Ellipse);
    let [a, b] = [ellipse.x[3], ellipse.x[4]];
    let ellipticity = 2.0 * a.hypot(b) / ellipse.x[2];
    let nearly_elliptic = ellipse.spread() < 0.5 * all.sqrt();
    if ellipticity > MOST_ELLIPTIC && nearly_elliptic {
        return Err(BallError::Elliptic { share: ellipticity });
    }
    if share > MOST_UNROUND {
        return Err(BallError::NotRound { share });
    }
    if ellipticity > MOST_ELLIPTIC {
        return Err(BallError::Elliptic { share: ellipticity });
    }
    let along = circle.correlation();
    Ok(Disc {
        center_px: [column, row],
        radius_px,
        sigma_px: circle.sigma(2) * along.sqrt(),
        residual_px: circle.spread(),
        ellipticity,
        ellipticity_sigma: 2.0 * ellipse.sigma(3).max(ellipse.sigma(4)) * ellipse.correlation().sqrt()
            / ellipse.x[2],
        greater_axis_rad: 0.5 * b.atan2(a),
        points: points.len(),
        independent: points.len() as f64 / along,
    })
}

/// Every point (column, row) where the outline crosses a line between neighbouring pixel centres.
pub(super) fn crossings(s: &Silhouette) -> Vec<[f64; 2]> {
    let [w, h] = s.size;
    let mut points = Vec::new();
    let mut cross = |x: usize, y: usize, other: usize, step: [f64; 2]| {
        let (a, b) = (f64::from(s.distance_px[y * w + x]), f64::from(s.distance_px[other]));
        if (a < 0.0) != (b < 0.0) {
            let t = a / (a - b);
            points.push([(s.origin[0] + x) as f64 + t * step[0], (s.origin[1] + y) as f64 + t * step[1]]);
        }
    };
    for y in 0..h {
        for x in 0..w {
            if x + 1 < w {
                cross(x, y, y * w + x + 1, [1.0, 0.0]);
            }
            if y + 1 < h {
                cross(x, y, (y + 1) * w + x, [0.0, 1.0]);
            }
        }
    }
    points
}

/// The outline's points that are the ball's alone, in the order of their direction from the middle.
fn seen(silhouette: &Silhouette, pedestal: Option<&PedestalOutline>) -> Vec<[f64; 2]> {
    let mut points = crossings(silhouette);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for p in &points {
        for k in 0..2 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let half = 0.5 * (high[0] - low[0]);
    if let Some(p) = pedestal {
        let level = 1.0 / p.top_slope.hypot(1.0);
        points.retain(|[x, y]| {
            let above = (p.top_row + p.top_slope * (x - p.centre_column) - y) * level;
            let over = (x - p.centre_column).abs() <= p.half_width + BESIDE_PX;
            !over || above >= OFF_CUT_PX.max(WEDGE * half)
        });
    }
    let middle = [0.5 * (low[0] + high[0]), low[1] + half];
    let direction = |p: &[f64; 2]| (p[1] - middle[1]).atan2(p[0] - middle[0]);
    points.sort_by(|a, b| direction(a).total_cmp(&direction(b)));
    points
}

/// Share of 72 directions from the points' middle in which there is one.
fn shown(points: &[[f64; 2]]) -> f64 {
    let x = Fit::start(points);
    let mut sectors = [false; 72];
    for p in points {
        let turn = (p[1] - x[1]).atan2(p[0] - x[0]) / std::f64::consts::TAU + 0.5;
        sectors[((turn * 72.0) as usize).min(71)] = true;
    }
    sectors.iter().filter(|s| **s).count() as f64 / 72.0
}

/// What is fitted: centre, radius; and the first order of an ellipse, radius + A cos 2φ + B sin 2φ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    Circle = 3,
    Ellipse = 5,
}

/// A fit and what is left of it.
struct Fit {
    x: DVector<f64>,
    residuals: Vec<f64>,
    weights: Vec<f64>,
    /// Inverse of the normal matrix.
    inverse: DMatrix<f64>,
}

impl Fit {
    /// Centre and radius that solve x² + y² = 2 a x + 2 b y + c (Kåsa 1976): a start, biased for short arcs.
    fn start(points: &[[f64; 2]]) -> [f64; 3] {
        let n = points.len().max(1) as f64;
        let mean = [0, 1].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
        let (mut normal, mut right) = (nalgebra::Matrix3::zeros(), nalgebra::Vector3::zeros());
        for p in points {
            let (x, y) = (p[0] - mean[0], p[1] - mean[1]);
            let row = nalgebra::Vector3::new(2.0 * x, 2.0 * y, 1.0);
            normal += row * row.transpose();
            right += row * (x * x + y * y);
        }
        let Some(s) = normal.lu().solve(&right) else { return [mean[0], mean[1], f64::NAN] };
        [mean[0] + s[0], mean[1] + s[1], (s[2] + s[0] * s[0] + s[1] * s[1]).max(0.0).sqrt()]
    }

    fn of(points: &[[f64; 2]], shape: Shape) -> Self {
        let unknowns = shape as usize;
        let mut x = DVector::zeros(unknowns);
        x.rows_mut(0, 3).copy_from_slice(&Self::start(points));
        let mut inverse = DMatrix::zeros(unknowns, unknowns);
        let mut weights = vec![1.0; points.len()];
        let mut residuals = Self::residuals(&x, points);
        for _ in 0..ITERATIONS {
            let spread = robust_spread(&residuals);
            weights = residuals.iter().map(|e| biweight(e / (TUKEY * spread))).collect();
            let mut normal = DMatrix::zeros(unknowns, unknowns);
            let mut right = DVector::zeros(unknowns);
            for ((p, e), w) in points.iter().zip(&residuals).zip(&weights) {
                let (sin, cos) = (p[1] - x[1]).atan2(p[0] - x[0]).sin_cos();
                let all = [cos, sin, 1.0, cos * cos - sin * sin, 2.0 * sin * cos];
                let row = DVector::from_column_slice(&all[..unknowns]);
                right += &row * (w * e);
                normal += &row * row.transpose() * *w;
            }
            let Some(inverted) = normal.try_inverse() else { break };
            let step = &inverted * right;
            x += &step;
            inverse = inverted;
            residuals = Self::residuals(&x, points);
            if step.amax() < SETTLED_PX {
                break;
            }
        }
        Self { x, residuals, weights, inverse }
    }

    /// Signed distance of each point from the shape, positive outside (first order in the ellipticity).
    fn residuals(x: &DVector<f64>, points: &[[f64; 2]]) -> Vec<f64> {
        (points.iter())
            .map(|p| {
                let (dx, dy) = (p[0] - x[0], p[1] - x[1]);
                let radius = if x.len() > 3 {
                    let (sin, cos) = (2.0 * dy.atan2(dx)).sin_cos();
                    x[2] + x[3] * cos + x[4] * sin
                } else {
                    x[2]
                };
                dx.hypot(dy) - radius
            })
            .collect()
    }

    /// Weighted root mean square of the residuals.
    fn spread(&self) -> f64 {
        let (sum, weight) = (self.residuals.iter().zip(&self.weights))
            .fold((0.0, 0.0), |(s, n), (e, w)| (s + w * e * e, n + w));
        (sum / f64::max(weight, 1.0)).sqrt()
    }

    /// Standard uncertainty of an unknown as if the points were independent.
    fn sigma(&self, unknown: usize) -> f64 {
        self.spread() * self.inverse[(unknown, unknown)].max(0.0).sqrt()
    }

    /// How many neighbouring points err alike.
    fn correlation(&self) -> f64 {
        let kept: Vec<f64> = (self.residuals.iter().zip(&self.weights)).map(|(e, w)| e * w).collect();
        integrated_correlation(&kept)
    }
}

/// How many neighbours in a series err alike: 1 + 2 Σ of its autocorrelation, up to where that first falls to zero
/// (the window of Sokal 1997, section 3, for a short correlation).
pub(super) fn integrated_correlation(series: &[f64]) -> f64 {
    let n = series.len();
    let variance = series.iter().map(|e| e * e).sum::<f64>();
    if variance <= 0.0 {
        return 1.0;
    }
    let likeness = |lag: usize| (0..n - lag).map(|i| series[i] * series[i + lag]).sum::<f64>() / variance;
    1.0 + 2.0 * (1..n / 4).map(likeness).take_while(|c| *c > 0.0).sum::<f64>()
}

/// Tukey's biweight of a residual over the limit.
fn biweight(u: f64) -> f64 {
    if u.abs() < 1.0 { (1.0 - u * u).powi(2) } else { 0.0 }
}

/// 1.4826 times the median size of the residuals: a normal distribution's standard deviation.
fn robust_spread(residuals: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = residuals.iter().map(|e| e.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let middle = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    (1.4826 * middle).max(LEAST_SPREAD_PX)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A silhouette of 400 × 400 px from its distance.
    fn silhouette(distance: impl Fn(f64, f64) -> f64) -> Silhouette {
        let size = [400, 400];
        let distance_px =
            (0..size[0] * size[1]).map(|k| distance((k % 400) as f64, (k / 400) as f64) as f32).collect();
        Silhouette { picture: [1000, 800], origin: [100, 50], size, distance_px }
    }

    fn ball(x: f64, y: f64) -> f64 {
        (x - 203.37).hypot(y - 190.81) - 120.43
    }

    const PEDESTAL: PedestalOutline = PedestalOutline {
        top_row: 350.0,
        top_slope: 0.0,
        centre_column: 303.0,
        half_width: 60.0,
        blur: 1.0,
        top_seen: true,
        slope_seen: true,
    };

    #[test]
    fn a_circle_comes_out_to_a_thousandth_of_a_pixel() {
        let disc = fit_disc(&silhouette(ball), None).unwrap();
        assert!((disc.radius_px - 120.43).abs() < 1e-3, "{disc:?}");
        assert!(
            (disc.center_px[0] - 303.37).abs() < 1e-3 && (disc.center_px[1] - 240.81).abs() < 1e-3,
            "{disc:?}"
        );
        assert!(disc.ellipticity < 1e-4 && disc.residual_px < 5e-3, "{disc:?}");
    }

    #[test]
    fn pedestal_wedge_and_dust_do_not_move_it() {
        let spoiled = |x: f64, y: f64| {
            let dust = (x - 90.0).hypot(y - 150.0) - 7.0;
            // The wedge beside the contact filled, and all cut level with the pedestal's top.
            let wedge = if (x - 203.0).abs() < 60.0 && y > 280.0 { -3.0 } else { 9.0 };
            ball(x, y).min(dust).min(wedge).max(y - 300.0)
        };
        let disc = fit_disc(&silhouette(spoiled), Some(&PEDESTAL)).unwrap();
        assert!((disc.radius_px - 120.43).abs() < 0.005, "{disc:?}");
    }

    #[test]
    fn what_is_no_ball_is_refused() {
        let block = |x: f64, y: f64| ((x - 200.0).abs() - 100.0).max((y - 200.0).abs() - 100.0);
        assert!(matches!(fit_disc(&silhouette(block), None), Err(BallError::NotRound { .. })));
        let egg = |x: f64, y: f64| ((x - 200.0).hypot((y - 200.0) / 1.05) - 100.0) / 1.02;
        assert!(
            matches!(fit_disc(&silhouette(egg), None), Err(BallError::Elliptic { share }) if (share - 0.05).abs() < 0.01)
        );
        let small = |x: f64, y: f64| (x - 200.0).hypot(y - 200.0) - 15.0;
        assert!(matches!(fit_disc(&silhouette(small), None), Err(BallError::TooSmall { .. })));
        let nothing = |_: f64, _: f64| 5.0;
        assert!(matches!(fit_disc(&silhouette(nothing), None), Err(BallError::TooLittle { .. })));
    }
}
