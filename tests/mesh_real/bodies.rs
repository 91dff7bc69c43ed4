//! Bodies that are no grains: plates, needles, touching balls, nothing, and values that are no numbers.

use super::{assert_good, assert_sound, default_controls};
use grainrig_core::geometry::{Aabb, ImplicitBody, Point, TriangleMesh, Vector};
use grainrig_core::mesh::{Controls, Distances, MeshError, Solid, mesh};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// A body from a closure and a box about the origin.
struct Body<F> {
    value: F,
    half: Vector,
}

impl<F: Fn(&Point) -> f64 + Sync> ImplicitBody for Body<F> {
    fn value(&self, p: &Point) -> f64 {
        (self.value)(p)
    }
    fn bounds(&self) -> Aabb {
        Aabb { min: Point::from(-self.half), max: Point::from(self.half) }
    }
}

fn body<F: Fn(&Point) -> f64 + Sync>(half: [f64; 3], value: F) -> Body<F> {
    Body { value, half: Vector::from(half) }
}

/// A cuboid by its half edges: the exact distance (outside) and the depth under the nearest face (inside).
fn cuboid(half: [f64; 3]) -> Body<impl Fn(&Point) -> f64 + Sync> {
    let h = Vector::from(half);
    body(half, move |p: &Point| {
        let q = p.coords.abs() - h;
        q.map(|x| x.max(0.0)).norm() + q.max().min(0.0)
    })
}

fn controls(surface_size_mm: f64) -> Controls {
    Controls {
        surface_size_mm,
        facet_angle_deg: 10.0,
        tet_volume_mm3: 0.5 * surface_size_mm.powi(3),
        ..Controls::for_size(1.0)
    }
}

#[test]
fn a_plate_is_meshed_where_the_size_resolves_it_and_an_error_or_sound_where_not() {
    let plate = cuboid([0.5, 0.4, 0.05]);
    let fine = controls(0.03);
    let made = mesh(&plate, &fine, &mut |_| ()).unwrap();
    assert_sound(&made, &fine, "plate");
    assert!((made.volume_mm3() / 0.08 - 1.0).abs() < 0.05, "{}", made.volume_mm3());
    for thickness in [0.02, 0.01, 0.003, 1e-4, 1e-9] {
        let coarse = controls(0.08);
        match mesh(&cuboid([0.5, 0.4, thickness]), &coarse, &mut |_| ()) {
            Ok(made) => drop(assert_sound(&made, &coarse, "thin plate")),
            Err(MeshError::Empty { .. } | MeshError::Promise(_)) => {}
            Err(e) => panic!("{thickness}: {e}"),
        }
    }
}

#[test]
fn of_two_touching_balls_both_or_the_larger_is_kept_and_the_rest_is_counted() {
    for (gap, radius) in [(0.0, 0.5), (-0.01, 0.5), (0.01, 0.4), (0.3, 0.4), (-0.1, 0.45)] {
        let apart = 0.5 + radius + gap;
        let two = body([1.6, 0.6, 0.6], move |p: &Point| {
            let a = (p - Point::new(-0.5, 0.0, 0.0)).norm() - 0.5;
            a.min((p - Point::new(apart - 0.5, 0.0, 0.0)).norm() - radius)
        });
        let c = controls(0.07);
        let made = mesh(&two, &c, &mut |_| ()).unwrap();
        assert_sound(&made, &c, "two balls");
        let ball = |r: f64| 4.0 / 3.0 * std::f64::consts::PI * r.powi(3);
        let expected = ball(0.5) + if made.dropped_pieces == 0 { ball(radius) } else { 0.0 };
        assert!((made.volume_mm3() / expected - 1.0).abs() < 0.04, "{gap}: {}", made.volume_mm3());
        assert_eq!(made.dropped_pieces, usize::from(gap > 0.2), "{gap}");
    }
}

#[test]
fn a_needle_from_triangles_is_meshed_or_refused_but_never_a_bad_mesh() {
    let needle = |w: f64| TriangleMesh {
        vertices: [[0., 0., 0.], [1., 0., 0.], [0.5, w, 0.], [0.5, 0.3 * w, w]].map(Point::from).to_vec(),
        triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
    };
    for width in [0.3, 0.1, 0.03, 0.01, 1e-3] {
        let c = controls(0.03);
        match mesh(&Solid::new(needle(width)).unwrap(), &c, &mut |_| ()) {
            Ok(made) => drop(assert_sound(&made, &c, "needle")),
            Err(MeshError::Empty { .. } | MeshError::Promise(_)) => {}
            Err(e) => panic!("{width}: {e}"),
        }
    }
}

#[test]
fn a_cube_keeps_its_edges_nearly_sharp() {
    // Turned, so that no face lies along the lattice.
    let turn = rotation(Vector::new(0.3, 0.5, 0.7));
    let cube = body([0.7; 3], move |p: &Point| {
        let q = turn(p).abs() - Vector::repeat(0.4);
        q.map(|x| x.max(0.0)).norm() + q.max().min(0.0)
    });
    let c = default_controls(0.512, 1.0);
    let made = mesh(&cube, &c, &mut |_| ()).unwrap();
    assert_good(&made, &c, "cube");
    assert!((made.volume_mm3() / 0.512 - 1.0).abs() < 0.002, "{}", made.volume_mm3());
    let d = Distances::measure(&cube, &made, &[]).unwrap().to_body;
    assert!(d.mean_mm < 0.02 * c.surface_size_mm && d.max_mm < 0.8 * c.surface_size_mm, "{d:?}");
}

/// A rotation by a vector's length about it (Rodrigues).
fn rotation(by: Vector) -> impl Fn(&Point) -> Vector + Sync {
    let (angle, axis) = (by.norm(), by.normalize());
    move |p: &Point| {
        let v = p.coords;
        v * angle.cos() + axis.cross(&v) * angle.sin() + axis * axis.dot(&v) * (1.0 - angle.cos())
    }
}

#[test]
fn a_body_smaller_than_the_lattice_says_the_lattice_and_what_to_do() {
    let speck = cuboid([1e-4, 1e-4, 1e-4]);
    let text = mesh(&speck, &controls(1.0), &mut |_| ()).unwrap_err().to_string();
    for part in ["1.44", "mm", "thinner", "surface_size_mm", "tet_volume_mm3", "smaller"] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let nothing = body([1.0; 3], |_: &Point| 1.0);
    assert!(matches!(mesh(&nothing, &controls(0.2), &mut |_| ()), Err(MeshError::Empty { .. })));
}

#[test]
fn values_that_are_no_numbers_are_an_error_and_boxes_that_are_wrong_too() {
    let c = controls(0.2);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let half = body([1.0; 3], move |p: &Point| if p.x > 0.0 { bad } else { p.coords.norm() - 0.8 });
        let e = mesh(&half, &c, &mut |_| ()).unwrap_err();
        assert!(matches!(e, MeshError::NotFinite(..)), "{e}");
    }
    // Not a number only in a shell so thin that no lattice point lies in it: searches along edges meet it.
    let shell = body([1.0; 3], |p: &Point| {
        let d = p.coords.norm() - 0.8;
        if (1e-9..1e-3).contains(&d) { f64::NAN } else { d }
    });
    match mesh(&shell, &c, &mut |_| ()) {
        Ok(made) => drop(assert_sound(&made, &c, "shell")),
        Err(e) => assert!(matches!(e, MeshError::NotFinite(..) | MeshError::Promise(_)), "{e}"),
    }
    // Values so large that their differences overflow.
    let steep = body([1.0; 3], |p: &Point| f64::MAX.copysign(p.coords.norm() - 0.8));
    match mesh(&steep, &c, &mut |_| ()) {
        Ok(made) => drop(assert_sound(&made, &c, "steep")),
        Err(e) => assert!(matches!(e, MeshError::Promise(_)), "{e}"),
    }
    let too_large = body([0.5; 3], |p: &Point| p.coords.norm() - 5.0);
    assert!(matches!(mesh(&too_large, &c, &mut |_| ()), Err(MeshError::Unbounded(_))));
    for half in [[0.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [f64::NAN, 1.0, 1.0], [f64::INFINITY, 1.0, 1.0]] {
        let e = mesh(&body(half, |p: &Point| p.coords.norm() - 0.5), &c, &mut |_| ()).unwrap_err();
        assert!(matches!(e, MeshError::Box(_)), "{half:?}: {e}");
    }
    let e = mesh(&cuboid([1.0; 3]), &controls(1e-4), &mut |_| ()).unwrap_err();
    assert!(matches!(e, MeshError::TooMany { .. }), "{e}");
}

/// Waves on a ball: wave vectors, phases and amplitudes.
fn waves() -> impl Strategy<Value = Vec<([f64; 3], f64, f64)>> {
    let wave = ([-5.0..5.0f64, -5.0..5.0f64, -5.0..5.0f64], 0.0..std::f64::consts::TAU, 0.0..0.07f64);
    proptest::collection::vec(wave, 1..5)
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 32,
        rng_seed: RngSeed::Fixed(1),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn every_smooth_body_is_meshed_and_keeps_the_controls(waves in waves(), size in 1e-3..1e3f64) {
        let radius = |d: &Vector| {
            let sum: f64 = waves.iter().map(|(k, phase, a)| a * (Vector::from(*k).dot(d) + phase).cos()).sum();
            0.5 * (1.0 + sum)
        };
        let bumpy = body([0.65 * size; 3], |p: &Point| {
            let q = p.coords / size;
            let r = q.norm();
            size * (r - radius(&q.try_normalize(1e-12).unwrap_or_else(Vector::z)))
        });
        let c = default_controls(std::f64::consts::FRAC_PI_6 * size.powi(3), 2.5);
        let made = mesh(&bumpy, &c, &mut |_| ());
        prop_assert!(made.is_ok(), "{:?}", made.err());
        assert_good(&made.unwrap(), &c, "waves");
    }
}
