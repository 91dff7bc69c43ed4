//! `grainrig reconstruct` and `grainrig replay`.

use super::Common;
use super::capture::{conclude, report};
use super::output::{print, print_json};
use super::progress::Progress;
use crate::jobs::{ReconstructOptions, ReplayOptions};
use anyhow::Result;

pub(super) fn run(common: &Common, options: &ReconstructOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    conclude(common, &outcome?)
}

pub(super) fn replay(common: &Common, options: &ReplayOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    let done = outcome?;
    if common.json {
        print_json(&done.to_json()?)?;
    } else {
        report(common, &done.finished)?;
    }
    done.check()?;
    if common.json { Ok(()) } else { print("replay     every product has the recorded bytes\n") }
}
