//! The laboratory's own compression test, from the exports of Instron's Bluehill.
//!
//! The layouts differ (encodings, decimal commas, preambles, where units stand, signs); [`read`] takes those it knows and refuses
//! what it doesn't, with the header: a unit is never guessed. [`Experiment::curve`] makes a curve to compare with: force and
//! approach from where the platen meets the grain, positive in compression, with the machine's own give taken off.

mod table;

use super::CurvePoint;
use table::Table;

/// The part of the largest force at which the platen counts as having met the grain.
const CONTACT: f64 = 0.02;
/// A fall by this part of the force reached so far ends the first loading.
const REVERSAL: f64 = 0.2;
/// Below this part of the largest force a plate-on-plate run is bedding in.
const BEDDING: f64 = 0.3;

/// Why a file is no usable test.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// No column of displacement or force.
    #[error(
        "no column of {what} is known in the header `{header}`; known are {known} (in English or Chinese): export the channel \
         under one of these names"
    )]
    Column {
        /// What is missing.
        what: &'static str,
        /// The header as it stands.
        header: String,
        /// Names that are known.
        known: &'static str,
    },
    /// A unit that is not known, or none.
    #[error(
        "the unit `{unit}` of {what} is not known in the header `{header}`; known are {known}: export in one of these"
    )]
    Unit {
        /// Of what.
        what: &'static str,
        /// The unit.
        unit: String,
        /// The header as it stands.
        header: String,
        /// Units that are known.
        known: &'static str,
    },
    /// A line that is no row of numbers.
    #[error("line {line}: `{text}` is no number; the header is `{header}`")]
    Number {
        /// The line, from 1.
        line: usize,
        /// What stands there.
        text: String,
        /// The header.
        header: String,
    },
    /// Too little to compare.
    #[error("{rows} rows of numbers, {what}; at least 5 that rise are needed")]
    Short {
        /// Rows found.
        rows: usize,
        /// What is missing.
        what: &'static str,
    },
    /// A compliance that makes no sense.
    #[error(
        "a compliance of {value} µm/N: it must be zero or more, and finite; a stiff machine has 0.01 to 0.1 µm/N"
    )]
    Compliance {
        /// What was given or measured.
        value: f64,
    },
}

/// A test as the machine recorded it: displacement in mm and force in N, with the signs of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Displacement of the platen, mm.
    pub displacement_mm: Vec<f64>,
    /// Force, N.
    pub force_n: Vec<f64>,
}

/// How much the machine itself gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compliance {
    um_per_n: f64,
}

impl Compliance {
    /// A machine that does not give.
    pub fn none() -> Self {
        Self { um_per_n: 0.0 }
    }

    /// A known compliance, µm/N.
    ///
    /// # Errors
    /// [`ExperimentError::Compliance`] where it is negative or no number.
    pub fn given(um_per_n: f64) -> Result<Self, ExperimentError> {
        if um_per_n.is_finite() && um_per_n >= 0.0 {
            Ok(Self { um_per_n })
        } else {
            Err(ExperimentError::Compliance { value: um_per_n })
        }
    }

    /// From a run of plate on plate: the slope of the displacement against the force once the plates have bedded in.
    ///
    /// # Errors
    /// [`ExperimentError`] where the run does not load the plates, or the slope is negative.
    pub fn measured(plates: &Experiment) -> Result<Self, ExperimentError> {
        let curve = plates.curve(&Self::none())?;
        let most = curve.iter().map(|p| p.force_n).fold(0.0, f64::max);
        let used: Vec<&CurvePoint> = curve.iter().filter(|p| p.force_n >= BEDDING * most).collect();
        let n = used.len() as f64;
        if used.len() < 3 {
            return Err(ExperimentError::Short { rows: used.len(), what: "loaded plates" });
        }
        let (mf, md) = (
            used.iter().map(|p| p.force_n).sum::<f64>() / n,
            used.iter().map(|p| p.approach_mm).sum::<f64>() / n,
        );
        let sff: f64 = used.iter().map(|p| (p.force_n - mf).powi(2)).sum();
        let sfd: f64 = used.iter().map(|p| (p.force_n - mf) * (p.approach_mm - md)).sum();
        Self::given(1e3 * sfd / sff)
    }

    /// The compliance, µm/N.
    pub fn um_per_n(&self) -> f64 {
        self.um_per_n
    }
}

/// Reads an export.
///
/// # Errors
/// [`ExperimentError`]: a column, a unit or a number that is not known; nothing is guessed.
pub fn read(bytes: &[u8]) -> Result<Experiment, ExperimentError> {
    let table = Table::read(bytes)?;
    if table.displacement_mm.len() < 5 {
        return Err(ExperimentError::Short { rows: table.displacement_mm.len(), what: "too few" });
    }
    Ok(Experiment { displacement_mm: table.displacement_mm, force_n: table.force_n })
}

impl Experiment {
    /// The first loading as a curve: compression positive, the force's zero and the approach's zero taken before the platen
    /// meets the grain (2 % of the largest force), the machine's give taken off.
    ///
    /// # Errors
    /// [`ExperimentError::Short`] where the force does not change.
    pub fn curve(&self, compliance: &Compliance) -> Result<Vec<CurvePoint>, ExperimentError> {
        let rows = self.force_n.len();
        let first = self.force_n[0];
        // A grain between platens can only be pressed: the way in which the force goes farthest is compression.
        let (low, high) = (self.force_n.iter())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), f| (l.min(*f), h.max(*f)));
        let sign = if high - first >= first - low { 1.0 } else { -1.0 };
        let force: Vec<f64> = self.force_n.iter().map(|f| sign * f).collect();
        let most = force.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let range = most - force[0];
        if range <= 0.0 {
            return Err(ExperimentError::Short { rows, what: "and the force does not change" });
        }
        let met = force.iter().position(|f| f - force[0] > CONTACT * range).unwrap_or(rows);
        let mut before: Vec<f64> = force[..met].to_vec();
        before.sort_by(f64::total_cmp);
        let zero = before.get(before.len() / 2).copied().unwrap_or(force[0]);
        let mut reached = f64::NEG_INFINITY;
        let mut end = rows;
        for (i, f) in force.iter().enumerate().skip(met) {
            reached = reached.max(*f);
            if reached - zero > 0.05 * range && reached - f > REVERSAL * (reached - zero) {
                end = i;
                break;
            }
        }
        let top = (met..end).max_by(|a, b| force[*a].total_cmp(&force[*b])).map_or(end, |i| i + 1);
        let from = met.saturating_sub(1);
        let start_mm = self.displacement_mm[from];
        let way = if self.displacement_mm[top.max(1) - 1] >= start_mm { 1.0 } else { -1.0 };
        let curve: Vec<CurvePoint> = (from..top)
            .map(|i| {
                let force_n = force[i] - zero;
                let given_mm = 1e-3 * compliance.um_per_n * force_n;
                CurvePoint { approach_mm: way * (self.displacement_mm[i] - start_mm) - given_mm, force_n }
            })
            .collect();
        if curve.len() < 5 {
            return Err(ExperimentError::Short { rows: curve.len(), what: "in the first loading" });
        }
        Ok(curve)
    }
}

#[cfg(test)]
mod tests;
