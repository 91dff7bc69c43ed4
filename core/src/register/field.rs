//! An implicit body sampled on a lattice, trilinear, for searches that ask it millions of times.

use crate::geometry::{Aabb, ImplicitBody, Point, Vector};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Values of a body at the points of a lattice, trilinear between them.
#[derive(Debug, Clone)]
pub(super) struct Field {
    bounds: Aabb,
    pitch_mm: f64,
    /// Points along x, y and z.
    size: [usize; 3],
    /// `[z, y, x]`, mm.
    values: Vec<f32>,
}

/// The mass of a homogeneous body: where its centre is and how it spreads.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    /// The centroid.
    pub centre: Point,
    /// The second moments about it over the volume, mm².
    pub spread: Matrix3<f64>,
}

impl Field {
    /// Samples a body over a box with `cells` cells along its longest edge.
    pub fn of(body: &dyn ImplicitBody, bounds: &Aabb, cells: usize) -> Self {
        let pitch_mm = bounds.size().max() / cells as f64;
        let size: [usize; 3] = std::array::from_fn(|k| (bounds.size()[k] / pitch_mm).ceil() as usize + 2);
        let values = (0..size.iter().product())
            .into_par_iter()
            .map(|n| body.value(&Self::point(bounds, pitch_mm, size, n)) as f32)
            .collect();
        Self { bounds: *bounds, pitch_mm, size, values }
    }

    fn point(bounds: &Aabb, pitch_mm: f64, [nx, ny, _]: [usize; 3], n: usize) -> Point {
        bounds.min + Vector::new((n % nx) as f64, (n / nx % ny) as f64, (n / nx / ny) as f64) * pitch_mm
    }

    /// Centroid and spread of the lattice points inside; `None` where there is none.
    pub fn moments(&self) -> Option<Moments> {
        let inside = || {
            (self.values.iter().enumerate())
                .filter(|(_, v)| **v < 0.0)
                .map(|(n, _)| Self::point(&self.bounds, self.pitch_mm, self.size, n))
        };
        let count = inside().count() as f64;
        if count == 0.0 {
            return None;
        }
        let centre = Point::from(inside().map(|p| p.coords).sum::<Vector>() / count);
        let spread = inside().map(|p| (p - centre) * (p - centre).transpose()).sum::<Matrix3<f64>>() / count;
        Some(Moments { centre, spread })
    }
}

impl ImplicitBody for Field {
    /// Outside the lattice's box the value at the box grows by the distance from it.
    fn value(&self, p: &Point) -> f64 {
        let at = (p - self.bounds.min) / self.pitch_mm;
        let mut away2 = 0.0;
        let (mut cell, mut part) = ([0; 3], [0.0; 3]);
        for k in 0..3 {
            let within = at[k].clamp(0.0, (self.size[k] - 1) as f64);
            away2 += (at[k] - within).powi(2);
            cell[k] = (within as usize).min(self.size[k] - 2);
            part[k] = within - cell[k] as f64;
        }
        let [nx, ny, _] = self.size;
        let first = (cell[2] * ny + cell[1]) * nx + cell[0];
        let along_x = |n: usize| {
            let (a, b) = (f64::from(self.values[n]), f64::from(self.values[n + 1]));
            a + part[0] * (b - a)
        };
        let along_y = |n: usize| {
            let (a, b) = (along_x(n), along_x(n + nx));
            a + part[1] * (b - a)
        };
        let (a, b) = (along_y(first), along_y(first + nx * ny));
        a + part[2] * (b - a) + away2.sqrt() * self.pitch_mm
    }

    fn bounds(&self) -> Aabb {
        self.bounds
    }
}

/// The gradient of a body's function by central differences over `step_mm` to either side.
pub(super) fn gradient(body: &dyn ImplicitBody, p: &Point, step_mm: f64) -> Vector {
    Vector::from_fn(|k, _| {
        let mut d = Vector::zeros();
        d[k] = step_mm;
        (body.value(&(p + d)) - body.value(&(p - d))) / (2.0 * step_mm)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ball;

    #[test]
    fn a_balls_field_has_its_distances_its_centre_and_its_spread() {
        let ball = Ball { center: Point::new(0.1, -0.2, 0.3), radius_mm: 0.5 };
        let field = Field::of(&ball, &ball.bounds().grown(0.1), 60);
        let p = Point::new(0.35, 0.0, 0.52);
        assert!((field.value(&p) - ball.value(&p)).abs() < 1e-3);
        let far = ball.center + Vector::x() * 3.0;
        assert!((field.value(&far) - ball.value(&far)).abs() < 0.02);
        let normal = (p - ball.center).normalize();
        assert!((gradient(&field, &p, 0.01) - normal).norm() < 0.02);
        let moments = field.moments().unwrap();
        assert!((moments.centre - ball.center).norm() < 1e-3, "{moments:?}");
        // A fifth of the squared radius in every direction.
        assert!((moments.spread - Matrix3::identity() * 0.05).norm() < 1e-3, "{moments:?}");
    }
}
