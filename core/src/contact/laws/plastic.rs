//! Von Mises' plasticity (J2) with linear hardening: Y = Y₀ + H ε̄. Radial return and pressure are those of `radial_return.rs`.

use super::radial_return::{Plastic, YieldStress};
use super::{Law, Program};
use crate::contact::Material;
use std::sync::Arc;

/// The law in the table.
pub(super) static LAW: Law = Law {
    name: "plastic",
    legend: "elastic-plastic",
    what: "Elastic, then perfectly plastic",
    yields: true,
    parameters: &[],
    of: |material| Arc::new(Plastic::new(material, VonMises::from(material))),
};

/// Von Mises' yield stress, MPa.
#[derive(Debug)]
struct VonMises {
    initial: f64,
    hardening: f64,
}

impl From<&Material> for VonMises {
    /// What does not yield yields at no stress.
    fn from(material: &Material) -> Self {
        Self { initial: material.yield_mpa.unwrap_or(f64::INFINITY), hardening: material.hardening_mpa }
    }
}

impl YieldStress for VonMises {
    #[inline(always)]
    fn limit_mpa(&self, strain: f64, _mean_mpa: f64) -> f64 {
        self.initial + self.hardening * strain
    }

    #[inline(always)]
    fn hardening_mpa(&self) -> f64 {
        self.hardening
    }

    fn deck(&self, _program: Program) -> Option<String> {
        Some(format!("*PLASTIC\n{}, 0.\n{}, 1.\n", self.initial, self.initial + self.hardening))
    }
}
