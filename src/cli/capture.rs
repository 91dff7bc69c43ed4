//! `grainrig capture` and `grainrig resume`.

use super::output::{print, print_json, say};
use super::progress::Progress;
use super::signals::stoppable;
use super::{Common, next, usage};
use crate::jobs::{CaptureOptions, Finished, ResumeOptions, Resumed};
use crate::pipeline::{OUTLINE, ResultVerdict};
use anyhow::Result;
use grainrig_core::silhouette::Verdict;

pub(super) fn run(common: &Common, options: &CaptureOptions) -> Result<()> {
    let progress = Progress::new();
    let context = common.configured(&progress)?;
    let outcome = options.run(&context, &stoppable());
    progress.finish();
    conclude(common, &outcome?)
}

pub(super) fn resume(common: &Common, options: &ResumeOptions) -> Result<()> {
    if common.as_given {
        return Err(usage(
            "--as-given goes with a new session, or with `grainrig reconstruct` of one whose views are all there: what is \
             resumed goes on as it was begun",
        ));
    }
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress), &stoppable());
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

/// Whether the result can be relied on, and why not.
pub(super) fn verdict_lines(told: &ResultVerdict) -> Vec<String> {
    let word = match told.verdict {
        Verdict::Good => "good: the views agree with one another and with one grain",
        Verdict::Doubtful => "DOUBTFUL",
        Verdict::Bad => "BAD: do not use it before it is mended",
    };
    let reasons = told.reasons.iter().map(|reason| format!("           {reason}"));
    std::iter::once(format!("verdict    {word}")).chain(reasons).collect()
}

/// The result in words, a line for each figure.
pub(super) fn summary(done: &Finished) -> String {
    let r = &done.result;
    let mut lines = verdict_lines(&r.verdict);
    lines.push(format!("session    {}", done.folder.display()));
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
