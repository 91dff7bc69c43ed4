//! What comes of an ensemble, its files and its sheet.

use super::cases::Case;
use super::{AT, FORCES, Guessed, Interval, JobError};
use crate::jobs::{OtherCurve, stated};
use crate::session::{to_json, to_json_value, write_whole};
use grainrig_core::contact::{CurvePoint, Surrogate};
use grainrig_core::report::{Mark, Panel, Point, Series, Sheet};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::Path;

/// An error of the guesses beyond which a person should know, as a share.
const ERROR: f64 = 0.25;

/// What was drawn from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Drawing {
    /// What was pressed.
    pub source: String,
    /// How many ways were drawn.
    pub draws: usize,
    /// How many were computed by finite elements.
    pub cases: usize,
    /// Standard deviation of the tilt about either level axis, degrees.
    pub placing_deg: f64,
    /// The least and the greatest friction.
    pub friction: [f64; 2],
    /// The least and the greatest Young's modulus, MPa.
    pub young_mpa: [f64; 2],
    /// Standard deviation of the surface, µm.
    pub outline_um: f64,
    /// The share of the hull that is hollows which no view shows, by which its centre of mass is not known.
    pub hollow_share: f64,
    /// The depths to which the part that the pedestal hid was closed, mm, one as likely as the other; empty where there was none.
    pub foot_depths_mm: Vec<f64>,
    /// In how many ways the grain may lie: its rests, or one where that is stated.
    pub ways_to_lie: usize,
    /// The force at which `δ_i` is read, N.
    pub transition_n: f64,
}

/// An ensemble, as far as it came.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnsembleResult {
    /// Whether all cases were computed.
    pub finished: bool,
    /// What was drawn from.
    #[serde(flatten)]
    pub drawing: Drawing,
    /// What came of it, once all cases were computed.
    #[serde(flatten)]
    pub figures: Option<EnsembleFigures>,
    /// What was written, as it was named.
    pub files: Vec<String>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// What comes of an ensemble.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EnsembleFigures {
    /// The approach at which the force passes `transition_n` for the last time.
    pub delta_i_mm: DeltaI,
    /// What of it the plates come while they turn the grain.
    pub rocking_mm: Interval,
    /// What of it they sink in.
    pub deformation_mm: Interval,
    /// `δ_i` where one thing alone is not known, and the grain otherwise is as it was placed.
    pub alone: Vec<OneUnknown>,
    /// The band of curves.
    pub band: Vec<BandLine>,
    /// What the computed cases say of what shapes alone say.
    pub regression: Regression,
    /// Computing time of the cases, on one core each, s.
    pub core_s: f64,
}

/// `δ_i`, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DeltaI {
    /// Over all draws.
    #[serde(flatten)]
    pub interval: Interval,
    /// As a compression alone lays and presses the grain; none where that could not be computed.
    #[serde(rename = "as_placed")]
    pub as_placed_mm: Option<f64>,
}

/// `δ_i` where one thing alone is not known.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OneUnknown {
    /// What: `rest`, `placing`, `friction`, `surface`, `young`, or `regression`.
    pub what: &'static str,
    /// `δ_i`.
    pub delta_i_mm: Interval,
}

/// The approach at a force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BandLine {
    /// The force, N.
    pub force_n: f64,
    /// Where it is passed for the last time.
    pub approach_mm: Interval,
}

/// What the computed cases say of the others.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Regression {
    /// What is computed over what the shape says, at the transition's force.
    pub ratio: f64,
    /// Half of the cases are wrong by less, each foretold by the others, as a share.
    pub error: f64,
    /// What was computed over what the other cases say of it.
    pub left_out: Vec<f64>,
}

/// What the figures are made of.
pub(super) struct Figures<'a> {
    pub drawing: Drawing,
    pub all: Vec<Guessed>,
    pub chosen: Vec<usize>,
    pub as_placed: &'a Guessed,
    pub cases: Vec<Case>,
    /// At the transition's force.
    pub transition: Surrogate,
    /// At each of the forces.
    pub surrogates: Vec<Option<Surrogate>>,
    pub alone: Vec<(&'static str, Vec<Guessed>)>,
    pub beside: Vec<OtherCurve>,
    pub warnings: Vec<String>,
}

impl Figures<'_> {
    /// Computes them and writes the files; `given` is the folder as it was named.
    pub(super) fn written(mut self, folder: &Path, given: &Path) -> Result<EnsembleResult, JobError> {
        let figures = self.figures();
        self.warn(&figures);
        let sheet = self.sheet(&figures);
        let mut result = EnsembleResult {
            finished: true,
            drawing: self.drawing.clone(),
            figures: Some(figures),
            files: Vec::new(),
            warnings: self.warnings.clone(),
        };
        let png = sheet.png().map_err(|e| JobError::Encode(e.to_string()))?;
        let files = [
            ("ensemble.png", png),
            ("ensemble.svg", sheet.svg()),
            ("draws.csv", self.draws().into_bytes()),
            ("cases.csv", self.computed().into_bytes()),
        ];
        let names = files.iter().map(|(name, _)| *name).chain(["result.json"]);
        result.files = names.map(|name| given.join(name).display().to_string()).collect();
        for (name, bytes) in &files {
            write_whole(folder, name, bytes)?;
        }
        write_whole(folder, "result.json", &to_json(&stated(to_json_value(&result)?))?)?;
        Ok(result)
    }

    /// How far the plates come in a draw at one of the [`FORCES`], mm: as it was computed, where it was, else as this says.
    fn approach_mm(&self, draw: usize, at: usize, surrogate: &Surrogate) -> f64 {
        let g = &self.all[draw];
        let force_n = FORCES[at] * self.drawing.transition_n;
        let case = self.chosen.iter().position(|&k| k == draw).map(|k| &self.cases[k + 1]);
        let computed = case.and_then(|case| Some(case.rocking_mm + case.sunk_mm(force_n)?));
        computed.unwrap_or_else(|| g.drawn.approach_mm + surrogate.drawn(g.sunk_mm[at], g.drawn.place))
    }

    fn delta_i_mm(&self, draw: usize) -> f64 {
        self.approach_mm(draw, AT, &self.transition)
    }

    fn figures(&self) -> EnsembleFigures {
        let interval = |of: &dyn Fn(usize) -> f64| {
            Interval::of((0..self.all.len()).map(|draw| (of(draw), 1.0)).collect())
        };
        let rocking = |draw: usize| self.all[draw].drawn.approach_mm;
        let band = self.surrogates.iter().enumerate().filter_map(|(at, surrogate)| {
            let surrogate = surrogate.as_ref()?;
            let approach_mm = interval(&|draw| self.approach_mm(draw, at, surrogate));
            Some(BandLine { force_n: FORCES[at] * self.drawing.transition_n, approach_mm })
        });
        let surrogate = &self.transition;
        let certain = |g: &Guessed| g.drawn.approach_mm + surrogate.ratio * g.sunk_mm[AT];
        let mut alone: Vec<OneUnknown> = (self.alone.iter())
            .map(|(what, draws)| OneUnknown {
                what,
                delta_i_mm: Interval::of(draws.iter().map(|g| (certain(g), 1.0)).collect()),
            })
            .collect();
        let p = self.as_placed;
        let errors = surrogate.left_out.iter();
        let of_errors = errors.map(|e| (p.drawn.approach_mm + surrogate.ratio * e * p.sunk_mm[AT], 1.0));
        alone.push(OneUnknown { what: "regression", delta_i_mm: Interval::of(of_errors.collect()) });
        EnsembleFigures {
            delta_i_mm: DeltaI {
                interval: interval(&|draw| self.delta_i_mm(draw)),
                as_placed_mm: self.cases[0].delta_i_mm(),
            },
            rocking_mm: interval(&rocking),
            deformation_mm: interval(&|draw| self.delta_i_mm(draw) - rocking(draw)),
            alone,
            band: band.collect(),
            regression: Regression {
                ratio: surrogate.ratio,
                error: surrogate.error(),
                left_out: surrogate.left_out.clone(),
            },
            core_s: self.cases.iter().map(|c| c.wall_s).sum(),
        }
    }

    fn warn(&mut self, figures: &EnsembleFigures) {
        for (k, case) in self.cases.iter().enumerate() {
            if let Some(why) = &case.failed {
                self.warnings
                    .push(format!("case {} could not be computed and counts for nothing: {why}", k + 1));
            }
        }
        if figures.regression.error > ERROR {
            self.warnings.push(format!(
                "what is computed differs by {:.0} % from what the shape says, in half the cases: more cases (--cases) make the \
                 interval more certain, not narrower",
                100.0 * figures.regression.error
            ));
        }
    }

    /// A line for each draw.
    fn draws(&self) -> String {
        let mut out = String::from(
            "draw,surface,way_to_lie,tilt_deg,friction,young_mpa,rotate_x_deg,rotate_y_deg,rotate_z_deg,turned_deg,rocking_mm,\
             guess_mm,delta_i_mm,computed\n",
        );
        for (k, g) in self.all.iter().enumerate() {
            let (d, (x, y, z)) = (&g.drawn, g.drawn.laid.euler_angles());
            let [x, y, z] = [x, y, z].map(f64::to_degrees);
            let _ = writeln!(
                out,
                "{},{},{},{:.4},{:.4},{:.1},{x:.4},{y:.4},{z:.4},{:.4},{:.6},{:.6},{:.6},{}",
                k + 1,
                d.surface + 1,
                d.lying + 1,
                d.tilt.to_degrees(),
                d.friction,
                d.young_mpa,
                d.turned.to_degrees(),
                d.approach_mm,
                g.sunk_mm[AT],
                self.delta_i_mm(k),
                self.chosen.contains(&k)
            );
        }
        out
    }

    /// A line for each computed case.
    fn computed(&self) -> String {
        let mut out = String::from(
            "case,surface,friction,young_mpa,rotate_x_deg,rotate_y_deg,rotate_z_deg,rocking_mm,guess_mm,computed_mm,delta_i_mm,\
             tetrahedra,core_s\n",
        );
        for (k, c) in self.cases.iter().enumerate() {
            let [x, y, z] = c.rotate_deg;
            let figure = |mm: Option<f64>| mm.map_or_else(String::new, |mm| format!("{mm:.6}"));
            let _ = writeln!(
                out,
                "{},{},{:.4},{:.1},{x:.4},{y:.4},{z:.4},{:.6},{:.6},{},{},{},{:.1}",
                k + 1,
                c.surface + 1,
                c.friction,
                c.young_mpa,
                c.rocking_mm,
                c.guess_mm,
                figure(c.computed_mm),
                figure(c.delta_i_mm()),
                c.elements,
                c.wall_s
            );
        }
        out
    }

    fn sheet(&self, figures: &EnsembleFigures) -> Sheet {
        let line = |name: &str, points: Vec<Point>| Series { name: name.into(), points, joined: true };
        let um = |x_mm: f64, y: f64| Point { x: 1e3 * x_mm, y, sigma: None };
        let border = |name: &str, of: &dyn Fn(&Interval) -> f64| {
            let start = um(0.0, 0.0);
            let points = figures.band.iter().map(|b| um(of(&b.approach_mm), b.force_n));
            line(name, std::iter::once(start).chain(points).collect())
        };
        let curve = |points: &[CurvePoint]| points.iter().map(|p| um(p.approach_mm, p.force_n)).collect();
        let mut curves = vec![
            border("5 %", &|i| i.p05_mm),
            border("half", &|i| i.median_mm),
            border("95 %", &|i| i.p95_mm),
            line("as placed", curve(&self.cases[0].curve)),
        ];
        curves.extend(self.beside.iter().map(|other| line(&other.name, curve(&other.points))));
        let mut sorted: Vec<f64> = (0..self.all.len()).map(|draw| self.delta_i_mm(draw)).collect();
        sorted.sort_by(f64::total_cmp);
        let share = |k: usize| 100.0 * (k as f64 + 0.5) / sorted.len() as f64;
        let shares = sorted.iter().enumerate().map(|(k, mm)| um(*mm, share(k))).collect();
        let pairs = self.cases.iter().filter_map(|c| Some((c.guess_mm, c.computed_mm?)));
        let computed: Vec<Point> = pairs.map(|(guess, mm)| um(guess, 1e3 * mm)).collect();
        let most = computed.iter().map(|p| p.x).fold(0.0, f64::max);
        let ratio = figures.regression.ratio;
        let straight = vec![um(0.0, 0.0), um(1e-3 * most, ratio * most)];
        let rows = || figures.alone.iter().enumerate().map(|(k, a)| (figures.alone.len() - k, a));
        let medians = rows().map(|(y, a)| um(a.delta_i_mm.median_mm, y as f64));
        let half = Series { name: "half".into(), points: medians.collect(), joined: false };
        let alone = rows().map(|(y, a)| {
            let ends = [a.delta_i_mm.p05_mm, a.delta_i_mm.p95_mm].map(|mm| um(mm, y as f64));
            line(&format!("{y} {}", a.what), ends.to_vec())
        });
        let panel = |title: &str, abscissa: &str, series: Vec<Series>| Panel {
            title: title.into(),
            abscissa: abscissa.into(),
            series,
            marks: Vec::<Mark>::new(),
        };
        let panels = vec![
            panel("force, N", "approach of the plates, µm", curves),
            panel("draws below, %", "delta_i, µm", vec![line("", shares)]),
            panel(
                "delta_i from 5 to 95 % where one thing alone is not known",
                "delta_i, µm",
                std::iter::once(half).chain(alone).collect(),
            ),
            panel(
                "sunk in at the transition as computed, µm",
                "as the shape says, µm",
                vec![
                    Series { name: "cases".into(), points: computed, joined: false },
                    line(&format!("{ratio:.2} times"), straight),
                ],
            ),
        ];
        Sheet {
            title: format!("Ensemble of {}", self.drawing.source),
            panels,
            figures: lines(&self.drawing, figures),
            warnings: self.warnings.clone(),
        }
    }
}

/// What a person reads of an ensemble.
pub fn lines(drawn: &Drawing, f: &EnsembleFigures) -> Vec<String> {
    let um = |mm: f64| 1e3 * mm;
    let interval = |i: &Interval| {
        format!("{:.2} µm (5 % below {:.2}, 95 % below {:.2})", um(i.median_mm), um(i.p05_mm), um(i.p95_mm))
    };
    let as_placed =
        f.delta_i_mm.as_placed_mm.map_or_else(String::new, |mm| format!("; as placed {:.2} µm", um(mm)));
    let lies = if drawn.ways_to_lie == 1 {
        "one way to lie".into()
    } else {
        format!("{} rests by their chances", drawn.ways_to_lie)
    };
    let mut out = vec![
        format!("delta_i at {} N: {}{as_placed}", drawn.transition_n, interval(&f.delta_i_mm.interval)),
        format!("rocking {}; deformation {}", interval(&f.rocking_mm), interval(&f.deformation_mm)),
        format!(
            "{} draws: {lies}, laid askew by {:.2}°, friction {} to {}, E {:.0} to {:.0} MPa, surface known to {:.2} µm, \
             {:.1} % of it hollow",
            drawn.draws,
            drawn.placing_deg,
            drawn.friction[0],
            drawn.friction[1],
            drawn.young_mpa[0],
            drawn.young_mpa[1],
            drawn.outline_um,
            100.0 * drawn.hollow_share
        ),
    ];
    if let [least, .., most] = sorted(&drawn.foot_depths_mm)[..] {
        out.push(format!("the hidden foot closed {:.1} to {:.1} µm deep", um(least), um(most)));
    }
    out.extend(f.alone.iter().map(|a| format!("{} alone: {}", a.what, interval(&a.delta_i_mm))));
    out.push(format!(
        "{} cases by finite elements in {:.0} core seconds: {:.2} times what the shape says, half of them within {:.0} % when left out",
        drawn.cases,
        f.core_s,
        f.regression.ratio,
        100.0 * f.regression.error
    ));
    out
}

fn sorted(values: &[f64]) -> Vec<f64> {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values
}
