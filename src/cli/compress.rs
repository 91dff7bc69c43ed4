//! `grainrig compress`.

use super::Common;
use super::output::{print, print_json, say};
use super::progress::{Progress, percent};
use super::signals::stop_flag;
use crate::jobs::{
    CompressOptions, CompressProgress, CompressResult, Context, EnsembleOptions, EnsembleSpread,
    ensemble_lines, experiment_lines, rocking_line, transition_line,
};
use crate::session::to_json_value;
use anyhow::Result;
use clap::Args;
use grainrig_core::contact::CurvePoint;
use std::path::Path;

/// Options of `compress`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[command(flatten)]
    grain: CompressOptions,
    #[command(flatten)]
    spread: EnsembleSpread,
}

pub(super) fn run(common: &Common, arguments: &Arguments) -> Result<()> {
    if arguments.spread.draws.is_some() {
        let (grain, spread) = (arguments.grain.clone(), arguments.spread.clone());
        return ensemble(common, &EnsembleOptions { grain, spread });
    }
    one(common, &arguments.grain)
}

fn ensemble(common: &Common, options: &EnsembleOptions) -> Result<()> {
    let stop = stop_flag("stopping; the same command again goes on with the cases that are missing");
    let progress = Progress::new();
    let context = Context { stop, ..common.context(&progress) };
    let outcome = options.run(&context);
    progress.finish();
    let result = outcome?;
    for w in &result.warnings {
        say(format!("warning: {w}"));
    }
    if common.json {
        return print_json(&to_json_value(&result)?);
    }
    let mut lines = vec![format!("grain      {}", result.drawing.source)];
    match &result.figures {
        Some(figures) => lines.extend(ensemble_lines(&result.drawing, figures)),
        None => {
            lines.push("interrupted: the same command again goes on with the cases that are missing".into());
        }
    }
    lines.extend(result.files);
    print(&(lines.join("\n") + "\n"))
}

fn one(common: &Common, options: &CompressOptions) -> Result<()> {
    let stop =
        stop_flag("stopping; the same command again, or `grainrig compress --resume`, goes on from there");
    let context = Context { stop, ..common.context(&Progress::new()) };
    let bar = percent("compressing");
    let meshing = percent("");
    let mut phase = String::new();
    let begun = options.begin(&context, &mut |now, done| set_up(&meshing, &mut phase, now, done));
    meshing.finish_and_clear();
    let mut compression = begun?;
    let (elements, nodes, step_s) = compression.size();
    say(format!("{elements} tetrahedra, {nodes} nodes, steps of {:.3} ns", 1e9 * step_s));
    if compression.done() > 0.0 {
        say(format!("going on from the checkpoint at {:.0} %", 100.0 * compression.done()));
    }
    if let Some(line) = compression.settings().goes_on() {
        say(line);
    }
    let mut said = None;
    let result = compression.run(&context.stop, &mut |p| show(&bar, &mut said, &p));
    bar.finish_and_clear();
    let result = result?;
    for w in &result.warnings {
        say(format!("warning: {w}"));
    }
    let folder = compression.folder();
    if common.json {
        return print_json(&CompressOptions::to_json(&result, folder)?);
    }
    print(&summary(&result, folder))
}

/// What is done before the plates move: the bar, or where nobody sees one a line for each thing.
fn set_up(bar: &indicatif::ProgressBar, phase: &mut String, now: &str, done: f64) {
    if phase != now {
        now.clone_into(phase);
        if bar.is_hidden() {
            say(now);
        } else {
            bar.set_message(now.to_owned());
        }
    }
    bar.set_position((100.0 * done) as u64);
}

/// The bar, or where nobody sees one a line for each twentieth of the way.
fn show(bar: &indicatif::ProgressBar, said: &mut Option<u32>, p: &CompressProgress) {
    let s = p.sample;
    let left = p.left_s.map_or_else(String::new, |s| format!(", about {} s left", s.ceil()));
    let line =
        format!("{:.3} µm, {:.3} N, {} contacts{left}", 1e3 * s.approach_mm, s.force_n, s.touches.len());
    bar.set_position((100.0 * p.done) as u64);
    let twentieth = (20.0 * p.done) as u32;
    if !bar.is_hidden() {
        bar.set_message(line);
    } else if said.is_none_or(|said| twentieth > said) {
        // The first sample as well: it shows that the plates move.
        *said = Some(twentieth);
        say(format!("{:3.0} %: {line}", 100.0 * p.done));
    }
}

/// What a person reads.
fn summary(r: &CompressResult, folder: &Path) -> String {
    let last = r.curve.last().copied().unwrap_or(CurvePoint { approach_mm: 0.0, force_n: 0.0 });
    let mut lines = vec![
        format!("grain      {}", r.settings.source),
        format!("mesh       {} tetrahedra, {} nodes", r.elements, r.nodes),
        format!(
            "run        {} steps of {:.3} ns in {:.1} s, {:.2} % of mass added",
            r.steps,
            1e9 * r.step_s,
            r.wall_s,
            100.0 * r.added_mass
        ),
        format!("curve      {:.4} N at {:.3} µm of approach", last.force_n, 1e3 * last.approach_mm),
    ];
    lines.extend(r.settings.rocking.as_ref().map(|rocking| format!("rocking    {}", rocking_line(rocking))));
    match &r.transition {
        Some(t) => {
            let parts = r.deformation_mm.filter(|_| r.settings.rocked_mm() > 0.0).map_or_else(
                String::new,
                |deformed| {
                    format!(
                        "; {:.2} µm of rocking and {:.2} µm of deformation",
                        1e3 * r.settings.rocked_mm(),
                        1e3 * deformed
                    )
                },
            );
            lines.push(format!("δ_i        at {} N: {}{parts}", r.settings.transition_n, transition_line(t)));
        }
        None => {
            lines
                .push(format!("δ_i        not known: the force does not pass {} N", r.settings.transition_n));
        }
    }
    if let Some(h) = &r.hertz {
        lines.push(format!(
            "Hertz      E* = {:.0} MPa at half the height, or R = {:.4} mm at the material's E*; residual {:.3} N",
            h.contact_modulus_mpa, h.radius_mm, h.residual_n
        ));
    }
    if let Some(ratio) = r.over_two_plate_form {
        lines.push(format!("form       {ratio:.4} of the two-plate form at the end"));
    }
    if r.settings.placed_deg.iter().any(|angle| *angle != 0.0) {
        let [x, y, z] = r.settings.placed_deg;
        lines.push(format!("placed     --rotate-deg {x:.4} {y:.4} {z:.4}"));
    }
    let e = &r.energy;
    lines.push(format!(
        "energy     plates' work {:.4e} N·mm, internal {:.4e}, kinetic {:.2e}; {}",
        e.external,
        e.internal,
        e.kinetic,
        e.balance_error.map_or_else(
            || "before the contacts have formed".to_owned(),
            |b| format!("unaccounted {b:.1e} of the work")
        )
    ));
    if let Some(q) = &r.quasi_static {
        lines.push(format!(
            "motion     at most {} of the internal energy, at {:.2} µm, since contacts had formed at {:.2} µm",
            q.share(),
            1e3 * q.at_mm,
            1e3 * q.formed_mm
        ));
    }
    lines.push(format!(
        "contacts   {} in all, {} at the end; the grain turned by {:.3}°",
        r.contacts.len(),
        r.contacts.iter().filter(|c| c.died_mm.is_none()).count(),
        r.rotation_deg
    ));
    if let Some(e) = &r.experiment {
        lines.extend(experiment_lines(e));
        lines.extend(e.reading.notes.iter().map(|n| format!("note       experiment: {n}")));
    }
    lines.push(format!("folder     {}", folder.display()));
    lines.push(format!("files      {}", r.files.join(", ")));
    lines.join("\n") + "\n"
}
