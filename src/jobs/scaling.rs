//! The size of a pixel from photographs of a body of known diameter on the pedestal.

use super::importing::{PICTURES, all_pictures, is_picture};
use super::scale_file::{BodyKind, PictureScale, ScaleFile};
use super::{Context, JobError};
use crate::pipeline::PipelineError;
use crate::session::import::{SourceImage, photographs};
use crate::session::{to_json, write_whole};
use grainrig_core::calibrate::{Artefact, Observation, ScaleError, fit_disc, fit_sides, pixel_size};
use grainrig_core::formats::decode;
use grainrig_core::geometry::Angle;
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::silhouette::{
    self, EdgeSymmetry, PedestalMode, Picture, Segmentation, Side, Source, ToneCurve,
};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// How far all outlines may lie to one side of the true edge, as a share of their blur's standard deviation. Half-way
/// between the levels of body and background is the edge only where the body is as bright at its rim as further in;
/// a ball's shaded rim moves it outwards before a bright background and inwards before a dark one, by up to this share
/// (balls of known size: `tests/calibrate_scale.rs`).
const EDGE_OVER_BLUR: f64 = 0.12;
/// A pin above its pedestal is at least this high, pixels, or the pedestal's cut has taken it for a pedestal.
const LEAST_PIN_ROWS: usize = 60;
/// A ball's outline longer in one direction by this much is worth a warning, as a share and in standard deviations.
const OVAL: (f64, f64) = (1e-3, 5.0);

/// What is to be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct ScaleRequest {
    /// The folder; its sub-folders are not looked at.
    pub folder: PathBuf,
    /// Glob over file names.
    pub pattern: String,
    /// A picture of the stage without the body; left out of the pictures where the pattern matches it too.
    pub background: Option<PathBuf>,
    /// What was photographed.
    pub body: BodyKind,
    /// Its diameter, mm.
    pub diameter_mm: f64,
    /// How far the diameter may be off, mm.
    pub tolerance_mm: f64,
    /// Distance from the centre of projection to the axis, mm.
    pub camera_distance_mm: Option<f64>,
    /// The table's angle in each picture, counter-clockwise seen from above, where they are known.
    pub angles: Angles,
    /// How the body is told from pedestal and background.
    pub silhouette: silhouette::Settings,
}

/// The size of a pixel, to be measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ScaleOptions {
    /// Folder of photographs (JPEG, PNG, TIFF) of the body, taken with the settings of the grain's pictures.
    #[schema(value_type = String)]
    pub folder: PathBuf,
    /// Which files show the body, as a glob over file names.
    #[arg(long, value_name = "GLOB", default_value = PICTURES)]
    #[serde(default = "all_pictures")]
    pub pattern: String,
    /// The ball's diameter, mm.
    #[arg(
        long,
        value_name = "MM",
        allow_negative_numbers = true,
        conflicts_with = "pin_diameter_mm",
        required_unless_present = "pin_diameter_mm"
    )]
    pub ball_diameter_mm: Option<f64>,
    /// The diameter of an upright cylindrical pin, instead of a ball's, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub pin_diameter_mm: Option<f64>,
    /// How far the true diameter may be from the one given, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, default_value_t = 0.0)]
    #[serde(default)]
    pub ball_tolerance_mm: f64,
    /// A picture of the stage without the body, of the same size.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub background: Option<PathBuf>,
    /// Distance from the lens's centre to the axis, mm; where it is not given, what it leaves open is part of the
    /// uncertainty.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub camera_distance_mm: Option<f64>,
    /// Angle of the table between one picture and the next, degrees, counter-clockwise seen from above; negative
    /// where it turns clockwise. With it, how far the body stands before or behind the axis is known.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with = "angles")]
    pub step_deg: Option<f64>,
    /// Angle of the table in each picture, degrees, instead of an even step: 0,36,72.
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', allow_negative_numbers = true)]
    pub angles: Option<Vec<f64>>,
    /// The file to write; one that is there is replaced.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = String)]
    pub out: PathBuf,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

impl ScaleOptions {
    /// What is to be measured, where it makes sense.
    fn request(&self, context: &Context) -> Result<ScaleRequest, JobError> {
        let (body, diameter_mm) = match (self.ball_diameter_mm, self.pin_diameter_mm) {
            (Some(d), None) => (BodyKind::Ball, d),
            (None, Some(d)) => (BodyKind::Pin, d),
            _ => return Err(JobError::Usage("give --ball-diameter-mm or --pin-diameter-mm".into())),
        };
        let angles = match (self.step_deg, self.angles.clone()) {
            (Some(step), None) => Angles::Step(step),
            (None, Some(each)) => Angles::Each(each),
            (None, None) => Angles::Unknown,
            (Some(_), Some(_)) => {
                return Err(JobError::Usage("give --step-deg or --angles, not both".into()));
            }
        };
        let finite = match &angles {
            Angles::Unknown => true,
            Angles::Step(step) => step.is_finite(),
            Angles::Each(each) => each.iter().all(|a| a.is_finite()),
        };
        if !finite {
            let text = "an angle is not a finite number of degrees; correct --step-deg or --angles";
            return Err(JobError::Usage(text.into()));
        }
        Ok(ScaleRequest {
            folder: context.names.input(&self.folder)?,
            pattern: self.pattern.clone(),
            background: self.background.as_ref().map(|path| context.names.input(path)).transpose()?,
            body,
            diameter_mm,
            tolerance_mm: self.ball_tolerance_mm,
            camera_distance_mm: self.camera_distance_mm,
            angles,
            silhouette: context.config.silhouette.clone(),
        })
    }

    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        let request = self.request(context)?;
        plausible::slips(&self.doubts(&request), context.as_given || self.as_given)?;
        self.place(context).map(drop)
    }

    /// Measures the size of a pixel and writes the file.
    ///
    /// # Errors
    /// As [`calibrate_scale`]; [`JobError::Usage`] for a name that is none of a file; a disk that fails.
    pub fn run(&self, context: &Context) -> Result<ScaleFile, JobError> {
        let request = self.request(context)?;
        let as_given = context.as_given || self.as_given;
        let doubts = self.doubts(&request);
        plausible::slips(&doubts, as_given)?;
        let (folder, name) = self.place(context)?;
        context.working("measuring the body", 0.0);
        let mut file = calibrate_scale(&request)?;
        let pixel = file.mm_per_px.value.and_then(|v| plausible::MM_PER_PX.doubt(v));
        file.warnings.extend(plausible::settle(doubts.into_iter().chain(pixel).collect(), as_given)?);
        write_whole(&folder, &name, &to_json(&file)?)?;
        Ok(file)
    }

    /// What of the figures no laboratory has.
    fn doubts(&self, request: &ScaleRequest) -> Vec<Doubt> {
        let name = match request.body {
            BodyKind::Ball => "ball_diameter_mm",
            BodyKind::Pin => "pin_diameter_mm",
        };
        let tolerance = plausible::share_of("ball_tolerance_mm", request.diameter_mm, [0.0, 0.1]);
        let step = plausible::VIEW_STEP.named("step_deg");
        [
            plausible::DIAMETER.named(name).doubt(request.diameter_mm),
            tolerance.doubt(self.ball_tolerance_mm),
            self.camera_distance_mm.and_then(|d| plausible::CAMERA_DISTANCE.doubt(d)),
            self.step_deg.and_then(|s| step.doubt(s.abs())),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// The folder and the name of the file that is to be written.
    fn place(&self, context: &Context) -> Result<(PathBuf, String), JobError> {
        let out = self.out.display();
        if is_picture(&self.out) {
            let text = format!("--out {out} has a picture's ending; a calibration is JSON: end it in .json");
            return Err(JobError::Usage(text));
        }
        let path = context.names.output(&self.out)?;
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        match path.file_name().and_then(|n| n.to_str()) {
            Some(name) if !path.is_dir() => Ok((folder.to_owned(), name.to_owned())),
            _ => Err(JobError::Usage(format!(
                "--out {out} is no name for a file; give one such as scale.json"
            ))),
        }
    }
}

/// The table's angles.
#[derive(Debug, Clone, PartialEq)]
pub enum Angles {
    /// Nobody knows them.
    Unknown,
    /// The same step, degrees, from each picture to the next.
    Step(f64),
    /// One for each picture, degrees.
    Each(Vec<f64>),
}

/// Measures the size of a pixel.
///
/// # Errors
/// [`JobError`] where a picture cannot be used, shows no such body, or the pictures disagree.
pub fn calibrate_scale(request: &ScaleRequest) -> Result<ScaleFile, JobError> {
    (request.silhouette.check()).map_err(PipelineError::Silhouettes)?;
    let found = photographs(&request.folder, &request.pattern, request.background.as_deref())?;
    let angles = request.angles_of(found.images.len())?;
    let background = found.background.as_ref().map(picture).transpose()?;
    let mut sightings = Vec::new();
    let mut pictures = Vec::new();
    let mut warnings = Vec::new();
    let request = &request.with_tone_curve(&found.images, background.as_ref())?;
    for (image, angle) in found.images.iter().zip(angles) {
        let (sighting, seen, said) = request.look(image, background.as_ref(), angle)?;
        sightings.push(sighting);
        pictures.push(seen);
        warnings.extend(said.into_iter().map(|w| format!("{}: {w}", image.name)));
    }
    let middle = |size: u32| 0.5 * (f64::from(size) - 1.0);
    let gauge = Artefact {
        diameter_mm: request.diameter_mm,
        tolerance_mm: request.tolerance_mm,
        camera_distance_mm: request.camera_distance_mm,
        principal_px: found.size.map(middle),
        ball: request.body == BodyKind::Ball,
        edge_px: EDGE_OVER_BLUR * pictures.iter().map(|p| p.blur_px).sum::<f64>() / pictures.len() as f64,
    };
    let scale = pixel_size(&sightings, &gauge).map_err(|error| match error {
        ScaleError::Disagree { index, .. } => {
            JobError::Body { file: found.images[index].name.clone(), reason: error.to_string() }
        }
        other => JobError::Scale(other),
    })?;
    for (picture, mm) in pictures.iter_mut().zip(&scale.each_mm_per_px) {
        picture.mm_per_px = *mm;
    }
    warnings.extend(scale.warnings);
    let (kind, version) = ScaleFile::marks();
    Ok(ScaleFile {
        kind,
        version,
        software: super::SOFTWARE.into(),
        mm_per_px: scale.mm_per_px,
        relative_sigma: scale.budget,
        body: request.body,
        diameter_mm: request.diameter_mm,
        tolerance_mm: request.tolerance_mm,
        camera_distance_mm: scale.camera_distance_mm,
        eccentricity_mm: scale.eccentricity_mm,
        picture_px: found.size,
        pictures,
        warnings,
    })
}

fn picture(image: &SourceImage) -> Result<Picture, JobError> {
    decode(&image.read()?.bytes).map_err(|reason| JobError::Body {
        file: image.name.clone(),
        reason: format!("{reason}; take it again"),
    })
}

impl ScaleRequest {
    fn angles_of(&self, pictures: usize) -> Result<Vec<Option<Angle>>, JobError> {
        let turned: Vec<f64> = match &self.angles {
            Angles::Unknown => return Ok(vec![None; pictures]),
            Angles::Step(step) => (0..pictures).map(|k| k as f64 * step).collect(),
            Angles::Each(angles) => angles.clone(),
        };
        if turned.len() != pictures {
            return Err(JobError::Angles { angles: turned.len(), pictures });
        }
        Ok(turned.into_iter().map(|a| Some(Angle::from_deg(a))).collect())
    }

    /// With the tone curve that the edges of all pictures show together, where neither a person nor the files say which it is.
    fn with_tone_curve(
        &self,
        images: &[SourceImage],
        background: Option<&Picture>,
    ) -> Result<Self, JobError> {
        let mut request = self.clone();
        if self.silhouette.tone_curve != ToneCurve::Auto {
            return Ok(request);
        }
        let mut all: Option<EdgeSymmetry> = None;
        for image in images {
            let picture = picture(image)?;
            // What cannot be cut out is told when it is looked at.
            let found = self.silhouette(&picture, background.map(|b| b as &dyn Source)).ok();
            let Some(one) = found.and_then(|(found, _)| found.symmetry) else { return Ok(request) };
            match &mut all {
                Some(all) => all.add(&one),
                None => all = Some(one),
            }
        }
        if let Some(curve) = all.and_then(|all| all.curve()) {
            request.silhouette.tone_curve = curve;
        }
        Ok(request)
    }

    /// One picture: what it shows, and what a person should know of it.
    fn look(
        &self,
        image: &SourceImage,
        background: Option<&Picture>,
        angle: Option<Angle>,
    ) -> Result<(Observation, PictureScale, Vec<String>), JobError> {
        let fail = |reason: String| JobError::Body { file: image.name.clone(), reason };
        let picture = picture(image)?;
        let (found, cut_below) =
            self.silhouette(&picture, background.map(|b| b as &dyn Source)).map_err(fail)?;
        let borders = Side::ALL.iter().zip(found.report.touches_border);
        if let Some((side, _)) = borders.clone().find(|(s, t)| *t && !(cut_below && **s == Side::Bottom)) {
            return Err(fail(format!(
                "the body reaches the {} border of the picture, so part of it is not seen; centre it, or use a smaller \
                 magnification",
                side.name()
            )));
        }
        let mut warnings: Vec<String> = found.report.warnings.clone();
        if cut_below {
            warnings.retain(|w| !w.contains("bottom end of the picture"));
        }
        let pedestal = found.report.pedestal.as_ref();
        let (radius_px, sigma_px, residual_px, center_px, ellipticity) = match self.body {
            BodyKind::Ball => {
                let disc = fit_disc(&found.silhouette, pedestal).map_err(|e| fail(e.to_string()))?;
                if disc.ellipticity > OVAL.0.max(OVAL.1 * disc.ellipticity_sigma) {
                    warnings.push(format!(
                        "the outline is {:.2} % longer in one direction ({:.0}° from the rows): the pixels are no squares, \
                         the ball is worn, or it stands far from the picture's middle",
                        100.0 * disc.ellipticity,
                        disc.greater_axis_rad.to_degrees()
                    ));
                }
                (disc.radius_px, disc.sigma_px, disc.residual_px, disc.center_px, Some(disc.ellipticity))
            }
            BodyKind::Pin => {
                let sides = fit_sides(&found.silhouette).map_err(|e| fail(e.to_string()))?;
                (sides.half_width_px, sides.sigma_px, sides.residual_px, sides.center_px, None)
            }
        };
        let sighting = Observation {
            radius_px,
            sigma_px,
            center_px,
            pedestal_column_px: pedestal.map(|p| p.centre_column),
            angle,
        };
        let seen = PictureScale {
            file: image.name.clone(),
            sha256: image.sha256.clone(),
            angle_deg: angle.map(Angle::deg),
            radius_px,
            sigma_px,
            residual_px,
            blur_px: found.blur_px,
            center_px,
            ellipticity,
            mm_per_px: f64::NAN,
        };
        Ok((sighting, seen, warnings))
    }

    /// The body's silhouette, and whether it may go on below the picture: a pin that stands in a chuck looks like a
    /// pedestal and is kept whole.
    fn silhouette(
        &self,
        picture: &Picture,
        background: Option<&dyn Source>,
    ) -> Result<(Segmentation, bool), String> {
        let first = silhouette::find(picture, background, &self.silhouette);
        if self.body == BodyKind::Ball {
            return first.map(|f| (f, false)).map_err(|e| e.to_string());
        }
        if let Ok(found) = &first
            && found.report.pedestal.is_some()
            && found.silhouette.extents_px().iter().flatten().count() >= LEAST_PIN_ROWS
        {
            return first.map(|f| (f, false)).map_err(|e| e.to_string());
        }
        let whole = silhouette::Settings { pedestal: PedestalMode::None, ..self.silhouette.clone() };
        silhouette::find(picture, background, &whole).map(|f| (f, true)).map_err(|e| e.to_string())
    }
}
