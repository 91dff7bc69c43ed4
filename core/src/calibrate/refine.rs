//! Calibration of the rig from the silhouettes of a session.

use super::calibration::{Calibration, Finding, FindingKind, Rotation, ViewCalibration};
use super::fit::{Fit, MODEST, PedestalObservation, Prior, Priors, Sample, Start, VIEW_SIGMA_STEPS};
use super::frontier::top_outline;
use super::profile::AxisLine;
use super::rig::{MODEST_RECIPROCAL, NEAR_SIGMAS, Rig, RigFit, blind, residual_px, unsure_px};
use super::round::{ELEVATION, RECIPROCAL, ROLL, SHARED};
use super::turning::{self, Change, STEP_SIZE, Turning};
use super::{Axis, AxisError, AxisMethod, How, Measured, find_axis};
use crate::geometry::Angle;
use crate::silhouette::{Silhouette, Verdict};

/// Fewest views that are held against one another.
const LEAST_VIEWS: usize = 6;
/// Most views: time grows with the cube of their number.
const MOST_VIEWS: usize = 100;
/// What an elevation must be of its standard uncertainty to count as seen.
const SEEN_SIGMAS: f64 = 3.0;
/// What [`MODEST`] is for the rays' elevation, which small errors of the outlines move most.
const MODEST_ELEVATION: f64 = 4.4;
/// What an outline may be off by on one side all along, pixels (standard deviation).
const OUTLINE_PX: f64 = 0.08;
/// Where the pictures speak against the sense of rotation by so many standard uncertainties, a warning is given. That parallel
/// views do not show it needs none: it is configured, `rotation.how` states that it was taken from there, and a mirrored
/// grain has the same volume, size, mesh and compression.
const DOUBTED_SIGMAS: f64 = 2.5;
/// Where the views seem to stand further apart than this, pixels, and by the outlines alone less than this share of it, what was taken for the
/// pedestal is something else: a shaded side of it, or a thing behind.
const FAR_APART_PX: f64 = 4.0;
const APART_SHARE: f64 = 0.4;
/// A view's shift beyond this many times what is usual is worth a word.
const FAR_SIGMAS: f64 = 4.0;

/// A view's outline and what is known of it.
#[derive(Debug, Clone, Copy)]
pub struct SeenView<'a> {
    /// Index in the plan.
    pub index: usize,
    /// The stage's angle.
    pub angle: Angle,
    /// The outline.
    pub silhouette: &'a Silhouette,
    /// The pedestal, where it was seen.
    pub pedestal: Option<PedestalObservation>,
    /// Whether the outline may be wrong (see the view's quality).
    pub bad: bool,
}

/// What is known of the rig beforehand.
#[derive(Debug, Clone, PartialEq)]
pub struct Known {
    /// Size of a pixel at the axis, mm.
    pub mm_per_px: Measured,
    /// The row of z = 0.
    pub origin_row_px: f64,
    /// Distance to the axis, mm.
    pub camera_distance_mm: Option<f64>,
    /// Column of the axis in the origin's row.
    pub axis_column_px: Option<f64>,
    /// Roll, degrees.
    pub roll_deg: Option<f64>,
    /// Whether the grain is configured to turn clockwise when the stage angle grows.
    pub clockwise: bool,
    /// A full step of the motor, degrees.
    pub full_step_deg: f64,
    /// Whether the views' own offsets and angles are to be used.
    pub refine: bool,
}

/// Measures the rig from all views; the axis as found by mirror images or tangency is what it starts from.
///
/// # Errors
/// [`AxisError`] where neither the views nor the user give the axis.
pub fn calibrate(views: &[SeenView], known: &Known) -> Result<(Calibration, Axis), AxisError> {
    let sense = if known.clockwise { -1.0 } else { 1.0 };
    let axis = first_axis(views, known, sense)?;
    let start = AxisLine {
        column_px: axis.column_px + axis.roll_rad.tan() * (known.origin_row_px - axis.row_px),
        row_px: known.origin_row_px,
        roll_rad: axis.roll_rad,
    };
    let tops: Vec<Vec<[f64; 2]>> = views.iter().map(|v| top_outline(v.silhouette)).collect();
    let samples: Vec<Sample> = (views.iter().zip(&tops))
        .map(|(v, top)| Sample { silhouette: v.silhouette, pedestal: v.pedestal, top })
        .collect();
    let made = ((LEAST_VIEWS..=MOST_VIEWS).contains(&views.len()))
        .then(|| FittedRig::of(views, &samples, known, &start, sense))
        .flatten();
    Ok((made.map_or_else(|| unmeasured(views, known, &start), |w| w.calibration(views, known)), axis))
}

fn first_axis(views: &[SeenView], known: &Known, sense: f64) -> Result<Axis, AxisError> {
    let given = |column_px: f64, roll_rad: f64, method| Axis {
        column_px,
        row_px: known.origin_row_px,
        roll_rad,
        residual_px: 0.0,
        method,
    };
    let roll = known.roll_deg.map(f64::to_radians);
    if let Some(column_px) = known.axis_column_px {
        return Ok(given(column_px, roll.unwrap_or(0.0), AxisMethod::Given));
    }
    let found = find_axis(&views.iter().map(|v| (v.angle * sense, v.silhouette)).collect::<Vec<_>>())?;
    Ok(Axis { roll_rad: roll.unwrap_or(found.roll_rad), ..found })
}

/// The fit, and how its angles are to be read.
struct FittedRig {
    turning: Turning,
    /// 1 where signed angles are the stage's, −1 where they are its negatives.
    sense: f64,
    sense_seen: bool,
    /// Whether the pedestal was left out, as it does not stand where the outlines' axis is.
    leaves_pedestal_out: bool,
    /// Reciprocal distance from the pictures alone, and its standard uncertainty, 1/pixels.
    reciprocal: (f64, f64),
}

impl FittedRig {
    fn of(
        views: &[SeenView],
        samples: &[Sample],
        known: &Known,
        start: &AxisLine,
        sense: f64,
    ) -> Option<Self> {
        let exactly = |value: f64| Prior { value, sigma: 1e-9 };
        let priors = Priors {
            column_px: known.axis_column_px.map(|c| Prior { value: c, sigma: 1e-6 }),
            roll_rad: known.roll_deg.map(|r| exactly(r.to_radians())),
            reciprocal: None,
            full_step_rad: known.full_step_deg.to_radians(),
        };
        let rig = Rig {
            views,
            priors,
            noted: known.camera_distance_mm.zip(known.mm_per_px.value).map(|(d, m)| m / d),
        };
        let mut sense = sense;
        let mut worked = rig.worked_out(samples, sense, Start::Line(start))?;
        let apart = worked.turning.fit.hyper.runout_px;
        let outlines: Vec<Sample> = samples.iter().map(|s| Sample { pedestal: None, ..*s }).collect();
        let alone =
            (apart > FAR_APART_PX).then(|| rig.worked_out(&outlines, sense, Start::Line(start))).flatten();
        let alone = alone.filter(|alone| alone.turning.fit.hyper.runout_px < APART_SHARE * apart);
        let leaves_pedestal_out = alone.is_some();
        let samples = if leaves_pedestal_out { &outlines } else { samples };
        worked = alone.unwrap_or(worked);
        // Seen from a finite distance, the grain's mirror image turning the other way would need a camera behind it; turning the right way, it
        // shows the camera where it is. A distance that shows neither way is something else's: rays that rise steeply, or light.
        let is_near = |sign: f64, (q, sigma): (f64, f64)| sign * q > NEAR_SIGMAS * sigma;
        if is_near(-1.0, worked.reciprocal) {
            let line = worked.turning.fit.line;
            let mirrored = rig.worked_out(samples, -sense, Start::Line(&line))?;
            if is_near(1.0, mirrored.reciprocal) {
                (sense, worked) = (-sense, mirrored);
            }
        }
        let RigFit { turning, reciprocal } = worked;
        let sense_seen = is_near(1.0, reciprocal);
        Some(Self { turning, sense, sense_seen, leaves_pedestal_out, reciprocal })
    }

    fn calibration(&self, views: &[SeenView], known: &Known) -> Calibration {
        let Turning { fit, angles, unsure_rad, found } = &self.turning;
        let mut warnings = Vec::new();
        let height = fit.height_px.max(1.0);
        let shared = OUTLINE_PX * (2.0 / height);
        let sigma = |k: usize, more: f64| fit.sigma(k, MODEST).hypot(more);
        let scale = known.mm_per_px.value.unwrap_or(1.0);
        let (camera_distance_mm, camera_distance_note) = self.distance(known, scale, fit, &mut warnings);
        // Where no distance is told the views are taken for parallel, and the rays rise by what parallel ones would have to.
        let (q, q_sigma) = match camera_distance_mm.value {
            Some(_) => (fit.parameters[RECIPROCAL], fit.sigma(RECIPROCAL, MODEST_RECIPROCAL)),
            None => (0.0, self.reciprocal.0.hypot(self.reciprocal.1)),
        };
        let (elevation, own_sigma, slope) = fit.given(ELEVATION, (RECIPROCAL, q), MODEST_ELEVATION);
        let own_sigma = own_sigma.hypot(shared);
        let elevation_sigma = own_sigma.hypot(slope * q_sigma);
        let of_it = if camera_distance_mm.value.is_some() { elevation_sigma } else { own_sigma };
        let elevation_deg = if elevation.abs() > SEEN_SIGMAS * of_it {
            Measured::measured(elevation.to_degrees(), elevation_sigma.to_degrees())
        } else {
            // Level is what it is taken for: it may be what the outlines give, and as much more as they may be off.
            Measured::assumed(0.0, Some(elevation.hypot(elevation_sigma).to_degrees()))
        };
        let typical = fit.hyper.runout_px.max(0.1);
        let details: Vec<ViewCalibration> = (views.iter().enumerate())
            .map(|(i, v)| {
                let offset_px = fit.offset_px(i);
                let offset_sigma_px = sigma(SHARED + i, OUTLINE_PX);
                let turned_rad = angles[i] - angles[0];
                let mut warnings = Vec::new();
                if offset_px.abs() > FAR_SIGMAS * typical {
                    warnings.push(format!(
                        "the view stands {offset_px:+.1} px beside the others, {typical:.1} px is usual: look for a knock or a \
                         loose mount"
                    ));
                }
                ViewCalibration {
                    index: v.index,
                    nominal_angle_deg: v.angle.deg(),
                    angle_deg: (self.sense * (angles[i] + fit.ahead_rad(i))).to_degrees(),
                    angle_sigma_deg: fit.ahead_sigma_rad(i, turned_rad).hypot(unsure_rad[i]).to_degrees(),
                    offset_px,
                    offset_sigma_px,
                    residual_px: fit.residuals_px[i],
                    verdict: if warnings.is_empty() { Verdict::Good } else { Verdict::Doubtful },
                    warnings,
                }
            })
            .collect();
        let findings: Vec<Finding> = found.iter().map(|f| self.finding(f, views)).collect();
        warnings.extend(findings.iter().map(|f| f.text.clone()));
        warnings.extend(blind(views));
        let (residual_px, limit_px) = (residual_px(fit), unsure_px(fit));
        if residual_px > limit_px {
            warnings.push(format!(
                "the views' outlines contradict one another by {residual_px:.1} px (usual: below {limit_px:.1} px), so that slips \
                 and lost steps cannot be told: light through the grain or shadows spoil them; look at the outlines"
            ));
        }
        if self.leaves_pedestal_out {
            warnings.push(format!(
                "what was taken for the pedestal does not stand on the axis that the outlines show (column {:.0}): it was left out of \
                 the calibration; look where the outlines are cut at its top",
                fit.line.column_px
            ));
        }
        let counter_clockwise = self.sense > 0.0;
        if counter_clockwise == known.clockwise {
            warnings.push(format!(
                "the pictures show the grain turning {} (seen from above, when the stage angle grows), the configuration says \
                 the opposite: the pictures are believed; mend `clockwise` (or --rotation)",
                if counter_clockwise { "counter-clockwise" } else { "clockwise" }
            ));
        } else if self.reciprocal.0 < -DOUBTED_SIGMAS * self.reciprocal.1 {
            warnings.push(
                "the pictures rather show the other sense of rotation than the configured one, but not surely, so that the \
                 grain may be mirrored: check `clockwise` (or --rotation)"
                    .into(),
            );
        }
        let given =
            |value: Option<f64>, measured: Measured| value.map_or(measured, |v| Measured::given(v, None));
        Calibration {
            mm_per_px: known.mm_per_px,
            axis_column_px: given(
                known.axis_column_px,
                Measured::measured(fit.line.column_px, sigma(0, OUTLINE_PX)),
            ),
            origin_row_px: known.origin_row_px,
            roll_deg: given(
                known.roll_deg,
                Measured::measured(fit.line.roll_rad.to_degrees(), sigma(ROLL, shared).to_degrees()),
            ),
            camera_distance_mm,
            camera_distance_note,
            elevation_deg,
            rotation: Rotation {
                counter_clockwise,
                how: if self.sense_seen { How::Measured } else { How::Assumed },
            },
            radial_runout_px: fit.hyper.runout_px,
            residual_px,
            refined: known.refine,
            views: details,
            findings,
            warnings,
        }
    }

    /// The distance as noted and measured, or how far the camera must be at least; the pictures' own evidence on it.
    fn distance(
        &self,
        known: &Known,
        scale: f64,
        fit: &Fit,
        warnings: &mut Vec<String>,
    ) -> (Measured, String) {
        let (q, sigma) = self.reciprocal;
        let nearest = scale / (q.max(0.0) + NEAR_SIGMAS * sigma);
        let seen = q > NEAR_SIGMAS * sigma;
        let note = if seen {
            format!("the outlines say {:.0} ± {:.0} mm", scale / q, distance_sigma_mm(scale, q, sigma))
        } else if nearest < 20.0 * fit.mean_reach_px * scale {
            "the outlines do not show it".into()
        } else {
            format!(
                "the views look parallel: the camera is farther than {nearest:.0} mm, or the lens is telecentric"
            )
        };
        let refuted = known.camera_distance_mm.filter(|d| (q - scale / d).abs() > NEAR_SIGMAS * sigma);
        if let Some(d) = refuted {
            warnings.push(format!(
                "the camera's distance is given as {d} mm, but {note}: the outlines are believed; check the given one"
            ));
        }
        // With what was noted, where that can be.
        let (best, sigma) = (fit.parameters[RECIPROCAL], fit.sigma(RECIPROCAL, MODEST_RECIPROCAL));
        let measured = if best > sigma && (seen || known.camera_distance_mm.is_some()) {
            let how = if seen { How::Measured } else { How::Given };
            let sigma = Some(distance_sigma_mm(scale, best, sigma));
            Measured { value: Some(scale / best), sigma, how }
        } else {
            // What was noted is not left out without a word.
            if let (Some(d), None) = (known.camera_distance_mm, refuted) {
                warnings.push(format!(
                    "the camera's distance is given as {d} mm, but {note}: the views are taken for parallel; check the given one"
                ));
            }
            Measured::not_observable()
        };
        (measured, note)
    }

    fn finding(&self, found: &turning::DetectedChange, views: &[SeenView]) -> Finding {
        let degrees = (self.sense * found.rad).to_degrees();
        let sigma_deg = MODEST * found.sigma_rad.to_degrees();
        let travel = views.last().map_or(0.0, |v| (v.angle - views[0].angle).deg());
        let ahead = degrees * travel >= 0.0;
        let how = if ahead { "ahead" } else { "behind" };
        let size = degrees.abs();
        match found.change {
            Change::Step => {
                let farthest =
                    (views.iter().map(|v| (v.angle - views[0].angle).deg().abs())).fold(0.0, f64::max);
                let ratio = 1.0 + if ahead { size } else { -size } / farthest.max(1e-9);
                Finding {
                    kind: FindingKind::StepSize,
                    view: None,
                    between: None,
                    degrees,
                    sigma_deg,
                    step_ratio: Some(ratio),
                    text: format!(
                        "every step turns the grain {:.2} % {} than it should ({size:.1}° ± {sigma_deg:.1}° {how} at the end): \
                         check steps per turn, microsteps and gear of the stage",
                        100.0 * (ratio - 1.0).abs(),
                        if ratio > 1.0 { "further" } else { "less" }
                    ),
                }
            }
            Change::From(k) => {
                let [from, to] = found.between.map(|k| views[k].index);
                let range = if from == to {
                    format!("from view {from} on")
                } else {
                    format!("from view {} on (as likely as any of {from} to {to})", views[k].index)
                };
                let (kind, cause) = match (found.or_step, found.lost_steps) {
                    (true, _) => (
                        FindingKind::SlipOrStepSize,
                        ", or every step turns it a little wrong, which the outlines do not tell apart: check glue and \
                         coupling, then steps per turn, microsteps and gear of the stage; a second capture tells, as a slip \
                         does not come again in the same place"
                            .into(),
                    ),
                    (false, 0) => (
                        FindingKind::Slip,
                        ": it slipped on its pedestal, or the stage lost its place; check glue and coupling"
                            .into(),
                    ),
                    (false, steps) => (
                        FindingKind::LostSteps,
                        format!(
                            ": {steps} full step{} of the motor lost, or the grain slipped; check the motor's current, speed \
                             and acceleration, and the glue",
                            if steps > 1 { "s" } else { "" }
                        ),
                    ),
                };
                Finding {
                    kind,
                    view: Some(views[k].index),
                    between: Some([from, to]),
                    degrees,
                    sigma_deg,
                    step_ratio: None,
                    text: format!("{range}, the grain is {size:.1}° ± {sigma_deg:.1}° {how}{cause}"),
                }
            }
        }
    }
}

/// Half the width of the distances whose reciprocals lie within one standard uncertainty of `reciprocal`, mm.
fn distance_sigma_mm(scale: f64, reciprocal: f64, sigma: f64) -> f64 {
    0.5 * (scale / (reciprocal - sigma) - scale / (reciprocal + sigma))
}

/// Too few views or rows to hold against one another: what is given or was found at first stands.
fn unmeasured(views: &[SeenView], known: &Known, start: &AxisLine) -> Calibration {
    let stated = |given: Option<f64>, found: f64| match given {
        Some(v) => Measured::given(v, None),
        None => Measured { value: Some(found), sigma: None, how: How::Measured },
    };
    Calibration {
        mm_per_px: known.mm_per_px,
        axis_column_px: stated(known.axis_column_px, start.column_px),
        origin_row_px: known.origin_row_px,
        roll_deg: stated(known.roll_deg, start.roll_rad.to_degrees()),
        camera_distance_mm: (known.camera_distance_mm)
            .map_or_else(Measured::not_observable, |d| Measured::given(d, None)),
        camera_distance_note: "the views were not held against one another".into(),
        elevation_deg: Measured::assumed(0.0, None),
        rotation: Rotation { counter_clockwise: !known.clockwise, how: How::Assumed },
        radial_runout_px: 0.0,
        residual_px: 0.0,
        refined: false,
        views: (views.iter())
            .map(|v| ViewCalibration {
                index: v.index,
                nominal_angle_deg: v.angle.deg(),
                angle_deg: v.angle.deg(),
                angle_sigma_deg: (VIEW_SIGMA_STEPS * known.full_step_deg)
                    .hypot(STEP_SIZE * (v.angle - views[0].angle).deg()),
                offset_px: 0.0,
                offset_sigma_px: 0.0,
                residual_px: 0.0,
                verdict: Verdict::Good,
                warnings: Vec::new(),
            })
            .collect(),
        findings: Vec::new(),
        warnings: vec![format!(
            "{} views with the rows that they share are not held against one another ({LEAST_VIEWS} to {MOST_VIEWS} views \
             can be, on 8 heights or more): axis and roll carry no uncertainty, slips would not be seen",
            views.len()
        )],
    }
}
