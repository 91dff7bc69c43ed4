//! Spheres between plates against closed forms.

use crate::bodies::{ball, graded_ball};
use grainrig::contact::{Loading, Material, Press, hertz};

#[test]
fn a_coarse_ball_comes_near_the_two_plate_form() {
    let radius = 0.4075;
    let coarser: f64 = std::env::var("COARSER").ok().map_or(1.4, |s| s.parse().unwrap());
    let material = Material::default();
    let loading = Loading { to_force_n: None, to_approach_mm: Some(0.06), ..Loading::default() };
    let mesh = match std::env::var("GRADED") {
        Ok(g) => {
            let g: Vec<f64> = g.split(',').map(|x| x.parse().unwrap()).collect();
            graded_ball(radius, g[0], g[1], g[2])
        }
        Err(_) => ball(radius, coarser),
    };
    let mut press = Press::new(&mesh, &material, 0.0, 2.0 * radius, 0.0, &loading).unwrap();
    println!(
        "{} elements, added {:.4}, step {:e}, least {:e}",
        press.body().elements(),
        press.body().added_mass(),
        press.step_s(),
        press.body().least_element_limit_s()
    );
    let start = std::time::Instant::now();
    while !press.finished() {
        let n = press.samples().len();
        let s = press.next_sample().unwrap().clone();
        let f = hertz::two_plate_force_n(&material, radius, 0.5 * s.approach_mm);
        if n % 8 == 0 || n < 5 || n % 2 == 0 && s.approach_mm > 0.02 || press.finished() {
            println!(
                "{:7.3} µm {:9.3} N ({:9.3}) {:.4} low {:.3} up {:.3} KE/IE {:.5} bal {:.2e} v {:.0} dt {:.3e} steps {} touches {} area {:.5}",
                1e3 * s.approach_mm,
                s.force_n,
                f,
                s.force_n / f,
                s.lower_n[2],
                s.upper_n[2],
                s.energy.kinetic / s.energy.internal(),
                s.energy.balance_error(),
                s.speed_mm_s,
                s.step_s,
                s.steps,
                s.touches.len(),
                s.touches.first().map_or(0.0, |t| t.area_mm2)
            );
        }
    }
    println!(
        "{:.1} s, {} steps; {:?}",
        start.elapsed().as_secs_f64(),
        press.dynamics().steps,
        press.samples().last().unwrap().energy
    );
}
