//! Hulls of grains whose volume is known: the data that the volume's estimate is fitted to.
//!
//! ```text
//! cargo bench -p grainrig-core --bench volume_fit -- /where/it/is/particle_shape_set
//! cargo test -p grainrig-core estimate::fit -- --nocapture
//! ```
//!
//! The first makes the data (ten minutes on two cores), the second fits, prints what the data give, and fails where a
//! constant is something else. The folder is that of the programs THAMES and VCCTL (Bullard and others, NIST; GitHub
//! jwbullard/THAMES, MIT licence, commit 039ede0e7b): spherical harmonics of particles of cement, slag and crushed rock
//! by X-ray tomography, a folder a powder. With them go their convex hulls, and grains cut by planes, ellipsoids and
//! rough boxes made here. Half of all are pressed flat. Each is laid in three poses and seen from all around, without a
//! pedestal, its outlines by the share of each pixel that it covers; the hull is that of `hull::slices`. A row a hull
//! goes into `core/src/hull/estimate/fit/hulls.csv`. Then the estimate as it is built here is tried on shapes that are not
//! in the data, where `shared/data/grains` is beside the repository; without a folder, only that.

use grainrig_core::contact::rest;
use grainrig_core::formats::stl;
use grainrig_core::geometry::{Point, TriangleMesh, Vector};
use grainrig_core::hull::estimate::{Known, Signs, VolumeEstimate, estimate, signs};
use grainrig_core::hull::slices::SlicedHull;
use nalgebra::{Matrix3, Rotation3};
use outline::Edges;
use random::Random;
use rayon::prelude::*;
use std::error::Error;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::fs;
use std::path::{Path, PathBuf};

mod outline;
#[path = "../../../tests/support/random.rs"]
mod random;
mod shape;

/// Particles of each powder.
const PARTICLES: usize = 50;
/// Grains of each kind that is made here; of those cut by planes, which fit worst, twice as many.
const MADE: [(&str, usize); 4] = [("convex", 80), ("cut", 160), ("ellipsoid", 80), ("box", 80)];
/// Degrees up to which particles are made: some smoother than they are.
const DEGREES: [usize; 4] = [8, 12, 20, 28];
/// Planes about a convex hull.
const PLANES: usize = 150;
/// Half of the grains are pressed to a thickness of between these shares of the length.
const THICKNESS: [f64; 2] = [0.25, 0.6];
/// Poses, one of them at random for each hull.
const POSES: [&str; 6] = ["any", "flat", "flat", "upright", "resting", "tipped"];
/// By how much a tipped grain is off lying flat, degrees.
const TIPPED_DEG: [f64; 2] = [20.0, 40.0];
/// Views and the degrees that they go around: two hulls of a grain are of the first kind, one of another.
const VIEWS: [(usize, f64); 10] = [
    (25, 180.0),
    (8, 180.0),
    (10, 180.0),
    (12, 180.0),
    (16, 180.0),
    (20, 180.0),
    (36, 180.0),
    (50, 180.0),
    (25, 360.0),
    (50, 360.0),
];
/// Diameter of the ball of a grain's volume, pixels.
const DIAMETER_PX: [f64; 2] = [180.0, 220.0];
/// Particles that the data must not know: the shapes of `shared/data/grains` were made of them.
const HELD_OUT: [&str; 4] =
    ["cement140-anm-02210.dat", "ma160-anm-00357.dat", "ma160-anm-00593.dat", "ma160-anm-02444.dat"];

/// A hull.
struct Hull {
    pose: &'static str,
    signs: Signs,
    /// By how much it is larger than the grain, as a share of the grain.
    excess: f64,
    /// What the estimate says, with nothing uncertain but what it is.
    estimate: Option<VolumeEstimate>,
    truth_mm3: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    // What begins with two dashes is for the harness, which there is none of.
    let folder = std::env::args().skip(1).find(|a| !a.starts_with("--"));
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    if let Some(folder) = folder {
        make(Path::new(&folder), &here.join("src/hull/estimate/fit/hulls.csv"))?;
    }
    let shapes = here.join("../../shared/data/grains");
    if shapes.exists() {
        try_on(&shapes)?;
    }
    Ok(())
}

/// Makes the table.
fn make(folder: &Path, table: &Path) -> Result<(), Box<dyn Error>> {
    let sphere = shape::icosphere();
    let mut grains: Vec<(String, Option<PathBuf>)> = Vec::new();
    for powder in entries(folder, |name| !["box", "ellipsoid"].contains(&name))? {
        let usable = |name: &str| name.contains("-anm-") && !HELD_OUT.contains(&name);
        let files = if powder.is_dir() { entries(&powder, usable)? } else { Vec::new() };
        let count = PARTICLES.min(files.len());
        grains.extend((0..count).map(|k| (name_of(&powder), Some(files[k * files.len() / count].clone()))));
    }
    let particles = grains.len();
    for (kind, count) in MADE {
        let file = |k: usize| (kind == "convex").then(|| grains[k * particles / count].1.clone()).flatten();
        let made: Vec<_> = (0..count).map(|k| (kind.to_owned(), file(k))).collect();
        grains.extend(made);
    }
    let rows: Vec<Vec<String>> = (grains.par_iter().enumerate())
        .map(|(seed, (kind, file))| {
            let hulls = hulls(&sphere, kind, file.as_deref(), &mut Random::new(seed as u64));
            hulls.iter().map(|hull| row(kind, hull)).collect()
        })
        .collect();
    let mut lines = String::from("kind,pose,views,empty,unsteady,restless,gaps,slender,excess\n");
    rows.iter().flatten().for_each(|row| lines.push_str(row));
    fs::write(table, lines)?;
    println!("{} hulls", rows.iter().map(Vec::len).sum::<usize>());
    Ok(())
}

/// What is in a folder under such names, in their order.
fn entries(folder: &Path, wanted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut all = fs::read_dir(folder)?.map(|e| e.map(|e| e.path())).collect::<Result<Vec<_>, _>>()?;
    all.retain(|path| wanted(&name_of(path)));
    all.sort();
    Ok(all)
}

fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A line of the table: four digits a figure.
fn row(kind: &str, hull: &Hull) -> String {
    let s = &hull.signs;
    let figures = [s.concavity, s.curvature_variation, s.axial_variation, s.gaps, s.slenderness, hull.excess]
        .map(|v| {
            let digits = (3.0 - v.abs().max(1e-6).log10().floor()).clamp(0.0, 7.0) as usize;
            format!("{v:.digits$}")
        });
    format!("{kind},{},{},{}\n", hull.pose, s.views, figures.join(","))
}

/// A grain's hulls; none where its file is no particle.
fn hulls(sphere: &TriangleMesh, kind: &str, file: Option<&Path>, draw: &mut Random) -> Vec<Hull> {
    let Some(mut mesh) = grain(sphere, kind, file, draw) else { return Vec::new() };
    if draw.unit() < 0.5 {
        mesh = pressed(&mesh, draw.between(THICKNESS[0], THICKNESS[1]));
    }
    (0..3)
        .filter_map(|k| {
            let views = if k < 2 { VIEWS[0] } else { draw.pick(&VIEWS[1..]) };
            hull(&mesh, draw.pick(&POSES), views, draw)
        })
        .collect()
}

fn grain(sphere: &TriangleMesh, kind: &str, file: Option<&Path>, draw: &mut Random) -> Option<TriangleMesh> {
    if let Some(file) = file {
        let particle = shape::particle(sphere, &fs::read_to_string(file).ok()?, draw.pick(&DEGREES))?;
        return Some(if kind == "convex" { shape::convex(&particle, PLANES) } else { particle });
    }
    if kind == "cut" {
        let facets = 6 + draw.below(35);
        return Some(shape::cut(facets, draw));
    }
    let half = Vector::new(draw.between(0.5, 1.0), 1.0, draw.between(0.3, 0.9));
    let (exponent, bumps) = match kind {
        "box" => (draw.between(4.0, 14.0), draw.between(0.0, 0.06)),
        _ if draw.unit() < 0.5 => (2.0, 0.0),
        _ => (2.0, draw.between(0.0, 0.05)),
    };
    Some(shape::rough(sphere, &half, exponent, bumps, draw))
}

/// Pressed along its shortest axis until its thickness is such a share of its length, where it is thicker; its axes
/// then lie along x, y and z, the longest first.
fn pressed(mesh: &TriangleMesh, thickness: f64) -> TriangleMesh {
    let (axes, half) = shape::axes(mesh);
    let by = (thickness * half[0] / half[2]).min(1.0);
    let press = Matrix3::from_diagonal(&Vector::new(1.0, 1.0, by)) * axes;
    TriangleMesh {
        vertices: mesh.vertices.iter().map(|p| press * p).collect(),
        triangles: mesh.triangles.clone(),
    }
}

/// The hull of a body in a pose; `None` where the views show no slices.
fn hull(
    mesh: &TriangleMesh,
    pose: &'static str,
    (views, round): (usize, f64),
    draw: &mut Random,
) -> Option<Hull> {
    let middle = Point::from(shape::moments(mesh).0);
    let turn = pose_of(mesh, &middle, pose, draw);
    let posed = TriangleMesh {
        vertices: mesh.vertices.iter().map(|p| Point::from(turn * (p - middle))).collect(),
        triangles: mesh.triangles.clone(),
    };
    let truth_mm3 = posed.volume_mm3();
    let mm_per_px = (6.0 / PI * truth_mm3).cbrt() / draw.between(DIAMETER_PX[0], DIAMETER_PX[1]);
    let first = draw.between(0.0, round);
    let angles: Vec<f64> = (0..views).map(|k| first + round * k as f64 / views as f64).collect();
    let cones = outline::views(&posed, &Edges::of(&posed), &angles, mm_per_px);
    let measures = SlicedHull::of_cones(&cones).ok()?.measures();
    let bounds = measures.bounding_box_mm?;
    let known = Known {
        volume_mm3: measures.volume_mm3,
        surface_mm2: measures.surface_area_mm2,
        bounds,
        scale: None,
        cameras: 0.0,
        foot: 0.0,
        outline_px: 0.0,
    };
    Some(Hull {
        pose,
        signs: signs(&cones, &bounds)?,
        excess: measures.volume_mm3 / truth_mm3 - 1.0,
        estimate: estimate(&cones, &known).ok(),
        truth_mm3,
    })
}

/// The rotation into a pose; where it leaves something open, that is drawn.
fn pose_of(mesh: &TriangleMesh, middle: &Point, pose: &str, draw: &mut Random) -> Rotation3<f64> {
    let about = |axis, angle: f64| Rotation3::from_axis_angle(&axis, angle);
    let [x, y, z] = [Vector::x_axis(), Vector::y_axis(), Vector::z_axis()];
    let any = draw.rotation().to_rotation_matrix();
    let over = about(x, if draw.unit() < 0.5 { PI } else { 0.0 });
    let spin = about(z, draw.between(0.0, TAU));
    // The shortest axis upright.
    let flat = spin * over * Rotation3::from_matrix_unchecked(shape::axes(mesh).0);
    match pose {
        "flat" => flat,
        "upright" => about(y, FRAC_PI_2) * over * spin.inverse() * flat,
        "tipped" => about(x, draw.between(TIPPED_DEG[0], TIPPED_DEG[1]).to_radians()) * flat,
        "resting" => {
            let points: Vec<Point> = mesh.vertices.iter().map(|p| Point::from(any * (p - middle))).collect();
            rest::rotation(&points, &Point::origin()) * any
        }
        _ => any,
    }
}

/// Prints how the estimate does on shapes that it was not fitted to, as they are and pressed.
fn try_on(shapes: &Path) -> Result<(), Box<dyn Error>> {
    // The finer one is the same body again.
    let wanted = |name: &str| name.ends_with(".stl") && !name.contains("analytic") && !name.contains("finer");
    let mut all = Vec::new();
    for file in entries(shapes, wanted)? {
        let mesh = stl::read(&fs::read(&file)?)?;
        let mut jobs = Vec::new();
        for thickness in [1.0, 0.5, 0.35] {
            jobs.extend(POSES.map(|pose| (thickness, pose)));
        }
        let hulls: Vec<Hull> = (jobs.into_par_iter().enumerate())
            .flat_map_iter(|(seed, (thickness, pose))| {
                let mesh = pressed(&mesh, thickness);
                let mut draw = Random::new(seed as u64);
                (0..4).filter_map(|_| hull(&mesh, pose, VIEWS[0], &mut draw)).collect::<Vec<_>>()
            })
            .collect();
        say(&name_of(&file), &hulls.iter().collect::<Vec<_>>());
        all.extend(hulls);
    }
    for pose in ["any", "flat", "upright", "resting", "tipped"] {
        say(pose, &all.iter().filter(|h| h.pose == pose).collect::<Vec<_>>());
    }
    say("lower than half its breadth", &all.iter().filter(|h| h.signs.slenderness < 0.5).collect::<Vec<_>>());
    say("all", &all.iter().collect::<Vec<_>>());
    Ok(())
}

fn say(name: &str, hulls: &[&Hull]) {
    let figures: Vec<(bool, f64, f64)> = (hulls.iter())
        .filter_map(|h| {
            let e = h.estimate.as_ref()?;
            let [low, high] = e.interval_mm3;
            let is_in = low <= h.truth_mm3 && h.truth_mm3 <= high;
            Some((is_in, 100.0 * (e.volume_mm3 / h.truth_mm3 - 1.0), 100.0 * (high - low) / e.volume_mm3))
        })
        .collect();
    let median = |of: &dyn Fn(&(bool, f64, f64)) -> f64| {
        let mut values: Vec<f64> = figures.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    println!(
        "{name:28} {:3} hulls, {:5.1} % in the interval; median error {:+.2} %, width {:.2} %",
        figures.len(),
        100.0 * figures.iter().filter(|f| f.0).count() as f64 / figures.len() as f64,
        median(&|f| f.1),
        median(&|f| f.2)
    );
}
