//! From a body to tetrahedra and an Abaqus deck: a body may be any function that is negative inside, here two balls that overlap.
//!
//! `cargo run --release -p grainrig-core --example body_to_abaqus > grain.inp`

use grainrig_core::formats::inp;
use grainrig_core::geometry::{Aabb, Ball, ImplicitBody, Point};
use grainrig_core::mesh::{Controls, mesh};
use std::error::Error;

/// Two balls as one body: where either is negative.
struct Twin([Ball; 2]);

impl ImplicitBody for Twin {
    fn value(&self, p: &Point) -> f64 {
        self.0.iter().map(|b| b.value(p)).fold(f64::INFINITY, f64::min)
    }
    fn bounds(&self) -> Aabb {
        let [a, b] = [self.0[0].bounds(), self.0[1].bounds()];
        Aabb { min: a.min.inf(&b.min), max: a.max.sup(&b.max) }
    }
}

/// Runs it; the deck, and the mesh's least dihedral angle in degrees.
///
/// # Errors
/// A mesh that breaks a control, or a body that has none.
pub fn run() -> Result<(String, f64), Box<dyn Error>> {
    let ball = |x: f64, radius_mm: f64| Ball { center: Point::new(x, 0.0, radius_mm), radius_mm };
    let grain = Twin([ball(-0.2, 0.4), ball(0.25, 0.3)]);
    // Sizes that suit a grain of 1 mm; one of them changed. They are promises: a mesh that breaks one is an error.
    let controls = Controls { surface_size_mm: 0.05, ..Controls::for_size(1.0) };
    let tets = mesh(&grain, &controls, &mut |_| ())?;
    let quality = tets.quality();
    eprintln!(
        "{} nodes, {} tetrahedra, {:.4} mm³, dihedral angles from {:.1}°",
        tets.nodes.len(),
        tets.tets.len(),
        tets.volume_mm3(),
        quality.dihedral_deg.min
    );
    // Nodes within 20 µm of the lowest and the highest place become the sets BOTTOM and TOP.
    let mut deck = Vec::new();
    inp::write(&tets, &["two balls that overlap".into()], 0.02, &mut deck)?;
    Ok((String::from_utf8(deck)?, quality.dihedral_deg.min))
}

#[allow(dead_code)]
fn main() -> Result<(), Box<dyn Error>> {
    print!("{}", run()?.0);
    Ok(())
}
