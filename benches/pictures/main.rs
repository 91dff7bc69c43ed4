//! The program measured on pictures whose truth is known: about a hundred sets of rendered photographs, each of one grain
//! on a pedestal, as different as laboratories take them.
//!
//! `cargo bench --bench pictures -- [NAME PART …] [--list] [--preview] [--render-only] [--slips]`
//!
//! Sets that are not there yet are rendered into `target/pictures`, or the folder that `GRAINRIG_PICTURES` names (about twenty
//! minutes of one core for all, 0.6 GB); a set whose row of the plan has changed is rendered again. Then the program, with its
//! default configuration and what an operator knows, imports each, and its outlines, hull, interval, verdicts and findings are
//! held against the truth: a row a set, then the summary; the same as `summary.csv`, and each set's worst view in `worst.png`.
//! Parts of names choose sets. `--preview` shows one picture of each (`preview.png`), `--render-only` ends after the
//! rendering. `--slips` measures instead, on the opaque sets, whether a slip of 1.5° before view 13 is found.
//! `GRAINRIG_BIN` names another build of the program.

mod bvh;
mod chance;
mod compare;
mod develop;
mod ideal;
mod light;
mod plan;
mod program;
mod render;
mod rig;
mod scene;
mod sets;
mod shade;
mod shape;
mod sheet;
mod table;
mod trace;
mod view;
mod words;

use anyhow::{Result, bail};
use plan::Row;
use program::Verdicts;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::Instant;
use table::{Figures, HEADING, csv, summary};

/// How far the grain slips, degrees; a finding counts that states as much within a third.
const SLIP_DEG: f64 = 1.5;

/// The angle at which a set is shown by `--preview`.
const PREVIEW_DEG: f64 = 36.0;

/// What is to be done.
#[derive(Default, Clone, Copy, PartialEq, Eq)]
enum Task {
    List,
    Preview,
    Render,
    #[default]
    Measure,
    Slips,
}

#[derive(Default)]
struct Asked {
    parts: Vec<String>,
    task: Task,
}

impl Asked {
    fn read() -> Result<Self> {
        let mut asked = Self::default();
        for argument in std::env::args().skip(1) {
            match argument.as_str() {
                // Cargo's own.
                "--bench" => {}
                "--list" => asked.task = Task::List,
                "--preview" => asked.task = Task::Preview,
                "--render-only" => asked.task = Task::Render,
                "--slips" => asked.task = Task::Slips,
                other if other.starts_with('-') => {
                    bail!("{other} is not known; known are --list, --preview, --render-only and --slips")
                }
                part => asked.parts.push(part.to_owned()),
            }
        }
        Ok(asked)
    }

    fn rows(&self) -> Result<Vec<Row>> {
        let all = sets::all();
        let names: BTreeSet<&str> = all.iter().map(|r| r.name).collect();
        assert_eq!(names.len(), all.len(), "two sets have one name");
        let is_chosen = |row: &Row| {
            let named = self.parts.is_empty() || self.parts.iter().any(|part| row.name.contains(part));
            named && (self.task != Task::Slips || row.is_opaque())
        };
        let rows: Vec<Row> = all.into_iter().filter(is_chosen).collect();
        if rows.is_empty() {
            bail!("no set's name has {} in it; --list lists them", self.parts.join(" or "));
        }
        Ok(rows)
    }
}

/// Where the sets are.
fn folder() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap_or(Path::new("target"));
    std::env::var_os("GRAINRIG_PICTURES").map_or_else(|| target.join("pictures"), PathBuf::from)
}

fn main() -> Result<()> {
    let asked = Asked::read()?;
    let rows = asked.rows()?;
    if asked.task == Task::List {
        rows.iter().for_each(|row| println!("{}", row.name));
        return Ok(());
    }
    let grains = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/grains"));
    if !grains.exists() {
        println!("skipped: the shapes of grains are not there ({})", grains.display());
        return Ok(());
    }
    let sets = folder();
    std::fs::create_dir_all(&sets)?;
    println!("{} sets in {}", rows.len(), sets.display());
    match asked.task {
        Task::List => Ok(()),
        Task::Preview => {
            let tile = |row: &Row| sheet::small(row.name, &render::one_picture(row, PREVIEW_DEG, grains)?);
            let tiles: Vec<_> = rows.par_iter().map(tile).collect::<Result<_>>()?;
            sheet::save(&tiles, &sets.join("preview.png"))
        }
        Task::Render => render_all(&rows, &sets, grains),
        Task::Measure => measure(&rows, &sets, grains),
        Task::Slips => slips(&rows, &sets, grains),
    }
}

fn render_all(rows: &[Row], sets: &Path, grains: &Path) -> Result<()> {
    let mut failed = 0;
    for row in rows {
        let start = Instant::now();
        match render::rendered(row, sets, grains) {
            Ok(set) => {
                let over = set.number("ideal_hull_mm3") / set.number("volume_above_pedestal_mm3") - 1.0;
                let seconds = start.elapsed().as_secs_f64();
                println!("{:<34} ideal hull {:+.2} %, {seconds:.1} s", row.name, 100.0 * over);
            }
            Err(why) => {
                failed += 1;
                println!("{:<34} cannot be rendered: {why:#}", row.name);
            }
        }
    }
    if failed > 0 {
        bail!("{failed} sets cannot be rendered");
    }
    Ok(())
}

fn measure(rows: &[Row], sets: &Path, grains: &Path) -> Result<()> {
    let (mut all, mut tiles) = (Vec::new(), Vec::new());
    println!("{HEADING}");
    for row in rows {
        let set = render::rendered(row, sets, grains)?;
        let said = program::imported(row, &set, &sets.join(".sessions"))?;
        let outlines = compare::compared(row, &set, said.result.as_ref().ok())?;
        if let Some(worst) = outlines.iter().min_by(|a, b| a.iou.total_cmp(&b.iou)) {
            tiles.push(sheet::tile(row, &set, worst)?);
        }
        let figures = Figures::new(row, &set, &said, &outlines);
        println!("{}", figures.line());
        all.push(figures);
    }
    println!("\n{}", summary(&all));
    std::fs::write(sets.join("summary.csv"), csv(&all))?;
    sheet::save(&tiles, &sets.join("worst.png"))?;
    println!("{} and worst.png beside it", sets.join("summary.csv").display());
    Ok(())
}

/// Whether slips are found.
fn slips(rows: &[Row], sets: &Path, grains: &Path) -> Result<()> {
    let mut found = 0;
    for row in rows {
        render::rendered(row, sets, grains)?;
        let row = row.clone().with(|r| r.slip_deg = SLIP_DEG);
        let set = render::rendered(&row, sets, grains)?;
        let said = program::imported(&row, &set, &sets.join(".sessions"))?;
        let text = match &said.result {
            Err(why) => format!("no result: {why}"),
            Ok(result) => {
                let verdicts = Verdicts::of(result);
                let is_found = verdicts.slips.iter().any(|deg| (deg - SLIP_DEG).abs() < SLIP_DEG / 3.0);
                found += usize::from(is_found);
                let findings = verdicts.findings.join(", ");
                format!(
                    "{}  {}, {findings}",
                    if is_found { "found" } else { "MISSED" },
                    verdicts.grade.name()
                )
            }
        };
        println!("{:<34} {text}", row.name);
    }
    let share = 100.0 * f64::from(found as u32) / rows.len() as f64;
    println!("\nslips of {SLIP_DEG}° found: {found} of {} ({share:.1} %)", rows.len());
    Ok(())
}
