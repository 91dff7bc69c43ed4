//! A compression as a whole: the same on any number of threads, resumed as uninterrupted, and what is refused.

use crate::bodies::{ball, block};
use grainrig_core::contact::{ContactError, Loading, Material, Plate, Press, Sample, StateError};
use grainrig_core::geometry::Point;
use grainrig_core::mesh::TetMesh;
use nalgebra::Rotation3;

fn loading() -> Loading {
    Loading { to_force_n: Some(5.0), ..Loading::default() }
}

fn plastic() -> Material {
    Material { yield_mpa: Some(300.0), ..Material::default() }
}

fn new(mesh: &TetMesh, material: &Material, gap: f64, friction: f64) -> Result<Press, ContactError> {
    Press::new(mesh, material, 0.0, gap, friction, &loading())
}

fn run(mut press: Press, most: usize) -> Press {
    while !press.finished() && press.samples().len() < most {
        press.next_sample().unwrap();
    }
    press
}

#[test]
fn one_thread_and_two_give_the_same_bits() {
    let mesh = ball(0.5, 2.0);
    for material in [Material::default(), plastic()] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run(new(&mesh, &material, 1.0, 0.2).unwrap(), 25).save())
        };
        assert!(on(1) == on(2));
    }
}

#[test]
fn a_resumed_compression_is_the_uninterrupted_one() {
    let mesh = ball(0.5, 3.0);
    for material in [Material::default(), plastic()] {
        let make = || new(&mesh, &material, 1.0, 0.2).unwrap();
        let whole = run(make(), 40).save();
        let part = run(make(), 17).save();
        let mut resumed = make();
        resumed.restore(&part).unwrap();
        assert!(run(resumed, 40).save() == whole);
        // What is cut short or of another body is refused, and nothing is taken from it.
        let mut other = make();
        let before = other.save();
        assert!(matches!(other.restore(&part[..part.len() - 3]), Err(StateError::Damaged(_))));
        assert!(matches!(other.restore(b"grainrig"), Err(StateError::Damaged(_))));
        let mut soft = new(&mesh, &Material { young_mpa: 1e3, ..material.clone() }, 1.0, 0.2).unwrap();
        assert_eq!(soft.restore(&part), Err(StateError::Other));
        assert!(other.save() == before);
    }
}

/// A checkpoint whose header was changed, at its length.
fn with_header(saved: &[u8], change: impl FnOnce(&mut serde_json::Value)) -> Vec<u8> {
    let start = saved.iter().position(|&b| b == b'{').unwrap();
    let length = u64::from_le_bytes(saved[start - 8..start].try_into().unwrap()) as usize;
    let mut header = serde_json::from_slice(&saved[start..start + length]).unwrap();
    change(&mut header);
    let header = serde_json::to_vec(&header).unwrap();
    [&saved[..start - 8], &(header.len() as u64).to_le_bytes(), &header, &saved[start + length..]].concat()
}

#[test]
fn a_checkpoint_that_was_tampered_with_is_refused() {
    let mesh = ball(0.5, 3.0);
    let make = || new(&mesh, &Material::default(), 1.0, 0.2).unwrap();
    let saved = run(make(), 17).save();
    let mut press = make();
    let before = press.save();
    assert!(press.restore(&with_header(&saved, |_| ())).is_ok(), "the test's own way of changing it");
    press = make();
    let tampered: [(&str, serde_json::Value); 6] = [
        ("/step_s", 0.0.into()),
        ("/step_s", (-1e-9).into()),
        ("/tracker/contacts", serde_json::json!([])),
        ("/tracker/contacts/0/id", 7.into()),
        ("/tracker/alive/0/0", 99.into()),
        ("/tracker/alive/0/1/0", u32::MAX.into()),
    ];
    for (place, value) in tampered {
        let damaged = with_header(&saved, |header| {
            *header.pointer_mut(place).unwrap_or_else(|| panic!("there is no {place}")) = value;
        });
        assert!(matches!(press.restore(&damaged), Err(StateError::Damaged(_))), "{place}");
    }
    let mut infinite = saved.clone();
    let end = infinite.len();
    infinite[end - 8..].copy_from_slice(&f64::INFINITY.to_le_bytes());
    assert!(matches!(press.restore(&infinite), Err(StateError::Damaged(_))));
    assert!(press.save() == before, "nothing is taken from it");
}

#[test]
fn a_block_on_an_edge_turns_until_it_lies_and_its_contacts_are_followed() {
    // A bar, leaning by 6°, is pushed down at its high edge and rocks flat: the contact moves, the block turns by 6°.
    let sides = [0.6, 0.4, 0.3];
    let mesh = block(sides, [6, 4, 3]);
    let tilt = Rotation3::from_euler_angles(0.0, f64::to_radians(6.0), 0.0);
    let middle = Point::new(0.3, 0.2, 0.15);
    let nodes: Vec<Point> = mesh.nodes.iter().map(|p| Point::from(tilt * (p - middle))).collect();
    let low = nodes.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let leaning = TetMesh::new(nodes, mesh.tets);
    let loading = Loading { to_force_n: Some(2000.0), slowest: 4e-4, ..Loading::default() };
    let mut press = Press::new(&leaning, &Material::default(), 0.0, -2.0 * low, 0.1, &loading).unwrap();
    while !press.finished() && press.samples().len() < 4000 {
        press.next_sample().unwrap();
    }
    let last = press.samples().last().unwrap();
    let turned = press.rotation().angle().to_degrees();
    assert!((turned - 6.0).abs() < 0.3, "{turned}° at {} N", last.force_n);
    assert!(press.contacts().len() >= 2);
    assert!(press.contacts().iter().any(|c| c.plate == Plate::Lower));
    let carried: f64 = last.touches.iter().map(|t| t.force_n).sum();
    assert!((carried / (2.0 * last.force_n) - 1.0).abs() < 0.1, "{carried} {}", last.force_n);
    assert!(last.energy.balance_error().abs() < 0.01, "{:?}", last.energy);
}

#[test]
fn tipping_costs_no_force_at_any_speed() {
    // A bar that leans by a degree is a mechanism until it lies flat, 10.5 µm further: only its inertia and the little damping of
    // its motion as a whole resist.
    let mesh = block([0.6, 0.4, 0.3], [6, 4, 3]);
    let tilt = Rotation3::from_euler_angles(0.0, f64::to_radians(1.0), 0.0);
    let middle = Point::new(0.3, 0.2, 0.15);
    let nodes: Vec<Point> = mesh.nodes.iter().map(|p| Point::from(tilt * (p - middle))).collect();
    let low = nodes.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    let leaning = TetMesh::new(nodes, mesh.tets);
    let way_mm = 0.6 * f64::to_radians(1.0).sin() - 0.3 * (1.0 - f64::to_radians(1.0).cos());
    let pressed = |speed: f64| {
        let loading = Loading { to_force_n: Some(200.0), slowest: speed * 4e-6, ..Loading::default() };
        let press = Press::new(&leaning, &Material::default(), 0.0, -2.0 * low, 0.2, &loading).unwrap();
        run(press, usize::MAX).samples().to_vec()
    };
    let at = |samples: &[Sample], force: f64| {
        samples.iter().find(|s| s.force_n > force).map_or(f64::NAN, |s| s.approach_mm)
    };
    let (slow, fast) = (pressed(2.0), pressed(6.0));
    for samples in [&slow, &fast] {
        let most =
            (samples.iter().filter(|s| s.approach_mm < 0.95 * way_mm)).map(|s| s.force_n).fold(0.0, f64::max);
        println!("tipping: at most {most:.3} N; 20 N at {:.3} um", 1e3 * at(samples, 20.0));
        assert!(most < 0.05, "{most}");
    }
    assert!((at(&slow, 20.0) - at(&fast, 20.0)).abs() < 0.02 * way_mm);
}

#[test]
fn friction_holds_a_sheared_contact_and_without_it_there_is_none() {
    let mesh = ball(0.5, 3.0);
    let sideways = |friction: f64| {
        let press = run(new(&mesh, &Material::default(), 1.0, friction).unwrap(), usize::MAX);
        let s = press.samples().last().unwrap().clone();
        (s.lower_n[0].hypot(s.lower_n[1]), s.lower_n[2], s.energy.friction)
    };
    let (free, pressed, lost) = sideways(0.0);
    assert!(free < 1e-12 && pressed > 0.5 && lost.abs() < 1e-15, "{free} {pressed} {lost}");
    let (held, pressed, lost) = sideways(0.3);
    assert!(held < 0.3 * pressed && lost >= 0.0, "{held} {pressed} {lost}");
}

#[test]
fn plates_loadings_and_steps_that_cannot_be_are_refused() {
    let mesh = ball(0.5, 4.0);
    let m = Material::default();
    let missed = new(&mesh, &m, 5.0, 0.2).unwrap_err();
    assert!(matches!(missed, ContactError::Missed { .. }), "{missed}");
    assert!(matches!(new(&mesh, &m, 0.7, 0.2), Err(ContactError::Missed { .. })));
    assert!(new(&mesh, &m, 1.0, -0.1).unwrap_err().to_string().starts_with("friction"));
    let with = |loading: Loading| Press::new(&mesh, &m, 0.0, 1.0, 0.2, &loading).unwrap_err();
    let step = with(Loading { step_s: Some(1e-6), ..loading() });
    assert!(matches!(step, ContactError::Unstable { asked_s, stable_s } if asked_s > stable_s), "{step}");
    for (bad, name) in [
        (Loading { to_force_n: Some(-1.0), ..loading() }, "to_force_n"),
        (Loading { to_force_n: None, ..loading() }, "to_force_n"),
        (Loading { to_approach_mm: Some(f64::NAN), ..loading() }, "to_approach_mm"),
        (Loading { slowest: 0.0, ..loading() }, "slowest"),
        (Loading { mass_scaling: -1.0, ..loading() }, "mass_scaling"),
    ] {
        assert!(with(bad).to_string().starts_with(name), "{}", with(bad));
    }
}
