//! `grainrig import`.

use super::capture::conclude;
use super::progress::Progress;
use super::reconstruct::MeshOptions;
use super::{Common, usage};
use crate::daemon::{self, GivenScale, ImportGeometry, ScaleFile};
use crate::pipeline::{LengthUnit, TurntableSettings};
use crate::session::check_name;
use crate::session::import::{ImportRequest, Rotation};
use anyhow::{Context as _, Result};
use clap::{Args, ValueEnum};
use std::path::{Path, PathBuf};

/// Every picture of a folder.
pub(super) const PICTURES: &str = "*.{jpg,jpeg,png,tif,tiff,JPG,JPEG,PNG,TIF,TIFF}";

/// Whether a file name's ending is a picture's.
pub(super) fn is_picture(ending: &str) -> bool {
    let list = PICTURES.trim_start_matches("*.{").trim_end_matches('}');
    list.split(',').any(|e| e.eq_ignore_ascii_case(ending))
}

/// Options of `import`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Folder of photographs (JPEG, PNG, TIFF), taken in the order of the numbers in their names.
    folder: PathBuf,
    /// Which files are views, as a glob over file names.
    #[arg(long, value_name = "GLOB", default_value = PICTURES)]
    pattern: String,
    /// Angle between one view and the next, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 7.2,
        allow_negative_numbers = true,
        conflicts_with = "cameras"
    )]
    step_deg: f64,
    /// Angle of the first view, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        conflicts_with = "cameras"
    )]
    first_deg: f64,
    /// Which way the grain turns, seen from above.
    #[arg(long, value_enum, default_value_t = Sense::Ccw, conflicts_with = "cameras")]
    rotation: Sense,
    /// Size of a pixel at the rotation axis, mm; every length and volume hangs on it, so it has no default.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "cameras")]
    mm_per_px: Option<f64>,
    /// A file of `grainrig calibrate scale`: the size of a pixel with its uncertainty, and the camera's distance
    /// where it was given there.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["cameras", "mm_per_px"])]
    calibration: Option<PathBuf>,
    /// Distance from the lens's centre to the axis, mm; leave it out for a telecentric lens.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, conflicts_with = "cameras")]
    camera_distance_mm: Option<f64>,
    /// Column of the rotation axis, pixels; measured from the silhouettes where it is not given.
    #[arg(long, value_name = "PX", allow_negative_numbers = true, conflicts_with = "cameras")]
    axis_column_px: Option<f64>,
    /// Turn of the picture (the axis leans left towards the top where positive), degrees; measured where not given.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true, conflicts_with = "cameras")]
    roll_deg: Option<f64>,
    /// Use the stage's angles as they are and no sideways shift of single views; both are measured and told all the same.
    #[arg(long, conflicts_with = "cameras")]
    no_refine: bool,
    /// A camera for each picture: a Middlebury `_par.txt`, or CSV with 12 numbers (3×4 matrix, row by row) a line.
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// Unit of the world that the cameras see: `none` for shapes without lengths. A `_par.txt` in metres is
    /// turned into mm.
    #[arg(long, value_enum, requires = "cameras", default_value_t = Unit::Mm)]
    camera_unit: Unit,
    /// A picture of the stage without the grain, of the same size.
    #[arg(long, value_name = "FILE")]
    background: Option<PathBuf>,
    /// Index (from 0) of a picture at half a turn from the first, which shows the axis and does not carve;
    /// the pictures after it go on from the one before it.
    #[arg(long, value_name = "INDEX", allow_negative_numbers = true, conflicts_with = "cameras")]
    closing_view: Option<usize>,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long)]
    no_pictures: bool,
    /// Name of the session, 1 to 64 letters, digits, `.`, `_` or `-`; by default the folder's.
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    #[command(flatten)]
    mesh: MeshOptions,
}

/// Which way the grain turns, seen from above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Sense {
    /// Counter-clockwise.
    Ccw,
    /// Clockwise.
    Cw,
}

/// Units of length.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Unit {
    /// Millimetres.
    Mm,
    /// None: shapes only, no volumes.
    None,
}

pub(super) fn run(common: &Common, arguments: Arguments) -> Result<()> {
    let mut config = common.config()?;
    let Arguments { folder, pattern, cameras, camera_unit, background, name, mesh, closing_view, .. } =
        arguments;
    let geometry = match (&cameras, camera_unit) {
        (Some(_), Unit::Mm) => ImportGeometry::Cameras(LengthUnit::Mm),
        (Some(_), Unit::None) => ImportGeometry::Cameras(LengthUnit::None),
        (None, _) => {
            let scale = scale(arguments.mm_per_px, arguments.calibration.as_deref())?;
            let table = TurntableSettings {
                mm_per_px: scale.mm_per_px,
                mm_per_px_sigma: scale.sigma,
                camera_distance_mm: arguments.camera_distance_mm.or(scale.camera_distance_mm),
                axis_column_px: arguments.axis_column_px,
                roll_deg: arguments.roll_deg.or(config.optics.roll_deg),
                // The plan's angles have the sense already.
                clockwise: false,
                refine: config.optics.refine && !arguments.no_refine,
            };
            ImportGeometry::Turntable { table, picture_px: scale.picture_px }
        }
    };
    config.report.pictures &= !arguments.no_pictures;
    if let Some(asked) = mesh.settings() {
        config.mesh = asked.over(&config.mesh);
    }
    let name = match name {
        Some(name) => name,
        None => folder
            .canonicalize()
            .ok()
            .and_then(|f| f.file_name().map(|n| n.to_string_lossy().into_owned()))
            .with_context(|| format!("there is no folder {}; give a folder of photographs", folder.display()))
            .and_then(|name| match check_name("session name", &name) {
                Ok(()) => Ok(name),
                Err(e) => Err(usage(format!("{e}; it is the folder's name, give another with --name"))),
            })?,
    };
    let rotation = match arguments.rotation {
        Sense::Ccw => Rotation::Ccw,
        Sense::Cw => Rotation::Cw,
    };
    let (step_deg, first_deg) = (arguments.step_deg, arguments.first_deg);
    let request =
        ImportRequest { folder, pattern, step_deg, first_deg, rotation, closing_view, background, cameras };
    let progress = Progress::new();
    let outcome = daemon::import(&common.data, &name, &config, &request, geometry, &progress.watcher());
    progress.finish();
    conclude(common, &outcome?)
}

/// The size of a pixel, from the one option or the other.
fn scale(mm_per_px: Option<f64>, calibration: Option<&Path>) -> Result<GivenScale> {
    match (mm_per_px, calibration) {
        (_, Some(path)) => Ok(ScaleFile::read(path)?.given()),
        (Some(mm_per_px), None) => {
            Ok(GivenScale { mm_per_px, sigma: None, camera_distance_mm: None, picture_px: None })
        }
        (None, None) => Err(usage(
            "the scale is missing; give --calibration (a file of `grainrig calibrate scale`), --mm-per-px (the size of a \
             pixel at the axis, mm) or --cameras",
        )),
    }
}
