//! What holds for any bodies and views.

use grainrig_core::hull::slices::{RowGrid, SliceError, SlicedHull, Strips};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::{PI, TAU};

type Polygon = Vec<[f64; 2]>;

/// A body of upright prisms: polygons with lowest and highest place.
#[derive(Debug, Clone)]
struct Prisms(Vec<(Polygon, [f64; 2])>);

/// Star-shaped polygons, convex or not, about any centre.
fn polygon() -> impl Strategy<Value = Polygon> {
    let radii = proptest::collection::vec(0.05..0.5, 3..9);
    (radii, -0.5..0.5, -0.5..0.5).prop_map(|(radii, x, y)| {
        let step = TAU / radii.len() as f64;
        let corner =
            |(k, r): (usize, f64)| [x + r * (k as f64 * step).cos(), y + r * (k as f64 * step).sin()];
        radii.into_iter().enumerate().map(corner).collect()
    })
}

fn prisms() -> impl Strategy<Value = Prisms> {
    let prism = (polygon(), 0.0..0.5, 0.1..0.6).prop_map(|(p, low, size)| (p, [low, low + size]));
    proptest::collection::vec(prism, 1..4).prop_map(Prisms)
}

fn angles() -> impl Strategy<Value = Vec<f64>> {
    proptest::collection::vec(-7.0..7.0, 3..9)
}

const ROW_GRID: RowGrid = RowGrid { first_mm: 0.02, pitch_mm: 0.04, rows: 25 };

impl Prisms {
    /// What a view sees: the union of the prisms' intervals.
    fn seen(&self, angle: f64, z: f64, out: &mut Vec<[f64; 2]>) {
        let mut all: Vec<[f64; 2]> = (self.0.iter())
            .filter(|(_, [low, high])| (*low..*high).contains(&z))
            .map(|(p, _)| {
                let u = p.iter().map(|c| c[0] * angle.cos() - c[1] * angle.sin());
                [u.clone().fold(f64::MAX, f64::min), u.fold(f64::MIN, f64::max)]
            })
            .collect();
        all.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let first = out.len();
        for [a, b] in all {
            match out[first..].last_mut() {
                Some(last) if a <= last[1] => last[1] = last[1].max(b),
                _ => out.push([a, b]),
            }
        }
    }

    fn views(&self, angles: &[f64]) -> Vec<Strips> {
        let view = |a: &f64| Strips::from_fn(ROW_GRID, *a, |z, out| self.seen(*a, z, out)).unwrap();
        angles.iter().map(view).collect()
    }
}

/// Whether a place is in one of the convex polygons; `slack` (mm²) is twice the area by which it may miss an edge.
fn holds(pieces: &[Polygon], p: [f64; 2], slack: f64) -> bool {
    pieces.iter().any(|piece| {
        (0..piece.len()).all(|k| {
            let (a, b) = (piece[k], piece[(k + 1) % piece.len()]);
            let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
            dx * (p[1] - a[1]) - dy * (p[0] - a[0]) >= -slack
        })
    })
}

/// The common area by counting places that every strip holds, and the spacing's square.
fn counted(views: &[Strips], row: usize) -> f64 {
    let n = 400;
    let step = 3.0 / f64::from(n);
    let mut count = 0;
    for k in 0..n * n {
        let p = [f64::from(k % n) * step - 1.5, f64::from(k / n) * step - 1.5];
        count += u32::from(views.iter().all(|v| {
            let u = p[0] * v.angle_rad().cos() - p[1] * v.angle_rad().sin();
            v.row(row).iter().any(|[a, b]| (*a..=*b).contains(&u))
        }));
    }
    f64::from(count) * step * step
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: RngSeed::Fixed(5), cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn the_hull_holds_the_body_and_nothing_that_a_view_excludes(body in prisms(), angles in angles()) {
        let views = body.views(&angles);
        let hull = SlicedHull::new(&views).unwrap();
        for row in 0..ROW_GRID.rows {
            let z = ROW_GRID.height(row);
            let pieces = hull.polygons(row);
            for (p, _) in body.0.iter().filter(|(_, [low, high])| (*low..*high).contains(&z)) {
                let n = p.len() as f64;
                let c = [p.iter().map(|c| c[0]).sum::<f64>() / n, p.iter().map(|c| c[1]).sum::<f64>() / n];
                // The corners and places between, which a body without holes has too.
                for (k, a) in p.iter().enumerate() {
                    let b = p[(k + 1) % p.len()];
                    for t in [0.0, 0.3, 0.7] {
                        let at = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
                        prop_assert!(holds(&pieces, at, 1e-12), "row {row}: {at:?} of {c:?}");
                    }
                }
            }
            for piece in &pieces {
                for (view, c) in views.iter().flat_map(|v| piece.iter().map(move |c| (v, c))) {
                    let u = c[0] * view.angle_rad().cos() - c[1] * view.angle_rad().sin();
                    let inside = |[a, b]: &[f64; 2]| (a - 1e-9..=b + 1e-9).contains(&u);
                    prop_assert!(view.row(row).iter().any(inside), "row {row}: a corner at {u} of {c:?}");
                }
            }
        }
        let row = 9;
        let (area, count) = (hull.slice_figures(row).area_mm2, counted(&views, row));
        let within = hull.polygons(row).iter().flatten().flatten().all(|x| x.abs() < 1.5);
        prop_assert!(!within || (area - count).abs() < 0.01 + 0.03 * area, "{area} {count}");
    }

    #[test]
    fn a_view_more_never_adds(body in prisms(), angles in angles(), other in prisms(), angle in -7.0..7.0) {
        // The added view need not even show the same body.
        let mut views = body.views(&angles);
        let before = SlicedHull::new(&views).unwrap();
        views.extend(other.views(&[angle]));
        let after = SlicedHull::new(&views).unwrap();
        let rounding = 1e-13;
        prop_assert!(after.volume_mm3() <= before.volume_mm3() + rounding);
        for row in 0..ROW_GRID.rows {
            let area = |h: &SlicedHull| h.slice_figures(row).area_mm2;
            prop_assert!(area(&after) <= area(&before) + rounding, "row {row}");
        }
    }

    #[test]
    fn neither_the_order_of_views_nor_threads_change_a_bit(body in prisms(), angles in angles(), turn in 0_usize..9) {
        let mut angles = angles;
        // A view from the opposite side, and one taken twice.
        angles.extend([angles[0] + PI, angles[1]]);
        let views = body.views(&angles);
        let hull = SlicedHull::new(&views).unwrap();
        let measures = hull.measures();
        for threads in 1..=3 {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut shuffled = views.clone();
            shuffled.rotate_left(turn % views.len());
            shuffled[1..].reverse();
            let (again, volume) = pool.install(|| {
                let h = SlicedHull::new(&shuffled).unwrap();
                let v = h.volume_mm3();
                (h, v)
            });
            prop_assert_eq!(pool.install(|| again.measures()), measures);
            prop_assert_eq!(volume.to_bits(), hull.volume_mm3().to_bits());
            prop_assert_eq!(&again, &hull);
        }
    }

    #[test]
    fn a_turn_of_all_views_changes_figures_by_rounding(body in prisms(), angles in angles(), by in -10.0..10.0) {
        // Views close in direction would make the angles' own rounding count.
        let apart = |k: usize| angles[..k].iter().all(|a| (a - angles[k]).sin().abs() > 1e-3);
        prop_assume!((0..angles.len()).all(apart));
        let views = body.views(&angles);
        let turned: Vec<Strips> = views.iter().map(|v| v.turned_to(v.angle_rad() + by)).collect();
        let figures = |v: &[Strips]| SlicedHull::new(v).unwrap().measures();
        let (a, b) = (figures(&views), figures(&turned));
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * a.abs().max(1.0);
        prop_assert!(near(a.volume_mm3, b.volume_mm3), "{} {}", a.volume_mm3, b.volume_mm3);
        prop_assert!(near(a.surface_area_mm2, b.surface_area_mm2), "{} {}", a.surface_area_mm2, b.surface_area_mm2);
        prop_assert!(near(a.inertia_mm5.trace(), b.inertia_mm5.trace()));
    }
}

#[test]
fn views_that_bound_nothing_or_have_other_rows_are_refused() {
    let view = |row_grid, angle| Strips::from_fn(row_grid, angle, |_, out| out.push([-1.0, 1.0])).unwrap();
    assert_eq!(SlicedHull::new(&[]), Err(SliceError::OneDirection { views: 0 }));
    let opposite = [view(ROW_GRID, 0.3), view(ROW_GRID, 0.3 + PI), view(ROW_GRID, 0.3)];
    assert_eq!(SlicedHull::new(&opposite), Err(SliceError::OneDirection { views: 3 }));
    let other = RowGrid { rows: 24, ..ROW_GRID };
    let mixed = SlicedHull::new(&[view(ROW_GRID, 0.0), view(other, 1.0)]);
    assert!(matches!(mixed, Err(SliceError::RowGrids { view: 1, .. })), "{mixed:?}");
    // Nothing in common is a hull without volume.
    let away = Strips::from_fn(ROW_GRID, 2.0, |_, out| out.push([7.0, 8.0])).unwrap();
    let empty = SlicedHull::new(&[view(ROW_GRID, 0.0), view(ROW_GRID, 1.0), away]).unwrap().measures();
    assert_eq!((empty.volume_mm3, empty.surface_area_mm2, empty.bounding_box_mm), (0.0, 0.0, None));
    assert_eq!(empty.centroid_mm, None);
}
