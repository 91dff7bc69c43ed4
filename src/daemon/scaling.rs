//! The size of a pixel from photographs of a body of known diameter on the pedestal.

use super::DaemonError;
use super::scale_file::{BodyKind, PictureScale, ScaleFile};
use crate::pipeline::PipelineError;
use crate::session::import::{SourceImage, photographs};
use grainrig_core::calibrate::{Artefact, Observation, ScaleError, fit_disc, fit_sides, pixel_size};
use grainrig_core::formats::decode;
use grainrig_core::geometry::Angle;
use grainrig_core::silhouette::{self, PedestalMode, Picture, Segmentation, Side, Source};
use std::path::PathBuf;

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
/// [`DaemonError`] where a picture cannot be used, shows no such body, or the pictures disagree.
pub fn calibrate_scale(request: &ScaleRequest) -> Result<ScaleFile, DaemonError> {
    (request.silhouette.check()).map_err(|source| PipelineError::Silhouette { view: 0, source })?;
    let found = photographs(&request.folder, &request.pattern, request.background.as_deref())?;
    let angles = request.angles_of(found.images.len())?;
    let background = found.background.as_ref().map(picture).transpose()?;
    let mut sightings = Vec::new();
    let mut pictures = Vec::new();
    let mut warnings = Vec::new();
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
            DaemonError::Body { file: found.images[index].name.clone(), reason: error.to_string() }
        }
        other => DaemonError::Scale(other),
    })?;
    for (picture, mm) in pictures.iter_mut().zip(&scale.each_mm_per_px) {
        picture.mm_per_px = *mm;
    }
    warnings.extend(scale.warnings);
    let (kind, version) = ScaleFile::marks();
    Ok(ScaleFile {
        kind,
        version,
        software: concat!("grainrig ", env!("CARGO_PKG_VERSION")).into(),
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

fn picture(image: &SourceImage) -> Result<Picture, DaemonError> {
    decode(&image.read()?.bytes).map_err(|reason| DaemonError::Body {
        file: image.name.clone(),
        reason: format!("{reason}; take it again"),
    })
}

impl ScaleRequest {
    fn angles_of(&self, pictures: usize) -> Result<Vec<Option<Angle>>, DaemonError> {
        let turned: Vec<f64> = match &self.angles {
            Angles::Unknown => return Ok(vec![None; pictures]),
            Angles::Step(step) => (0..pictures).map(|k| k as f64 * step).collect(),
            Angles::Each(angles) => angles.clone(),
        };
        if turned.len() != pictures {
            return Err(DaemonError::Angles { angles: turned.len(), pictures });
        }
        Ok(turned.into_iter().map(|a| Some(Angle::from_deg(a))).collect())
    }

    /// One picture: what it shows, and what a person should know of it.
    fn look(
        &self,
        image: &SourceImage,
        background: Option<&Picture>,
        angle: Option<Angle>,
    ) -> Result<(Observation, PictureScale, Vec<String>), DaemonError> {
        let fail = |reason: String| DaemonError::Body { file: image.name.clone(), reason };
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
