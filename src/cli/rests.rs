//! `grainrig rests`.

use super::Common;
use super::output::{print, print_json, say};
use super::progress::Progress;
use crate::jobs::{Askew, RestsOptions};
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
    if let Some(e) = &found.ensemble {
        let mut depths = e.foot_depths_mm.clone();
        depths.sort_by(f64::total_cmp);
        let foot = match &depths[..] {
            [least, .., most] => {
                format!(", the hidden foot closed {:.1} to {:.1} µm deep", 1e3 * least, 1e3 * most)
            }
            _ => String::new(),
        };
        let _ = writeln!(
            text,
            "Laid askew by {}° (standard deviation, about each level axis), {} times in each rest, frictions of {} to {}{foot}:\n\
             {:>4} {:>8} {:>27} {:>13}",
            e.placing_deg,
            e.draws,
            e.friction[0],
            e.friction[1],
            "rest",
            "chance",
            "rocking µm: 5 % … 50 % … 95 %",
            "plates turn"
        );
        let row = |name: &str, chance: f64, i: &Askew| {
            let [low, middle, high] =
                [i.rocking_mm.p05_mm, i.rocking_mm.median_mm, i.rocking_mm.p95_mm].map(|mm| 1e3 * mm);
            let turned = 100.0 * i.rocks_share;
            format!(
                "{name:>4} {:>6.1} % {low:>9.2} … {middle:>6.2} … {high:>6.2} {turned:>11.0} %\n",
                100.0 * chance
            )
        };
        for r in &found.rests {
            text.extend(r.askew.as_ref().map(|i| row(&r.rest.to_string(), r.chance, i)));
        }
        text += &row("all", 1.0, &e.askew);
    }
    for line in &found.files {
        let _ = writeln!(text, "{line}");
    }
    print(&text)
}
