//! Meshes that are finer where plates will touch the body, and coarser inside.

use super::grains::files;
use super::{assert_sound, default_controls, on_threads};
use grainrig_core::formats::stl;
use grainrig_core::geometry::{Ball, Point};
use grainrig_core::mesh::{Controls, Solid, mesh};

const BALL: Ball = Ball { center: Point::new(0.1, -0.2, 0.3), radius_mm: 0.4 };

fn controls() -> Controls {
    Controls {
        surface_size_mm: 0.06,
        tet_volume_mm3: 1e-3,
        size_at_contact_mm: Some(0.012),
        contact_depth_mm: Some(0.01),
        ..Controls::for_size(0.8)
    }
}

#[test]
fn facets_are_small_at_the_contacts_and_tetrahedra_grow_into_the_body() {
    let c = controls();
    let made = mesh(&BALL, &c, &mut |_| ()).unwrap();
    let q = assert_sound(&made, &c, "graded ball");
    assert!(q.dihedral_deg.min > 20.0 && q.dihedral_deg.max < 158.0, "{q:?}");
    let surface = made.surface().triangles;
    let near = |p: &Point| (p.z - 0.3).abs() > 0.4 - 0.01;
    let radius = |[a, b, c]: [Point; 3]| {
        let double_area = (b - a).cross(&(c - a)).norm();
        (b - a).norm() * (c - b).norm() * (a - c).norm() / (2.0 * double_area)
    };
    let at_contacts: Vec<f64> = (0..surface.triangles.len())
        .map(|t| surface.corners(t))
        .filter(|p| p.iter().all(near))
        .map(radius)
        .collect();
    // A cap of 10 µm on a ball of 0.4 mm has 0.025 mm²: hundreds of facets whose circumradius is 12 µm or less.
    assert!(at_contacts.len() > 200, "{}", at_contacts.len());
    assert!(at_contacts.iter().all(|r| *r <= 0.012));
    // The middle of the body is coarse: an equal mesh everywhere would have several times as many.
    let middle =
        (0..made.tets.len()).filter(|&t| made.corners(t).iter().all(|p| (p - BALL.center).norm() < 0.2));
    let volumes: Vec<f64> = made.tet_volumes_mm3().collect();
    let mean = middle.clone().map(|t| volumes[t]).sum::<f64>() / middle.count() as f64;
    assert!(mean > 20.0 * 0.012f64.powi(3) / 2.0, "{mean}");
}

#[test]
fn real_grains_with_fine_contacts_are_as_good_as_even_ones() {
    let all = std::env::var_os("GRAINRIG_ALL").is_some();
    for (k, file) in files().into_iter().enumerate() {
        let solid = Solid::new(stl::read(&std::fs::read(&file).unwrap()).unwrap()).unwrap();
        let even = default_controls(solid.surface().volume_mm3(), 2.0);
        // In turn; both for each with the hours (`make test-long`).
        let finer = if all { &[2.5, 6.0][..] } else { &[[2.5, 6.0][k % 2]] };
        for &finer in finer {
            let c = Controls { size_at_contact_mm: Some(even.surface_size_mm / finer), ..even };
            let made = mesh(&solid, &c, &mut |_| ()).unwrap();
            let name = format!("{} {finer}", file.display());
            let q = assert_sound(&made, &c, &name);
            println!(
                "{name}: {} tetrahedra, {:.1}° to {:.1}°, facets from {:.1}°",
                made.tets.len(),
                q.dihedral_deg.min,
                q.dihedral_deg.max,
                q.facet_angle_deg
            );
            assert!(q.dihedral_deg.min > 20.0 && q.dihedral_deg.max < 158.0, "{name}: {q:?}");
        }
    }
}

#[test]
fn a_graded_mesh_is_the_same_on_one_thread_and_on_three() {
    let c = controls();
    let [a, b] = [1, 3].map(|n| on_threads(n, || mesh(&BALL, &c, &mut |_| ()).unwrap()));
    assert_eq!(a, b);
}

#[test]
fn contacts_that_contradict_the_rest_are_refused() {
    let refused = |c: Controls, parts: &[&str]| {
        let text = mesh(&BALL, &c, &mut |_| ()).unwrap_err().to_string();
        assert!(parts.iter().all(|p| text.contains(p)), "{text}");
    };
    refused(
        Controls { size_at_contact_mm: Some(0.1), ..controls() },
        &["size_at_contact_mm", "0.1 mm", "at most"],
    );
    refused(Controls { size_at_contact_mm: Some(f64::NAN), ..controls() }, &["size_at_contact_mm", "NaN"]);
    refused(
        Controls { contact_depth_mm: Some(-1.0), ..controls() },
        &["contact_depth_mm", "-1 mm", "positive"],
    );
    refused(Controls { size_at_contact_mm: None, ..controls() }, &["contact_depth_mm", "size_at_contact_mm"]);
}
