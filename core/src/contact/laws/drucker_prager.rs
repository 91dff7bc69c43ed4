//! Drucker and Prager's plasticity without dilation: Y = Y₀ + H ε̄ + k p, and none below zero (p: pressure). Radial return and
//! pressure are those of `radial_return.rs`.
//!
//! Source: Drucker and Prager, Soil mechanics and plastic analysis or limit design, Quart. Appl. Math. 10, 157, 1952; k = tan β of
//! Abaqus' linear model with K = 1 and ψ = 0. In uniaxial compression it yields at Y₀/(1 − k/3). What flows keeps its volume, so
//! the work of flow is that of the deviator.

use super::radial_return::{Plastic, YieldStress};
use super::{Law, Parameter, Program};
use crate::contact::Material;
use crate::plausible::Quantity;
use std::sync::Arc;

const SLOPE: &str = "pressure_slope";

/// The law in the table.
pub(super) static LAW: Law = Law {
    name: "drucker_prager",
    legend: "Drucker-Prager",
    what: "Elastic, then plastic at a stress that grows with the pressure",
    yields: true,
    parameters: &[Parameter {
        quantity: Quantity { name: SLOPE, unit: "", low: -1e-9, high: 1.5, slips: &[] },
        option: "pressure-slope",
        usual: 0.5,
        limits: [0.0, 2.5],
        limit: "from 0 to 2.5",
        what: "Growth of the yield stress of a drucker_prager grain with the pressure",
    }],
    of: |material| Arc::new(Plastic::new(material, DruckerPrager::from(material))),
};

/// The yield stress, MPa.
#[derive(Debug)]
struct DruckerPrager {
    initial: f64,
    hardening: f64,
    slope: f64,
}

impl From<&Material> for DruckerPrager {
    fn from(material: &Material) -> Self {
        Self {
            initial: material.yield_mpa.unwrap_or(f64::INFINITY),
            hardening: material.hardening_mpa,
            slope: material.parameter(SLOPE),
        }
    }
}

impl YieldStress for DruckerPrager {
    #[inline(always)]
    fn limit_mpa(&self, strain: f64, mean_mpa: f64) -> f64 {
        (self.initial + self.hardening * strain - self.slope * mean_mpa).max(0.0)
    }

    #[inline(always)]
    fn hardening_mpa(&self) -> f64 {
        self.hardening
    }

    /// `CalculiX` has no such law. Abaqus takes the shear stress at no pressure, Y/√3.
    fn deck(&self, program: Program) -> Option<String> {
        let shear = |y: f64| y / 3f64.sqrt();
        (program == Program::Abaqus).then(|| {
            format!(
                "*DRUCKER PRAGER, SHEAR CRITERION=LINEAR\n{:.6}, 1., 0.\n*DRUCKER PRAGER HARDENING, TYPE=SHEAR\n{:.6}, 0.\n{:.6}, 1.\n",
                self.slope.atan().to_degrees(),
                shear(self.initial),
                shear(self.initial + self.hardening)
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Body, Dynamics, Plates};
    use crate::geometry::Point;
    use crate::mesh::TetMesh;

    /// Von Mises' stress and the pressure of a tetrahedron that is sheared after it was pressed or drawn out.
    fn sheared(slope: f64, volume_strain: f64) -> (f64, f64, f64) {
        let material = Material { parameters: [(SLOPE.to_owned(), slope)].into(), ..Material::default() };
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mesh = TetMesh::new(corners.map(Point::from).to_vec(), vec![[0, 1, 2, 3]]);
        let body = Body::new(&mesh, &material.by(&LAW, 100.0)).unwrap();
        let mut d = Dynamics::new(&body);
        let rest = d.positions().to_vec();
        let mut plates = Plates { lower_mm: -1e3, upper_mm: 1e3, friction: 0.0 };
        let grown = 1.0 + volume_strain / 3.0;
        let at = |n: u32| -> Vec<[f64; 3]> {
            let (grown, shear) = (if n > 0 { grown } else { 1.0 }, 1e-4 * f64::from(n));
            rest.iter().map(|x| [grown * (x[0] + shear * x[1]), grown * x[1], grown * x[2]]).collect()
        };
        let dt = 1e-9;
        for n in 0..100u32 {
            let (now, before) = (at(n), at(n.saturating_sub(1)));
            let v = now.iter().zip(&before).map(|(a, b)| [0, 1, 2].map(|k| (a[k] - b[k]) / dt)).collect();
            d.set(now, v);
            d.step(&body, &mut plates, [0.0; 2], dt).unwrap();
        }
        let fields = d.fields(&body);
        let s = fields.stress_mpa[0];
        (fields.mises_mpa()[0], -(s[0] + s[1] + s[2]) / 3.0, d.energy(&body).plastic)
    }

    #[test]
    fn what_flows_bears_as_much_as_the_pressure_allows() {
        for slope in [0.0, 0.5, 1.2] {
            let (mises, pressure, plastic) = sheared(slope, -2e-3);
            assert!(pressure > 100.0 && plastic > 0.0, "{pressure} {plastic}");
            assert!((mises / (100.0 + slope * pressure) - 1.0).abs() < 1e-9, "{slope}: {mises} {pressure}");
        }
        // Drawn out so far that nothing is left to bear shear.
        let (mises, pressure, _) = sheared(1.2, 5e-3);
        assert!(pressure < -100.0 / 1.2 && mises < 1e-6, "{mises} {pressure}");
    }

    #[test]
    fn abaqus_gets_its_angle_and_the_shear_stress_and_calculix_nothing() {
        let material = Material { hardening_mpa: 3f64.sqrt() * 100.0, ..Material::default() };
        let material = Material { parameters: [(SLOPE.to_owned(), 1.0)].into(), ..material };
        let material = material.by(&LAW, 3f64.sqrt() * 50.0);
        let deck = material.deck(Program::Abaqus).unwrap();
        assert!(deck.contains("LINEAR\n45.000000, 1., 0.\n*DRUCKER"), "{deck}");
        assert!(deck.ends_with("TYPE=SHEAR\n50.000000, 0.\n150.000000, 1.\n"), "{deck}");
        assert_eq!(material.deck(Program::Calculix), None);
        let steep = Material { parameters: [(SLOPE.to_owned(), 3.0)].into(), ..material };
        assert!(steep.check().unwrap_err().to_string().starts_with(SLOPE));
    }
}
