//! `grainrig import`.

use super::Common;
use super::capture::conclude;
use super::progress::Progress;
use crate::jobs::ImportOptions;
use anyhow::Result;

pub(super) fn run(common: &Common, options: &ImportOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.configured(&progress)?);
    progress.finish();
    conclude(common, &outcome?)
}
