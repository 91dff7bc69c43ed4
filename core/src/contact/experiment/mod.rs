//! The laboratory's own compression test, from the exports of Instron's Bluehill.
//!
//! The layouts differ (encodings, decimal commas, preambles, where units stand, signs); [`read`] takes those it knows and refuses
//! what it doesn't, with the header: a unit is never guessed. [`Experiment::read_off`] makes a curve to compare with: force and
//! approach from where the platen meets the grain, positive in compression, with the machine's own give taken off; and says what
//! it took for zero, contact and end.

mod reading;
mod table;

use super::CurvePoint;
pub use reading::{LoadingEnd, Reading};
use table::Table;

/// Below this part of the largest force a plate-on-plate run is bedding in.
const BEDDING: f64 = 0.3;
/// The transition's usual force, N: it sets what a load cell of that range resolves.
const TRANSITION_N: f64 = 2.0;

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
    #[error("{rows} rows of numbers, {what}; at least 5 are needed, of which 3 after contact")]
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
        let (curve, _) = plates.read_off(&Self::none(), TRANSITION_N)?;
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

#[cfg(test)]
mod tests;
