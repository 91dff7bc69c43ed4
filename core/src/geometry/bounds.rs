//! Axis-aligned boxes.

use super::{Point, Vector};
use serde::{Deserialize, Serialize};

/// An axis-aligned box in the world, in mm; `min` ≤ `max` in every component.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Aabb {
    /// The corner of least x, y and z.
    pub min: Point,
    /// The corner of greatest x, y and z.
    pub max: Point,
}

impl Aabb {
    /// The smallest box that holds all points, or `None` where there is no point.
    pub fn of(points: impl IntoIterator<Item = Point>) -> Option<Self> {
        let mut points = points.into_iter();
        let first = points.next()?;
        Some(
            points.fold(Self { min: first, max: first }, |b, p| Self {
                min: b.min.inf(&p),
                max: b.max.sup(&p),
            }),
        )
    }
    /// Edge lengths, mm.
    pub fn size(&self) -> Vector {
        self.max - self.min
    }
    /// The greatest coordinate of any of its points, whatever its sign, mm.
    pub fn farthest(&self) -> f64 {
        self.min.coords.amax().max(self.max.coords.amax())
    }
    /// The centre.
    pub fn center(&self) -> Point {
        nalgebra::center(&self.min, &self.max)
    }
    /// The same box, larger by `margin_mm` on every side.
    #[must_use]
    pub fn grown(&self, margin_mm: f64) -> Self {
        let d = Vector::repeat(margin_mm);
        Self { min: self.min - d, max: self.max + d }
    }
    /// The common part of two boxes, or `None` where they are disjoint.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let both = Self { min: self.min.sup(&other.min), max: self.max.inf(&other.max) };
        (0..3).all(|k| both.min[k] <= both.max[k]).then_some(both)
    }
    /// The eight corners.
    pub fn corners(&self) -> [Point; 8] {
        std::array::from_fn(|i| {
            let pick = |k: usize| if i >> k & 1 == 0 { self.min[k] } else { self.max[k] };
            Point::new(pick(0), pick(1), pick(2))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_holds_its_points_and_intersects_as_sets_do() {
        let b = Aabb::of([Point::new(0., 1., 2.), Point::new(3., -1., 5.)]).unwrap();
        assert_eq!(b.size(), Vector::new(3., 2., 3.));
        assert_eq!(b.intersection(&b.grown(1.0)), Some(b));
        let far = Aabb { min: Point::new(9., 9., 9.), max: Point::new(10., 10., 10.) };
        assert_eq!(b.intersection(&far), None);
        assert_eq!(Aabb::of(b.corners()), Some(b));
    }
}
