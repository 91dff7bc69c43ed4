//! `grainrig focus`.

use super::output::{print, print_json};
use super::{Common, signals};
use crate::jobs::{self, Focused};
use crate::rig::Frame;
use crate::session::write_whole;
use anyhow::{Context as _, Result};
use clap::Args;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Arguments of `focus`.
#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Pictures to look at; without it, until Ctrl-C.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pictures: Option<u64>,
    /// Keep the newest picture in this file, which is never half a one: a viewer that reloads it shows live view.
    #[arg(long, value_name = "FILE")]
    save: Option<PathBuf>,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    let config = common.config()?;
    let stop = signals::stop_flag("stopping after this picture");
    let mut all = Vec::new();
    let mut failed = Ok(());
    jobs::focus(&config, &mut |focused, frame| {
        failed = show(common, arguments, focused, frame);
        all.push(focused.clone());
        let enough = arguments.pictures.is_some_and(|n| all.len() as u64 >= n);
        if failed.is_err() || enough || stop.load(Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    })?;
    failed?;
    if common.json { print_json(&BTreeMap::from([("pictures", &all)])) } else { Ok(()) }
}

fn show(common: &Common, arguments: &Arguments, focused: &Focused, frame: &Frame) -> Result<()> {
    if let Some(file) = &arguments.save {
        let folder = file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let name =
            file.file_name().and_then(|n| n.to_str()).context("--save names no file; give it a name")?;
        write_whole(folder, name, &frame.bytes)?;
    }
    if common.json {
        return Ok(());
    }
    print(&line(focused))
}

fn line(f: &Focused) -> String {
    let share = if f.best > 0.0 { 100.0 * f.sharpness / f.best } else { 0.0 };
    let blur = f.blur_px.map_or_else(
        || "no grain is found".to_owned(),
        |px| format!("the grain's outline is blurred by {px:.2} px"),
    );
    format!("{:>5}  sharpness {:.3e}, {share:>3.0} % of the best; {blur}\n", f.picture, f.sharpness)
}
