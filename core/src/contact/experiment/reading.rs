//! Evaluation of a grain's first loading in a test record: the force's zero, where the platen met the grain, where the crosshead
//! turned round, and where the force passed the transition.
//!
//! ```text
//!   force │                                ╱│ end: the crosshead turns round, or the record ends
//!         │  first crossing          δ_i ╱
//!   2 N   ├ ─ ─ ─ ─ ╱╲─ ─ ─ ─ ─ ─ ─ ─ ╱─ ─
//!         │        ╱  ╲              ╱
//!   contact ┄┄┄┄┄┄╱┄┄┄┄╲____________╱        five standard deviations of the noise above zero
//!   zero  │~~~~~~│                           its noise and drift, before contact
//!         └──────┴──────────────────────── displacement
//!                0 = approach
//! ```
//!
//! Nothing is measured by the largest force: how far somebody went on pressing shows nothing of how the grain was met.

use super::{Compliance, Experiment, ExperimentError};
use crate::contact::CurvePoint;
use serde::{Deserialize, Serialize};

/// The force is off its zero where it is so many standard deviations of the noise from it.
const SIGMAS: f64 = 5.0;
/// So many rows in a row must be: a single spike is no contact.
const RUN: usize = 3;
/// Rows that the first look at the noise takes; fewer where the force rises before.
const FIRST: usize = 8;
/// Rows before a drift is distinguished from the noise.
const DRIFT: usize = 16;
/// So often the rows before contact are looked at again without those just before it.
const AGAIN: usize = 3;
/// Rows without which there is no noise to speak of.
const LEAST: usize = 3;
/// The rise that is drawn back to zero has so many rows at least, and ends at so many thresholds.
const RISE: usize = 5;
const FAINT: f64 = 20.0;
/// Powers of the approach with which a force may rise: a flat or tilting grain, a smooth round one (Hertz), a rough one.
const POWERS: [f64; 3] = [1.0, 1.5, 2.0];
/// The least threshold over the transition's force: what no load cell of that range resolves.
const LEAST_CONTACT: f64 = 0.002;

/// Why a loading ended where it did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoadingEnd {
    /// The crosshead turned round.
    TurnedRound,
    /// There are no more rows.
    RecordEnds,
}

/// What was read off a test, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// The approach at which the force passes `transition_n` for the last time on its way up, mm from contact, without the
    /// machine's give; none where it never gets there.
    pub delta_i_mm: Option<f64>,
    /// The approach at which it passes `transition_n` for the first time, mm: less than `delta_i_mm` where it fell again.
    pub first_crossing_mm: Option<f64>,
    /// The force at which `δ_i` is read, N.
    pub transition_n: f64,
    /// What the machine showed before contact, N, in the file's own sign: the force's zero.
    pub zero_n: f64,
    /// Standard deviation of the force before contact, N; none where too few rows lie before it.
    pub noise_n: Option<f64>,
    /// How far the force must be above its zero for contact, N.
    pub contact_n: f64,
    /// Displacement at contact, mm, in the file's own sign: the approach's zero, where the first rise is zero when it is drawn back.
    pub contact_mm: f64,
    /// How far apart rows are there, mm: contact is not known better.
    pub spacing_mm: f64,
    /// Rows before contact, on which the zero rests.
    pub rows_before: usize,
    /// Rows from contact to the end of the loading.
    pub rows_loading: usize,
    /// All rows of the record.
    pub rows: usize,
    /// Why the loading ended.
    pub end: LoadingEnd,
    /// The approach there, mm.
    pub end_mm: f64,
    /// The largest force of the loading, N.
    pub largest_n: f64,
    /// Compliance taken off, µm/N.
    pub compliance_um_per_n: f64,
    /// What a person should know.
    pub notes: Vec<String>,
}

/// The rows before contact.
struct Before {
    /// The first row that is not.
    met: usize,
    zero: f64,
    noise: Option<f64>,
    threshold: f64,
    /// By how much the zero drifted until contact, N.
    drift: f64,
}

impl Experiment {
    /// The first loading and what is read off it at `transition_n`: compression positive, from where the platen met the grain
    /// to where the crosshead turned round, the machine's give taken off.
    ///
    /// # Errors
    /// [`ExperimentError::Short`] where the force never leaves its noise, or too few rows follow contact.
    pub fn read_off(
        &self,
        compliance: &Compliance,
        transition_n: f64,
    ) -> Result<(Vec<CurvePoint>, Reading), ExperimentError> {
        let rows = self.force_n.len().min(self.displacement_mm.len());
        if let Some(once) = self.once() {
            let (curve, mut reading) = once.read_off(compliance, transition_n)?;
            reading.notes.push(format!(
                "{} rows repeat the one before them and count once",
                rows - once.force_n.len()
            ));
            reading.rows = rows;
            return Ok((curve, reading));
        }
        let first = self.force_n.first().copied().unwrap_or(0.0);
        // A grain between platens can only be pressed: the way in which the force goes farthest is compression.
        let (low, high) = (self.force_n.iter())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(*f), h.max(*f)));
        let sign = if high - first >= first - low { 1.0 } else { -1.0 };
        let force: Vec<f64> = self.force_n.iter().map(|f| sign * f).collect();
        let before = before(&force, transition_n)
            .ok_or(ExperimentError::Short { rows, what: "and the force never leaves its noise" })?;
        // The last row that lies within the noise, before those that are above it.
        let quiet = before.zero + before.threshold / SIGMAS;
        let from = (0..before.met).rfind(|&i| force[i] <= quiet).unwrap_or(before.met.saturating_sub(1));
        let (end, why) = self.turn(from);
        let way = self.way(from);
        let start_mm = self.origin(&force, from, &before, way);
        let spacing_mm = {
            let next = (from + 1).min(rows - 1);
            (self.displacement_mm[next] - self.displacement_mm[from]).abs()
        };
        let from = (0..=from).rfind(|&i| way * (self.displacement_mm[i] - start_mm) <= 0.0).unwrap_or(0);
        let curve: Vec<CurvePoint> = (from..end)
            .map(|i| {
                let force_n = force[i] - before.zero;
                let given_mm = 1e-3 * compliance.um_per_n * force_n;
                CurvePoint { approach_mm: way * (self.displacement_mm[i] - start_mm) - given_mm, force_n }
            })
            .collect();
        if curve.len() < LEAST {
            return Err(ExperimentError::Short { rows: curve.len(), what: "in the first loading" });
        }
        let crossings = crossings(&curve, transition_n, before.threshold);
        let mut reading = Reading {
            delta_i_mm: crossings.map(|c| c.1),
            first_crossing_mm: crossings.map(|c| c.0),
            transition_n,
            zero_n: sign * before.zero,
            noise_n: before.noise,
            contact_n: before.threshold,
            contact_mm: start_mm,
            spacing_mm,
            rows_before: before.met.min(from + 1),
            rows_loading: curve.len(),
            rows,
            end: why,
            end_mm: curve.last().map_or(0.0, |p| p.approach_mm),
            largest_n: curve.iter().map(|p| p.force_n).fold(f64::NEG_INFINITY, f64::max),
            compliance_um_per_n: compliance.um_per_n,
            notes: Vec::new(),
        };
        reading.notes = notes(&reading, &before, &curve);
        Ok((curve, reading))
    }

    /// The record without rows that repeat the one before, where a tenth of them do and more: they would look like less noise.
    fn once(&self) -> Option<Self> {
        let rows = || self.displacement_mm.iter().zip(&self.force_n);
        let mut once = Self { displacement_mm: Vec::new(), force_n: Vec::new() };
        let mut before = None;
        for row in rows() {
            if before == Some(row) {
                // The third of the kind is a record of its own: a machine at rest shows the same again and again.
                before = None;
            } else {
                once.displacement_mm.push(*row.0);
                once.force_n.push(*row.1);
                before = Some(row);
            }
        }
        (10 * (self.force_n.len() - once.force_n.len()) >= self.force_n.len().max(10)).then_some(once)
    }

    /// Where the grain was met, mm: the first rise above the noise, drawn back to zero by the law that fits it best. A
    /// load cell shows nothing of the first micrometre of a round contact.
    fn origin(&self, force: &[f64], from: usize, before: &Before, way: f64) -> f64 {
        let Before { met, zero, threshold, .. } = *before;
        let known = self.displacement_mm[from];
        let point = |i: usize| [way * (self.displacement_mm[i] - known), force[i] - zero];
        let mut most = 0.0f64;
        let end = (met..force.len())
            .find(|&i| {
                let f = force[i] - zero;
                most = most.max(f);
                (i >= met + RISE && f > FAINT * threshold) || f < most - threshold
            })
            .unwrap_or(force.len());
        let rise: Vec<[f64; 2]> = (met..end).map(point).filter(|p| p[1] > threshold).collect();
        // As many quiet rows before, which the right law passes as well.
        let all: Vec<[f64; 2]> = (met.saturating_sub(rise.len())..end).map(point).collect();
        if before.noise.is_none() || rise.len() < RISE {
            return known;
        }
        let fits = POWERS.map(|power| back(&rise, &all, power));
        let best = fits.into_iter().flatten().min_by(|a, b| a[1].total_cmp(&b[1]));
        // It lies about as far before the last quiet row as that lies before the first loud one.
        let most = way * (self.displacement_mm[met] - known);
        best.map_or(known, |[at, _]| known + way * at.clamp(-most.max(0.0), most.max(0.0)))
    }

    /// The sense in which the displacement goes once the grain is met: that of its farthest point from there.
    fn way(&self, from: usize) -> f64 {
        let start = self.displacement_mm[from];
        let noise = self.jitter_mm();
        // The first row that is clearly elsewhere: an unloading may go farther back than the loading went.
        let moved = self.displacement_mm[from..].iter().find(|d| (*d - start).abs() > noise);
        if moved.is_none_or(|d| *d >= start) { 1.0 } else { -1.0 }
    }

    /// The row after the farthest before the crosshead turned round, and whether it did.
    fn turn(&self, from: usize) -> (usize, LoadingEnd) {
        let (way, back) = (self.way(from), self.jitter_mm());
        let mut farthest = from;
        for (i, d) in self.displacement_mm.iter().enumerate().skip(from) {
            let beyond = way * (d - self.displacement_mm[farthest]);
            if beyond >= 0.0 {
                farthest = i;
            } else if -beyond > back {
                return (farthest + 1, LoadingEnd::TurnedRound);
            }
        }
        (self.force_n.len().min(self.displacement_mm.len()), LoadingEnd::RecordEnds)
    }

    /// What the displacement may go back by without having turned, mm: its noise, from 0.1 µm to 2 µm (rows at uneven times
    /// look like noise, and no encoder has more).
    fn jitter_mm(&self) -> f64 {
        let bends = self.displacement_mm.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]);
        (SIGMAS * spread(&bends.collect::<Vec<_>>()) / 6f64.sqrt()).clamp(1e-4, 2e-3)
    }
}

/// Looks for contact from the record's beginning; none where the force never leaves its noise.
fn before(force: &[f64], transition_n: f64) -> Option<Before> {
    let floor = LEAST_CONTACT * transition_n;
    let begin = median(force[..force.len().min(5)].to_vec());
    // Rows by which it has surely risen are no noise, however few there are.
    let risen = force.iter().position(|f| f - begin > 0.5 * transition_n);
    let first = FIRST.min(risen.unwrap_or(force.len()));
    // Not by the median here: of eight rows it is too small now and then, and a spike does no harm.
    let bends: Vec<f64> = force[..first].windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect();
    let noise = (bends.iter().map(|b| b * b).sum::<f64>() / (6.0 * bends.len().max(1) as f64)).sqrt();
    // As many of the first rows as show no rise but for noise and a slow drift.
    let calm = (LEAST..=first).rev().find(|&n| {
        let rise = slope(&force[..n]) * (n - 1) as f64;
        rise.abs() <= (SIGMAS * noise).max(0.005 * transition_n)
    });
    let Some(mut known) = calm else {
        return Some(Before { met: 0, zero: force[0], noise: None, threshold: floor, drift: 0.0 })
            .filter(|_| force.iter().any(|f| f - force[0] > floor));
    };
    let mut again = 0;
    loop {
        let rest = &force[..known];
        // A drift that does not stand out of the noise is none.
        let slope = Some(slope(rest))
            .filter(|s| known >= DRIFT && s.abs() * known as f64 > SIGMAS * self::noise(rest))
            .unwrap_or(0.0);
        let level: Vec<f64> = rest.iter().enumerate().map(|(i, f)| f - slope * i as f64).collect();
        let at_first = median(level.clone());
        let around = spread(&level).max(self::noise(rest));
        let threshold = (SIGMAS * around).max(1.5 * step(rest)).max(floor);
        let line = |i: usize| at_first + slope * i as f64;
        // No farther than twice the rows that the line rests on.
        let reach = (2 * known).min(force.len());
        let above = |i: usize| force[i] - line(i) > threshold;
        // Noise alone makes a run now and then, which soon ends; what rises fast or stays is none.
        let stays = |i: usize| {
            let next = i..(i + FIRST).min(force.len());
            let fast = force[i..(i + RUN).min(force.len())].iter().any(|f| f - line(i) > 0.5 * transition_n);
            fast || 4 * next.clone().filter(|&j| above(j)).count() >= 3 * next.len()
        };
        let met = (0..reach).find(|&i| (i..(i + RUN).min(force.len())).all(above) && stays(i));
        if let Some(met) = met {
            // The rows just before may be the contact's beginning, taken for a drift.
            let surely = met * 4 / 5;
            if again < AGAIN && surely >= LEAST && surely != known {
                (again, known) = (again + 1, surely);
                continue;
            }
            return Some(Before {
                met,
                zero: line(met),
                noise: Some(around),
                threshold,
                drift: line(met) - at_first,
            });
        }
        if reach == force.len() {
            return None;
        }
        known = reach;
    }
}

/// First and last crossing of a force on the way up, mm. Crossings between which the force fell by less than its noise are one,
/// at their middle.
fn crossings(curve: &[CurvePoint], force_n: f64, noise_n: f64) -> Option<(f64, f64)> {
    let below = force_n - noise_n.min(0.5 * force_n);
    let mut groups: Vec<(f64, f64)> = Vec::new();
    let mut fell = true;
    for w in curve.windows(2) {
        if w[0].force_n < below {
            fell = true;
        }
        if w[0].force_n < force_n && w[1].force_n >= force_n {
            let part = (force_n - w[0].force_n) / (w[1].force_n - w[0].force_n);
            let at = w[0].approach_mm + part * (w[1].approach_mm - w[0].approach_mm);
            match groups.last_mut() {
                Some(group) if !fell => group.1 = at,
                _ => groups.push((at, at)),
            }
            fell = false;
        }
    }
    let middle = |g: &(f64, f64)| 0.5 * (g.0 + g.1);
    groups.first().map(middle).zip(groups.last().map(middle))
}

/// Where k (x − x₀)^power is zero for the k and x₀ that fit the rise best, and the mean square of what is left of all rows, N².
fn back(rise: &[[f64; 2]], all: &[[f64; 2]], power: f64) -> Option<[f64; 2]> {
    let n = rise.len() as f64;
    let y = |p: &[f64; 2]| p[1].powf(1.0 / power);
    let (mx, my) = (rise.iter().map(|p| p[0]).sum::<f64>() / n, rise.iter().map(y).sum::<f64>() / n);
    let sxx: f64 = rise.iter().map(|p| (p[0] - mx).powi(2)).sum();
    let sxy: f64 = rise.iter().map(|p| (p[0] - mx) * (y(p) - my)).sum();
    let slope = sxy / sxx;
    if !(slope.is_finite() && slope > 0.0) {
        return None;
    }
    let at = mx - my / slope;
    let left = |p: &[f64; 2]| p[1] - (slope * (p[0] - at).max(0.0)).powf(power);
    Some([at, all.iter().map(|p| left(p).powi(2)).sum::<f64>() / all.len() as f64])
}

/// What a person should know of a reading.
fn notes(r: &Reading, before: &Before, curve: &[CurvePoint]) -> Vec<String> {
    let mut out = Vec::new();
    let n = r.transition_n;
    match r.delta_i_mm {
        None => out.push(format!(
            "the first loading never passes {n} N: it ends at {:.3} N, where {}; no δ_i can be read",
            r.largest_n,
            match r.end {
                LoadingEnd::TurnedRound => "the crosshead turns round (rows after that are not used)",
                LoadingEnd::RecordEnds => "the record ends",
            }
        )),
        Some(d) => {
            let last = curve.last().map_or(0.0, |p| p.force_n);
            if last < n - r.contact_n {
                out.push(format!("after δ_i the force falls below {n} N again, and the loading ends there: the rise did not last"));
            }
            let top = curve.iter().take_while(|p| p.approach_mm < d).map(|p| p.force_n).fold(0.0, f64::max);
            if top > 2.0 * n {
                out.push(format!(
                    "the force had reached {top:.3} N before it fell and passed {n} N again: if the grain broke there, the first \
                     crossing is its δ_i"
                ));
            }
        }
    }
    if r.noise_n.is_none() {
        out.push(
            "the record begins in contact: the force's zero is its first row, and the approach counts from there; record some rows \
             before the platen touches"
                .into(),
        );
    } else if r.rows_before < FIRST {
        out.push(format!(
            "only {} rows lie before contact: the force's zero is not well known",
            r.rows_before
        ));
    }
    if r.contact_n > 0.5 * n {
        out.push(format!(
            "the noise before contact is large: contact is called at {:.3} N, against {n} N",
            r.contact_n
        ));
    }
    if before.drift.abs() > 0.125 * n {
        out.push(format!(
            "the force drifts by {:.3} N before contact is called: tare later, or the grain is loaded from the start",
            before.drift
        ));
    }
    if r.delta_i_mm.is_some_and(|d| r.spacing_mm > 0.2 * d.abs()) {
        out.push(format!(
            "rows are {:.2} µm apart at contact: δ_i is not known better; record more often",
            1e3 * r.spacing_mm
        ));
    }
    out
}

/// Standard deviation of the noise, N, whatever the slope: from second differences, which a straight line has none of.
fn noise(force: &[f64]) -> f64 {
    spread(&force.windows(3).map(|w| w[0] - 2.0 * w[1] + w[2]).collect::<Vec<_>>()) / 6f64.sqrt()
}

/// The smallest step between different values, N: what the instrument resolves.
fn step(force: &[f64]) -> f64 {
    let steps = force.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 0.0);
    steps.min_by(f64::total_cmp).unwrap_or(0.0)
}

/// The median of the slopes of pairs half the rows apart, N a row (after Theil and Sen): neither spikes nor noise move it much.
fn slope(force: &[f64]) -> f64 {
    let half = force.len() / 2;
    if half == 0 {
        return 0.0;
    }
    median((0..force.len() - half).map(|i| (force[i + half] - force[i]) / half as f64).collect())
}

/// The standard deviation by the median of the distances from the median: outliers do not move it.
fn spread(values: &[f64]) -> f64 {
    let middle = median(values.to_vec());
    1.4826 * median(values.iter().map(|v| (v - middle).abs()).collect())
}

/// The middle value; zero of none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { 0.0 } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}
