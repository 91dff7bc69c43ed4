//! Elements, waves and sums that are known exactly.

use crate::bodies::{ball, block};
use grainrig_core::contact::{Body, ContactError, Dynamics, Material, Plates};
use grainrig_core::geometry::Point;
use grainrig_core::mesh::TetMesh;
use nalgebra::{Matrix3, Rotation3, Vector3};
use std::f64::consts::{PI, TAU};

fn elastic() -> Material {
    Material::default()
}

fn plastic(yield_mpa: f64) -> Material {
    Material { yield_mpa: Some(yield_mpa), ..Material::default() }
}

/// Plates so far away that nothing meets them.
fn far() -> Plates {
    Plates { lower_mm: -1e3, upper_mm: 1e3, friction: 0.0 }
}

fn map(body: &Body, by: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Vec<[f64; 3]> {
    Dynamics::new(body).positions().iter().map(|p| by(Vector3::from(*p)).into()).collect()
}

#[test]
fn a_homogeneous_stretch_makes_the_same_stress_everywhere_whatever_the_mesh() {
    // The forces on inner nodes are nought, and the energy is that of Hooke's law.
    let body = Body::new(&ball(0.5, 3.0), &elastic()).unwrap();
    let e = 1e-5;
    let strain = Matrix3::new(e, 0.3 * e, 0.1 * e, 0.3 * e, -0.5 * e, 0.2 * e, 0.1 * e, 0.2 * e, 0.7 * e);
    let places = map(&body, |x| x + strain * x);
    let mut d = Dynamics::new(&body);
    d.set(places, vec![[0.0; 3]; body.nodes()]);
    let m = elastic();
    let volume = body.mass_t() / m.density_t_mm3;
    let square = strain.iter().map(|s| s * s).sum::<f64>();
    let hooke = volume * (m.shear_mpa() * square + 0.5 * m.lambda_mpa() * strain.trace().powi(2));
    let stored = d.energy(&body).stored;
    assert!((stored / hooke - 1.0).abs() < 1e-4, "{stored} {hooke}");
    // After one tiny step only surface nodes have moved: inner ones feel no force.
    let dt = 1e-12;
    d.step(&body, &mut far(), [0.0; 2], dt).unwrap();
    let (mut inner, mut outer) = (0.0f64, 0.0f64);
    for (p, v) in d.positions().iter().zip(d.velocities()) {
        let speed = Vector3::from(*v).norm();
        if Vector3::from(*p).norm() < 0.35 { inner = inner.max(speed) } else { outer = outer.max(speed) }
    }
    assert!(inner < 1e-9 * outer, "{inner} {outer}");
}

#[test]
fn a_block_under_uniaxial_stress_pushes_with_hookes_stress() {
    let (sides, strain) = ([0.3, 0.2, 0.5], -1e-4);
    let material = elastic();
    let body = Body::new(&block(sides, [3, 2, 4]), &material).unwrap();
    let aside = 1.0 - material.poisson * strain;
    let mut d = Dynamics::new(&body);
    d.set(
        map(&body, |x| Vector3::new(aside * x.x, aside * x.y, (1.0 + strain) * x.z)),
        vec![[0.0; 3]; body.nodes()],
    );
    let mut plates = Plates { lower_mm: 0.0, upper_mm: sides[2] * (1.0 + strain), friction: 0.0 };
    let dt = 1e-13;
    let said = d.step(&body, &mut plates, [0.0; 2], dt).unwrap();
    let expected = -material.young_mpa * strain * sides[0] * sides[1];
    assert!((said.lower_n_s[2] / dt / expected - 1.0).abs() < 2e-4, "{} {expected}", said.lower_n_s[2] / dt);
    assert!((said.upper_n_s[2] / dt / -expected - 1.0).abs() < 2e-4);
    assert_eq!(said.nodes, [12, 12]);
}

#[test]
fn a_rigid_turn_makes_no_stress() {
    let mesh = ball(0.5, 4.0);
    for material in [elastic(), plastic(100.0)] {
        let body = Body::new(&mesh, &material).unwrap();
        let axis = nalgebra::Unit::new_normalize(Vector3::new(1.0, 2.0, -0.5));
        let mut d = Dynamics::new(&body);
        let rest = d.positions().to_vec();
        let steps = 48;
        let dt = 1e-9;
        let mut worst = 0.0f64;
        for n in 1..=steps {
            let at = |n: usize| Rotation3::from_axis_angle(&axis, TAU * n as f64 / steps as f64);
            let places: Vec<[f64; 3]> = rest.iter().map(|p| (at(n) * Vector3::from(*p)).into()).collect();
            let before: Vec<Vector3<f64>> = rest.iter().map(|p| at(n - 1) * Vector3::from(*p)).collect();
            let v: Vec<[f64; 3]> =
                places.iter().zip(&before).map(|(a, b)| ((Vector3::from(*a) - b) / dt).into()).collect();
            d.set(places, v);
            // A total law's stress follows from the places; one with a memory has to go through the step.
            if material.yield_mpa.is_some() {
                d.step(&body, &mut far(), [0.0; 2], dt).unwrap();
            }
            let fields = d.fields(&body);
            worst = fields.stress_mpa.iter().flatten().fold(worst, |w, s| w.max(s.abs()));
        }
        assert!(worst < 1e-9 * material.young_mpa, "{worst} MPa");
    }
}

#[test]
fn a_bar_rings_with_the_speed_of_its_waves() {
    // A free bar's lowest mode along itself has the period 2L/c, c = √(E/ρ), but for (πνr/L)²/2 of lateral inertia.
    let (length, side, cells) = (2.0, 0.05, 40);
    let body = Body::new(&block([length, side, side], [cells, 1, 1]), &elastic()).unwrap();
    let mut d = Dynamics::new(&body);
    let dt = 0.9 * d.stable_step_s(&body);
    let rest = d.positions().to_vec();
    let shape = |p: &[f64; 3]| (PI * p[0] / length).cos();
    d.set(rest.clone(), rest.iter().map(|p| [1e-3 * shape(p), 0.0, 0.0]).collect());
    let (mut crossings, mut before) = (Vec::new(), 1.0);
    while crossings.len() < 6 {
        d.step(&body, &mut far(), [0.0; 2], dt).unwrap();
        let now: f64 = rest.iter().zip(d.velocities()).map(|(p, v)| shape(p) * v[0]).sum();
        if now * before < 0.0 {
            crossings.push(d.time_s - dt * now / (now - before));
        }
        before = now;
    }
    let period = (crossings[5] - crossings[1]) / 2.0;
    let m = elastic();
    let speed = 2.0 * length / period;
    let bar = (m.young_mpa / m.density_t_mm3).sqrt();
    assert!((speed / bar - 1.0).abs() < 0.01, "{speed} mm/s, not {bar}");
}

#[test]
fn a_ball_in_flight_keeps_momentum_spin_and_energy() {
    for material in [elastic(), plastic(300.0)] {
        let body = Body::new(&ball(0.5, 3.0), &material).unwrap();
        let mut d = Dynamics::new(&body);
        let dt = 0.8 * d.stable_step_s(&body);
        let rest = d.positions().to_vec();
        // Flying, turning, and ringing.
        let v = rest.iter().map(|p| [100.0 - 4e3 * p[1], 4e3 * p[0], 50.0 + 5e3 * p[2]]).collect();
        d.set(rest, v);
        let start = d.motion(&body);
        for _ in 0..2000 {
            d.step(&body, &mut far(), [0.0; 2], dt).unwrap();
        }
        let end = d.motion(&body);
        let size = body.mass_t() * 5e3;
        for k in 0..3 {
            assert!((end.momentum_n_s[k] - start.momentum_n_s[k]).abs() < 1e-12 * size);
            // The moment is taken with places a half step after the velocities.
            assert!((end.spin_n_mm_s[k] - start.spin_n_mm_s[k]).abs() < 1e-12 * size, "{start:?} {end:?}");
        }
    }
}

#[test]
fn damping_takes_ringing_and_a_twentieth_from_flight_and_turning() {
    let body = Body::new(&ball(0.5, 3.0), &elastic()).unwrap();
    let mut d = Dynamics::new(&body);
    d.damping_per_s = 1e6;
    let dt = 0.8 * d.stable_step_s(&body);
    let rest = d.positions().to_vec();
    let v = rest.iter().map(|p| [100.0 - 4e3 * p[1], 4e3 * p[0], 50.0 + 5e3 * p[2]]).collect();
    d.set(rest, v);
    let start = d.motion(&body);
    d.step(&body, &mut far(), [0.0; 2], 1e-15).unwrap();
    let began = d.energy(&body).kinetic;
    let steps = (4e-6 / dt).ceil();
    for _ in 0..steps as usize {
        d.step(&body, &mut far(), [0.0; 2], dt).unwrap();
    }
    let end = d.motion(&body);
    let kept = (-0.05 * d.damping_per_s * steps * dt).exp();
    assert!((end.momentum_n_s[0] / start.momentum_n_s[0] / kept - 1.0).abs() < 1e-3);
    assert!((end.spin_n_mm_s[2] / start.spin_n_mm_s[2] / kept - 1.0).abs() < 1e-3);
    // Of the ringing e⁻⁴ of its energy is left; the rest of what moves is flight and turning.
    let e = d.energy(&body);
    assert!(e.stored < 0.05 * body.mass_t() * 5e3f64.powi(2) * 0.5f64.powi(2) / 10.0, "{e:?}");
    // Nothing but the start put energy in: what damping took is what is gone.
    let now = e.kinetic + e.stored + e.viscous + e.damping;
    assert!((now / began - 1.0).abs() < 1e-3, "{now} {began}");
}

#[test]
fn the_stable_step_is_where_central_differences_begin_to_grow() {
    let body = Body::new(&ball(0.5, 3.0), &elastic()).unwrap();
    let fresh = Dynamics::new(&body);
    let stable = fresh.stable_step_s(&body);
    assert!(stable > body.least_element_time_step_s(), "{stable} {}", body.least_element_time_step_s());
    let grows = |dt: f64| {
        let mut d = fresh.clone();
        let rest = d.positions().to_vec();
        let v = (0..rest.len()).map(|n| [0.0, 0.0, if n % 2 == 0 { 1e-3 } else { -1e-3 }]).collect();
        d.set(rest, v);
        for _ in 0..3000 {
            if d.step(&body, &mut far(), [0.0; 2], dt).is_err() {
                return true;
            }
        }
        d.velocities().iter().flatten().any(|v| v.abs() > 1.0)
    };
    assert!(!grows(0.98 * stable));
    assert!(grows(1.05 * stable));
}

#[test]
fn meshes_that_are_no_grain_are_refused_with_what_to_do() {
    let good = block([0.5, 0.5, 0.5], [1, 1, 1]);
    let told = |mesh: &TetMesh| Body::new(mesh, &elastic()).unwrap_err();
    let scaled = |by: f64| TetMesh::new(good.nodes.iter().map(|p| p * by).collect(), good.tets.clone());
    assert!(told(&scaled(1e-7)).to_string().contains("metres"));
    assert!(told(&scaled(1e7)).to_string().contains("micrometres"));
    let mut inverted = good.clone();
    inverted.tets[2].swap(0, 1);
    assert!(told(&inverted).to_string().contains("tetrahedron 2"), "{}", told(&inverted));
    let mut two = good.clone();
    let n = two.nodes.len() as u32;
    two.nodes.extend(good.nodes.iter().map(|p| Point::new(p.x + 1.0, p.y, p.z)));
    two.tets.extend(good.tets.iter().map(|t| t.map(|i| i + n)));
    assert_eq!(told(&two), ContactError::Detached { pieces: 2, detached: 6, elements: 12 });
    let mut nan = good.clone();
    nan.nodes[3].y = f64::NAN;
    assert!(told(&nan).to_string().contains("node 3"));
}

#[test]
fn what_becomes_no_number_names_the_element_and_the_time() {
    let body = Body::new(&ball(0.5, 4.0), &elastic()).unwrap();
    let mut d = Dynamics::new(&body);
    let mut places = d.positions().to_vec();
    places[10][2] = f64::NAN;
    d.set(places, vec![[0.0; 3]; body.nodes()]);
    let error = d.step(&body, &mut far(), [0.0; 2], 1e-9).unwrap_err().to_string();
    assert!(error.contains("element ") && error.contains("no number") && error.contains("t = 0"), "{error}");
}
