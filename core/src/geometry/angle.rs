//! Angles as a type of their own: a mix-up of degrees and radians moves hardware.

use serde::{Deserialize, Serialize};

/// An angle, in radians inside and in degrees where a person reads or writes it.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Angle(f64);

impl Angle {
    /// From radians.
    pub const fn from_rad(rad: f64) -> Self {
        Self(rad)
    }
    /// From degrees.
    pub const fn from_deg(deg: f64) -> Self {
        Self(deg.to_radians())
    }
    /// In radians.
    pub const fn rad(self) -> f64 {
        self.0
    }
    /// In degrees.
    pub const fn deg(self) -> f64 {
        self.0.to_degrees()
    }
}

impl std::ops::Add for Angle {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl std::ops::Sub for Angle {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl std::ops::Mul<f64> for Angle {
    type Output = Self;
    fn mul(self, k: f64) -> Self {
        Self(self.0 * k)
    }
}

impl std::ops::Neg for Angle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl std::fmt::Display for Angle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.3}°", self.deg())
    }
}
