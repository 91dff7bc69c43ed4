//! `grainrig devices`.

use super::Common;
use super::output::{print, print_json};
use crate::jobs::{self, DeviceLine};
use crate::rig::discovery::Role;
use anyhow::Result;
use std::collections::BTreeMap;

pub(super) fn run(common: &Common) -> Result<()> {
    let devices = jobs::devices(&common.config()?)?;
    if common.json {
        return print_json(&BTreeMap::from([("devices", &devices)]));
    }
    let lines: Vec<String> = devices.iter().map(line).collect();
    print(&lines.concat())
}

/// One device: whether it is used, what it is, and why it can't be opened.
fn line(d: &DeviceLine) -> String {
    let used = if d.configured { '*' } else { ' ' };
    let role = match d.role {
        Role::Stage => "stage",
        Role::Camera => "camera",
    };
    let path = d.path.as_ref().map_or_else(String::new, |p| format!("  {}", p.display()));
    let barred = if d.permitted { "" } else { "  (not permitted: `grainrig doctor` says what to do)" };
    let held = d.held_by.as_ref().map_or_else(String::new, |by| format!("  (held by {by})"));
    format!("{used} {role:<7} {:<19} {}{path}{barred}{held}\n", d.driver, d.name)
}
