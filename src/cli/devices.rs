//! `grainrig devices`.

use super::Common;
use super::output::{print, print_json};
use crate::daemon;
use anyhow::Result;

pub(super) fn run(common: &Common) -> Result<()> {
    let devices = daemon::devices(&common.config()?)?;
    if common.json {
        return print_json(&devices);
    }
    let lines: Vec<String> =
        devices.iter().map(|d| format!("{:<7} {:<10} {}\n", d.role, d.kind, d.name)).collect();
    print(&lines.concat())
}
