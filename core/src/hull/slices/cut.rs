//! Half-plane intersection in the plane: half-planes in the order of their directions, and convex polygons cut by a line.

/// A corner of a convex polygon, counter-clockwise, and the half-plane whose edge begins there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Corner {
    /// mm.
    pub at: [f64; 2],
    /// Number of the half-plane.
    pub edge: u32,
}

#[inline]
pub(super) fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

#[inline]
pub(super) fn cross(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// Scratch buffers of [`Chain::intersect`]: the lines that bound the common part so far, in order, and the corners
/// between neighbours.
#[derive(Debug, Default)]
pub(super) struct Chain {
    lines: Vec<u32>,
    corners: Vec<[f64; 2]>,
}

impl Chain {
    /// Adds to `out` the polygon of the half-planes n·p ≤ h, whose unit normals go once round counter-clockwise with
    /// less than half a turn between neighbours. False, and nothing added, where they have no common area.
    ///
    /// Each half-plane enters at the chain's back and leaves at most once (de Berg et al., *Computational Geometry*,
    /// section 4.2, with the angular order that makes it linear): O(N). A corner is computed along one of its lines,
    /// so it lies on both to rounding even where they are nearly parallel; areas then err by rounding only.
    pub(super) fn intersect(&mut self, normals: &[[f64; 2]], h: &[f64], out: &mut Vec<Corner>) -> bool {
        let (lines, corners) = (&mut self.lines, &mut self.corners);
        lines.clear();
        corners.clear();
        // Lines before `head` have been cut off by later ones.
        let mut head = 0;
        let normal = |k: u32| normals[k as usize];
        let beyond = |p: [f64; 2], k: u32| dot(normal(k), p) >= h[k as usize];
        for j in 0..normals.len() as u32 {
            while lines.len() > head + 1 && beyond(corners[lines.len() - 2], j) {
                lines.pop();
                corners.pop();
                // Past half a turn from the line now last, the cut-off corner was the nearest point to j: none is left.
                if cross(normal(lines[lines.len() - 1]), normal(j)) <= 0.0 {
                    return false;
                }
            }
            // Only past half a turn from the chain's first line can j cut that off: where many lines meet in one point,
            // rounding alone may put the first corner beyond j.
            let past = |head: usize, lines: &[u32]| cross(normal(j), normal(lines[head])) > 0.0;
            while lines.len() > head + 1 && past(head, lines) && beyond(corners[head], j) {
                head += 1;
                if cross(normal(j), normal(lines[head])) <= 0.0 {
                    return false;
                }
            }
            if let Some(&last) = lines.last() {
                corners.push(corner(normals, h, last, j));
            }
            lines.push(j);
        }
        while lines.len() > head + 2 && beyond(corners[lines.len() - 2], lines[head]) {
            lines.pop();
            corners.pop();
        }
        while lines.len() > head + 2 && beyond(corners[head], lines[lines.len() - 1]) {
            head += 1;
        }
        if lines.len() < head + 3 {
            return false;
        }
        let (first, last) = (lines[head], lines[lines.len() - 1]);
        out.push(Corner { at: corner(normals, h, last, first), edge: first });
        let between = corners[head..lines.len() - 1].iter().zip(&lines[head + 1..]);
        out.extend(between.map(|(at, edge)| Corner { at: *at, edge: *edge }));
        true
    }
}

/// Where the lines i and j meet.
#[inline]
fn corner(normals: &[[f64; 2]], h: &[f64], i: u32, j: u32) -> [f64; 2] {
    let (n, m) = (normals[i as usize], normals[j as usize]);
    let (a, b) = (h[i as usize], h[j as usize]);
    let along = (b - a * dot(n, m)) / cross(n, m);
    [a * n[0] - along * n[1], a * n[1] + along * n[0]]
}

/// Adds to `out` the part of a convex polygon where n·p ≤ h, its new edge numbered `edge`; fewer than three corners
/// where that has no area.
pub(super) fn clip(polygon: &[Corner], n: [f64; 2], h: f64, edge: u32, out: &mut Vec<Corner>) {
    let depth = |c: &Corner| dot(n, c.at) - h;
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (da, db) = (depth(a), depth(b));
        if da <= 0.0 {
            out.push(*a);
        }
        if (da < 0.0 && db > 0.0) || (da > 0.0 && db < 0.0) {
            let t = da / (da - db);
            let at = [a.at[0] + t * (b.at[0] - a.at[0]), a.at[1] + t * (b.at[1] - a.at[1])];
            out.push(Corner { at, edge: if da < 0.0 { edge } else { a.edge } });
        } else if da == 0.0 && db > 0.0 {
            // The polygon leaves through this corner: the cut begins there.
            if let Some(last) = out.last_mut() {
                last.edge = edge;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::moments::Moments;
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;
    use std::f64::consts::PI;

    /// The same common part by cutting a large square with one half-plane after the other.
    fn by_cutting(normals: &[[f64; 2]], h: &[f64]) -> f64 {
        let r = 1e3;
        let mut polygon =
            [[-r, -r], [r, -r], [r, r], [-r, r]].map(|at| Corner { at, edge: u32::MAX }).to_vec();
        for (k, (n, h)) in normals.iter().zip(h).enumerate() {
            let mut next = Vec::new();
            clip(&polygon, *n, *h, k as u32, &mut next);
            polygon = next;
        }
        Moments::of(&polygon).area
    }

    fn strips(angles: &[f64]) -> Vec<[f64; 2]> {
        let mut sorted = angles.to_vec();
        sorted.sort_by(f64::total_cmp);
        let n: Vec<[f64; 2]> = sorted.iter().map(|a| [a.cos(), a.sin()]).collect();
        n.iter().copied().chain(n.iter().map(|n| [-n[0], -n[1]])).collect()
    }

    #[test]
    fn strips_about_a_circle_make_the_regular_polygon() {
        for n in [2_u32, 3, 25, 72] {
            let angles: Vec<f64> = (0..n).map(|k| PI * f64::from(k) / f64::from(n)).collect();
            let normals = strips(&angles);
            let mut out = Vec::new();
            assert!(Chain::default().intersect(&normals, &vec![0.5; normals.len()], &mut out));
            assert_eq!(out.len(), 2 * n as usize);
            let expected = 0.5 * f64::from(n) * (PI / (2.0 * f64::from(n))).tan();
            assert!((Moments::of(&out).area / expected - 1.0).abs() < 1e-14);
            // The edge that begins in a corner lies on its line.
            for (k, c) in out.iter().enumerate() {
                for at in [c.at, out[(k + 1) % out.len()].at] {
                    assert!((dot(normals[c.edge as usize], at) - 0.5).abs() < 1e-15);
                }
            }
        }
    }

    #[test]
    fn lines_that_meet_in_the_corners_of_a_body_leave_the_body() {
        // Tight strips about a triangle, anywhere: most lines go through one of three points.
        for turn in 0..400 {
            let t = f64::from(turn) * 0.0137;
            let body = [0.3, 2.4, 4.4].map(|a: f64| [0.2 + 0.5 * (a + t).cos(), 0.5 * (a + t).sin() - 0.1]);
            let angles: Vec<f64> = (0..72).map(|k| PI * f64::from(k) / 72.0).collect();
            let normals = strips(&angles);
            let reach = |n: &[f64; 2]| body.iter().map(|c| dot(*n, *c)).fold(f64::MIN, f64::max);
            let h: Vec<f64> = normals.iter().map(reach).collect();
            let mut out = Vec::new();
            assert!(Chain::default().intersect(&normals, &h, &mut out), "{turn}");
            let area = |c: &[Corner]| Moments::of(c).area;
            let triangle = body.map(|at| Corner { at, edge: 0 });
            assert!((1.0..1.05).contains(&(area(&out) / area(&triangle))), "{turn}");
            assert!((area(&out) - by_cutting(&normals, &h)).abs() < 1e-12, "{turn}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(11), cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn in_angular_order_it_is_what_cutting_one_by_one_gives(
            angles in proptest::collection::vec(0.0..PI, 2..12),
            middles in proptest::collection::vec(-0.5..0.5, 12),
            halves in proptest::collection::vec(0.0..0.8, 12),
            near: bool,
        ) {
            let mut angles = angles;
            if near {
                // Nearly parallel neighbours.
                angles = angles.iter().flat_map(|a| [*a, a + 1e-7]).take(12).collect();
            }
            let normals = strips(&angles);
            let h: Vec<f64> = (0..angles.len()).map(|k| middles[k] + halves[k])
                .chain((0..angles.len()).map(|k| halves[k] - middles[k])).collect();
            let mut out = Vec::new();
            let found = Chain::default().intersect(&normals, &h, &mut out);
            let spread = angles.iter().fold(0.0, |m: f64, a| m.max((a - angles[0]).sin().abs()));
            prop_assume!(spread > 0.01);
            let (area, expected) = (Moments::of(&out).area, by_cutting(&normals, &h));
            prop_assert!(found || out.is_empty());
            prop_assert!((area - expected).abs() < 1e-10, "{area} {expected}");
        }
    }
}
