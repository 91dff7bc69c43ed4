//! `grainrig doctor`.

use super::Common;
use super::output::{print, print_json};
use crate::jobs::{self, Finding, Health};
use anyhow::{Result, bail};
use std::collections::BTreeMap;

pub(super) fn run(common: &Common) -> Result<()> {
    let config = common.config()?;
    let mut failed = Ok(());
    let findings = jobs::doctor(&config, &common.data, &mut |finding| {
        // A look at hardware takes seconds: each line comes when it is known.
        if !common.json && failed.is_ok() {
            failed = print(&line(finding));
        }
    });
    failed?;
    if common.json {
        print_json(&BTreeMap::from([("findings", &findings)]))?;
    }
    let bad = findings.iter().filter(|f| f.health == Health::Bad).count();
    if bad > 0 {
        bail!("{bad} of {} checks found something that a run would fail on", findings.len());
    }
    Ok(())
}

fn line(finding: &Finding) -> String {
    let health = match finding.health {
        Health::Good => "good",
        Health::Doubtful => "doubtful",
        Health::Bad => "BAD",
        Health::Skipped => "skipped",
    };
    let remedy = finding.remedy.as_ref().map_or_else(String::new, |r| format!("\n{:<24}→ {r}", ""));
    format!("{:<12} {health:<9}  {}{remedy}\n", finding.check, finding.found)
}
