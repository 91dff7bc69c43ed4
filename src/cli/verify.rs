//! `grainrig verify`.

use super::Common;
use super::output::{print, print_json, say};
use crate::session::State;
use anyhow::{Result, bail};
use clap::Args;
use std::path::PathBuf;

/// Options of `verify`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The session: its name in the data folder, or its folder's path.
    session: PathBuf,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let report = crate::session::verify(&folder)?;
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
