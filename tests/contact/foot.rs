//! The part that a pedestal hides, on real grains: each is sunk into a pedestal, cut flat at its top and closed again.

use crate::skip::shared_data;
use crate::sphere::long;
use grainrig_core::contact::{Foot, Rests};
use grainrig_core::formats::stl;
use grainrig_core::geometry::{ConvexHull, Point, TriangleMesh, Vector};
use nalgebra::Rotation3;

/// The diameter of a ball of the grain's volume, how deep it sits in its pedestal, and how far up the pedestal's light mixes with
/// its own: the simulated rig's, mm.
const SIZE_MM: f64 = 0.9;
const SUNK_MM: f64 = 0.02;
const HIDDEN_MM: f64 = 0.012;

/// A grain turned, as large as sand, on its pedestal.
fn standing(grain: &TriangleMesh, turn: &Rotation3<f64>) -> TriangleMesh {
    let diameter = (6.0 * grain.volume_mm3() / std::f64::consts::PI).cbrt();
    let mut vertices: Vec<Point> = grain.vertices.iter().map(|p| turn * p * (SIZE_MM / diameter)).collect();
    let low = vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    vertices.iter_mut().for_each(|p| p.z -= low + SUNK_MM);
    TriangleMesh { vertices, triangles: grain.triangles.clone() }
}

/// The direction below in the rest that a surface comes to from how it stands. Its centre is that of its corners: it is the same of
/// all that are compared, but for the foot.
fn rest(surface: &TriangleMesh) -> Vector {
    let hull = ConvexHull::new(&surface.vertices).unwrap();
    let middle = surface.vertices.iter().map(|p| p.coords).sum::<Vector>() / surface.vertices.len() as f64;
    let rests = Rests::new(hull, &Point::from(middle), None);
    rests.rests[rests.reached_from(&-Vector::z())].down
}

#[test]
fn a_grain_whose_foot_is_closed_comes_to_rest_as_the_whole_one_does() {
    let Some(folder) = shared_data("grains") else { return };
    let names =
        ["ct_cement140_02210", "ct_ma160_00357", "ct_ma160_00593", "ct_ma160_02444", "gravel_az_00002"]
            .into_iter()
            .chain(["sand_ma107_00002", "sand_ma107_00107"]);
    let (mut depths, mut off_flat, mut off_closed) = (Vec::new(), Vec::new(), Vec::new());
    for name in names {
        let grain = stl::read(&std::fs::read(folder.join(format!("{name}.stl"))).unwrap()).unwrap();
        for k in 0..if long() { 6 } else { 4 } {
            let k = f64::from(k);
            let whole = standing(&grain, &Rotation3::from_euler_angles(1.3 * k, 0.7 * k, 2.1 * k));
            let mut cut = whole.clone();
            cut.vertices.iter_mut().for_each(|p| p.z = p.z.max(0.0));
            let foot = Foot::of(&cut, HIDDEN_MM).unwrap();
            let down = rest(&whole);
            off_flat.push(rest(&cut).angle(&down).to_degrees());
            off_closed.push(rest(&foot.closed(&cut, 1.0)).angle(&down).to_degrees());
            depths.push(foot.depth_mm.map(|d| d / SUNK_MM));
        }
    }
    let count = depths.len();
    let closed: Vec<f64> = depths.into_iter().flatten().collect();
    let said = format!("depths {closed:.2?}\nflat {off_flat:.1?}\nclosed {off_closed:.1?}");
    println!("{said}");
    assert!(closed.len() * 10 >= count * 9, "{said}");
    // How it goes on is a guess, about as often too deep as not deep enough.
    let within = |range: std::ops::Range<f64>| closed.iter().filter(|x| range.contains(x)).count();
    assert!(within(0.5..2.0) * 10 >= closed.len() * 6, "{said}");
    assert!(within(0.0..1.0).abs_diff(within(1.0..f64::INFINITY)) * 3 < closed.len(), "{said}");
    // Left flat, some come to rest on another side; closed, none does.
    let worst = |off: &[f64]| off.iter().copied().fold(0.0, f64::max);
    assert!(worst(&off_flat) > 10.0 && worst(&off_closed) < 10.0, "{said}");
}
