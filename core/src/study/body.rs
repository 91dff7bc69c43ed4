//! A body whose every silhouette is known exactly.

use crate::geometry::{Aabb, Point, TriangleMesh};
use crate::hull::slices::RowGrid;

/// Cuts of neighbouring triangles closer than this meet, as a share of the body's size.
const MEET: f64 = 1e-9;

/// A body about whose z axis the views are taken.
#[derive(Debug, Clone)]
pub enum Body {
    /// A ball of this diameter, mm, about the origin.
    Ball(f64),
    /// A closed surface, mm, the middle of its box at the origin.
    Surface(TriangleMesh),
}

impl Body {
    /// A closed surface, moved so that the middle of its box is at the origin; `None` where it is empty.
    pub fn of_surface(mut surface: TriangleMesh) -> Option<Self> {
        let middle = surface.bounds()?.center();
        surface.vertices.iter_mut().for_each(|p| *p = Point::from(*p - middle));
        Some(Self::Surface(surface))
    }

    /// Volume, mm³.
    pub fn volume_mm3(&self) -> f64 {
        match self {
            Self::Ball(d) => std::f64::consts::PI / 6.0 * d.powi(3),
            Self::Surface(s) => s.volume_mm3(),
        }
    }

    /// Diameter of the ball of the same volume, mm.
    pub fn diameter_mm(&self) -> f64 {
        (6.0 * self.volume_mm3() / std::f64::consts::PI).cbrt()
    }

    /// The box, mm.
    pub(super) fn bounds(&self) -> Aabb {
        let cube = |r: f64| Aabb { min: Point::new(-r, -r, -r), max: Point::new(r, r, r) };
        match self {
            Self::Ball(d) => cube(0.5 * d),
            Self::Surface(s) => s.bounds().unwrap_or(cube(0.0)),
        }
    }

    /// Radius of the circle about the axis that the body turns in, mm.
    pub(super) fn reach_mm(&self) -> f64 {
        match self {
            Self::Ball(d) => 0.5 * d,
            Self::Surface(s) => s.vertices.iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max),
        }
    }

    /// What is seen of it at an angle, on each row of a grid: intervals across the axis, mm, ascending and disjoint.
    pub(super) fn intervals(&self, row_grid: RowGrid, angle_rad: f64) -> Vec<Vec<[f64; 2]>> {
        match self {
            Self::Ball(d) => (0..row_grid.rows)
                .map(|k| {
                    let half2 = 0.25 * d * d - row_grid.height(k).powi(2);
                    if half2 > 0.0 { vec![[-half2.sqrt(), half2.sqrt()]] } else { Vec::new() }
                })
                .collect(),
            Self::Surface(s) => shadow(s, row_grid, angle_rad),
        }
    }
}

/// On each row the union of the triangles' cuts at its height.
fn shadow(surface: &TriangleMesh, row_grid: RowGrid, angle_rad: f64) -> Vec<Vec<[f64; 2]>> {
    let (sin, cos) = angle_rad.sin_cos();
    let mut rows: Vec<Vec<[f64; 2]>> = vec![Vec::new(); row_grid.rows];
    let row_index = |z: f64| (z - row_grid.first_mm) / row_grid.pitch_mm;
    for t in 0..surface.triangles.len() {
        let corners = surface.corners(t).map(|p| [p.x * cos - p.y * sin, p.z]);
        let low = corners.iter().map(|c| row_index(c[1])).fold(f64::INFINITY, f64::min).ceil().max(0.0);
        let high = corners.iter().map(|c| row_index(c[1])).fold(f64::NEG_INFINITY, f64::max).floor();
        if high < low {
            continue;
        }
        for k in low as usize..(high as usize + 1).min(row_grid.rows) {
            let z = row_grid.height(k);
            let mut cut = [f64::INFINITY, f64::NEG_INFINITY];
            for (a, b) in [(corners[0], corners[1]), (corners[1], corners[2]), (corners[2], corners[0])] {
                if (a[1] <= z) != (b[1] <= z) {
                    let u = a[0] + (b[0] - a[0]) * (z - a[1]) / (b[1] - a[1]);
                    cut = [cut[0].min(u), cut[1].max(u)];
                }
            }
            if cut[0] < cut[1] {
                rows[k].push(cut);
            }
        }
    }
    let meet = MEET * surface.bounds().map_or(1.0, |b| b.size().max());
    rows.iter_mut().for_each(|row| join(row, meet));
    rows
}

/// Sorts intervals and joins those that meet.
fn join(row: &mut Vec<[f64; 2]>, meet: f64) {
    row.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut kept = 0;
    for k in 0..row.len() {
        if kept > 0 && row[k][0] <= row[kept - 1][1] + meet {
            row[kept - 1][1] = row[kept - 1][1].max(row[k][1]);
        } else {
            row[kept] = row[k];
            kept += 1;
        }
    }
    row.truncate(kept);
}
