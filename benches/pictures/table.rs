//! A row a set, the summary, and the same for a spreadsheet.

use super::compare::Compared;
use super::plan::Row;
use super::program::{Grade, Said, Verdicts};
use super::render::Rendered;
use super::rig::RigFigures;
use std::fmt::Write as _;

/// What the hull may differ from the ideal hull: on nearly all sets, and on all that are called good; points of the truth.
const CLOSE: f64 = 1.0;
const GOOD: f64 = 2.0;
/// What roll and axis may be off by, degrees and pixels.
const ROLL_DEG: f64 = 0.05;
const AXIS_PX: f64 = 0.5;

/// A set's figures. Volumes in per cent over the truth.
pub struct Figures {
    name: &'static str,
    iou: [f64; 2],
    worst_view: usize,
    area: f64,
    seen: f64,
    ideal: f64,
    hull: Option<f64>,
    estimate: Option<f64>,
    interval: Option<[f64; 2]>,
    verdicts: Option<Verdicts>,
    rig: Option<RigFigures>,
    failed: Option<String>,
    is_other: bool,
    seconds: f64,
}

/// The heading of [`Figures::line`].
pub const HEADING: &str = concat!(
    "set                                seen %    IoU  worst (view)   area %  ideal %   hull-ideal  estimate",
    "        interval %     truth  views g/d/b    roll °  axis px  rise °  rim px  grade     s  findings"
);

impl Figures {
    /// Of a set, what the program says, and its outlines.
    pub fn new(row: &Row, set: &Rendered, said: &Said, outlines: &[Compared]) -> Self {
        let truth = set.number("volume_above_pedestal_mm3");
        let percent = |volume: f64| 100.0 * (volume / truth - 1.0);
        let result = said.result.as_ref().ok();
        let of = |key: &str| result?["hull"][key].as_f64().map(percent);
        let ends = result.and_then(|r| r["hull"]["volume_interval_mm3"].as_array());
        let interval = ends.and_then(|e| Some([percent(e.first()?.as_f64()?), percent(e.get(1)?.as_f64()?)]));
        let mean = |of: fn(&Compared) -> f64| outlines.iter().map(of).sum::<f64>() / outlines.len() as f64;
        let worst = outlines.iter().min_by(|a, b| a.iou.total_cmp(&b.iou));
        Self {
            name: row.name,
            iou: [mean(|c| c.iou), worst.map_or(0.0, |w| w.iou)],
            worst_view: worst.map_or(0, |w| w.view),
            area: 100.0 * mean(|c| c.area),
            seen: 100.0 * mean(|c| c.seen),
            ideal: percent(set.number("ideal_hull_mm3")),
            hull: of("volume_mm3"),
            estimate: of("volume_estimate_mm3"),
            interval,
            verdicts: result.map(Verdicts::of),
            rig: result.and_then(|r| RigFigures::new(row, set, r)),
            failed: said.result.as_ref().err().cloned(),
            is_other: outlines.iter().any(|c| c.is_other),
            seconds: said.seconds,
        }
    }

    /// Hull less ideal hull, points.
    fn off(&self) -> Option<f64> {
        Some(self.hull? - self.ideal)
    }

    fn is_within(&self, points: f64) -> bool {
        self.off().is_some_and(|off| off.abs() <= points)
    }

    fn holds_truth(&self) -> bool {
        self.interval.is_some_and(|[low, high]| low <= 0.0 && 0.0 <= high)
    }

    fn grade(&self) -> Option<Grade> {
        self.verdicts.as_ref().map(|v| v.grade)
    }

    fn findings(&self) -> &[String] {
        self.verdicts.as_ref().map_or(&[], |v| &v.findings)
    }

    /// In one line.
    pub fn line(&self) -> String {
        let mut line = format!(
            "{:<34} {:6.1} {:.4} {:.4} ({:2}) {:+8.2} {:+8.2}",
            self.name, self.seen, self.iou[0], self.iou[1], self.worst_view, self.area, self.ideal
        );
        if let Some(why) = &self.failed {
            let _ = write!(line, "   no result: {why}");
            return line;
        }
        let number = |x: Option<f64>| x.map_or("-".into(), |x| format!("{x:+.2}"));
        let interval = self.interval.map_or("-".into(), |[low, high]| format!("{low:+.1} … {high:+.1}"));
        let mark = |is: bool| if is { "in" } else { "OUT" };
        let views = self.verdicts.as_ref().map_or("-".into(), |v| v.views.map(|n| n.to_string()).join("/"));
        let rig = self.rig.as_ref().map_or_else(String::new, |r| {
            format!("{:+.3}  {:+7.2} {:+7.2} {:7.2}", r.roll.by, r.column.by, r.elevation.by, r.rim_px)
        });
        let _ = write!(
            line,
            " {:>10}{} {:>9} {interval:>17} {:>9} {views:>12}  {rig:>32}  {:<8} {:4.1}  {}{}",
            number(self.off()),
            if self.is_within(CLOSE) { " " } else { "!" },
            number(self.estimate),
            mark(self.holds_truth()),
            self.grade().map_or("-", Grade::name),
            self.seconds,
            self.findings().join(", "),
            if self.is_other { " (the program has other outlines than this build)" } else { "" },
        );
        line
    }

    fn cells(&self) -> String {
        let number = |x: Option<f64>| x.map_or(String::new(), |x| format!("{x:.4}"));
        let views = self.verdicts.as_ref().map_or([0; 3], |v| v.views);
        let warnings = self.verdicts.as_ref().map_or(&[][..], |v| &v.warnings);
        let text = |parts: &[String]| format!("\"{}\"", parts.join("; ").replace('"', "'"));
        [
            self.name.to_owned(),
            number(Some(self.seen)),
            number(Some(self.iou[0])),
            number(Some(self.iou[1])),
            self.worst_view.to_string(),
            number(Some(self.area)),
            number(Some(self.ideal)),
            number(self.hull),
            number(self.off()),
            number(self.estimate),
            number(self.interval.map(|i| i[0])),
            number(self.interval.map(|i| i[1])),
            self.holds_truth().to_string(),
            views[0].to_string(),
            views[1].to_string(),
            views[2].to_string(),
            self.grade().map_or("none", Grade::name).to_owned(),
            number(self.rig.as_ref().map(|r| r.roll.by)),
            number(self.rig.as_ref().map(|r| r.roll.sigma)),
            number(self.rig.as_ref().map(|r| r.column.by)),
            number(self.rig.as_ref().map(|r| r.column.sigma)),
            number(self.rig.as_ref().map(|r| r.elevation.by)),
            number(self.rig.as_ref().map(|r| r.elevation.sigma)),
            number(self.rig.as_ref().map(|r| r.rim_px)),
            text(self.findings()),
            number(Some(self.seconds)),
            text(self.failed.as_slice()),
            text(warnings),
        ]
        .join(",")
    }
}

/// A table for a spreadsheet: a row a set.
pub fn csv(all: &[Figures]) -> String {
    let heading = "set,outline_seen_percent,iou_mean,iou_worst,worst_view,area_percent,ideal_percent,hull_percent,\
                   hull_minus_ideal_points,\
                   estimate_percent,interval_low_percent,interval_high_percent,truth_in_interval,views_good,\
                   views_doubtful,views_bad,grade,roll_off_deg,roll_sigma_deg,axis_off_px,axis_sigma_px,\
                   elevation_off_deg,elevation_sigma_deg,rim_px,findings,seconds,no_result,warnings";
    all.iter().fold(format!("{heading}\n"), |text, f| text + &f.cells() + "\n")
}

/// What all sets come to.
pub fn summary(all: &[Figures]) -> String {
    let total = all.len().max(1);
    let share = |what: &str, those: &dyn Fn(&&Figures) -> bool| {
        let count = all.iter().filter(those).count();
        format!("{what:<64} {count:>3} of {total} ({:.1} %)\n", 100.0 * count as f64 / total as f64)
    };
    let names = |those: &dyn Fn(&&Figures) -> bool| {
        let names: Vec<&str> = all.iter().filter(those).map(|f| f.name).collect();
        if names.is_empty() { "none".into() } else { format!("{}: {}", names.len(), names.join(", ")) }
    };
    let is_good = |f: &&Figures| f.grade() == Some(Grade::Good);
    let is_right = |f: &&Figures| f.is_within(CLOSE) && f.holds_truth();
    let mut out = share("hull within 1 point of the ideal hull", &|f| f.is_within(CLOSE));
    out += &share("hull within 2 points of the ideal hull", &|f| f.is_within(GOOD));
    out += &share("truth in the interval", &|f| f.holds_truth());
    let rig = |is: fn(&RigFigures) -> bool| move |f: &&Figures| f.rig.as_ref().is_some_and(is);
    out += &share("roll within 0.05°", &rig(|r| r.roll.is_within(ROLL_DEG)));
    out += &share("axis within 0.5 px", &rig(|r| r.column.is_within(AXIS_PX)));
    out += &share("roll within two stated uncertainties", &rig(|r| r.roll.is_stated()));
    out += &share("axis within two stated uncertainties", &rig(|r| r.column.is_stated()));
    out += &share("elevation within two stated uncertainties", &rig(|r| r.elevation.is_stated()));
    out += &share("no result at all", &|f| f.failed.is_some());
    out += &share("called good", &is_good);
    let wrong = names(&|f| is_good(f) && !f.is_within(GOOD));
    let _ = writeln!(out, "called good, and the hull is more than 2 points off: {wrong}");
    let outside = names(&|f| f.hull.is_some() && f.grade() != Some(Grade::Bad) && !f.holds_truth());
    let _ = writeln!(out, "truth outside the interval, and not called bad: {outside}");
    let _ = writeln!(out, "findings where nothing slipped: {}", names(&|f| !f.findings().is_empty()));
    let timid = names(&|f| f.grade().is_some_and(|g| g == Grade::Bad) && is_right(f));
    let _ = writeln!(out, "called bad, though hull and interval are right: {timid}");
    let doubted = names(&|f| f.grade().is_some_and(|g| g == Grade::Doubtful) && is_right(f));
    let _ = writeln!(out, "called doubtful, though hull and interval are right: {doubted}");
    out
}
