//! Scale: the size of a pixel at the rotation axis, from observations of an artefact of known diameter.
//!
//! A pinhole at the distance D from the axis sees a ball of radius R, whose centre is Y behind the axis, with the
//! radius R D / √((D + Y)² − R²) (in the axis' scale), and an upright pin with the same half width. On the turning
//! table the centre goes round: X = e cos(θ + φ), Y = e sin(θ + φ). X is seen; so where the angles are known, Y is.
//!
//! ```text
//! m = (1 + ¼ (u m/D)²) R / (r √((1 + Y/D)² − (R/D)²))
//! ```
//!
//! is the size of a pixel by an outline of radius r whose centre is u beside the optical axis; the first factor, the elongation of
//! a ball's outline, is taken off where D is given. The uncertainty budget is
//! `(σ/m)² = max(fit, spread)² + perspective² + body² + edge²` ([`UncertaintyBudget`]).

use super::measured::Measured;
use crate::geometry::Angle;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

/// Where it is not given how far away the camera is, it is taken to be at least this far, mm: no laboratory lens works
/// nearer to a turning grain.
pub const NEAREST_CAMERA_MM: f64 = 50.0;
/// Pictures that differ by more than this, as a share, do not show one body at one setting.
pub const MOST_DISAGREEMENT: f64 = 0.01;
/// The camera is at least this many radii away.
const LEAST_RADII: f64 = 3.0;
/// Where only one picture is there, the body may stand this far from the axis, as a share of its radius.
const ALONE: f64 = 0.25;
/// A scatter of the pictures this many times what their outlines promise is worth a warning.
const SCATTERED: f64 = 4.0;
/// Views at known angles that show the camera's distance.
const SHOW_DISTANCE: usize = 4;

/// An observation of the artefact: its outline in one picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Radius, or half width, of the outline, pixels.
    pub radius_px: f64,
    /// Its standard uncertainty, pixels.
    pub sigma_px: f64,
    /// Column and row of the outline's middle, pixels.
    pub center_px: [f64; 2],
    /// Column of the pedestal's middle, where it is seen.
    pub pedestal_column_px: Option<f64>,
    /// The table's angle, counter-clockwise seen from above, where it is known.
    pub angle: Option<Angle>,
}

/// The reference artefact (ball or pin of known diameter) and what is known of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Artefact {
    /// The body's diameter, mm.
    pub diameter_mm: f64,
    /// The diameter is right within this, mm.
    pub tolerance_mm: f64,
    /// Distance from the centre of projection to the axis, mm; `None` where it is not known.
    pub camera_distance_mm: Option<f64>,
    /// Column and row where the optical axis meets the picture: its middle, as far as anybody knows.
    pub principal_px: [f64; 2],
    /// Whether the body is a ball, whose outline a pinhole draws longer beside the optical axis.
    pub ball: bool,
    /// How far all outlines may be off to one side, pixels.
    pub edge_px: f64,
}

/// The uncertainty budget: contributions, each as a standard uncertainty over the value.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct UncertaintyBudget {
    /// The outlines' own scatter about their circles.
    pub fit: f64,
    /// The scatter of the pictures about their mean, over the root of their number; of `fit` and `spread`, which state
    /// the same, the greater counts.
    pub spread: f64,
    /// What the camera's distance and the body's position leave open.
    pub perspective: f64,
    /// The body's diameter.
    pub body: f64,
    /// A shift of all outlines to one side.
    pub edge: f64,
}

impl UncertaintyBudget {
    /// All together.
    pub fn sum(&self) -> f64 {
        [self.fit.max(self.spread), self.perspective, self.body, self.edge]
            .iter()
            .map(|p| p * p)
            .sum::<f64>()
            .sqrt()
    }
}

/// The size of a pixel and how it was got.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// Size of a pixel at the rotation axis, mm.
    pub mm_per_px: Measured,
    /// What makes up its uncertainty.
    pub budget: UncertaintyBudget,
    /// How far the body's middle stands from the axis, mm; `None` where the angles are not known.
    pub eccentricity_mm: Option<f64>,
    /// Distance from the centre of projection to the axis, mm: given, or shown by the pictures.
    pub camera_distance_mm: Measured,
    /// The value from each picture alone, mm.
    pub each_mm_per_px: Vec<f64>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// Why there is no scale.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ScaleError {
    /// Nothing was seen.
    #[error("no picture shows the body; at least one is needed")]
    NoObservations,
    /// A number that makes no sense.
    #[error("the {what} is {value} mm, it must be {limit}; correct it")]
    Length {
        /// What it is.
        what: &'static str,
        /// Its value, mm.
        value: f64,
        /// What is allowed.
        limit: &'static str,
    },
    /// The camera is inside the body, or nearly so.
    #[error(
        "the camera's distance is {distance_mm} mm, but a body of {radius_mm} mm radius needs at least {least_mm} mm; \
         give the distance from the lens's centre to the rotation axis"
    )]
    TooNear {
        /// The distance given, mm.
        distance_mm: f64,
        /// The body's radius, mm.
        radius_mm: f64,
        /// The least distance, mm.
        least_mm: f64,
    },
    /// Pictures of different things.
    #[error(
        "picture {index} says {value} mm per pixel, the middle of all is {middle}: {percent:.2} % apart, {limit} % is the \
         limit; look at that picture, and leave it out where it shows another body or another camera setting",
        percent = 100.0 * (value / middle - 1.0).abs(),
        limit = 100.0 * MOST_DISAGREEMENT
    )]
    Disagree {
        /// Which picture.
        index: usize,
        /// Its value, mm.
        value: f64,
        /// The median, mm.
        middle: f64,
    },
}

/// The size of a pixel at the rotation axis.
///
/// # Errors
/// [`ScaleError`] for lengths that make no sense and pictures that disagree.
pub fn pixel_size(observations: &[Observation], artefact: &Artefact) -> Result<Scale, ScaleError> {
    check(artefact)?;
    let n = observations.len();
    if n == 0 {
        return Err(ScaleError::NoObservations);
    }
    let radius_mm = 0.5 * artefact.diameter_mm;
    let radius_px = observations.iter().map(|s| s.radius_px).sum::<f64>() / n as f64;
    let rough = radius_mm / radius_px;
    let mut warnings = Vec::new();

    // Where the body stands, in the axis' scale; one more round for that would change e by its square over D.
    let orbit = Orbit::of(observations);
    let depths_mm: Option<Vec<f64>> = orbit.as_ref().map(|o| o.depths.iter().map(|y| y * rough).collect());
    let seen = match (&depths_mm, artefact.camera_distance_mm) {
        (Some(depths), None) => shown_nearness(observations, depths, radius_px),
        _ => None,
    };
    let nearness = match (artefact.camera_distance_mm, seen) {
        (Some(d), _) => Nearness { value: 1.0 / d, most: 1.0 / d, exact: true },
        (None, Some((value, sigma))) => {
            let most = (value.max(0.0) + 2.0 * sigma).min(1.0 / NEAREST_CAMERA_MM);
            Nearness { value: value.clamp(0.0, most), most, exact: false }
        }
        (None, None) => Nearness { value: 0.0, most: 1.0 / NEAREST_CAMERA_MM, exact: false },
    };

    let each: Vec<f64> = (observations.iter().enumerate())
        .map(|(i, s)| {
            let depth_mm = depths_mm.as_ref().map_or(0.0, |y| y[i]);
            let near = 1.0 + depth_mm * nearness.value;
            // R D / √((D + Y)² − R²) over R, with 1/D for D so that telecentric is 0.
            let seen = 1.0 / (near * near - (radius_mm * nearness.value).powi(2)).sqrt();
            let longer = if artefact.exact_ball() {
                1.0 + elongation(s, artefact, rough, nearness.value)
            } else {
                1.0
            };
            radius_mm * seen * longer / s.radius_px
        })
        .collect();
    let middle = median(&each);
    if let Some((index, &value)) =
        each.iter().enumerate().find(|(_, m)| (*m / middle - 1.0).abs() > MOST_DISAGREEMENT)
    {
        return Err(ScaleError::Disagree { index, value, middle });
    }
    let value = each.iter().sum::<f64>() / n as f64;

    let fit = observations.iter().map(|s| s.sigma_px.powi(2)).sum::<f64>().sqrt() / n as f64 / radius_px;
    let spread = if n > 1 {
        let squares = each.iter().map(|m| (m / value - 1.0).powi(2)).sum::<f64>();
        (squares / (n * (n - 1)) as f64).sqrt()
    } else {
        0.0
    };
    let perspective = perspective(observations, artefact, &nearness, orbit.as_ref(), rough);
    if spread > SCATTERED * fit && spread * (n as f64).sqrt() > perspective {
        warnings.push(format!(
            "the pictures scatter by {:.3} % where their outlines promise {:.3} %: look for dust on the body, and see \
             that neither focus nor light has changed between them",
            100.0 * spread * (n as f64).sqrt(),
            100.0 * fit * (n as f64).sqrt()
        ));
    }
    if perspective > fit.max(spread).max(1e-4) {
        let mut remedies = Vec::new();
        if artefact.camera_distance_mm.is_none() {
            remedies.push("the distance from the lens's centre to the axis");
        }
        if orbit.is_none() {
            remedies.push("the table's angle in at least three pictures");
        }
        if !remedies.is_empty() {
            warnings.push(format!(
                "perspective leaves {:.3} % open; give {} to lower it",
                100.0 * perspective,
                remedies.join(" and ")
            ));
        }
    }
    let budget = UncertaintyBudget {
        fit,
        spread,
        perspective,
        // Anything within the tolerance is as likely: a rectangle's standard deviation (GUM 4.3.7).
        body: artefact.tolerance_mm / 3f64.sqrt() / artefact.diameter_mm,
        edge: artefact.edge_px / radius_px,
    };
    let camera_distance_mm = match (artefact.camera_distance_mm, seen) {
        (Some(d), _) => Measured::given(d, None),
        // Only a distance that the pictures distinguish from infinity.
        (None, Some((near, sigma))) if near > 3.0 * sigma => {
            Measured::measured(1.0 / near, sigma / near.powi(2))
        }
        _ => Measured::not_observable(),
    };
    Ok(Scale {
        mm_per_px: Measured::measured(value, value * budget.sum()),
        budget,
        eccentricity_mm: orbit.map(|o| o.radius * value),
        camera_distance_mm,
        each_mm_per_px: each,
        warnings,
    })
}

impl Artefact {
    /// Whether the outline's elongation can be taken off.
    fn exact_ball(&self) -> bool {
        self.ball && self.camera_distance_mm.is_some()
    }
}

fn check(artefact: &Artefact) -> Result<(), ScaleError> {
    let bad = |what, value, limit| Err(ScaleError::Length { what, value, limit });
    if !(artefact.diameter_mm.is_finite() && artefact.diameter_mm > 0.0) {
        return bad("body's diameter", artefact.diameter_mm, "a positive number");
    }
    if !(artefact.tolerance_mm >= 0.0 && artefact.tolerance_mm < 0.5 * artefact.diameter_mm) {
        return bad(
            "diameter's tolerance",
            artefact.tolerance_mm,
            "0 or more, and less than half the diameter",
        );
    }
    if let Some(distance_mm) = artefact.camera_distance_mm {
        let radius_mm = 0.5 * artefact.diameter_mm;
        let least_mm = LEAST_RADII * radius_mm;
        if !distance_mm.is_finite() || distance_mm < least_mm {
            return Err(ScaleError::TooNear { distance_mm, radius_mm, least_mm });
        }
    }
    Ok(())
}

/// One over the camera's distance, 1/mm.
struct Nearness {
    /// What is taken for it.
    value: f64,
    /// The greatest that it may be.
    most: f64,
    /// Whether it was given.
    exact: bool,
}

/// The circle on which the body goes round the axis, in pixels.
struct Orbit {
    /// Its radius.
    radius: f64,
    /// Standard uncertainty of a depth.
    sigma: f64,
    /// How far behind the axis the body stands in each picture.
    depths: Vec<f64>,
}

impl Orbit {
    /// From columns u = u₀ + p cos θ + q sin θ: the depth is p sin θ − q cos θ. `None` unless the angles are known and
    /// there are enough different ones.
    fn of(observations: &[Observation]) -> Option<Self> {
        let angles: Vec<(f64, f64)> =
            observations.iter().map(|s| s.angle.map(|a| a.rad().sin_cos())).collect::<Option<_>>()?;
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (s, (sin, cos)) in observations.iter().zip(&angles) {
            let row = Vector3::new(1.0, *cos, *sin);
            normal += row * row.transpose();
            right += row * s.center_px[0];
        }
        let inverse = normal.try_inverse()?;
        // The worse of p and q, as many times a column's own uncertainty.
        let worse = inverse[(1, 1)].max(inverse[(2, 2)]).sqrt();
        if !worse.is_finite() || worse > 10.0 {
            return None;
        }
        let x = inverse * right;
        let off: f64 = (observations.iter().zip(&angles))
            .map(|(s, (sin, cos))| (s.center_px[0] - x[0] - x[1] * cos - x[2] * sin).powi(2))
            .sum();
        let free = observations.len().saturating_sub(3).max(1) as f64;
        Some(Self {
            radius: x[1].hypot(x[2]),
            sigma: (off / free).sqrt() * worse,
            depths: angles.iter().map(|(sin, cos)| x[1] * sin - x[2] * cos).collect(),
        })
    }
}

/// One over the camera's distance and its standard uncertainty (1/mm), from how the radius falls with the depth:
/// r = r₀ (1 − Y/D).
fn shown_nearness(observations: &[Observation], depths_mm: &[f64], radius_px: f64) -> Option<(f64, f64)> {
    if observations.len() < SHOW_DISTANCE {
        return None;
    }
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    for (s, y) in observations.iter().zip(depths_mm) {
        let row = Vector2::new(1.0, -y);
        normal += row * row.transpose();
        right += row * (s.radius_px / radius_px - 1.0);
    }
    let inverse = normal.try_inverse()?;
    let x = inverse * right;
    let off: f64 = (observations.iter().zip(depths_mm))
        .map(|(s, y)| (s.radius_px / radius_px - 1.0 - x[0] + x[1] * y).powi(2))
        .sum();
    let own = observations.iter().map(|s| (s.sigma_px / radius_px).powi(2)).sum::<f64>()
        / observations.len() as f64;
    let variance = (off / (observations.len() - 2) as f64).max(own);
    Some((x[1], (variance * inverse[(1, 1)]).sqrt()))
}

/// How much longer than its smaller axis a ball's outline is in the mean: the cone of its rays, inclined by θ against
/// the optical axis, cuts the picture in an ellipse whose greater axis is 1/cos θ times the smaller one.
fn elongation(s: &Observation, artefact: &Artefact, mm_per_px: f64, nearness: f64) -> f64 {
    let off_px = (s.center_px[0] - artefact.principal_px[0]).hypot(s.center_px[1] - artefact.principal_px[1]);
    0.25 * (off_px * mm_per_px * nearness).powi(2)
}

/// What the camera's distance and the body's position leave open, over the value.
fn perspective(
    observations: &[Observation],
    artefact: &Artefact,
    nearness: &Nearness,
    orbit: Option<&Orbit>,
    mm_per_px: f64,
) -> f64 {
    let n = observations.len() as f64;
    let radius_mm = 0.5 * artefact.diameter_mm;
    // A one-sided error, anything up to b as likely, has the mean square b²/3.
    let one_sided = 3f64.sqrt();
    let position = if let Some(o) = orbit {
        // What is left is the depths' own uncertainty, and where the distance is open, their mean.
        let mean = o.depths.iter().sum::<f64>() / n * mm_per_px;
        let open = if nearness.exact { 0.0 } else { nearness.most - nearness.value };
        (o.sigma * mm_per_px * nearness.most).hypot(mean * open)
    } else {
        let columns = || observations.iter().map(|s| s.center_px[0]);
        let (low, high) =
            columns().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), u| (l.min(u), h.max(u)));
        let beside = (observations.iter())
            .filter_map(|s| s.pedestal_column_px.map(|p| (s.center_px[0] - p).abs()))
            .fold(0.5 * (high - low), f64::max);
        let alone = if observations.len() < 2 { ALONE * radius_mm } else { 0.0 };
        // Anywhere on its circle: the depth's mean square is half the circle's radius squared.
        (beside * mm_per_px).max(alone) * nearness.most / 2f64.sqrt()
    };
    let bulge = |near: f64| 0.5 * (radius_mm * near).powi(2);
    let size = if nearness.exact { 0.0 } else { (bulge(nearness.most) - bulge(nearness.value)) / one_sided };
    let longer = if artefact.ball {
        let greatest = |s: &Observation| elongation(s, artefact, mm_per_px, nearness.most);
        // Where it was taken off, nobody knows that the optical axis meets the picture's middle.
        observations.iter().map(greatest).fold(0.0, f64::max) / one_sided
    } else {
        0.0
    };
    (position * position + size * size + longer * longer).sqrt()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    0.5 * (sorted[(sorted.len() - 1) / 2] + sorted[sorted.len() / 2])
}

#[cfg(test)]
mod tests {
    use super::*;

    const MM_PER_PX: f64 = 0.004;
    const GAUGE: Artefact = Artefact {
        diameter_mm: 2.0,
        tolerance_mm: 0.0,
        camera_distance_mm: None,
        principal_px: [500.0, 400.0],
        ball: true,
        edge_px: 0.0,
    };

    /// What a pinhole at this distance sees of a 2 mm ball whose centre goes round the axis 0.3 mm away from it.
    fn seen(distance_mm: f64, angles_deg: &[f64], known: bool) -> Vec<Observation> {
        (angles_deg.iter())
            .map(|a| {
                let angle = Angle::from_deg(*a);
                let (sin, cos) = (angle.rad() + 0.7).sin_cos();
                let depth = distance_mm + 0.3 * sin;
                Observation {
                    radius_px: distance_mm / (depth * depth - 1.0).sqrt() / MM_PER_PX,
                    sigma_px: 0.01,
                    center_px: [500.0 + 0.3 * cos * distance_mm / depth / MM_PER_PX, 400.0],
                    pedestal_column_px: Some(500.0),
                    angle: known.then_some(angle),
                }
            })
            .collect()
    }

    #[test]
    fn with_angles_and_distance_perspective_is_taken_off() {
        let artefact = Artefact { camera_distance_mm: Some(60.0), ..GAUGE };
        let scale = pixel_size(&seen(60.0, &[0.0, 36.0, 72.0, 108.0, 144.0], true), &artefact).unwrap();
        assert!((scale.mm_per_px.value.unwrap() / MM_PER_PX - 1.0).abs() < 3e-5, "{scale:?}");
        assert!((scale.eccentricity_mm.unwrap() - 0.3).abs() < 2e-3, "{scale:?}");
        assert!(scale.warnings.is_empty(), "{scale:?}");
    }

    #[test]
    fn angles_alone_show_the_distance() {
        let scale = pixel_size(&seen(60.0, &[0.0, 36.0, 72.0, 108.0, 144.0], true), &GAUGE).unwrap();
        let distance = scale.camera_distance_mm.value.unwrap();
        assert!((distance / 60.0 - 1.0).abs() < 0.02, "{scale:?}");
        let error = (scale.mm_per_px.value.unwrap() / MM_PER_PX - 1.0).abs();
        assert!(error < 2.0 * scale.budget.sum() && error < 1e-4, "{error} {scale:?}");
    }

    #[test]
    fn what_is_not_known_is_in_the_uncertainty() {
        for distance in [60.0, 120.0, 1e6] {
            for count in [1, 2, 3, 5] {
                let angles = [0.0, 36.0, 72.0, 108.0, 144.0];
                let scale = pixel_size(&seen(distance, &angles[..count], false), &GAUGE).unwrap();
                let error = (scale.mm_per_px.value.unwrap() / MM_PER_PX - 1.0).abs();
                assert!(error < 2.0 * scale.budget.sum(), "{distance} mm, {count}: {error} {scale:?}");
                assert_eq!(scale.warnings.iter().filter(|w| w.contains("perspective leaves")).count(), 1);
            }
        }
        let tolerance = Artefact { tolerance_mm: 0.02, ..GAUGE };
        let scale = pixel_size(&seen(1e6, &[0.0], false), &tolerance).unwrap();
        assert!((scale.budget.body - 0.01 / 3f64.sqrt()).abs() < 1e-12);
        assert!(scale.budget.sum() > scale.budget.body);
    }

    #[test]
    fn a_picture_of_another_thing_is_named_and_nonsense_refused() {
        let mut views = seen(1e6, &[0.0, 36.0, 72.0], true);
        views[1].radius_px *= 1.02;
        assert!(matches!(pixel_size(&views, &GAUGE), Err(ScaleError::Disagree { index: 1, .. })));
        assert_eq!(pixel_size(&[], &GAUGE), Err(ScaleError::NoObservations));
        for diameter_mm in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let refused = pixel_size(&views, &Artefact { diameter_mm, ..GAUGE });
            assert!(matches!(refused, Err(ScaleError::Length { .. })), "{refused:?}");
        }
        let near = Artefact { camera_distance_mm: Some(1.5), ..GAUGE };
        assert!(matches!(pixel_size(&views, &near), Err(ScaleError::TooNear { .. })));
    }
}
