//! Somebody's photographs become a session and go the same way as the rig's.

use super::recorded::{computation, compute, conclude};
use super::scale_file::{GivenScale, ScaleFile};
use super::{Context, Finished, JobError, Watcher};
use crate::config::Config;
use crate::pipeline::{Cameras, LengthUnit, MeshSettings, TurntableSettings};
use crate::session::import::{ImportRequest, Rotation, scan};
use crate::session::{Store, check_name};
use crate::trace;
use grainrig_core::plausible;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Every picture of a folder.
pub(super) const PICTURES: &str = "*.{jpg,jpeg,png,tif,tiff,JPG,JPEG,PNG,TIF,TIFF}";

pub(super) fn all_pictures() -> String {
    PICTURES.into()
}

/// Whether a file name's ending is a picture's.
pub(super) fn is_picture(file: &Path) -> bool {
    let list = PICTURES.trim_start_matches("*.{").trim_end_matches('}');
    let ending = file.extension().and_then(|e| e.to_str());
    ending.is_some_and(|ending| list.split(',').any(|e| e.eq_ignore_ascii_case(ending)))
}

/// Photographs to be taken in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct ImportOptions {
    /// Folder of photographs (JPEG, PNG, TIFF), taken in the order of the numbers in their names.
    #[schema(value_type = String)]
    pub folder: PathBuf,
    /// Which files are views, as a glob over file names.
    #[arg(long, value_name = "GLOB", default_value = PICTURES)]
    #[serde(default = "all_pictures")]
    pub pattern: String,
    /// Angle between one view and the next, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = STEP_DEG,
        allow_negative_numbers = true,
        conflicts_with = "cameras"
    )]
    #[serde(default = "step_deg")]
    pub step_deg: f64,
    /// Angle of the first view, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        conflicts_with = "cameras"
    )]
    #[serde(default)]
    pub first_deg: f64,
    /// Which way the grain turns, seen from above.
    #[arg(long, value_enum, default_value_t = Rotation::Ccw, conflicts_with = "cameras")]
    #[serde(default)]
    pub rotation: Rotation,
    /// Size of a pixel at the rotation axis, mm; every length and volume hangs on it, so it has no default.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "cameras")]
    pub mm_per_px: Option<f64>,
    /// A file of `grainrig calibrate scale`: the size of a pixel with its uncertainty, and the camera's distance
    /// where it was given there.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["cameras", "mm_per_px"])]
    #[schema(value_type = Option<String>)]
    pub calibration: Option<PathBuf>,
    /// Distance from the lens's centre to the axis, mm; leave it out for a telecentric lens.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "cameras")]
    pub camera_distance_mm: Option<f64>,
    /// Column of the rotation axis, pixels; measured from the silhouettes where it is not given.
    #[arg(long, value_name = "PX", allow_negative_numbers = true, conflicts_with = "cameras")]
    pub axis_column_px: Option<f64>,
    /// Turn of the picture (the axis leans left towards the top where positive), degrees; measured where not given.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with = "cameras")]
    pub roll_deg: Option<f64>,
    /// Use the stage's angles as they are and no sideways shift of single views; both are measured and told all the same.
    #[arg(long, conflicts_with = "cameras")]
    #[serde(default)]
    pub no_refine: bool,
    /// A camera for each picture: a Middlebury `_par.txt`, or CSV with 12 numbers (3×4 matrix, row by row) a line.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub cameras: Option<PathBuf>,
    /// Unit of the world that the cameras see: `none` for shapes without lengths. A `_par.txt` in metres is
    /// turned into mm.
    #[arg(long, value_enum, requires = "cameras", default_value_t = LengthUnit::Mm)]
    #[serde(default)]
    pub camera_unit: LengthUnit,
    /// A picture of the stage without the grain, of the same size.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub background: Option<PathBuf>,
    /// Index (from 0) of a picture at half a turn from the first, which shows the axis and does not carve;
    /// the pictures after it go on from the one before it.
    #[arg(long, value_name = "INDEX", allow_negative_numbers = true, conflicts_with = "cameras")]
    pub closing_view: Option<usize>,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long)]
    #[serde(default)]
    pub no_pictures: bool,
    /// Name of the session, 1 to 64 letters, digits, `.`, `_` or `-`; by default the folder's.
    #[arg(long, value_name = "NAME")]
    pub name: Option<String>,
    /// The mesh's controls.
    #[command(flatten)]
    #[serde(default)]
    pub mesh: MeshSettings,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

const STEP_DEG: f64 = 7.2;

fn step_deg() -> f64 {
    STEP_DEG
}

impl ImportOptions {
    /// The new session's name.
    ///
    /// # Errors
    /// [`JobError`] where it is none, or there is no such folder to have it from.
    pub fn session(&self, context: &Context) -> Result<String, JobError> {
        if let Some(name) = &self.name {
            check_name("session name", name)?;
            return Ok(name.clone());
        }
        let folder = context.names.input(&self.folder)?;
        let whole = folder.canonicalize().ok();
        let name = whole.and_then(|f| f.file_name().map(|n| n.to_string_lossy().into_owned()));
        let name = name.ok_or_else(|| {
            JobError::Content(format!(
                "there is no folder {}; give a folder of photographs",
                self.folder.display()
            ))
        })?;
        check_name("session name", &name).map_err(|e| {
            JobError::Usage(format!("{e}; it is the folder's name, give another with --name"))
        })?;
        Ok(name)
    }

    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        let name = self.session(context)?;
        let folder = context.names.store().folder(&name)?;
        if folder.symlink_metadata().is_ok() {
            return Err(JobError::Taken { path: folder });
        }
        self.geometry(context).map(drop)?;
        self.request(context).map(drop)
    }

    /// Takes the photographs in as a new session and computes its products.
    ///
    /// # Errors
    /// As [`import`].
    pub fn run(&self, context: &Context) -> Result<Finished, JobError> {
        let mut config = context.config.clone();
        config.as_given |= context.as_given || self.as_given;
        config.report.pictures &= !self.no_pictures;
        config.mesh = self.mesh.over(&config.mesh);
        let (name, geometry) = (self.session(context)?, self.geometry(context)?);
        let data = context.names.store().data();
        import(data, &name, &config, &self.request(context)?, geometry, &context.watcher)
    }

    fn request(&self, context: &Context) -> Result<ImportRequest, JobError> {
        let input = |path: &Option<PathBuf>| path.as_ref().map(|path| context.names.input(path)).transpose();
        Ok(ImportRequest {
            folder: context.names.input(&self.folder)?,
            pattern: self.pattern.clone(),
            step_deg: self.step_deg,
            first_deg: self.first_deg,
            rotation: self.rotation,
            closing_view: self.closing_view,
            background: input(&self.background)?,
            cameras: input(&self.cameras)?,
        })
    }

    fn geometry(&self, context: &Context) -> Result<ImportGeometry, JobError> {
        if self.cameras.is_some() {
            return Ok(ImportGeometry::Cameras(self.camera_unit));
        }
        let scale = match (self.mm_per_px, &self.calibration) {
            (_, Some(path)) => ScaleFile::read(&context.names.input(path)?)?.given(),
            (Some(mm_per_px), None) => {
                GivenScale { mm_per_px, sigma: None, camera_distance_mm: None, picture_px: None }
            }
            (None, None) => {
                let text = "the scale is missing; give --calibration (a file of `grainrig calibrate scale`), --mm-per-px (the \
                            size of a pixel at the axis, mm) or --cameras";
                return Err(JobError::Usage(text.into()));
            }
        };
        let optics = &context.config.optics;
        let table = TurntableSettings {
            mm_per_px: scale.mm_per_px,
            mm_per_px_sigma: scale.sigma,
            camera_distance_mm: self.camera_distance_mm.or(scale.camera_distance_mm),
            axis_column_px: self.axis_column_px,
            roll_deg: self.roll_deg.or(optics.roll_deg),
            // The plan's angles have the sense already.
            clockwise: false,
            refine: optics.refine && !self.no_refine,
        };
        Ok(ImportGeometry::Turntable { table, picture_px: scale.picture_px })
    }
}

/// How the photographs see the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ImportGeometry {
    /// One camera that stands still before a turntable.
    Turntable {
        /// What is known of it.
        table: TurntableSettings,
        /// Width and height of the pictures that its scale was measured in, pixels.
        picture_px: Option<[u32; 2]>,
    },
    /// A camera for each photograph, from the request's camera file, whose world has this unit.
    Cameras(LengthUnit),
}

/// Imports photographs as a new session and computes its products. Blocks until all is done.
///
/// # Errors
/// [`JobError`]; where a photograph or a camera can't be used, nothing is left of the session. Where only the
/// computation fails the session stays.
pub fn import(
    data: &Path,
    name: &str,
    config: &Config,
    request: &ImportRequest,
    geometry: ImportGeometry,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    trace::job("import", name, || imported(data, name, config, request, geometry, watcher))
}

fn imported(
    data: &Path,
    name: &str,
    config: &Config,
    request: &ImportRequest,
    geometry: ImportGeometry,
    watcher: &Watcher,
) -> Result<Finished, JobError> {
    config.check()?;
    if let ImportGeometry::Turntable { table, .. } = geometry {
        let doubts: Vec<_> = (table.doubts().into_iter())
            .chain(plausible::VIEW_STEP.named("step_deg").doubt(request.step_deg))
            .collect();
        plausible::slips(&doubts, config.as_given)?;
        table.check()?;
        plausible::settle(doubts, config.as_given)?;
    }
    let found = scan(request)?;
    let cameras = match geometry {
        ImportGeometry::Turntable { table, picture_px } => {
            if let Some(calibrated) = picture_px.filter(|s| *s != found.size) {
                return Err(JobError::OtherSize { calibrated, pictures: found.size });
            }
            Cameras::Turntable(table)
        }
        ImportGeometry::Cameras(unit) => {
            Cameras::Given { projections: found.cameras.iter().map(|c| c.1.clone()).collect(), unit }
        }
    };
    let encode = |e: serde_json::Error| JobError::Encode(e.to_string());
    let config = serde_json::to_value(config).map_err(encode)?;
    let cameras = serde_json::to_value(cameras).map_err(encode)?;
    let mut session = found.import(&Store::new(data), name, config, cameras)?;
    // Whoever watches hears of the imported views as of captured ones.
    session.recording().events().iter().for_each(|e| watcher(e));
    let watch = Arc::clone(watcher);
    session.observe(move |e| watch(e));
    let recording = session.recording().clone();
    let (_, pipeline) = computation(&recording)?;
    let session = Mutex::new(session);
    let outcome = compute(&recording, &pipeline, &session);
    conclude(&session, outcome, None)
}
