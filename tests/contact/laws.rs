//! What every material law has to do, whichever it is: the table's laws go through this one after another.

use crate::bodies::{ball, block};
use grainrig_core::contact::{Body, Dynamics, Fields, LAWS, Law, Loading, Material, Plates, Press, Program};
use grainrig_core::mesh::TetMesh;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};

const STEP_S: f64 = 1e-9;
/// A stretch with shear, of strains about a hundredth.
const STRETCH: Matrix3<f64> = Matrix3::new(4e-3, 6e-3, -2e-3, 1e-3, -8e-3, 3e-3, 2e-3, 1e-3, 3e-3);

fn of(law: &'static Law) -> Material {
    Material { hardening_mpa: 2000.0, ..Material::default() }.by(law, 300.0)
}

/// Its laws, each with a material that has its usual parameters.
fn materials() -> Vec<Material> {
    LAWS.map(of).into()
}

/// Plates so far away that nothing meets them.
fn far() -> Plates {
    Plates { lower_mm: -1e3, upper_mm: 1e3, friction: 0.0 }
}

/// Takes a body through homogeneous deformations F(0) = 1, F(1), …, F(count); the state and the fields at the end.
fn taken(body: &Body, count: usize, f: impl Fn(usize) -> Matrix3<f64>) -> (Dynamics, Fields) {
    let mut d = Dynamics::new(body);
    let rest = d.positions().to_vec();
    let at = |n: usize| -> Vec<Vector3<f64>> { rest.iter().map(|x| f(n) * Vector3::from(*x)).collect() };
    let mut before = at(0);
    for n in 0..=count {
        let places = at(n);
        let v = places.iter().zip(&before).map(|(a, b)| ((a - b) / STEP_S).into()).collect::<Vec<_>>();
        let now: Vec<[f64; 3]> = places.iter().map(|p| (*p).into()).collect();
        d.set(now.clone(), v.clone());
        d.step(body, &mut far(), [0.0; 2], STEP_S).unwrap();
        // What the step moved is put back: the path is given.
        d.set(now, v);
        before = places;
    }
    let fields = d.fields(body);
    (d, fields)
}

fn stress(fields: &Fields, element: usize) -> Matrix3<f64> {
    let s = fields.stress_mpa[element];
    Matrix3::new(s[0], s[5], s[4], s[5], s[1], s[3], s[4], s[3], s[2])
}

fn turn(angle: f64) -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Unit::new_normalize(Vector3::new(1.0, 2.0, -0.5)), angle)
}

#[test]
fn a_pure_rotation_makes_no_stress_under_any_law() {
    let mesh = ball(0.5, 4.0);
    for material in materials() {
        let body = Body::new(&mesh, &material).unwrap();
        let (d, fields) = taken(&body, 48, |n| *turn(TAU * n as f64 / 48.0).matrix());
        let worst = fields.stress_mpa.iter().flatten().fold(0.0f64, |w, s| w.max(s.abs()));
        assert!(worst < 1e-9 * material.young_mpa, "{:?}: {worst} MPa", material.law());
        assert!(d.energy(&body).plastic.abs() < 1e-20);
    }
}

#[test]
fn stress_turns_with_a_rotation_laid_over_a_deformation() {
    let body = |m: &Material| Body::new(&block([0.3, 0.2, 0.4], [2, 2, 2]), m).unwrap();
    let count = 400;
    let share = |n: usize| n as f64 / count as f64;
    for material in materials() {
        let body = body(&material);
        let stretched = |n: usize| Matrix3::identity() + STRETCH * share(n);
        let (_, plain) = taken(&body, count, stretched);
        let (_, turned) = taken(&body, count, |n| turn(FRAC_PI_2 * share(n)).matrix() * stretched(n));
        let q = turn(FRAC_PI_2);
        for e in 0..body.elements() {
            let expected = q.matrix() * stress(&plain, e) * q.matrix().transpose();
            let off = (stress(&turned, e) - expected).norm() / expected.norm();
            assert!(off < 2e-3, "{:?}: element {e} is off by {off:.1e}", material.law());
            let grown = (turned.plastic_strain[e] - plain.plastic_strain[e]).abs();
            assert!(grown <= 2e-3 * plain.plastic_strain[e], "{:?}: {grown}", material.law());
        }
        assert_eq!(plain.plastic_strain[0] > 1e-3, material.law().yields, "the path is to make it yield");
    }
}

#[test]
fn stress_is_hookes_at_small_strains_and_the_derivative_of_the_stored_energy() {
    for material in materials() {
        let body = Body::new(&block([0.3, 0.2, 0.4], [2, 2, 2]), &material).unwrap();
        let volume = 0.3 * 0.2 * 0.4;
        let at = |f: Matrix3<f64>| taken(&body, 1, |n| if n == 0 { Matrix3::identity() } else { f });
        let strain = |h: f64| Matrix3::identity() + h * STRETCH;
        let h = 1e-3;
        let (_, fields) = at(strain(h));
        let e = 0.5 * h * (STRETCH + STRETCH.transpose());
        let hooke =
            2.0 * material.shear_mpa() * e + Matrix3::identity() * (material.lambda_mpa() * e.trace());
        let stored = |h: f64| at(strain(h)).0.energy(&body).stored;
        let by = 1e-2 * h;
        let derivative = (stored(h + by) - stored(h - by)) / (2.0 * by) / volume;
        for n in 0..body.elements() {
            let s = stress(&fields, n);
            assert!((s - hooke).norm() < 1e-4 * hooke.norm(), "{:?}: {s} {hooke}", material.law());
            let power = s.component_mul(&STRETCH).sum();
            assert!((power / derivative - 1.0).abs() < 1e-4, "{:?}: {power} {derivative}", material.law());
        }
    }
}

#[test]
fn the_elements_bound_the_stable_step_from_below_and_a_body_rings_stably_at_it() {
    for material in materials() {
        let body = Body::new(&ball(0.5, 4.0), &material).unwrap();
        let fresh = Dynamics::new(&body);
        let stable = fresh.stable_step_s(&body);
        assert!(stable > body.least_element_time_step_s(), "{:?}: {stable}", material.law());
        let grows = |dt: f64| {
            let mut d = fresh.clone();
            let rest = d.positions().to_vec();
            let v = (0..rest.len()).map(|n| [0.0, 0.0, if n % 2 == 0 { 1e-3 } else { -1e-3 }]).collect();
            d.set(rest, v);
            let ends = (0..2000).all(|_| d.step(&body, &mut far(), [0.0; 2], dt).is_ok());
            !ends || d.velocities().iter().flatten().any(|v| v.abs() > 1.0)
        };
        assert!(!grows(0.98 * stable), "{:?}", material.law());
        // Nodes with a pressure in common are softer than the elements that are reckoned with.
        assert!(grows(2.0 * stable), "{:?}: the bound is far too low", material.law());
    }
}

#[test]
fn a_closed_cycle_of_elastic_strains_gives_the_work_back() {
    let count = 4000;
    for material in materials() {
        let body = Body::new(&block([0.3, 0.2, 0.4], [2, 2, 2]), &material).unwrap();
        // Round through two strains that do not lie in one direction, and turned on the way.
        let path = |n: usize| {
            let a = TAU * n as f64 / count as f64;
            let other = Matrix3::new(-1e-3, 2e-3, 0.0, 0.0, 5e-4, 1e-3, -1e-3, 0.0, 5e-4);
            let e = 0.02 * STRETCH * (1.0 - a.cos()) + 0.1 * other * a.sin();
            turn(0.5 * (1.0 - a.cos())).matrix() * (Matrix3::identity() + e)
        };
        let (half, most) = taken(&body, count / 2, path);
        let (whole, left) = taken(&body, count, path);
        let largest = |f: &Fields| f.stress_mpa.iter().flatten().fold(0.0f64, |w, s| w.max(s.abs()));
        assert!(whole.energy(&body).plastic.abs() < 1e-20, "{:?} is not to yield here", material.law());
        // A law in rates comes back to the first order of a step's turn, here 5e-4.
        assert!(largest(&left) < 1e-3 * largest(&most), "{:?}: {}", material.law(), largest(&left));
        let (stored, at_most) = (whole.energy(&body).stored, half.energy(&body).stored);
        assert!(stored.abs() < 1e-5 * at_most, "{:?}: {stored} of {at_most}", material.law());
    }
}

/// A block pressed by plates that come and go, looked at every so many steps.
fn pressed(material: &Material, mut look: impl FnMut(&Dynamics, &Body)) {
    let body = Body::new(&block([0.3, 0.3, 0.3], [3, 3, 3]), material).unwrap();
    let mut d = Dynamics::new(&body);
    d.damping_per_s = 2e5;
    let dt = 0.8 * d.stable_step_s(&body);
    let mut plates = Plates { lower_mm: 0.0, upper_mm: 0.3, friction: 0.1 };
    let count = 4000;
    for n in 0..count {
        let speed = 600.0 * (TAU * f64::from(n) / f64::from(count)).sin();
        d.step(&body, &mut plates, [speed, -speed], dt).unwrap();
        if n % 50 == 49 {
            look(&d, &body);
        }
    }
}

#[test]
fn what_plates_put_in_is_accounted_for_and_plastic_work_never_comes_back() {
    for material in materials() {
        let mut plastic = 0.0;
        let mut most = 0.0f64;
        let mut end = None;
        pressed(&material, |d, body| {
            let e = d.energy(body);
            assert!(e.plastic >= plastic, "{:?}: {} after {plastic}", material.law(), e.plastic);
            plastic = e.plastic;
            most = most.max(e.external);
            end = Some(e);
        });
        let e = end.unwrap();
        let accounted = e.kinetic + e.internal() + e.viscous + e.damping + e.friction + e.impact;
        assert!((e.external - accounted).abs() < 0.01 * most, "{:?}: {e:?}", material.law());
        assert_eq!(e.plastic > 0.1 * most, material.law().yields, "{:?}: {e:?} of {most}", material.law());
    }
}

#[test]
fn a_saved_history_goes_on_with_the_same_bits() {
    let mesh = ball(0.5, 3.0);
    let loading = Loading { to_force_n: Some(20.0), ..Loading::default() };
    let run = |mut press: Press, most: usize| {
        while !press.finished() && press.samples().len() < most {
            press.next_sample().unwrap();
        }
        press
    };
    for material in materials() {
        let soft =
            if material.law().yields { Material { yield_mpa: Some(50.0), ..material } } else { material };
        let make = || Press::new(&mesh, &soft, 0.0, 1.0, 0.2, &loading).unwrap();
        let part = run(make(), 30);
        let strains = part.dynamics().fields(part.body()).plastic_strain;
        assert_eq!(strains.iter().any(|s| *s > 0.0), soft.law().yields, "{:?}", soft.law());
        let mut resumed = make();
        resumed.restore(&part.save()).unwrap();
        assert!(run(resumed, 40).save() == run(part, 40).save(), "{:?}", soft.law());
    }
}

#[test]
fn a_material_says_what_it_is_in_json_and_in_an_abaqus_deck() {
    let small: TetMesh = block([0.3, 0.3, 0.3], [1, 1, 1]);
    for material in materials() {
        let text = serde_json::to_string(&material).unwrap();
        assert_eq!(serde_json::from_str::<Material>(&text).unwrap(), material);
        assert!(Body::new(&small, &material).is_ok());
        let deck = material.deck(Program::Abaqus).unwrap();
        assert!(deck.starts_with("*ELASTIC\n100000, 0.22\n") && deck.ends_with('\n'), "{deck}");
        assert!(deck.lines().all(|line| line.len() <= 80 && line.is_ascii()), "{deck}");
        let named = LAWS.map(|law| law.name);
        assert!(named.contains(&material.law().name) && material.doubts().is_empty());
    }
}
