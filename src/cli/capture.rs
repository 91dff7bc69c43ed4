//! `grainrig capture` and `grainrig resume`.

use super::output::{print, print_json, say};
use super::progress::Progress;
use super::signals::stoppable;
use super::{Common, Quality, next, usage};
use crate::daemon::{self, Finished, Resumed, ScaleFile};
use crate::pipeline::OUTLINE;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;

/// Options of `capture`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Name of the new session: 1 to 64 letters, digits, `.`, `_` or `-`.
    name: String,
    /// Number of views over half a turn, instead of the configuration's: 2 to 200 with motor steps of 0.9°.
    /// The step between them is the greatest whole number of motor steps that keeps them within it.
    #[arg(long, value_name = "COUNT", allow_negative_numbers = true)]
    views: Option<u32>,
    /// A file of `grainrig calibrate scale`, which sets the size of a pixel instead of the configuration
    /// (`optics.mm_per_px`), and the camera's distance where it was given there.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Use the stage's angles as they are and no sideways shift of single views; both are measured and told all the same.
    #[arg(long)]
    no_refine: bool,
    /// Draw no outlines over the photographs, and no sheet of the calibration.
    #[arg(long)]
    no_pictures: bool,
    /// What becomes of a picture that is out of focus, shaken, overexposed, obstructed or a copy of another, instead
    /// of what the configuration says.
    #[arg(long, value_enum)]
    quality: Option<Quality>,
    /// Write the simulated rig's truth (shape, angles, camera) into this folder.
    #[arg(long, value_name = "DIR")]
    truth: Option<PathBuf>,
}

/// Options of `resume`.
#[derive(Debug, Args)]
pub struct ResumeArguments {
    /// The session: its name in the data folder, or its folder's path.
    session: PathBuf,
    /// What becomes of a picture that is no good among the missing views, instead of what the session's
    /// configuration says.
    #[arg(long, value_enum)]
    quality: Option<Quality>,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let mut config = common.config()?;
    if let Some(views) = arguments.views {
        let half_turn = (180.0 / config.plan.step_deg + 1e-9).floor();
        let steps = (half_turn / f64::from(views)).floor();
        if views < 2 || steps < 1.0 {
            return Err(usage(format!(
                "--views is {views}; give 2 to {half_turn}: a half turn has {half_turn} motor steps of {}° \
                 (plan.step_deg)",
                config.plan.step_deg
            )));
        }
        config.plan.views = views;
        config.plan.steps_per_view = steps as u32;
        config.plan.check().map_err(usage)?;
    }
    if let Some(path) = &arguments.calibration {
        let scale = ScaleFile::read(path)?.given();
        config.optics.mm_per_px = scale.mm_per_px;
        config.optics.mm_per_px_sigma = scale.sigma;
        config.optics.camera_distance_mm = scale.camera_distance_mm.or(config.optics.camera_distance_mm);
    }
    config.optics.refine &= !arguments.no_refine;
    config.report.pictures &= !arguments.no_pictures;
    if let Some(quality) = arguments.quality {
        config.acquire.quality = quality.into();
    }
    config.check()?;
    let control = stoppable();
    let progress = Progress::new();
    let outcome = daemon::capture(
        &common.data,
        &arguments.name,
        &config,
        arguments.truth.as_deref(),
        &control,
        &progress.watcher(),
    );
    progress.finish();
    conclude(common, &outcome?)
}

pub(super) fn resume(common: &Common, arguments: &ResumeArguments) -> Result<()> {
    if common.as_given {
        return Err(usage(
            "--as-given goes with a new session, or with `grainrig reconstruct` of one whose views are all there: what is \
             resumed goes on as it was begun",
        ));
    }
    let folder = super::session_folder(common, &arguments.session)?;
    let control = stoppable();
    let progress = Progress::new();
    let outcome = daemon::resume(&folder, arguments.quality.map(Into::into), &control, &progress.watcher());
    progress.finish();
    match outcome? {
        Resumed::Done(done) => conclude(common, &done),
        Resumed::MadeAgain { done, lost } => {
            say(format!(
                "note: {} of the session's products were missing or had changed ({}) and are made again",
                lost.len(),
                lost.join(", ")
            ));
            conclude(common, &done)
        }
        Resumed::NothingToDo { session, views, result } => {
            say(format!(
                "session {session} is complete: its {views} views are captured and its products made, \
                 nothing is left to do; `grainrig replay` proves it, `grainrig reconstruct` computes it with \
                 another mesh"
            ));
            if common.json { print_json(&result) } else { Ok(()) }
        }
    }
}

/// Tells the user what was made and where it is, and what to do with it.
pub(super) fn conclude(common: &Common, done: &Finished) -> Result<()> {
    report(common, done)?;
    if common.json { Ok(()) } else { print(&next::after(common, done)) }
}

/// Tells the user what was made and where it is.
pub(super) fn report(common: &Common, done: &Finished) -> Result<()> {
    if common.json {
        return print_json(&done.result);
    }
    print(&done.result.merge.as_ref().map_or_else(|| summary(done), |m| super::merge::summary(done, m)))
}

/// The result in words, a line for each figure.
pub(super) fn summary(done: &Finished) -> String {
    let r = &done.result;
    let mut lines = vec![format!("session    {}", done.folder.display())];
    if let (Some(hull), Some(volume), Some([low, high])) =
        (r.hull.volume_mm3, r.hull.volume_estimate_mm3, r.hull.volume_interval_mm3)
    {
        // As many digits for a grain of a tenth of a millimetre as for one of 3 mm.
        let digits = (3 - volume.log10().floor() as i32).clamp(1, 9) as usize;
        lines.push(format!(
            "volume     {volume:.digits$} mm³ ({low:.digits$} … {high:.digits$}; hull {hull:.digits$})"
        ));
    } else if let Some(why) = &r.hull.volume_unknown {
        lines.push(format!("volume     of the grain itself not known: {why}"));
    }
    lines.extend([
        match (r.hull.volume_mm3, r.hull.voxel_volume_mm3, r.hull.voxel_mm, r.hull.surface_area_mm2) {
            (Some(volume), Some(counted), Some(edge), Some(area)) => format!(
                "hull       {volume:.5} mm³ from {} views (an upper bound of the grain)\n           \
                 {counted:.5} mm³ by counting voxels of {edge:.5} mm; surface {area:.5} mm²",
                r.views
            ),
            _ => format!("hull       from {} views; no volume, the cameras have no unit of length", r.views),
        },
        format!(
            "           silhouettes filled: IoU {:.4} in the mean, {:.4} in the worst view",
            r.hull.silhouette_iou.mean, r.hull.silhouette_iou.min
        ),
        format!(
            "mesh       {} nodes, {} triangles, {} tetrahedra",
            r.mesh.nodes, r.mesh.triangles, r.mesh.tetrahedra
        ),
        format!(
            "           {}dihedral angles {:.1}° to {:.1}° (1 %: {:.1}°), facet angles from {:.1}°",
            r.mesh.volume_mm3.map_or_else(String::new, |v| format!("{v:.5} mm³; ")),
            r.mesh.dihedral_deg.min,
            r.mesh.dihedral_deg.max,
            r.mesh.dihedral_deg.p01,
            r.mesh.facet_angle_deg.min
        ),
    ]);
    let outlines = || r.products.iter().filter(|(kind, _)| kind.starts_with(OUTLINE));
    let others = r.products.iter().filter(|(kind, _)| !kind.starts_with(OUTLINE));
    lines.extend(others.map(|(kind, path)| format!("{kind:<10} {path}")));
    if let Some((_, first)) = outlines().next() {
        lines.push(format!("outlines   {first} and {} more", outlines().count() - 1));
    }
    lines.extend(r.warnings.iter().map(|w| format!("note       {w}")));
    lines.join("\n") + "\n"
}
