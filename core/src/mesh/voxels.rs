//! An implicit body from a binary voxel volume, smoothed.

use super::{MeshError, check_extent};
use crate::geometry::{Aabb, ImplicitBody, Point, Vector};
use rayon::prelude::*;

/// A body of voxels, its staircase smoothed: the value is half less how much of the voxels about the point is filled
/// (weighted as 1 2 1 along each axis, linear between), times two pitches: about the distance where the surface faces along
/// an axis. Smoothing moves a surface with radius of curvature r inwards by about 0.7 pitch²/r: a ball of 30 voxels across
/// loses 1 % of its volume. What is thinner than a voxel is lost.
#[derive(Debug, Clone, PartialEq)]
pub struct Voxels {
    /// The centre of the first voxel.
    origin: Point,
    pitch_mm: f64,
    size: [usize; 3],
    /// How many are filled.
    count: usize,
    /// `[z, y, x]`: how much of the 27 voxels around each, weighted as 1 2 1 along each axis, is filled.
    filled: Vec<f32>,
}

impl Voxels {
    /// From voxels `[z, y, x]` (x fastest) of edge `pitch_mm`, the first centred at `origin`; beyond them is outside.
    ///
    /// # Errors
    /// [`MeshError::Control`] for a pitch that is not a positive number, [`MeshError::Voxels`] where there are not as many
    /// as the size states; those of [`check_extent`].
    pub fn new(origin: Point, pitch_mm: f64, size: [usize; 3], inside: &[bool]) -> Result<Self, MeshError> {
        if !(pitch_mm.is_finite() && pitch_mm > 0.0) {
            let (limit, remedy) = ("positive and finite", "give the edge of a voxel");
            return Err(MeshError::Control { name: "pitch_mm", value: pitch_mm, unit: "mm", limit, remedy });
        }
        let expected = size.iter().try_fold(1usize, |n, s| n.checked_mul(*s));
        if expected != Some(inside.len()) || inside.is_empty() {
            return Err(MeshError::Voxels { size, count: inside.len() });
        }
        let edges = Vector::from(size.map(|n| n as f64)) * pitch_mm;
        check_extent(&Aabb { min: origin, max: origin + edges })?;
        let mut filled: Vec<f32> = inside.iter().map(|b| f32::from(u8::from(*b))).collect();
        for (stride, along) in [1, size[0], size[0] * size[1]].into_iter().zip(size) {
            let before = filled.clone();
            for (i, f) in filled.iter_mut().enumerate() {
                let at = i / stride % along;
                let low = if at > 0 { before[i - stride] } else { 0.0 };
                let high = if at + 1 < along { before[i + stride] } else { 0.0 };
                *f = 0.25 * (low + 2.0 * before[i] + high);
            }
        }
        let count = inside.iter().filter(|b| **b).count();
        Ok(Self { origin, pitch_mm, size, count, filled })
    }

    /// The volume of the voxels that are filled, before smoothing, mm³: what smoothing moves from one to another stays.
    pub fn volume_mm3(&self) -> f64 {
        self.count as f64 * self.pitch_mm.powi(3)
    }

    /// Points on the smoothed surface: where it crosses the lines between the centres of neighbouring voxels.
    pub fn surface_points(&self) -> Vec<Point> {
        let [nx, ny, nz] = self.size.map(|n| n as i64);
        let of_layer = |z: i64| {
            let mut out = Vec::new();
            for (y, x) in (-1..ny).flat_map(|y| (-1..nx).map(move |x| (y, x))) {
                let here = self.at([x, y, z]) - 0.5;
                for k in 0..3 {
                    let mut next = [x, y, z];
                    next[k] += 1;
                    let there = self.at(next) - 0.5;
                    if (here < 0.0) != (there < 0.0) {
                        let mut way = Vector::new(x as f64, y as f64, z as f64);
                        way[k] += here / (here - there);
                        out.push(self.origin + way * self.pitch_mm);
                    }
                }
            }
            out
        };
        (-1..nz).into_par_iter().flat_map_iter(of_layer).collect()
    }

    fn at(&self, c: [i64; 3]) -> f64 {
        if (0..3).any(|k| c[k] < 0 || c[k] >= self.size[k] as i64) {
            return 0.0;
        }
        let [x, y, z] = c.map(|x| x as usize);
        f64::from(self.filled[(z * self.size[1] + y) * self.size[0] + x])
    }
}

impl ImplicitBody for Voxels {
    fn value(&self, p: &Point) -> f64 {
        let q = (p - self.origin) / self.pitch_mm;
        let low = q.map(f64::floor);
        let part = q - low;
        let mut sum = 0.0;
        for i in 0..8i64 {
            let bit = |k: usize| i >> k & 1;
            let weight: f64 = (0..3).map(|k| if bit(k) == 1 { part[k] } else { 1.0 - part[k] }).product();
            sum += weight * self.at(std::array::from_fn(|k| low[k] as i64 + bit(k)));
        }
        2.0 * (0.5 - sum) * self.pitch_mm
    }
    fn bounds(&self) -> Aabb {
        let size = Vector::from(self.size.map(|n| n as f64)) * self.pitch_mm;
        let min = self.origin - Vector::repeat(0.5 * self.pitch_mm);
        Aabb { min, max: min + size }.grown(self.pitch_mm)
    }
    // No steepness: away from the surface the value is constant, and bounds no distance.
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{Controls, mesh};

    #[test]
    fn a_ball_of_voxels_is_meshed_with_its_volume_and_without_stairs() {
        let n = 40;
        let inside: Vec<bool> = (0..n * n * n)
            .map(|i| [i % n, i / n % n, i / n / n].map(|x| x as f64 - 19.5))
            .map(|c| c.iter().map(|x| x * x).sum::<f64>() < 15.0 * 15.0)
            .collect();
        let voxels = Voxels::new(Point::origin(), 0.02, [n; 3], &inside).unwrap();
        let made = mesh(&voxels, &Controls::for_size(1.2), &mut |_| ()).unwrap();
        let counted = voxels.volume_mm3();
        assert!((counted / (4.0 / 3.0 * std::f64::consts::PI * 0.027) - 1.0).abs() < 0.015, "{counted}");
        assert!((made.volume_mm3() / counted - 1.0).abs() < 0.012, "{} {counted}", made.volume_mm3());
        let middle = Vector::repeat(19.5 * 0.02);
        for p in made.surface().triangles.vertices {
            assert!(((p.coords - middle).norm() - 0.3).abs() < 0.01, "{p}");
        }
        let points = voxels.surface_points();
        // Each line through the ball's shadow along an axis, twice: 3 · 2 · π · 15².
        assert!((4000..4500).contains(&points.len()), "{}", points.len());
        for p in points {
            assert!(voxels.value(&p).abs() < 1e-7 && ((p.coords - middle).norm() - 0.3).abs() < 0.01, "{p}");
        }
    }

    #[test]
    fn wrong_counts_and_pitches_are_refused() {
        assert!(matches!(Voxels::new(Point::origin(), 0.0, [1; 3], &[true]), Err(MeshError::Control { .. })));
        let e = Voxels::new(Point::origin(), 1.0, [2; 3], &[true]).unwrap_err().to_string();
        assert!(e.contains("2 × 2 × 2") && e.contains("1 voxels"), "{e}");
    }
}
