//! Histograms of a mesh's quality over its tetrahedra and facets.

use super::{TetMesh, score};

/// A histogram of equal bins; values beyond its ends count in the first and last.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Histogram {
    /// Where the first bin begins.
    pub low: f64,
    /// Where the last one ends.
    pub high: f64,
    /// How many values each has.
    pub counts: Vec<u64>,
}

impl Histogram {
    fn new(low: f64, high: f64, bins: usize) -> Self {
        Self { low, high, counts: vec![0; bins] }
    }
    fn add(&mut self, value: f64) {
        let bins = self.counts.len();
        let at = (value - self.low) / (self.high - self.low) * bins as f64;
        self.counts[(at.max(0.0) as usize).min(bins - 1)] += 1;
    }
}

/// The spread of a mesh's quality.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Spread {
    /// Six dihedral angles of each tetrahedron, degrees.
    pub dihedral_deg: Histogram,
    /// Three angles of each surface facet, degrees.
    pub facet_angle_deg: Histogram,
    /// Circumradius over shortest edge; 0.61 is regular.
    pub radius_edge: Histogram,
    /// Longest edge over smallest altitude; 1.22 is regular.
    pub aspect: Histogram,
    /// Smallest altitude of each tetrahedron over their median.
    pub altitude: Histogram,
}

impl TetMesh {
    /// Histograms of the mesh, which must pass [`TetMesh::check`].
    pub fn spread(&self) -> Spread {
        let mut spread = Spread {
            dihedral_deg: Histogram::new(0.0, 180.0, 90),
            facet_angle_deg: Histogram::new(0.0, 180.0, 90),
            radius_edge: Histogram::new(0.5, 2.0, 60),
            aspect: Histogram::new(1.0, 5.0, 60),
            altitude: Histogram::new(0.0, 2.0, 60),
        };
        let mut altitudes = Vec::with_capacity(self.tets.len());
        for t in 0..self.tets.len() {
            let m = self.measure(t);
            m.cosines.iter().for_each(|c| spread.dihedral_deg.add(c.clamp(-1.0, 1.0).acos().to_degrees()));
            spread.radius_edge.add(m.radius_edge);
            let p = self.corners(t);
            let longest = score::EDGES.iter().map(|&[i, j, ..]| (p[i] - p[j]).norm()).fold(0.0, f64::max);
            spread.aspect.add(longest / m.altitude_mm);
            altitudes.push(m.altitude_mm);
        }
        if !altitudes.is_empty() {
            let mut sorted = altitudes.clone();
            let middle = (sorted.len() - 1) / 2;
            let median = *sorted.select_nth_unstable_by(middle, f64::total_cmp).1;
            altitudes.iter().for_each(|a| spread.altitude.add(a / median));
        }
        let surface = self.surface().triangles;
        for t in 0..surface.triangles.len() {
            let p = surface.corners(t);
            for k in 0..3 {
                let (u, v) = (p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
                spread.facet_angle_deg.add(u.angle(&v).to_degrees());
            }
        }
        spread
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Point;

    #[test]
    fn the_regular_tetrahedron_has_all_its_values_in_one_bin_each() {
        let p = [[1., 1., 1.], [-1., 1., -1.], [1., -1., -1.], [-1., -1., 1.]].map(Point::from);
        let spread = TetMesh::new(p.to_vec(), vec![[0, 1, 2, 3]]).spread();
        let only = |h: &Histogram, value: f64, count: u64| {
            let bin = ((value - h.low) / (h.high - h.low) * h.counts.len() as f64) as usize;
            assert_eq!((h.counts[bin], h.counts.iter().sum::<u64>()), (count, count), "{h:?}");
        };
        only(&spread.dihedral_deg, 70.5, 6);
        // Sixty degrees lie between two bins.
        assert_eq!(spread.facet_angle_deg.counts[29..31].iter().sum::<u64>(), 12);
        only(&spread.radius_edge, 0.612, 1);
        only(&spread.aspect, 1.2247, 1);
        only(&spread.altitude, 1.0, 1);
    }
}
