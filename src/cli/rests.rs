//! `grainrig rests`.

use super::Common;
use super::output::{print, print_json, say};
use super::progress::Progress;
use crate::jobs::RestsOptions;
use crate::session::to_json_value;
use anyhow::Result;
use std::fmt::Write as _;

pub(super) fn run(common: &Common, options: &RestsOptions) -> Result<()> {
    let progress = Progress::new();
    let outcome = options.run(&common.context(&progress));
    progress.finish();
    let found = outcome?;
    for w in &found.warnings {
        say(format!("warning: {w}"));
    }
    if common.json {
        return print_json(&to_json_value(&found)?);
    }
    let mut text = format!(
        "Rests of {} that take a lift of {:.2} µm and more to leave; plates of friction {}\n{:>4} {:>8} {:>10} {:>9} {:>5} {:>8} {:>11} {:>9}\n",
        found.source,
        1e3 * found.least_lift_mm,
        found.friction,
        "rest",
        "chance",
        "height mm",
        "lift µm",
        "feet",
        "gap",
        "rocking µm",
        "turned"
    );
    // Writing to a string cannot fail.
    for r in &found.rests {
        let lift = r.lift_mm.map_or_else(|| "lowest".to_owned(), |mm| format!("{:.2}", 1e3 * mm));
        let end = match (r.rocks, r.held_by_friction) {
            (false, true) => "friction holds it",
            (false, false) => "stands",
            (true, true) => "until friction holds it",
            (true, false) => "until it stands",
        };
        let foot = if r.on_foot { '*' } else { ' ' };
        let photographed = if r.rest == found.as_photographed { "; as photographed" } else { "" };
        let _ = writeln!(
            text,
            "{:>4}{foot}{:>6.1} % {:>10.4} {:>9} {:>5} {:>7.2}° {:>11.2} {:>8.2}°  {end}{photographed}",
            r.rest,
            100.0 * r.chance,
            r.height_mm,
            lift,
            r.feet_mm.len(),
            r.gap_deg,
            1e3 * r.rocking_mm,
            r.rocking_deg
        );
    }
    for line in &found.files {
        let _ = writeln!(text, "{line}");
    }
    print(&text)
}
