//! The controls of a mesh, which are promises: facet size, facet angle, cell size, distance.
//!
//! ```text
//! facet (a ≤ b ≤ c, area A):   R = abc/(4A) ≤ surface_size_mm       (size_at_contact_mm where plates will touch)
//!                              sin α = a/(2R) = 2A/(bc) ≥ sin facet_angle_deg
//! cell (volume V):             V ≤ tet_volume_mm3
//! surface:                     |f| at the facets' corners, edge middles and centres ≤ distance_mm,
//!                              distance of points of the body's surface from the facets ≤ distance_mm
//! ```
//!
//! These are the criteria of Delaunay refinement (Boissonnat and Oudot, Graph. Models 67, 2005: angle, size and distance of a
//! facet; size of a cell), checked here on the finished mesh. The method of Nadimi and Fonseca (2017) states the first three.

use super::broken::BrokenControl;
use super::{MeshError, Quality};
use serde::{Deserialize, Serialize};

/// Lattice spacing over surface size: measured on spheres and grains, the largest circumradius of a surface
/// facet is 0.62 spacings after smoothing.
pub(super) const SPACING_PER_SIZE: f64 = 1.45;
/// Cubed lattice spacing over largest tetrahedron: a lattice tetrahedron has a³/12; warping and smoothing
/// stretch some, measured to a³/6.
pub(super) const CUBES_PER_TET: f64 = 6.0;
/// Above this a facet angle cannot be promised by this mesher on any body.
const MOST_FACET_ANGLE_DEG: f64 = 30.0;

/// What the mesh must keep; each is checked on the finished mesh.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Controls {
    /// Largest circumradius of a surface facet, mm.
    pub surface_size_mm: f64,
    /// Smallest angle in a surface facet, degrees; at most 30.
    pub facet_angle_deg: f64,
    /// Largest volume of a tetrahedron, mm³.
    pub tet_volume_mm3: f64,
    /// Largest distance between the mesh's surface and the body's, either way, mm; `None`: not promised.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_mm: Option<f64>,
    /// Largest circumradius of a surface facet where plates will touch the body, at its lowest and highest points in z,
    /// mm; from there the elements grow into the body. `None`: as everywhere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_at_contact_mm: Option<f64>,
    /// How far below the highest and above the lowest point the contacts reach, mm; `None`: 2 % of the height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact_depth_mm: Option<f64>,
}

impl Controls {
    /// Controls that give about 50 000 tetrahedra to a compact grain (one that fills half of the cube on its
    /// diameter) of this diameter in mm.
    pub fn for_size(diameter_mm: f64) -> Self {
        let spacing = 0.0493 * diameter_mm;
        Self {
            surface_size_mm: spacing / SPACING_PER_SIZE,
            facet_angle_deg: 25.0,
            tet_volume_mm3: spacing.powi(3) / CUBES_PER_TET,
            distance_mm: None,
            size_at_contact_mm: None,
            contact_depth_mm: None,
        }
    }

    /// Whether the controls can be kept at all.
    ///
    /// # Errors
    /// [`MeshError::Control`] for a value that is not finite, not positive, or an angle above 30°.
    pub fn check(&self) -> Result<(), MeshError> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let bad =
            |name, value, unit, limit, remedy| Err(MeshError::Control { name, value, unit, limit, remedy });
        if !positive(self.surface_size_mm) {
            let remedy = "a fortieth of the grain's diameter is usual";
            return bad("surface_size_mm", self.surface_size_mm, "mm", "positive and finite", remedy);
        }
        if !positive(self.tet_volume_mm3) {
            let remedy = "half the cube of surface_size_mm is usual";
            return bad("tet_volume_mm3", self.tet_volume_mm3, "mm³", "positive and finite", remedy);
        }
        if !positive(self.facet_angle_deg) || self.facet_angle_deg > MOST_FACET_ANGLE_DEG {
            let remedy = "25° is reached on most grains";
            return bad("facet_angle_deg", self.facet_angle_deg, "°", "above 0° and at most 30°", remedy);
        }
        if let Some(distance) = self.distance_mm.filter(|d| !positive(*d)) {
            let remedy = "a tenth of surface_size_mm is usual";
            return bad("distance_mm", distance, "mm", "positive and finite", remedy);
        }
        if let Some(size) = self.size_at_contact_mm
            && (!positive(size) || size > self.surface_size_mm)
        {
            let remedy = "set it smaller than surface_size_mm, or leave it out";
            return bad("size_at_contact_mm", size, "mm", "positive and at most surface_size_mm", remedy);
        }
        if let Some(depth) = self.contact_depth_mm
            && (!positive(depth) || self.size_at_contact_mm.is_none())
        {
            let remedy = "a few hundredths of the body's height are usual, beside a size_at_contact_mm";
            return bad(
                "contact_depth_mm",
                depth,
                "mm",
                "positive, and given with size_at_contact_mm",
                remedy,
            );
        }
        Ok(())
    }

    /// The promised distance, where the largest distance breaks it.
    pub(super) fn too_far(&self, reached: f64) -> Option<BrokenControl> {
        let promised = self.distance_mm.filter(|promised| reached > *promised)?;
        Some(BrokenControl {
            name: "distance_mm",
            promised,
            reached,
            unit: "mm",
            what: "largest distance between the mesh's surface and the body's",
            remedy: "set it larger, or surface_size_mm smaller",
        })
    }

    /// The first control that a mesh of this quality breaks, whose largest facet at the contacts has this circumradius.
    pub(super) fn broken_by(&self, quality: &Quality, at_contact_mm: Option<f64>) -> Option<BrokenControl> {
        if quality.facet_circumradius_mm > self.surface_size_mm {
            return Some(BrokenControl {
                name: "surface_size_mm",
                promised: self.surface_size_mm,
                reached: quality.facet_circumradius_mm,
                unit: "mm",
                what: "largest facet circumradius",
                remedy: "set it larger",
            });
        }
        if let (Some(promised), Some(reached)) = (self.size_at_contact_mm, at_contact_mm)
            && reached > promised
        {
            return Some(BrokenControl {
                name: "size_at_contact_mm",
                promised,
                reached,
                unit: "mm",
                what: "largest facet circumradius at the contacts",
                remedy: "set it larger",
            });
        }
        if quality.tet_volume_mm3 > self.tet_volume_mm3 {
            return Some(BrokenControl {
                name: "tet_volume_mm3",
                promised: self.tet_volume_mm3,
                reached: quality.tet_volume_mm3,
                unit: "mm³",
                what: "largest tetrahedron",
                remedy: "set it larger",
            });
        }
        (quality.facet_angle_deg < self.facet_angle_deg).then_some(BrokenControl {
            name: "facet_angle_deg",
            promised: self.facet_angle_deg,
            reached: quality.facet_angle_deg,
            unit: "°",
            what: "smallest facet angle",
            remedy: "set it smaller, or surface_size_mm smaller so that the surface's features are resolved",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_controls_are_refused_with_their_limit() {
        let good = Controls::for_size(1.0);
        assert_eq!(good.check(), Ok(()));
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Controls { surface_size_mm: bad, ..good }.check().is_err());
            assert!(Controls { tet_volume_mm3: bad, ..good }.check().is_err());
            assert!(Controls { facet_angle_deg: bad, ..good }.check().is_err());
        }
        let e = Controls { facet_angle_deg: 31.0, ..good }.check().unwrap_err().to_string();
        assert!(e.contains("31 °") && e.contains("at most 30°") && e.contains("25°"), "{e}");
    }

    #[test]
    fn a_misspelt_control_is_refused() {
        let text = "surface_size_mm = 0.1\nfacet_angle_deg = 15\ntet_volume_mm3 = 1e-4\n";
        assert!(toml::from_str::<Controls>(text).is_ok());
        assert!(toml::from_str::<Controls>(&format!("{text}facet_size = 1\n")).is_err());
    }
}
