//! The command that a person will want next, as it can be typed where this one was.

use super::{Common, DATA};
use crate::jobs::Finished;
use crate::session::Store;
use grainrig_core::calibrate::FindingKind;
use std::path::Path;

/// The line under a session's result: what was captured is pressed next, unless it has to be captured again.
pub(super) fn after(common: &Common, done: &Finished) -> String {
    let r = &done.result;
    let findings = r.calibration.as_ref().map_or(&[][..], |c| &c.findings);
    let moved = findings.iter().any(|f| f.kind != FindingKind::StepSize);
    let (command, why) = if moved {
        ("capture", "captures it anew, once what the notes name is mended")
    } else if r.hull.volume_mm3.is_none() {
        (
            "verify",
            "compares every file with what was recorded; without a unit of length nothing can be pressed",
        )
    } else {
        ("compress", "presses the grain between two plates")
    };
    let which = if moved {
        format!("{}-2", r.session)
    } else {
        let folder = done.folder.as_path();
        let name = folder.file_name().and_then(|n| n.to_str()).unwrap_or_default();
        let is_named = Store::new(&common.data).folder(name).is_ok_and(|there| there == folder);
        if is_named { quoted(Path::new(name)) } else { quoted(folder) }
    };
    let data = match common.data.as_path() {
        data if data == Path::new(DATA) => String::new(),
        data => format!(" --data {}", quoted(data)),
    };
    line(&format!("grainrig {command} {which}{data}"), why)
}

fn line(command: &str, why: &str) -> String {
    format!("next       {command}    # {why}\n")
}

/// A path as a shell takes it for one word.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let plain = |c: char| c.is_alphanumeric() || "/._-+,:@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text;
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_stays_one_word() {
        assert_eq!(quoted(Path::new("data/quartz-07")), "data/quartz-07");
        assert_eq!(quoted(Path::new("my grains/it's")), r"'my grains/it'\''s'");
        assert_eq!(quoted(Path::new("$(rm)")), "'$(rm)'");
    }
}
