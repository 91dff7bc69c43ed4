//! `grainrig verify`.

use super::Common;
use super::output::{print, print_json, say};
use super::progress::Progress;
use crate::jobs::VerifyOptions;
use crate::session::State;
use anyhow::{Result, bail};

pub(super) fn run(common: &Common, options: &VerifyOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    let report = outcome?;
    let folder = common.names().session(&options.session)?;
    if common.json {
        print_json(&report)?;
    }
    let faults = report.faults.len();
    if report.is_sound() {
        if common.json {
            return Ok(());
        }
        let now = match report.state {
            Some(State::Capturing) => "; a run captures it now",
            Some(State::Computing) => "; a run computes it now",
            _ if report.busy => "; it is in use now",
            Some(State::Complete) => "",
            // Lines that were taken off a journal's end look as if the run had been killed there.
            _ => "; the session is not complete, `grainrig resume` goes on with it",
        };
        return print(&format!(
            "{}: every file has the recorded bytes ({} of {} views, {} products, {} journal lines){now}\n",
            folder.display(),
            report.frames,
            report.planned,
            report.products,
            report.records
        ));
    }
    for fault in &report.faults {
        say(fault);
    }
    let count = if faults == 1 { "1 file is".to_owned() } else { format!("{faults} files are") };
    bail!("{count} not as recorded in {}; each line above says what to do", folder.display())
}
