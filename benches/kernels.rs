//! The five kernels that most of the time goes into, each on one core: its time, and its instructions, of which a busy machine
//! takes no notice. Run: `cargo bench --bench kernels` (three minutes).
//!
//! Valgrind's cachegrind counts this program with the kernel run once and run twice; the difference is one run without what
//! prepares it. Where valgrind is not installed that is said, and times stand alone.

mod common;

use common::{median_s, rig, views};
use grainrig::rig::Camera as _;
use grainrig::rig::simulated::open;
use grainrig_core::contact::{Body, Dynamics, Material, Plates};
use grainrig_core::formats::decode;
use grainrig_core::geometry::{Ball, Point};
use grainrig_core::hull::{HullGrid, find_bounds};
use grainrig_core::mesh::{Controls, TetMesh, mesh};
use grainrig_core::silhouette;
use std::hint::black_box;
use std::process::Command;

/// What is run, and of how much.
const KERNELS: [(&str, &str); 5] = [
    ("elastic", "200 steps of a ball"),
    ("plastic", "200 steps of a ball"),
    ("silhouette", "a picture of 1296 x 864"),
    ("hull", "12 views, 120 cells"),
    ("mesh", "a ball"),
];
const STEPS: usize = 200;

fn ball() -> TetMesh {
    let ball = Ball { center: Point::new(0.0, 0.0, 0.5), radius_mm: 0.5 };
    mesh(&ball, &Controls::for_size(2.0), &mut |_| ()).expect("a mesh")
}

/// Prepares a kernel; each call runs it once, on what it was given before.
fn kernel(name: &str) -> Box<dyn FnMut()> {
    match name {
        "elastic" | "plastic" => {
            let yield_mpa = (name == "plastic").then_some(100.0);
            let body = Body::new(&ball(), &Material { yield_mpa, ..Material::default() }).expect("a body");
            let fresh = Dynamics::new(&body);
            let step_s = 0.9 * fresh.stable_step_s(&body);
            Box::new(move || {
                let mut dynamics = fresh.clone();
                let mut plates = Plates { lower_mm: 0.0, upper_mm: 1.0, friction: 0.2 };
                for _ in 0..STEPS {
                    dynamics.step(&body, &mut plates, [500.0, -500.0], step_s).expect("a step");
                }
                black_box(dynamics);
            })
        }
        "silhouette" => {
            let (_, mut camera, _) = open(&rig(1296, 864)).expect("the built-in grain");
            let picture = decode(&camera.capture().expect("a picture").bytes).expect("a picture");
            let settings = silhouette::Settings::default();
            Box::new(move || drop(black_box(silhouette::find(&picture, None, &settings).expect("a grain"))))
        }
        "hull" => {
            let cones = views(12).0;
            let bounds = find_bounds(&cones).expect("a grain");
            let cell_mm = bounds.size().max() / 120.0;
            Box::new(move || {
                let mut grid = HullGrid::new(&bounds, cell_mm).expect("a grid");
                grid.carve_all(&cones, &mut |_| ());
                black_box(grid.measures());
            })
        }
        _ => Box::new(|| drop(black_box(ball()))),
    }
}

/// Instructions of this program with a kernel run so often.
fn counted(name: &str, runs: usize) -> Result<u64, String> {
    let own = std::env::current_exe().map_err(|e| e.to_string())?;
    let made = Command::new("valgrind")
        .args(["--tool=cachegrind", "--cache-sim=no", "--cachegrind-out-file=/dev/null"])
        .arg(own)
        .args(["--runs", name, &runs.to_string()])
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .map_err(|e| format!("valgrind can't be run ({e})"))?;
    let said = String::from_utf8_lossy(&made.stderr);
    let figure = said.lines().find_map(|l| l.split("refs:").nth(1)).map(|f| f.trim().replace(',', ""));
    figure.and_then(|f| f.parse().ok()).ok_or_else(|| format!("valgrind counted nothing: {said}"))
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    if let Some(at) = args.iter().position(|a| a == "--runs") {
        let mut run = kernel(&args[at + 1]);
        (0..args[at + 2].parse().unwrap_or(1)).for_each(|_| run());
        return;
    }
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    for (name, size) in KERNELS {
        let seconds = one.install(|| median_s(kernel(name)));
        let count = counted(name, 2).and_then(|two| Ok(two.saturating_sub(counted(name, 1)?)));
        let instructions = match count {
            Ok(n) => format!("{:10.1} million instructions", 1e-6 * n as f64),
            Err(why) => format!("instructions skipped: {why}"),
        };
        println!("{name:<12} {size:>24} {:>10.2} ms {instructions}", 1e3 * seconds);
    }
}
