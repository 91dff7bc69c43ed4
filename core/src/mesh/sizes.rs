//! The size field: how large the cells of the background grid may be at a point.
//!
//! ```text
//! a(p) = min(a_surface + g·depth(p), a_inside, a_contact + g·|z − contact zone|),   g = 0.6
//! ```

use super::controls::{CUBES_PER_TET, SPACING_PER_SIZE};
use super::{Controls, TetMesh, score};
use crate::geometry::{ImplicitBody, Point};
use rayon::prelude::*;

/// By how much a cell may grow over a distance of 1, away from a contact or from the surface. Widths are rounded down to
/// halves of one another, so that in the mean they grow by about 0.4.
const GRADING: f64 = 0.6;
/// How far below the highest and above the lowest point a contact reaches, over the body's height, where it is not given:
/// a ball pressed by that much touches on a circle of 0.28 of its radius.
const CONTACT_DEPTH: f64 = 0.02;
/// Columns along x and y by which the highest and the lowest point are sought.
const COLUMNS: i32 = 72;
/// Steps along a column before it is given up: it grazes the body.
const MOST_STEPS: usize = 4000;

/// The zones at the top and bottom of a body where plates will touch it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contacts {
    /// Where the zone at the bottom ends, mm.
    pub(super) below: f64,
    /// Where the zone at the top begins, mm.
    pub(super) above: f64,
    /// Largest circumradius of a facet there, mm.
    pub(super) size_mm: f64,
}

impl Contacts {
    /// The zones of a body; `None` where the controls ask for none.
    pub(super) fn of(body: &dyn ImplicitBody, controls: &Controls) -> Option<Self> {
        let size_mm = controls.size_at_contact_mm?;
        let [low, high] = heights(body, size_mm);
        let depth = controls.contact_depth_mm.unwrap_or(CONTACT_DEPTH * (high - low));
        Some(Self { below: low + depth, above: high - depth, size_mm })
    }

    /// How far below or above the nearer zone a height is, mm; zero inside.
    pub(super) fn distance(&self, z: f64) -> f64 {
        (z - self.below).min(self.above - z).max(0.0)
    }

    /// The largest circumradius of a surface facet with all corners in a zone, mm; zero where there is none.
    pub(super) fn largest_facet_mm(&self, mesh: &TetMesh) -> f64 {
        let surface = mesh.surface().triangles;
        (0..surface.triangles.len())
            .map(|t| surface.corners(t))
            .filter(|p| p.iter().all(|p| self.distance(p.z) == 0.0))
            .map(|p| score::circumradius_and_least_sine(&p).0)
            .fold(0.0, f64::max)
    }
}

/// The size field: spacings of the body-centred grid, mm.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// The width of the finest cells.
    pub(super) finest_mm: f64,
    /// At the surface.
    pub(super) surface_mm: f64,
    /// Deep inside.
    pub(super) inside_mm: f64,
    /// At the contacts, and where they are.
    contacts: Option<(Contacts, f64)>,
}

impl Sizes {
    /// The spacings that should keep the controls, each multiplied by its factor in `finer` (surface, contact, volume).
    pub(super) fn new(controls: &Controls, contacts: Option<Contacts>, finer: [f64; 3]) -> Self {
        let inside_mm = (CUBES_PER_TET * controls.tet_volume_mm3).cbrt() * finer[2];
        let surface_mm = (SPACING_PER_SIZE * controls.surface_size_mm * finer[0]).min(inside_mm);
        let contacts = contacts.map(|c| (c, (SPACING_PER_SIZE * c.size_mm * finer[1]).min(surface_mm)));
        // Widths are halves of one another. Where that does not suit both sizes, the finer one or the coarser
        // one is met exactly: whichever leaves less of the other's to spare.
        let finest_mm = contacts.map_or(surface_mm, |(_, fine)| {
            let halvings = (surface_mm / fine).log2();
            let whole = (halvings - 1e-9).ceil().max(0.0);
            if whole - halvings <= 0.2 { surface_mm * (-whole).exp2() } else { fine }
        });
        Self { finest_mm, surface_mm, inside_mm, contacts }
    }

    /// The greatest width of a cell about `center` that reaches `half_mm` from there, all of it at least `depth_mm` below
    /// the surface (zero where it may touch it).
    pub(super) fn at(&self, center: &Point, half_mm: f64, depth_mm: f64) -> f64 {
        let own = (self.surface_mm + GRADING * depth_mm).min(self.inside_mm);
        let Some((zone, fine)) = self.contacts else { return own };
        own.min(fine + GRADING * (zone.distance(center.z) - half_mm).max(0.0))
    }
}

/// The lowest and highest point of a body along z, mm, sought along columns. Where none meets the body (it is empty, or
/// thinner than the columns' distance), its box.
fn heights(body: &dyn ImplicitBody, size_mm: f64) -> [f64; 2] {
    let bounds = body.bounds();
    let (size, least) = (bounds.size(), 0.02 * size_mm);
    let steep = body.steepness();
    // Along a column from one end until the body is met.
    let march = |x: f64, y: f64, from: f64, way: f64| -> Option<f64> {
        let mut gone = 0.0;
        for _ in 0..MOST_STEPS {
            let v = body.value(&Point::new(x, y, from + way * gone));
            if v.is_nan() || gone > size.z {
                return None;
            }
            if v <= least {
                return Some(from + way * (gone + v.min(least)));
            }
            gone += steep.map_or(0.25 * size_mm, |s| (v / s).max(0.25 * least));
        }
        None
    };
    let columns = |part: i32| (f64::from(part) + 0.5) / f64::from(COLUMNS);
    let found: Vec<[Option<f64>; 2]> = (0..COLUMNS * COLUMNS)
        .into_par_iter()
        .map(|k| {
            let x = bounds.min.x + size.x * columns(k % COLUMNS);
            let y = bounds.min.y + size.y * columns(k / COLUMNS);
            [march(x, y, bounds.min.z, 1.0), march(x, y, bounds.max.z, -1.0)]
        })
        .collect();
    let low = found.iter().filter_map(|f| f[0]).fold(f64::INFINITY, f64::min);
    let high = found.iter().filter_map(|f| f[1]).fold(f64::NEG_INFINITY, f64::max);
    if low < high { [low, high] } else { [bounds.min.z, bounds.max.z] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ball;

    #[test]
    fn the_lowest_and_highest_place_of_a_ball_are_found() {
        let ball = Ball { center: Point::new(0.1, 0.2, 0.3), radius_mm: 0.5 };
        let [low, high] = heights(&ball, 0.01);
        assert!((low + 0.2).abs() < 1e-3 && (high - 0.8).abs() < 1e-3, "{low} {high}");
    }

    #[test]
    fn cells_are_fine_at_the_contacts_and_grow_away_from_them() {
        let ball = Ball { center: Point::origin(), radius_mm: 0.4 };
        let controls =
            Controls { size_at_contact_mm: Some(0.008), surface_size_mm: 0.05, ..Controls::for_size(2.0) };
        let contacts = Contacts::of(&ball, &controls);
        let sizes = Sizes::new(&controls, contacts, [1.0; 3]);
        let at = |z: f64| sizes.at(&Point::new(0.0, 0.0, z), 0.0, 0.0);
        assert!((at(0.395) - 1.45 * 0.008).abs() < 1e-12 && (at(-0.39) - at(0.39)).abs() < 1e-12);
        assert!(at(0.3) > at(0.35) && at(0.35) > at(0.39) && (at(0.0) - 1.45 * 0.05).abs() < 1e-12);
        assert!(sizes.finest_mm <= at(0.4));
    }
}
