//! `grainrig merge`.

use super::Common;
use super::capture::conclude;
use super::progress::Progress;
use crate::jobs::{Finished, MergeOptions};
use crate::pipeline::MergeResult;
use anyhow::Result;

pub(super) fn run(common: &Common, options: &MergeOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    conclude(common, &outcome?)
}

/// The result of a merging in words, a line for each figure.
pub(super) fn summary(done: &Finished, m: &MergeResult) -> String {
    let r = &done.result;
    let [x, y, z] = m.translation_mm;
    let single = |p: &crate::pipeline::PoseResult| {
        format!("           {:.5} mm³ by the {} views of {} alone", p.volume_mm3, p.views, p.session)
    };
    let mut lines = super::capture::verdict_lines(&r.verdict);
    lines.extend([
        format!("merged     {}", done.folder.display()),
        format!(
            "hull       {:.5} mm³ by all {} views (an upper bound of the grain, with the feet that one pose's pedestal hides)",
            m.volume_mm3, r.views
        ),
        single(&m.a),
        single(&m.b),
        format!(
            "motion     {} to {}: turned by {:.2}° about ({:.3}, {:.3}, {:.3}), moved by ({x:.4}, {y:.4}, {z:.4}) mm; \
             upright axes {:.0}° apart",
            m.b.session,
            m.a.session,
            m.rotation_deg,
            m.rotation_axis[0],
            m.rotation_axis[1],
            m.rotation_axis[2],
            m.axes_apart_deg
        ),
        format!(
            "           silhouettes unfilled by {:.3} px along their outlines (limit {:.2} px; each pose alone {:.3} px)",
            m.unfilled.median_view_px, m.limit_px, m.unfilled_alone.median_view_px
        ),
    ]);
    if let Some(rival) = &m.rival {
        lines.push(format!(
            "           the next best turn is {:.0}° off and leaves {:.2} px unfilled, this one {:.2} px",
            rival.apart_deg, rival.mean_px, m.unfilled.mean_px
        ));
    }
    lines.push(format!(
        "mesh       {} nodes, {} triangles, {} tetrahedra; {:.5} mm³",
        r.mesh.nodes,
        r.mesh.triangles,
        r.mesh.tetrahedra,
        r.mesh.volume_mm3.unwrap_or_default()
    ));
    lines.extend(r.products.iter().map(|(kind, path)| format!("{kind:<10} {path}")));
    lines.extend(r.warnings.iter().map(|w| format!("note       {w}")));
    lines.join("\n") + "\n"
}
