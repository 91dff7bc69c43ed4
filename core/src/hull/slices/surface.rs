//! The surface between neighbouring slices, and at the ends of a stack.

use super::SlicedHull;
use super::cut::{Corner, clip, dot};
use super::moments::Moments;

/// A part of a slice, or of a piece, that rounding may have left where outlines only touch.
const SLIVER: f64 = 1e-9;

/// The surface between two neighbouring rows, mm², without the ends of stacks.
pub(super) fn between(hull: &SlicedHull, lower: usize, upper: usize) -> f64 {
    let (a, b) = (solid(hull, lower), solid(hull, upper));
    let pitch = hull.row_grid.pitch_mm;
    match (a.as_slice(), b.as_slice()) {
        ([], _) | (_, []) => 0.0,
        ([a], [b]) => mantle(a, b, &hull.normals, pitch),
        _ => match pairs(&a, &b, &hull.normals) {
            Some(pairs) => pairs.iter().map(|[a, b]| mantle(a, b, &hull.normals, pitch)).sum(),
            None => lump(&a, &b, &hull.normals, pitch),
        },
    }
}

/// The pieces of a slice without slivers.
fn solid(hull: &SlicedHull, row: usize) -> Vec<&[Corner]> {
    let mut pieces: Vec<&[Corner]> = hull.slice(row).collect();
    if pieces.len() > 1 {
        let least = SLIVER * hull.moments(row).area;
        pieces.retain(|p| Moments::of(p).area > least);
    }
    pieces
}

/// The end of a stack at row `k`, beside which a row has the area `inwards`: half a pitch of side, and the floor.
pub(super) fn end(hull: &SlicedHull, k: usize, inwards: f64) -> f64 {
    let half = 0.5 * hull.row_grid.pitch_mm;
    let area = hull.moments(k).area;
    // Where the stack is one row thick nothing shows how it ends: flat.
    let floor = if inwards > 0.0 { (1.5 * area - 0.5 * inwards).max(0.0) } else { area };
    let shrink = (floor / area).sqrt();
    let side = solid(hull, k).into_iter().map(|piece| {
        let Some(c) = Moments::of(piece).centroid() else { return 0.0 };
        (edges(piece))
            .map(|(a, length)| {
                let n = hull.normals[a.edge as usize];
                let from_centre = dot(n, [a.at[0] - c[0], a.at[1] - c[1]]);
                0.5 * (1.0 + shrink) * length * half.hypot((1.0 - shrink) * from_centre)
            })
            .sum::<f64>()
    });
    side.sum::<f64>() + floor
}

/// The corners, each with the length of the edge that begins there.
fn edges(piece: &[Corner]) -> impl Iterator<Item = (&Corner, f64)> {
    piece.iter().enumerate().map(|(k, a)| {
        let b = &piece[(k + 1) % piece.len()];
        (a, (b.at[0] - a.at[0]).hypot(b.at[1] - a.at[1]))
    })
}

fn perimeter(piece: &[Corner]) -> f64 {
    edges(piece).map(|(_, length)| length).sum()
}

/// The side of the convex hull of two convex slices: both are walked once round in the order of their edges' normals.
fn mantle(a: &[Corner], b: &[Corner], normals: &[[f64; 2]], pitch: f64) -> f64 {
    let least = |p: &[Corner]| (0..p.len()).min_by_key(|k| p[*k].edge).unwrap_or(0);
    let (from_a, from_b) = (least(a), least(b));
    let corner = |p: &[Corner], from: usize, k: usize| p[(from + k) % p.len()];
    let length = |p: &[Corner], from: usize, k: usize| {
        let (s, t) = (corner(p, from, k).at, corner(p, from, k + 1).at);
        (t[0] - s[0]).hypot(t[1] - s[1])
    };
    let (mut i, mut j, mut sum) = (0, 0, 0.0);
    while i < a.len() || j < b.len() {
        // The next edge of either; beyond the last one, its first corner is the farthest point again.
        let (p, q) = (corner(a, from_a, i), corner(b, from_b, j));
        let edge_of = |k: usize, n: usize, c: &Corner| if k < n { c.edge } else { u32::MAX };
        let (e, f) = (edge_of(i, a.len(), &p), edge_of(j, b.len(), &q));
        let n = normals[e.min(f) as usize];
        let slant = pitch.hypot(dot(n, [p.at[0] - q.at[0], p.at[1] - q.at[1]]));
        let mut both = 0.0;
        if e <= f {
            both += length(a, from_a, i);
            i += 1;
        }
        if f <= e {
            both += length(b, from_b, j);
            j += 1;
        }
        sum += 0.5 * both * slant;
    }
    sum
}

/// The pieces of two slices that belong together: each overlaps one of the other slice, and that one no other.
fn pairs<'a>(a: &[&'a [Corner]], b: &[&'a [Corner]], normals: &[[f64; 2]]) -> Option<Vec<[&'a [Corner]; 2]>> {
    if a.len() != b.len() {
        return None;
    }
    let area = |p: &[Corner]| Moments::of(p).area;
    let joined = |p: &[Corner], q: &[Corner]| overlap(p, q, normals) > SLIVER * area(p).min(area(q));
    let out: Vec<[&[Corner]; 2]> =
        a.iter().flat_map(|p| b.iter().filter(|q| joined(p, q)).map(|q| [*p, *q])).collect();
    let once = |side: usize, pieces: &[&[Corner]]| {
        pieces.iter().all(|p| out.iter().filter(|pair| std::ptr::eq(pair[side], *p)).count() == 1)
    };
    (once(0, a) && once(1, b)).then_some(out)
}

/// Slices that do not correspond: walls and floors taken as one slanting face.
fn lump(a: &[&[Corner]], b: &[&[Corner]], normals: &[[f64; 2]], pitch: f64) -> f64 {
    let sum = |pieces: &[&[Corner]], f: &dyn Fn(&[Corner]) -> f64| pieces.iter().map(|p| f(p)).sum::<f64>();
    let wall = 0.5 * pitch * (sum(a, &perimeter) + sum(b, &perimeter));
    let area = |p: &[Corner]| Moments::of(p).area;
    let common: f64 = a.iter().map(|p| sum(b, &|q| overlap(p, q, normals))).sum();
    wall.hypot((sum(a, &area) + sum(b, &area) - 2.0 * common).max(0.0))
}

/// Area that two convex polygons share. Their edges' normals are the half-planes': those of edges that are as short as
/// rounding could not be had from their ends.
fn overlap(a: &[Corner], b: &[Corner], normals: &[[f64; 2]]) -> f64 {
    let mut part = a.to_vec();
    let mut next = Vec::new();
    for corner in b {
        let n = normals[corner.edge as usize];
        next.clear();
        clip(&part, n, dot(n, corner.at), corner.edge, &mut next);
        std::mem::swap(&mut part, &mut next);
    }
    if part.len() > 2 { Moments::of(&part).area.max(0.0) } else { 0.0 }
}
