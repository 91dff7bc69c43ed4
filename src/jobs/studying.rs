//! The method studied on bodies of known volume.

use super::error::Of as _;
use super::mesh_files::Unit;
use super::meshing::body_doubt;
use super::{Context, JobError};
use crate::session::{to_json_value, write_whole};
use grainrig_core::formats::stl;
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::study::{Body, Row, Study, StudyError, curves, sensitivity, shapes, silhouettes, table};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::PathBuf;

/// Pixels across a surface by default, and size of a pixel for balls, mm.
const PIXELS: f64 = 200.0;
const PIXEL_MM: f64 = 0.005;
/// The balls, mm.
const BALLS: [f64; 2] = [0.5, 1.0];
/// Numbers of views whose shapes are drawn, where no others are asked for.
const DRAWN: [usize; 3] = [2, 6, 30];
/// The folder of its files, unless told.
const OUT: &str = "study-sensitivity";

/// A study of how the reconstructed volume depends on the number of views.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct StudyOptions {
    /// A closed surface (binary or ASCII STL) to turn about its z axis, instead of balls of 0.5 and 1 mm.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub stl: Option<PathBuf>,
    /// Unit of the STL file's numbers.
    #[arg(long, value_enum, default_value_t = Unit::Mm, requires = "stl")]
    #[serde(default)]
    pub unit: Unit,
    /// Size of a pixel, mm; by default 0.005, for a surface a two hundredth of its longest edge.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub pixel_mm: Option<f64>,
    /// Numbers of views over half a turn; by default 2 to 30.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    #[serde(default)]
    pub views: Vec<usize>,
    /// Folder for sensitivity.csv and the figures (SVG and PNG): silhouettes, shapes, curves.
    #[arg(long, value_name = "DIR", default_value = OUT)]
    #[serde(default = "out")]
    #[schema(value_type = String)]
    pub out: PathBuf,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

fn out() -> PathBuf {
    OUT.into()
}

/// What a study found.
#[derive(Debug, Serialize)]
pub struct Studied {
    /// A row for each body and number of views.
    pub rows: Vec<Row>,
    /// What was written, as it was named.
    pub files: Vec<String>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

impl Studied {
    /// What `--json` prints.
    ///
    /// # Errors
    /// [`JobError::Encode`] where a figure is not finite.
    pub fn to_json(&self) -> Result<Value, JobError> {
        Ok(to_json_value(self)?)
    }
}

impl StudyOptions {
    /// Whether it makes sense, as far as that can be told before anything is computed.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        self.stl.as_ref().map_or(Ok(()), |stl| context.names.input(stl).map(drop))?;
        context.names.output(&self.out).map(drop)
    }

    /// Computes the volumes and writes table and figures.
    ///
    /// # Errors
    /// [`JobError`]: a surface that is not closed, pixels or views that can't be studied, a disk that fails.
    pub fn run(&self, context: &Context) -> Result<Studied, JobError> {
        let studies = self.studies(context)?;
        let doubts = studies.iter().flat_map(|study| doubts(study, self.unit)).collect();
        let warnings = plausible::settle(doubts, context.as_given || self.as_given)?;
        let views: Vec<usize> = if self.views.is_empty() { (2..=30).collect() } else { self.views.clone() };
        let drawn: &[usize] = if self.views.is_empty() { &DRAWN } else { &views[..views.len().min(6)] };
        let place = context.names.output(&self.out)?;
        std::fs::create_dir_all(&place).map_err(|source| JobError::Write { path: place.clone(), source })?;
        let mut files = Vec::new();
        let mut write = |name: String, bytes: &[u8]| -> Result<(), JobError> {
            write_whole(&place, &name, bytes)?;
            files.push(self.out.join(name).display().to_string());
            Ok(())
        };
        let mut rows = Vec::new();
        for (k, study) in studies.iter().enumerate() {
            let told = |done: f64| context.working("studying", (k as f64 + done) / studies.len() as f64);
            rows.extend(sensitivity(study, &views, &mut { told })?);
            for (name, tiles) in [("silhouettes", silhouettes(study)), ("shapes", shapes(study, drawn)?)] {
                let name = match studies.len() {
                    1 => name.to_owned(),
                    _ => format!("{name}-{}", study.name.replace(' ', "-")),
                };
                write(format!("{name}.svg"), &tiles.svg())?;
                write(format!("{name}.png"), &tiles.png().map_err(drawing)?)?;
            }
        }
        let sheet = curves(&rows);
        write("curves.svg".into(), &sheet.svg())?;
        write("curves.png".into(), &sheet.png().map_err(drawing)?)?;
        write("sensitivity.csv".into(), table(&rows).as_bytes())?;
        Ok(Studied { rows, files, warnings })
    }

    fn studies(&self, context: &Context) -> Result<Vec<Study>, JobError> {
        let Some(given) = &self.stl else {
            let pixel_mm = self.pixel_mm.unwrap_or(PIXEL_MM);
            return Ok(BALLS
                .map(|d| Study { name: format!("ball {d} mm"), body: Body::Ball(d), pixel_mm })
                .into());
        };
        let bytes = crate::system::read(&context.names.input(given)?)?;
        let mut surface = stl::read(&bytes).of(given)?;
        surface.check().of(given)?;
        surface.vertices.iter_mut().for_each(|p| p.coords *= self.unit.in_mm());
        let longest = surface.bounds().map_or(0.0, |b| b.size().max());
        let body = Body::of_surface(surface)
            .ok_or_else(|| JobError::Content(format!("{} holds no triangle", given.display())))?;
        let name = given.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Ok(vec![Study { name, body, pixel_mm: self.pixel_mm.unwrap_or(longest / PIXELS) }])
    }
}

fn drawing(error: impl std::fmt::Display) -> JobError {
    JobError::Content(format!("a figure cannot be drawn: {error}"))
}

/// What of a study's figures no laboratory has.
fn doubts(study: &Study, unit: Unit) -> Vec<Doubt> {
    let longest_mm = match &study.body {
        Body::Ball(d) => *d,
        Body::Surface(s) => s.bounds().map_or(0.0, |b| b.size().max()),
    };
    let pixel = plausible::share_of("pixel_mm", longest_mm, [1e-5, 0.5]);
    body_doubt(longest_mm, unit).into_iter().chain(pixel.doubt(study.pixel_mm)).collect()
}

/// Whether what was asked for is at fault: the pixel, or the numbers of views.
pub(super) fn is_asked_for(error: &StudyError) -> bool {
    matches!(error, StudyError::Pixel { .. } | StudyError::Views(_))
}
