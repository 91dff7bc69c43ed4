//! Material parameters: isotropic elasticity, a yield stress with linear hardening, and what a law takes of its own.

use super::laws::{LAWS, Law};
use super::{ContactError, Program};
use crate::plausible::{self, Doubt};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Above this Poisson's ratio a four-node tetrahedron with a pressure of its own locks, and the time step goes to
/// zero with the bulk wave.
const MOST_POISSON: f64 = 0.495;

/// An isotropic material, and the law by which it answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus E, MPa.
    pub young_mpa: f64,
    /// Poisson's ratio ν.
    pub poisson: f64,
    /// Density ρ, t/mm³ (quartz: 2.65e-9).
    pub density_t_mm3: f64,
    /// Yield stress Y in uniaxial tension, MPa; none for an elastic material.
    pub yield_mpa: Option<f64>,
    /// Slope of the yield stress against the equivalent plastic strain, MPa; 0 is perfect plasticity.
    pub hardening_mpa: f64,
    /// The law; none for the first of [`LAWS`] that fits, elastic or von Mises' by whether there is a yield stress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<&'static Law>,
    /// Parameters of the law's own, by name; one that is left out has its usual value.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<String, f64>,
}

impl Default for Material {
    /// The elastic grain of Nadimi and Fonseca (2017): E = 100 GPa, ν = 0.22, and quartz' density.
    fn default() -> Self {
        Self {
            young_mpa: 100e3,
            poisson: 0.22,
            density_t_mm3: 2.65e-9,
            yield_mpa: None,
            hardening_mpa: 0.0,
            law: None,
            parameters: BTreeMap::new(),
        }
    }
}

impl Material {
    /// The law by which it answers.
    pub fn law(&self) -> &'static Law {
        self.law.unwrap_or_else(|| self.usual_law())
    }

    fn usual_law(&self) -> &'static Law {
        LAWS.into_iter().find(|law| law.yields == self.yield_mpa.is_some()).unwrap_or(LAWS[0])
    }

    /// The same by another law, with this yield stress where it takes one.
    #[must_use]
    pub fn by(mut self, law: &'static Law, yield_mpa: f64) -> Self {
        self.yield_mpa = law.yields.then_some(yield_mpa);
        self.law = Some(law).filter(|law| *law != self.usual_law());
        self
    }

    /// A parameter of the law's own: as given, or the usual one.
    pub fn parameter(&self, name: &str) -> f64 {
        let usual = || self.law().parameters.iter().find(|p| p.quantity.name == name).map(|p| p.usual);
        self.parameters.get(name).copied().or_else(usual).unwrap_or(f64::NAN)
    }

    /// The lines of a deck's material that say how it answers; none where the program has no such law.
    pub fn deck(&self, program: Program) -> Option<String> {
        (self.law().of)(self).deck(program)
    }

    /// What of its figures no laboratory has.
    pub fn doubts(&self) -> Vec<Doubt> {
        let own = self.law().parameters.iter();
        [
            plausible::YOUNG.doubt(self.young_mpa),
            plausible::POISSON.doubt(self.poisson),
            plausible::DENSITY.doubt(self.density_t_mm3),
            self.yield_mpa.and_then(|y| plausible::YIELD.doubt(y)),
            plausible::HARDENING.doubt(self.hardening_mpa).filter(|_| self.law().yields),
        ]
        .into_iter()
        .chain(own.map(|p| p.quantity.doubt(*self.parameters.get(p.quantity.name)?)))
        .flatten()
        .collect()
    }

    /// Lamé's first parameter λ, MPa.
    pub fn lambda_mpa(&self) -> f64 {
        self.young_mpa * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
    }

    /// The shear modulus μ, MPa.
    pub fn shear_mpa(&self) -> f64 {
        0.5 * self.young_mpa / (1.0 + self.poisson)
    }

    /// The bulk modulus κ, MPa.
    pub fn bulk_mpa(&self) -> f64 {
        self.young_mpa / (3.0 * (1.0 - 2.0 * self.poisson))
    }

    /// The modulus against a rigid partner, E* = E/(1−ν²), MPa.
    pub fn contact_modulus_mpa(&self) -> f64 {
        self.young_mpa / (1.0 - self.poisson * self.poisson)
    }

    /// The speed of pressure waves in the bulk, mm/s.
    pub fn pressure_wave_mm_s(&self) -> f64 {
        ((self.lambda_mpa() + 2.0 * self.shear_mpa()) / self.density_t_mm3).sqrt()
    }

    /// The speed of shear waves, mm/s.
    pub fn shear_wave_mm_s(&self) -> f64 {
        (self.shear_mpa() / self.density_t_mm3).sqrt()
    }

    /// Whether such a material can be computed.
    ///
    /// # Errors
    /// [`ContactError::Setting`] for a modulus, density or yield stress that is not positive and finite, a Poisson's ratio
    /// outside (−1, 0.495), hardening that is negative, a parameter outside its law's limits; [`ContactError::Parameter`] for one
    /// that its law does not take.
    pub fn check(&self) -> Result<(), ContactError> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let bad = |name, value, unit, limit, remedy| {
            Err(ContactError::Setting { name, value, unit, limit, remedy })
        };
        if !positive(self.young_mpa) {
            return bad(
                "young_mpa",
                self.young_mpa,
                "MPa",
                "positive and finite",
                "quartz has about 100000 MPa",
            );
        }
        if !(self.poisson > -1.0 && self.poisson < MOST_POISSON) {
            let remedy =
                "quartz has about 0.22; 0.5 and above is no material, just below it nothing is compressed";
            return bad("poisson", self.poisson, "", "above -1 and below 0.495", remedy);
        }
        if !positive(self.density_t_mm3) || self.density_t_mm3 > 1e-6 {
            let remedy = "it is in tonnes per mm³: quartz, 2650 kg/m³, has 2.65e-9";
            return bad("density_t_mm3", self.density_t_mm3, "t/mm³", "positive and at most 1e-6", remedy);
        }
        if let Some(y) = self.yield_mpa
            && !positive(y)
        {
            return bad(
                "yield_mpa",
                y,
                "MPa",
                "positive and finite",
                "give the stress at which it flows, or take an elastic material",
            );
        }
        if !(self.hardening_mpa >= 0.0 && self.hardening_mpa.is_finite()) {
            let remedy = "0 is perfect plasticity";
            return bad("hardening_mpa", self.hardening_mpa, "MPa", "not negative, and finite", remedy);
        }
        self.law().check(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_moduli_are_those_of_hooke() {
        let m = Material::default();
        assert!((m.bulk_mpa() - (m.lambda_mpa() + 2.0 / 3.0 * m.shear_mpa())).abs() < 1e-9);
        assert!((m.contact_modulus_mpa() - 105_086.0).abs() < 1.0);
        assert!((m.pressure_wave_mm_s() / 6.564e6 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn what_is_no_material_is_refused_by_name() {
        let good = Material::default();
        assert_eq!(good.check(), Ok(()));
        for (bad, name) in [
            (Material { poisson: 0.5, ..good.clone() }, "poisson"),
            (Material { poisson: f64::NAN, ..good.clone() }, "poisson"),
            (Material { yield_mpa: Some(0.0), ..good.clone() }, "yield_mpa"),
            (Material { yield_mpa: Some(-1.0), ..good.clone() }, "yield_mpa"),
            (Material { density_t_mm3: 2650.0, ..good.clone() }, "density_t_mm3"),
            (Material { young_mpa: -1.0, ..good.clone() }, "young_mpa"),
            (Material { hardening_mpa: -1.0, ..good.clone() }, "hardening_mpa"),
        ] {
            let text = bad.check().unwrap_err().to_string();
            assert!(text.starts_with(name), "{text}");
        }
    }
}
