//! `grainrig devices`.

use super::{Common, print_json};
use crate::daemon;
use anyhow::Result;

pub(super) fn run(common: &Common) -> Result<()> {
    let devices = daemon::devices(&common.config()?)?;
    if common.json {
        return print_json(&devices);
    }
    for d in devices {
        println!("{:<7} {:<10} {}", d.role, d.kind, d.name);
    }
    Ok(())
}
