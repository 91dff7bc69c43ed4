//! A number with its standard uncertainty and where it comes from.

use serde::{Deserialize, Serialize};

/// Where a number comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    /// Measured from the pictures.
    Measured,
    /// Given by the user.
    Given,
    /// Neither: a convention, or the rig's nominal value.
    Assumed,
    /// The pictures do not show it, and it was not given.
    NotObservable,
}

/// A number with its standard uncertainty; the unit stands in the name of whatever holds it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The number; `None` where there is none.
    pub value: Option<f64>,
    /// Its standard uncertainty (one standard deviation, the value's unit); `None` where nobody knows it.
    pub sigma: Option<f64>,
    /// Where it comes from.
    pub how: How,
}

impl Measured {
    /// Measured from the pictures.
    // Named as its siblings are, after where the number comes from.
    #[allow(clippy::self_named_constructors)]
    pub fn measured(value: f64, sigma: f64) -> Self {
        Self { value: Some(value), sigma: Some(sigma), how: How::Measured }
    }

    /// Given by the user, with its uncertainty where that was given too.
    pub fn given(value: f64, sigma: Option<f64>) -> Self {
        Self { value: Some(value), sigma, how: How::Given }
    }

    /// Taken for granted.
    pub fn assumed(value: f64, sigma: Option<f64>) -> Self {
        Self { value: Some(value), sigma, how: How::Assumed }
    }

    /// Not shown by the pictures.
    pub fn not_observable() -> Self {
        Self { value: None, sigma: None, how: How::NotObservable }
    }
}
