//! Bodies given by a function: negative inside, positive outside.

use super::{Aabb, Point};

/// A body known by a distance-like function of the point.
pub trait ImplicitBody: Sync {
    /// Negative inside, zero on the surface, positive outside; near the surface about the distance in mm.
    fn value(&self, p: &Point) -> f64;
    /// A box that holds the whole body.
    fn bounds(&self) -> Aabb;
    /// The most by which the value changes over 1 mm, where such a bound is known: what lies farther from the surface
    /// than a value over it need not be looked at.
    fn steepness(&self) -> Option<f64> {
        None
    }
}

/// A ball: the body of known answers.
#[derive(Debug, Clone, Copy)]
pub struct Ball {
    /// Its centre.
    pub center: Point,
    /// Its radius, mm.
    pub radius_mm: f64,
}

impl ImplicitBody for Ball {
    fn value(&self, p: &Point) -> f64 {
        (p - self.center).norm() - self.radius_mm
    }
    fn bounds(&self) -> Aabb {
        Aabb { min: self.center, max: self.center }.grown(self.radius_mm)
    }
    fn steepness(&self) -> Option<f64> {
        Some(1.0)
    }
}
