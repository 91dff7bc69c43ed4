//! Explicit dynamics: time per element and step. Run: `cargo bench --bench contact`.

mod common;

use grainrig::contact::{Body, Dynamics, Material, Plates};
use grainrig::geometry::{Ball, Point};
use grainrig::mesh::{Controls, mesh};
use std::time::Instant;

fn main() {
    let sizes: Vec<f64> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    let sizes = if sizes.is_empty() { vec![0.8, 0.36] } else { sizes };
    for coarser in sizes {
        let ball = Ball { center: Point::new(0.0, 0.0, 0.5), radius_mm: 0.5 };
        let made = mesh(&ball, &Controls::for_size(coarser), &mut |_| ()).expect("a mesh");
        for yield_mpa in [None, Some(100.0)] {
            let material = Material { yield_mpa, ..Material::default() };
            let start = Instant::now();
            let body = Body::new(&made, &material).expect("a body");
            let dynamics = Dynamics::new(&body);
            let prepared = start.elapsed().as_secs_f64();
            let dt = dynamics.stable_step_s(&body);
            println!(
                "{} elements, {} nodes, prepared {prepared:.2} s; least element {:.3e} s, body {dt:.3e} s in {:.2} s",
                body.elements(),
                body.nodes(),
                body.least_element_limit_s(),
                start.elapsed().as_secs_f64() - prepared
            );
            for threads in [1, 2] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
                let mut dynamics = dynamics.clone();
                let mut plates = Plates { lower_mm: 0.0, upper_mm: 1.0, friction: 0.2 };
                let steps = (20_000_000 / body.elements()).max(10);
                let s = pool.install(|| {
                    let start = Instant::now();
                    for _ in 0..steps {
                        dynamics.step(&body, &mut plates, [500.0, -500.0], 0.9 * dt).expect("a step");
                    }
                    start.elapsed().as_secs_f64()
                });
                println!(
                    "  yield {yield_mpa:?} threads {threads}: {:.1} ns per element and step",
                    1e9 * s / steps as f64 / body.elements() as f64
                );
            }
            let e = dynamics.energy(&body);
            let _ = e;
        }
    }
}
