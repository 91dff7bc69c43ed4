//! `grainrig mesh`.

use super::Common;
use super::output::{print, print_json, say};
use super::progress::Progress;
use crate::jobs::{MeshOptions, Meshed, file_ending};
use anyhow::Result;

pub(super) fn run(common: &Common, options: &MeshOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    let made = match outcome? {
        Meshed::Session(done) => return super::capture::report(common, &done),
        Meshed::File(made) => made,
    };
    made.warnings.iter().for_each(|w| say(format!("warning: {}: {w}", options.input.display())));
    if common.json {
        return print_json(&made.to_json()?);
    }
    let (volume_mm3, what, box_mm) = made.body;
    let mut lines = vec![format!(
        "{what:<10} {:.4} × {:.4} × {:.4} mm, {volume_mm3:.5} mm³",
        box_mm.x, box_mm.y, box_mm.z
    )];
    lines.extend(made.lines(made.seconds));
    lines.extend(made.notes.iter().map(|n| format!("note       {n}")));
    lines.extend(made.files.iter().map(|path| format!("{:<10} {}", file_ending(path), path.display())));
    print(&(lines.join("\n") + "\n"))
}
