//! `grainrig list`, `show` and `rm`: the sessions of the data folder.

use super::output::{print, print_json, say};
use super::{Common, usage};
use crate::session::{Recording, SessionError, Summary, remove};
use anyhow::Result;
use clap::Args;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io::{BufRead as _, IsTerminal as _};
use std::path::PathBuf;

/// Options of `show`.
#[derive(Debug, Args)]
pub struct ShowArguments {
    /// The session: its name in the data folder, or its folder's path.
    session: PathBuf,
}

/// Options of `rm`.
#[derive(Debug, Args)]
pub struct RemoveArguments {
    /// Names of sessions in the data folder.
    #[arg(required = true, value_name = "NAME")]
    sessions: Vec<String>,
    /// Remove without asking.
    #[arg(long, short)]
    yes: bool,
}

/// The sessions, the newest first.
pub(super) fn list(common: &Common) -> Result<()> {
    common.named_data_is_there()?;
    let mut all = common.store().list()?;
    all.sort_by(|a, b| b.created.cmp(&a.created).then_with(|| a.name.cmp(&b.name)));
    if common.json {
        return print_json(&BTreeMap::from([("sessions", &all)]));
    }
    if all.is_empty() {
        say(format!("no session in {}; `grainrig capture NAME` makes one", common.data.display()));
    }
    let wide = all.iter().map(|s| s.name.len()).max().unwrap_or(0);
    print(&all.iter().map(|s| line(s, wide)).collect::<String>())
}

/// A session: its name, when it was made, how far it has come, what is wrong with it.
fn line(s: &Summary, wide: usize) -> String {
    let created = s.created.map_or_else(|| "?".into(), |t| t.strftime("%Y-%m-%d %H:%M").to_string());
    let state = s.state.map_or_else(|| "damaged".into(), |state| word(&json!(state)));
    let busy = if s.busy { ", in use" } else { "" };
    let damage = s.damage.as_ref().map_or_else(String::new, |d| format!("  {d}"));
    let views = format!("{} of {} views", s.captured, s.planned);
    format!("{:<wide$}  {created:<16}  {views:<14}  {state}{busy}{damage}\n", s.name)
}

/// A state as a person reads it: `no_views` is "no views".
fn word(state: &Value) -> String {
    state.as_str().unwrap_or_default().replace('_', " ")
}

/// One session: what it was made with, how far it has come, its figures and files.
pub(super) fn show(common: &Common, arguments: &ShowArguments) -> Result<()> {
    let recording = Recording::read(&common.names().session(&arguments.session)?)?;
    let about = recording.about();
    if common.json {
        return print_json(&about);
    }
    let manifest = recording.manifest();
    let mut lines = vec![
        format!("session    {}", recording.folder().display()),
        format!("made       {} by {}", manifest.created.strftime("%Y-%m-%d %H:%M:%S UTC"), manifest.software),
        format!("state      {}", word(&about["state"])),
        format!("views      {} of {}", recording.views().len(), manifest.plan.views.len()),
    ];
    lines.extend(manifest.devices.iter().map(|d| format!("device     {d}")));
    lines.extend(manifest.merged_from.iter().map(|s| format!("merged     from {}", s.name)));
    let result = &about["result"];
    if let Some(verdict) = result.pointer("/verdict/verdict").and_then(Value::as_str) {
        lines.push(format!("verdict    {verdict}"));
        let reasons = result["verdict"]["reasons"].as_array().into_iter().flatten();
        lines.extend(reasons.map(|reason| format!("           {}", reason.as_str().unwrap_or_default())));
    }
    let figure = |place: &str| result.pointer(place).and_then(Value::as_f64);
    if let (Some(volume), Some(low), Some(high)) = (
        figure("/hull/volume_estimate_mm3"),
        figure("/hull/volume_interval_mm3/0"),
        figure("/hull/volume_interval_mm3/1"),
    ) {
        lines.push(format!("volume     {volume:.4} mm³ ({low:.4} … {high:.4})"));
    }
    if let Some(hull) = figure("/hull/volume_mm3") {
        lines.push(format!("hull       {hull:.4} mm³"));
    }
    if let (Some(nodes), Some(tets)) =
        (result["mesh"]["nodes"].as_u64(), result["mesh"]["tetrahedra"].as_u64())
    {
        lines.push(format!("mesh       {nodes} nodes, {tets} tetrahedra"));
    }
    lines.extend(recording.products().map(|p| format!("file       products/{}, {} bytes", p.file, p.bytes)));
    let warnings = result["warnings"].as_array().into_iter().flatten();
    lines.extend(warnings.map(|w| format!("note       {}", w.as_str().unwrap_or_default())));
    print(&(lines.join("\n") + "\n"))
}

/// Removes sessions, once a person has said that it is meant.
pub(super) fn rm(common: &Common, arguments: &RemoveArguments) -> Result<()> {
    let store = common.store();
    // All of them before the first: a slip of the hand removes nothing. A damaged one is removed like others.
    let mut views = 0;
    for name in &arguments.sessions {
        match store.read(name) {
            Ok(recording) => views += recording.views().len(),
            Err(
                e
                @ (SessionError::Absent { .. } | SessionError::Irregular { .. } | SessionError::Name { .. }),
            ) => return Err(e.into()),
            Err(_) => {}
        }
    }
    if !arguments.yes {
        if !std::io::stdin().is_terminal() {
            return Err(usage("nothing was removed: say --yes where nobody can be asked"));
        }
        let names = arguments.sessions.join(", ");
        say(format!(
            "Remove {names} from {}, with {views} pictures that can be read, for good? [y/N]",
            common.data.display()
        ));
        let mut answer = String::new();
        std::io::stdin().lock().read_line(&mut answer)?;
        if !matches!(answer.trim(), "y" | "Y" | "yes") {
            return Err(usage("nothing was removed"));
        }
    }
    for name in &arguments.sessions {
        remove(&store, name)?;
    }
    if common.json {
        return print_json(&json!({ "removed": arguments.sessions }));
    }
    let lines: Vec<String> = arguments.sessions.iter().map(|name| format!("removed    {name}\n")).collect();
    print(&lines.concat())
}
