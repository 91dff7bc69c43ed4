//! Volume, centroid, inertia, box and surface of the hull.
//!
//! Along the height every slice stands for a slab, one pitch thick and with its row in the middle: the figures are
//! exactly those of this stack of prisms. As an integral of the slice's area over the height that is the midpoint
//! rule: its error is pitch²/24 × (the slope of the area at the top − at the bottom), of second order, as are the
//! errors from kinks between. It is the rule of choice here because every slice has the same positive weight, so that
//! a view that takes from the slices takes from the volume too, and because a flat bottom (the cut at the pedestal)
//! costs nothing where the row grid tiles the height; with the rows given by pixels, it costs what the pixels miss of it.

use super::cut::Corner;
use super::moments::Moments;
use super::{SlicedHull, surface};
use crate::geometry::{Aabb, Point};
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Figures of one slice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceFigures {
    /// Height of its row, mm.
    pub height_mm: f64,
    /// Area, mm².
    pub area_mm2: f64,
    /// Centre of area (x, y), mm; `None` where the slice is empty.
    pub centroid_mm: Option<[f64; 2]>,
    /// Second moments of area about the rotation axis, ∫x², ∫y² and ∫xy, mm⁴.
    pub second_mm4: [f64; 3],
    /// Convex pieces.
    pub pieces: usize,
}

/// Figures of the hull, at a density of 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceMeasures {
    /// Volume, mm³: the slices' areas times the pitch.
    pub volume_mm3: f64,
    /// Surface area, mm²: [`SlicedHull::measures`] defines what is counted.
    pub surface_area_mm2: f64,
    /// Centre of volume; `None` where the hull is empty.
    pub centroid_mm: Option<Point>,
    /// Inertia tensor about the centre of volume, mm⁵: ∫(r²δᵢₖ − rᵢrₖ) dV. Zero where the hull is empty.
    pub inertia_mm5: Matrix3<f64>,
    /// The tight box of the prisms; `None` where the hull is empty.
    pub bounding_box_mm: Option<Aabb>,
}

impl SlicedHull {
    /// The figures of a row's slice.
    pub fn slice_figures(&self, row: usize) -> SliceFigures {
        let m = self.moments(row);
        SliceFigures {
            height_mm: self.row_grid.height(row),
            area_mm2: m.area,
            centroid_mm: m.centroid(),
            second_mm4: m.second,
            pieces: self.slice(row).count(),
        }
    }

    pub(super) fn moments(&self, row: usize) -> Moments {
        self.slice(row).fold(Moments::default(), |sum, piece| sum.plus(&Moments::of(piece)))
    }

    /// Volume alone, mm³.
    pub fn volume_mm3(&self) -> f64 {
        let areas: Vec<f64> = (0..self.row_grid.rows).into_par_iter().map(|k| self.moments(k).area).collect();
        areas.iter().sum::<f64>() * self.row_grid.pitch_mm
    }

    /// All figures; rows are summed in their order.
    ///
    /// The surface is that of the slices joined up, not of the prisms' steps. Between neighbouring rows of one convex
    /// piece each it is the side of the convex hull of both slices: a trapezoid between edges of one view, a triangle
    /// from an edge that only one of them has to the other's farthest corner, which is what the views' cylinders are
    /// to second order. At an end a slice goes on for half a pitch, its area by a straight line from the last two rows
    /// (a rounded end comes to a point, a flat one to its full area), and the area there closes it. Rows of several
    /// pieces are joined piece by piece where these correspond, and where they do not by √(wall² + floor²): the mean
    /// perimeter times the pitch, and the area that only one of the two slices has.
    pub fn measures(&self) -> SliceMeasures {
        let p = self.row_grid.pitch_mm;
        let rows: Vec<(Moments, f64)> = (0..self.row_grid.rows)
            .into_par_iter()
            .map(|k| (self.moments(k), if k > 0 { surface::between(self, k - 1, k) } else { 0.0 }))
            .collect();
        let (mut volume, mut area, mut first, mut second) = (0.0, 0.0, [0.0; 3], [0.0; 6]);
        for (k, (m, side)) in rows.iter().enumerate() {
            let z = self.row_grid.height(k);
            volume += m.area;
            area += side;
            let add = [m.first[0], m.first[1], z * m.area];
            (0..3).for_each(|i| first[i] += add[i]);
            let [xx, yy, xy] = m.second;
            let zz = (z * z + p * p / 12.0) * m.area;
            let add = [xx, yy, zz, xy, z * m.first[0], z * m.first[1]];
            (0..6).for_each(|i| second[i] += add[i]);
        }
        let area_of = |k: usize| rows[k].0.area;
        let ends = (0..rows.len()).filter(|k| area_of(*k) > 0.0).map(|k| {
            let beyond =
                |neighbour: Option<usize>| neighbour.filter(|n| *n < rows.len()).map_or(0.0, area_of);
            let (below, above) = (beyond(k.checked_sub(1)), beyond(Some(k + 1)));
            let end = |here: f64, other: f64| if here > 0.0 { 0.0 } else { surface::end(self, k, other) };
            end(below, above) + end(above, below)
        });
        area += ends.sum::<f64>();
        let volume_mm3 = volume * p;
        let c = first.map(|f| f / volume);
        let centroid_mm = (volume > 0.0).then(|| Point::from(c));
        let s = |i: usize, a: usize, b: usize| (second[i] - volume * c[a] * c[b]) * p;
        let inertia_mm5 = if volume > 0.0 {
            let (xx, yy, zz) = (s(0, 0, 0), s(1, 1, 1), s(2, 2, 2));
            let (xy, xz, yz) = (s(3, 0, 1), s(4, 0, 2), s(5, 1, 2));
            Matrix3::new(yy + zz, -xy, -xz, -xy, xx + zz, -yz, -xz, -yz, xx + yy)
        } else {
            Matrix3::zeros()
        };
        SliceMeasures {
            volume_mm3,
            surface_area_mm2: area,
            centroid_mm,
            inertia_mm5,
            bounding_box_mm: self.bounding_box(),
        }
    }

    fn bounding_box(&self) -> Option<Aabb> {
        let filled = |k: &usize| self.rows[*k] < self.rows[k + 1];
        let low = (0..self.row_grid.rows).find(filled)?;
        let high = (0..self.row_grid.rows).rfind(filled)?;
        let half = 0.5 * self.row_grid.pitch_mm;
        let at = |c: &Corner, z: f64| Point::new(c.at[0], c.at[1], z);
        let (bottom, top) = (self.row_grid.height(low) - half, self.row_grid.height(high) + half);
        Aabb::of(self.corners.iter().flat_map(|c| [at(c, bottom), at(c, top)]))
    }
}
