//! Explicit dynamics: nanoseconds per element and step, with each instruction set that the processor has; the program takes the
//! last. Run: `cargo bench --bench contact` (about two minutes).
//!
//! The yardstick is the machine's memory: a triad a = b + s c over arrays far larger than the caches, on as many threads. An
//! elastic element moves about 150 bytes a step through memory where the mesh is larger than the caches.

use grainrig_core::contact::{Body, Dynamics, Instructions, Material, Plates};
use grainrig_core::geometry::{Ball, Point};
use grainrig_core::mesh::{Controls, mesh};
use rayon::prelude::*;
use std::time::Instant;

/// Elements and steps of one figure, multiplied.
const WORK: usize = 10_000_000;
/// Numbers in each array of the triad.
const TRIAD: usize = 16_000_000;

/// Gigabytes a second of a triad on the threads of the pool that this runs in; the best of five.
fn bandwidth() -> f64 {
    let (b, c) = (vec![1.0f64; TRIAD], vec![2.0f64; TRIAD]);
    let mut a = vec![0.0f64; TRIAD];
    let best = (0..5).map(|_| {
        let start = Instant::now();
        let parts = a.par_chunks_mut(1 << 16).zip(b.par_chunks(1 << 16)).zip(c.par_chunks(1 << 16));
        parts.for_each(|((a, b), c)| a.iter_mut().zip(b).zip(c).for_each(|((a, b), c)| *a = b + 3.0 * c));
        start.elapsed().as_secs_f64()
    });
    24e-9 * TRIAD as f64 / best.fold(f64::INFINITY, f64::min)
}

fn main() {
    let pools: Vec<_> =
        [1, 2].map(|n| (n, rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool"))).into();
    for (threads, pool) in &pools {
        println!("memory, {threads} thread(s): {:.1} GB/s", pool.install(bandwidth));
    }
    for coarser in [0.8, 0.36] {
        let ball = Ball { center: Point::new(0.0, 0.0, 0.5), radius_mm: 0.5 };
        let made = mesh(&ball, &Controls::for_size(coarser), &mut |_| ()).expect("a mesh");
        for yield_mpa in [None, Some(100.0)] {
            let mut body = Body::new(&made, &Material { yield_mpa, ..Material::default() }).expect("a body");
            let fresh = Dynamics::new(&body);
            let step_s = 0.9 * fresh.stable_step_s(&body);
            let steps = (WORK / body.elements()).max(10);
            for set in Instructions::available() {
                body.instructions = set;
                let mut one = f64::NAN;
                for (threads, pool) in &pools {
                    let mut dynamics = fresh.clone();
                    let mut plates = Plates { lower_mm: 0.0, upper_mm: 1.0, friction: 0.2 };
                    let seconds = pool.install(|| {
                        let start = Instant::now();
                        for _ in 0..steps {
                            dynamics.step(&body, &mut plates, [500.0, -500.0], step_s).expect("a step");
                        }
                        start.elapsed().as_secs_f64()
                    });
                    let each = 1e9 * seconds / steps as f64 / body.elements() as f64;
                    if *threads == 1 {
                        one = each;
                    }
                    println!(
                        "{:8} elements, {:7}, {:>8}, {threads} thread(s): {each:5.1} ns per element and step, {:.2} x one thread, {} bytes each",
                        body.elements(),
                        if yield_mpa.is_some() { "plastic" } else { "elastic" },
                        set.to_string(),
                        one / each,
                        (body.bytes() + dynamics.bytes()) / body.elements()
                    );
                }
            }
        }
    }
}
