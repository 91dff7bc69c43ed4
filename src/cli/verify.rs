//! `grainrig verify`.

use super::{Common, print_json};
use anyhow::{Result, bail};
use clap::Args;
use std::path::PathBuf;

/// Options of `verify`.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Session: its name in the data folder, or its folder.
    session: PathBuf,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let folder = super::session_folder(common, &arguments.session)?;
    let report = crate::session::verify(&folder)?;
    if common.json {
        print_json(&report)?;
    }
    let faults = report.faults.len();
    if faults == 0 {
        if !common.json {
            println!("{}: every file has the recorded bytes", folder.display());
        }
        return Ok(());
    }
    for fault in &report.faults {
        eprintln!("{fault}");
    }
    bail!("{faults} faults in {}; restore the named files from a backup", folder.display())
}
