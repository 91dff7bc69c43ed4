//! Surface distances between mesh and body, both ways: mean and largest, mm.

use super::{MeshError, Solid, TetMesh};
use crate::geometry::{ImplicitBody, Point};
use rayon::prelude::*;
use serde::Serialize;

/// The mean and the largest of some distances, mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distance {
    /// The mean.
    pub mean_mm: f64,
    /// The largest.
    pub max_mm: f64,
}

/// Distances between a mesh's surface and a body's, both ways.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Distances {
    /// From the mesh's facets (corners, middles of edges, and centres, weighted as Simpson's rule on a triangle weighs
    /// them, and by area) to the body.
    pub to_body: Distance,
    /// From points on the body's surface to the mesh's surface.
    pub from_body: Distance,
}

impl Distances {
    /// Of a mesh from the body it was made of; `points` lie on the body's surface. Takes one body value for each corner,
    /// edge and facet of the mesh, and a search in a tree for each point.
    ///
    /// # Errors
    /// [`MeshError::Open`] where the mesh has no closed surface.
    pub fn measure(body: &dyn ImplicitBody, mesh: &TetMesh, points: &[Point]) -> Result<Self, MeshError> {
        let surface = mesh.surface().triangles;
        let at_vertices: Vec<f64> = surface.vertices.par_iter().map(|p| body.value(p).abs()).collect();
        // For each facet its mean, its largest and its area.
        let facets: Vec<[f64; 3]> = (0..surface.triangles.len())
            .into_par_iter()
            .map(|t| {
                let [a, b, c] = surface.corners(t);
                let edges =
                    [(a, b), (b, c), (c, a)].map(|(p, q)| body.value(&nalgebra::center(&p, &q)).abs());
                let centre = body.value(&((a.coords + b.coords + c.coords) / 3.0).into()).abs();
                let corners = surface.triangles[t].map(|v| at_vertices[v as usize]);
                // Exact for cubic functions: 1/20 of each corner, 2/15 of each middle, 9/20 of the centre.
                let mean = corners.iter().sum::<f64>() / 20.0
                    + edges.iter().sum::<f64>() * 2.0 / 15.0
                    + 9.0 / 20.0 * centre;
                let most = corners.into_iter().chain(edges).fold(centre, f64::max);
                [mean, most, 0.5 * (b - a).cross(&(c - a)).norm()]
            })
            .collect();
        let area: f64 = facets.iter().map(|f| f[2]).sum();
        let to_body = Distance {
            mean_mm: facets.iter().map(|f| f[0] * f[2]).sum::<f64>() / area,
            max_mm: facets.iter().map(|f| f[1]).fold(0.0, f64::max),
        };
        let solid = Solid::new(surface)?;
        let away: Vec<f64> = points.par_iter().map(|p| solid.value(p).abs()).collect();
        let from_body = Distance {
            mean_mm: away.iter().sum::<f64>() / away.len().max(1) as f64,
            max_mm: away.iter().copied().fold(0.0, f64::max),
        };
        Ok(Self { to_body, from_body })
    }

    /// The largest either way, mm.
    pub fn max_mm(&self) -> f64 {
        self.to_body.max_mm.max(self.from_body.max_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Ball;
    use crate::mesh::{Controls, mesh};

    #[test]
    fn a_ball_s_facets_lie_on_both_sides_by_their_sag() {
        let ball = Ball { center: Point::origin(), radius_mm: 1.0 };
        let controls = Controls::for_size(4.0);
        let made = mesh(&ball, &controls, &mut |_| ()).unwrap();
        let points: Vec<Point> =
            made.surface().triangles.vertices.iter().map(|p| (p.coords.normalize()).into()).collect();
        let d = Distances::measure(&ball, &made, &points).unwrap();
        // A facet of circumradius R sags by R²/2; half of it lies on either side.
        let sag = 0.5 * controls.surface_size_mm.powi(2);
        assert!(d.to_body.max_mm < sag && d.to_body.mean_mm < 0.4 * sag, "{d:?} {sag}");
        assert!(d.from_body.max_mm < sag && d.from_body.max_mm > 0.1 * sag, "{d:?} {sag}");
        assert!(d.max_mm() >= d.from_body.max_mm);
    }
}
