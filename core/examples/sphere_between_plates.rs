//! An elastic sphere of 0.8 mm between two rigid plates, against Hertz and the closed form for two plates.
//!
//! `cargo run --release -p grainrig-core --example sphere_between_plates`

use grainrig_core::contact::{Loading, Material, Press, Sample, hertz};
use grainrig_core::geometry::{Ball, Point};
use grainrig_core::mesh::{Controls, mesh};
use std::error::Error;

const RADIUS_MM: f64 = 0.4;

/// Runs it; the last force over that of the two-plate form.
///
/// # Errors
/// A mesh or a loading that can't be computed.
pub fn run() -> Result<f64, Box<dyn Error>> {
    let ball = Ball { center: Point::origin(), radius_mm: RADIUS_MM };
    // Elements of 25 µm where the plates touch, 150 µm elsewhere.
    let controls = Controls {
        surface_size_mm: 0.15,
        tet_volume_mm3: 0.5 * 0.15_f64.powi(3),
        size_at_contact_mm: Some(0.025),
        contact_depth_mm: Some(0.005),
        ..Controls::for_size(2.0 * RADIUS_MM)
    };
    let tets = mesh(&ball, &controls, &mut |_| ())?;
    // 100 GPa and a Poisson's ratio of 0.22; without friction, until the plates have come nearer by 12 µm.
    let material = Material::default();
    let loading = Loading { to_force_n: None, to_approach_mm: Some(0.012), ..Loading::default() };
    let mut press = Press::new(&tets, &material, 0.0, 2.0 * RADIUS_MM, 0.0, &loading)?;
    while !press.finished() {
        press.next_sample()?;
    }
    println!("approach, µm   force, N   Hertz, N   two plates, N");
    let mut ratio = 0.0;
    // In the first micrometres a few nodes carry everything: the law wants a contact of many.
    let later = |sample: &&Sample| sample.approach_mm > 0.006;
    for sample in press.samples().iter().filter(later) {
        // Each plate comes half the way.
        let each_mm = 0.5 * sample.approach_mm;
        let law = hertz::force_n(&material, RADIUS_MM, each_mm);
        let form = hertz::two_plate_force_n(&material, RADIUS_MM, each_mm);
        ratio = sample.force_n / form;
        println!("{:12.2} {:10.3} {law:10.3} {form:15.3}", 1e3 * sample.approach_mm, sample.force_n);
    }
    Ok(ratio)
}

#[allow(dead_code)]
fn main() -> Result<(), Box<dyn Error>> {
    run().map(|_| ())
}
