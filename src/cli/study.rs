//! `grainrig study`.

use super::mesh::{Unit, body_doubt};
use super::output::{print, print_json};
use super::{Common, help, progress, usage};
use crate::session::write_whole;
use anyhow::{Context as _, Result};
use clap::{Args, Subcommand};
use grainrig_core::formats::stl;
use grainrig_core::geometry::TriangleMesh;
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::study::{Body, Row, Study, StudyError, curves, sensitivity, shapes, silhouettes, table};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Options of `study`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// How the reconstructed volume depends on the number of views, on bodies of known volume.
    #[command(after_help = help::STUDY_SENSITIVITY)]
    Sensitivity(SensitivityArguments),
}

/// Options of `study sensitivity`.
#[derive(Debug, Args)]
struct SensitivityArguments {
    /// A closed surface (binary or ASCII STL) to turn about its z axis, instead of balls of 0.5 and 1 mm.
    #[arg(long, value_name = "FILE")]
    stl: Option<PathBuf>,
    /// Unit of the STL file's numbers.
    #[arg(long, value_enum, default_value_t = Unit::Mm, requires = "stl")]
    unit: Unit,
    /// Size of a pixel, mm; by default 0.005, for a surface a two hundredth of its longest edge.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pixel_mm: Option<f64>,
    /// Numbers of views over half a turn; by default 2 to 30.
    #[arg(long, value_name = "N,…", value_delimiter = ',')]
    views: Vec<usize>,
    /// Folder for sensitivity.csv and the figures (SVG and PNG): silhouettes, shapes, curves.
    #[arg(long, value_name = "DIR", default_value = "study-sensitivity")]
    out: PathBuf,
}

/// Pixels across a surface by default, and size of a pixel for balls, mm.
const PIXELS: f64 = 200.0;
const PIXEL_MM: f64 = 0.005;
/// The balls, mm.
const BALLS: [f64; 2] = [0.5, 1.0];
/// Numbers of views whose shapes are drawn, where no others are asked for.
const DRAWN: [usize; 3] = [2, 6, 30];

#[derive(serde::Serialize)]
struct Told<'a> {
    rows: &'a [Row],
    files: Vec<String>,
    warnings: Vec<String>,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let What::Sensitivity(a) = &arguments.what;
    let studies = studies(a)?;
    let doubts = studies.iter().flat_map(|study| doubts(study, a.unit)).collect();
    let warnings = plausible::settle(doubts, common.as_given)?;
    let views: Vec<usize> = if a.views.is_empty() { (2..=30).collect() } else { a.views.clone() };
    let drawn: &[usize] = if a.views.is_empty() { &DRAWN } else { &views[..views.len().min(6)] };
    std::fs::create_dir_all(&a.out).with_context(|| format!("cannot make the folder {}", a.out.display()))?;
    let bar = progress::percent("studying");
    let mut rows = Vec::new();
    let mut files = Vec::new();
    for (k, study) in studies.iter().enumerate() {
        let told = |done: f64| bar.set_position((100.0 * (k as f64 + done) / studies.len() as f64) as u64);
        rows.extend(sensitivity(study, &views, &mut { told }).map_err(wrong)?);
        let silhouettes = silhouettes(study);
        let shapes = shapes(study, drawn).map_err(wrong)?;
        for (name, tiles) in [("silhouettes", silhouettes), ("shapes", shapes)] {
            let name = if studies.len() > 1 {
                format!("{name}-{}", study.name.replace(' ', "-"))
            } else {
                name.into()
            };
            files.extend(write_both(&a.out, &name, &tiles.svg(), &tiles.png()?)?);
        }
    }
    bar.finish_and_clear();
    let sheet = curves(&rows);
    files.extend(write_both(&a.out, "curves", &sheet.svg(), &sheet.png()?)?);
    let csv = table(&rows);
    files.push(write(&a.out, "sensitivity.csv", csv.as_bytes())?);
    if common.json {
        return print_json(&Told { rows: &rows, files, warnings });
    }
    let mut text = format!(
        "V_R/V_M, real over reconstructed volume\n{:<16} {:>5} {:>8}  {:>8} {:>8} {:>11} {:>9} {:>9}\n",
        "body", "views", "angle", "voxels", "exact", "coarse mesh", "fine mesh", "analytic"
    );
    // Writing to a string cannot fail.
    for r in &rows {
        let v = &r.vr_over_vm;
        let _ = writeln!(
            text,
            "{:<16} {:>5} {:>7.2}°  {:>8.4} {:>8.4} {:>11.4} {:>9.4} {:>9}",
            r.body,
            r.views,
            r.angle_deg,
            v.voxel,
            v.exact,
            v.coarse_mesh,
            v.fine_mesh,
            r.analytic.map_or_else(String::new, |a| format!("{a:.4}"))
        );
    }
    for line in files.into_iter().chain(warnings.into_iter().map(|w| format!("note: {w}"))) {
        let _ = writeln!(text, "{line}");
    }
    print(&text)
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

fn studies(a: &SensitivityArguments) -> Result<Vec<Study>> {
    let Some(path) = &a.stl else {
        let pixel_mm = a.pixel_mm.unwrap_or(PIXEL_MM);
        return Ok(BALLS
            .map(|d| Study { name: format!("ball {d} mm"), body: Body::Ball(d), pixel_mm })
            .into());
    };
    let bytes = crate::system::read(path)?;
    let mut surface: TriangleMesh = stl::read(&bytes).with_context(|| path.display().to_string())?;
    surface.check().with_context(|| path.display().to_string())?;
    surface.vertices.iter_mut().for_each(|p| p.coords *= a.unit.in_mm());
    let longest = surface.bounds().map_or(0.0, |b| b.size().max());
    let body = Body::of_surface(surface).with_context(|| format!("{} holds no triangle", path.display()))?;
    let name = path.file_stem().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    Ok(vec![Study { name, body, pixel_mm: a.pixel_mm.unwrap_or(longest / PIXELS) }])
}

/// What was asked for is at fault where the pixel or the views are.
fn wrong(error: StudyError) -> anyhow::Error {
    match error {
        StudyError::Pixel { .. } | StudyError::Views(_) => usage(error),
        other => other.into(),
    }
}

fn write_both(folder: &Path, name: &str, svg: &[u8], png: &[u8]) -> Result<[String; 2]> {
    Ok([write(folder, &format!("{name}.svg"), svg)?, write(folder, &format!("{name}.png"), png)?])
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<String> {
    let path = folder.join(name);
    write_whole(folder, name, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    Ok(path.display().to_string())
}
