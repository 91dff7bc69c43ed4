//! The laboratory's own compression test, from the exports of Instron's Bluehill.
//!
//! The layouts differ (encodings, decimal commas, preambles, where units stand, signs); [`read`] takes those it knows and refuses
//! what it doesn't, with the header: a unit is never guessed. [`Experiment::read_off`] makes a curve to compare with: force and
//! approach from where the platen meets the grain, positive in compression, with the machine's own give taken off; and states what
//! it took for zero, contact and end.

mod error;
mod reading;
mod table;

use super::CurvePoint;
pub use error::ExperimentError;
pub use reading::{LoadingEnd, Reading};
use table::Table;

/// Below this part of the largest force a plate-on-plate run is bedding in.
const BEDDING: f64 = 0.3;
/// The transition's usual force, N: it sets what a load cell of that range resolves.
const TRANSITION_N: f64 = 2.0;

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
