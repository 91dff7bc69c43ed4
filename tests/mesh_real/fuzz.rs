//! Small random closed surfaces and voxel blobs: each becomes a mesh that keeps its controls, or an error.
//!
//! A few by default; `GRAINRIG_FUZZ_S=3600 cargo test --release --test mesh_real fuzz -- --nocapture` goes on for an hour,
//! with other ones each time `GRAINRIG_FUZZ_SEED` is another.

use super::{assert_sound, default_controls};
use crate::random::Random;
use grainrig_core::geometry::{ImplicitBody, Point, TriangleMesh, Vector};
use grainrig_core::mesh::{Controls, MeshError, Solid, Voxels, mesh};
use std::time::{Duration, Instant};

/// How many of each kind where no time is given.
const CASES: u64 = 12;

/// An octahedron divided a few times, its vertices moved in and out at random, and flattened: spiky, thin, but star-shaped.
fn surface(random: &mut Random) -> TriangleMesh {
    let mut vertices: Vec<Point> =
        [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]]
            .map(Point::from)
            .to_vec();
    let mut triangles =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..random.below(4) {
        let mut middles = std::collections::HashMap::new();
        let mut middle = |a: u32, b: u32, vertices: &mut Vec<Point>| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                let sum = vertices[a as usize].coords + vertices[b as usize].coords;
                vertices.push(sum.normalize().into());
                vertices.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (d, e, f) =
                    (middle(a, b, &mut vertices), middle(b, c, &mut vertices), middle(c, a, &mut vertices));
                [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
            })
            .collect();
    }
    let rough = [0.0, 0.2, 0.8, 1.6][random.below(4)];
    let flat = [1.0, 1.0, 0.3, 0.02][random.below(4)];
    for p in &mut vertices {
        p.coords *= 1.0 + rough * (random.unit() - 0.5);
        p.z *= flat;
    }
    TriangleMesh { vertices, triangles }
}

/// Voxels filled where a few random balls are, or at random.
fn voxels(random: &mut Random) -> Voxels {
    let size = [0; 3].map(|_| 1 + random.below(14));
    let balls: Vec<([f64; 3], f64)> = (0..=random.below(5))
        .map(|_| (size.map(|n| random.unit() * n as f64), random.unit() * 6.0))
        .collect();
    let part = if random.below(3) == 0 { random.unit() } else { 0.0 };
    let inside: Vec<bool> = (0..size.iter().product())
        .map(|i: usize| {
            let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]].map(|x| x as f64);
            let within =
                |(c, r): &([f64; 3], f64)| (0..3).map(|k| (at[k] - c[k]).powi(2)).sum::<f64>() < r * r;
            balls.iter().any(within) || random.unit() < part
        })
        .collect();
    Voxels::new(Point::origin(), 0.1, size, &inside).unwrap()
}

/// Meshes a body at a random size; whether there is a mesh.
fn try_one(random: &mut Random, body: &dyn ImplicitBody, name: &str) -> bool {
    let size: Vector = body.bounds().size();
    let volume = std::f64::consts::FRAC_PI_6 * size.product();
    let mut controls = default_controls(volume, 1.5 + 6.0 * random.unit());
    controls.facet_angle_deg = [5.0, 15.0, 25.0][random.below(3)];
    if random.below(4) == 0 {
        controls.size_at_contact_mm = Some(controls.surface_size_mm * (0.2 + 0.8 * random.unit()));
    }
    if random.below(4) == 0 {
        controls.tet_volume_mm3 *= 10.0;
    }
    match mesh(body, &controls, &mut |_| ()) {
        Ok(made) => {
            assert_sound(&made, &controls, name);
            true
        }
        Err(MeshError::Empty { .. } | MeshError::Promise(_) | MeshError::TooMany { .. }) => false,
        Err(e) => panic!("{name}: {e} ({:?})", Controls { ..controls }),
    }
}

#[test]
fn random_surfaces_and_blobs_become_meshes_or_errors() {
    let number = |name: &str| std::env::var(name).ok().and_then(|s| s.parse::<u64>().ok());
    let limit = number("GRAINRIG_FUZZ_S").map(Duration::from_secs);
    let seed = number("GRAINRIG_FUZZ_SEED").unwrap_or(1);
    let start = Instant::now();
    let [mut meshes, mut errors, mut refused] = [0u64; 3];
    for case in 0.. {
        if limit.map_or(case >= CASES, |limit| start.elapsed() > limit) {
            break;
        }
        let mut random = Random::new(seed << 32 | case);
        let name = format!("seed {seed}, case {case}");
        match Solid::turned_outwards(surface(&mut random)) {
            // A surface that cuts itself is meshed too: whatever comes of it must be a mesh.
            Ok((solid, _)) => {
                let crossing = solid.crossing().is_some();
                refused += u64::from(crossing);
                if try_one(&mut random, &solid, &name) { meshes += 1 } else { errors += 1 }
            }
            Err(_) => refused += 1,
        }
        let blob = voxels(&mut random);
        if try_one(&mut random, &blob, &name) { meshes += 1 } else { errors += 1 }
    }
    println!(
        "{meshes} meshes, {errors} refused as too thin, empty or out of promise, {refused} surfaces that cut themselves"
    );
    // 350 to 94 in 444 bodies: a mesher that refuses every other one is broken.
    assert!(meshes > 2 * errors, "{meshes} {errors}");
}
