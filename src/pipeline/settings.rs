//! What a person may set about the computation.

use super::PipelineError;
use grainrig_core::geometry::Projection;
use grainrig_core::mesh::Controls;
use grainrig_core::plausible::{self, Doubt, share_of, volume_share_of};
use grainrig_core::silhouette;
use serde::{Deserialize, Serialize};

/// Settings of the computation; every part has defaults.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Whether figures that look like slips of unit are meant so.
    pub as_given: bool,
    /// How the grain is told from pedestal and background.
    pub silhouette: silhouette::Settings,
    /// How finely the hull is measured.
    pub hull: HullSettings,
    /// The mesh's three controls.
    pub mesh: MeshSettings,
    /// What is drawn for a person's eye.
    pub report: ReportSettings,
}

/// What is drawn for a person's eye.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ReportSettings {
    /// Whether each view's outline over its photograph, and the sheet of the calibration, are among the products.
    pub pictures: bool,
}

impl Default for ReportSettings {
    fn default() -> Self {
        Self { pictures: true }
    }
}

/// How finely the hull is measured.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct HullSettings {
    /// Edge of a voxel, mm. By default a pixel's size, or 1/400 of the hull's longest edge where that is larger.
    pub voxel_mm: Option<f64>,
}

/// The mesh's controls; what is absent follows from the grain's size. One declaration: the command line, the configuration and
/// HTTP have these names.
#[derive(
    Debug,
    Clone,
    Default,
    PartialEq,
    Serialize,
    Deserialize,
    utoipa::ToSchema,
    schemars::JsonSchema,
    clap::Args,
)]
#[serde(deny_unknown_fields, default)]
pub struct MeshSettings {
    /// Largest circumradius of a surface facet, mm; by default 0.034 of the grain's equivalent diameter.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub surface_size_mm: Option<f64>,
    /// Smallest angle of a surface facet, degrees, up to 30; by default 25.
    #[arg(long, value_name = "DEG", allow_negative_numbers = true)]
    pub facet_angle_deg: Option<f64>,
    /// Largest volume of a tetrahedron, mm³; by default what fits the surface's size.
    #[arg(long, value_name = "MM3", allow_negative_numbers = true)]
    pub tet_volume_mm3: Option<f64>,
    /// Largest distance between the mesh's surface and the body's, either way, mm; by default none is promised.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub distance_mm: Option<f64>,
    /// Largest circumradius of a surface facet where plates will touch the grain, at its top and bottom, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub size_at_contact_mm: Option<f64>,
    /// How far the contacts reach below the highest and above the lowest place, mm; by default 2 % of the height.
    #[arg(long, value_name = "MM", allow_negative_numbers = true, requires = "size_at_contact_mm")]
    pub contact_depth_mm: Option<f64>,
}

impl MeshSettings {
    /// These, or `None` where nothing is set.
    pub fn asked(&self) -> Option<&Self> {
        (*self != Self::default()).then_some(self)
    }

    /// These settings, and `base`'s where nothing is set here.
    #[must_use]
    pub fn over(&self, base: &Self) -> Self {
        Self {
            surface_size_mm: self.surface_size_mm.or(base.surface_size_mm),
            facet_angle_deg: self.facet_angle_deg.or(base.facet_angle_deg),
            tet_volume_mm3: self.tet_volume_mm3.or(base.tet_volume_mm3),
            distance_mm: self.distance_mm.or(base.distance_mm),
            size_at_contact_mm: self.size_at_contact_mm.or(base.size_at_contact_mm),
            contact_depth_mm: self.contact_depth_mm.or(base.contact_depth_mm),
        }
    }

    /// What of these sizes no grain of about this length is meshed with, mm.
    pub fn doubts(&self, body_mm: f64) -> Vec<Doubt> {
        let lengths = [
            ("surface_size_mm", self.surface_size_mm, [1.0 / 3000.0, 1.0]),
            ("size_at_contact_mm", self.size_at_contact_mm, [1e-5, 1.0]),
            ("distance_mm", self.distance_mm, [1e-7, 0.5]),
            ("contact_depth_mm", self.contact_depth_mm, [1e-6, 1.0]),
        ];
        let of_body = || format!("the body is about {} mm long", plausible::figure(body_mm));
        (lengths.into_iter())
            .filter_map(|(name, value, share)| share_of(name, body_mm, share).doubt(value?))
            .chain(
                self.tet_volume_mm3
                    .and_then(|v| volume_share_of("tet_volume_mm3", body_mm, [1.0 / 5000.0, 1.5]).doubt(v)),
            )
            .map(|d| d.so_that(of_body()))
            .collect()
    }

    /// The controls for a body of this equivalent diameter.
    pub fn controls(&self, diameter_mm: f64) -> Controls {
        let base = Controls::for_size(diameter_mm);
        Controls {
            surface_size_mm: self.surface_size_mm.unwrap_or(base.surface_size_mm),
            facet_angle_deg: self.facet_angle_deg.unwrap_or(base.facet_angle_deg),
            // A finer surface alone must not break against a coarse interior's default, nor the reverse.
            tet_volume_mm3: self.tet_volume_mm3.unwrap_or_else(|| {
                base.tet_volume_mm3
                    * (self.surface_size_mm.unwrap_or(base.surface_size_mm) / base.surface_size_mm).powi(3)
            }),
            distance_mm: self.distance_mm,
            size_at_contact_mm: self.size_at_contact_mm,
            contact_depth_mm: self.contact_depth_mm,
        }
    }
}

/// The unit in which given cameras measure the world.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema, clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Millimetres.
    #[default]
    Mm,
    /// None: shapes only, no volumes or lengths.
    None,
}

/// Where each view's camera comes from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Cameras {
    /// A camera that stands still before a turntable; the axis is measured from the silhouettes.
    Turntable(TurntableSettings),
    /// A 3×4 matrix for each view.
    Given {
        /// The matrices, a view each.
        projections: Vec<Projection>,
        /// The unit of their world.
        unit: LengthUnit,
    },
}

/// What is known beforehand of a camera before a turntable.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TurntableSettings {
    /// Size of a pixel at the rotation axis, mm.
    pub mm_per_px: f64,
    /// Its standard uncertainty, mm; absent where nobody knows it.
    pub mm_per_px_sigma: Option<f64>,
    /// Distance from the centre of projection to the axis, mm; absent for a telecentric lens.
    pub camera_distance_mm: Option<f64>,
    /// Column of the axis, pixels; measured from the silhouettes where absent.
    pub axis_column_px: Option<f64>,
    /// Turn of the picture, degrees; measured where absent.
    pub roll_deg: Option<f64>,
    /// Whether the grain turns clockwise seen from above when the stage angle grows.
    pub clockwise: bool,
    /// Whether each view's own offset and angle, as measured from the silhouettes, are used.
    pub refine: bool,
}

impl Default for TurntableSettings {
    fn default() -> Self {
        Self {
            mm_per_px: 0.0043,
            mm_per_px_sigma: None,
            camera_distance_mm: None,
            axis_column_px: None,
            roll_deg: None,
            clockwise: false,
            refine: true,
        }
    }
}

impl TurntableSettings {
    /// What of these figures no laboratory has.
    pub fn doubts(&self) -> Vec<Doubt> {
        const WIDE_PX: f64 = 200.0;
        let wide_mm = plausible::figure(WIDE_PX * self.mm_per_px);
        let sigma = share_of("mm_per_px_sigma", self.mm_per_px, [0.0, 0.1]);
        let follows = format!("a grain {WIDE_PX} px wide would be {wide_mm} mm");
        [
            plausible::MM_PER_PX.doubt(self.mm_per_px).map(|d| d.so_that(follows)),
            self.mm_per_px_sigma.and_then(|s| sigma.doubt(s)),
            self.camera_distance_mm.and_then(|d| plausible::CAMERA_DISTANCE.doubt(d)),
        ]
        .into_iter()
        .flatten()
        .collect()
    }

    /// Whether every number makes sense.
    ///
    /// # Errors
    /// [`PipelineError::Setting`] names the one that does not.
    pub fn check(&self) -> Result<(), PipelineError> {
        let bad = |name, value, unit, limit| Err(PipelineError::Setting { name, value, unit, limit });
        if !(self.mm_per_px.is_finite() && self.mm_per_px > 0.0) {
            return bad("mm_per_px", self.mm_per_px, "mm per pixel", "a positive number");
        }
        if let Some(s) = self.mm_per_px_sigma
            && !(s.is_finite() && s >= 0.0)
        {
            return bad("mm_per_px_sigma", s, "mm per pixel", "0 or a positive number");
        }
        if let Some(d) = self.camera_distance_mm
            && !(d.is_finite() && d > 0.0)
        {
            return bad(
                "camera_distance_mm",
                d,
                "mm",
                "a positive number (leave it out for a telecentric lens)",
            );
        }
        if let Some(c) = self.axis_column_px
            && !c.is_finite()
        {
            return bad("axis_column_px", c, "px", "a number");
        }
        if let Some(r) = self.roll_deg
            && !(-45.0..=45.0).contains(&r)
        {
            return bad("roll_deg", r, "°", "between -45 and 45");
        }
        Ok(())
    }
}

impl Settings {
    /// Whether every number makes sense.
    ///
    /// # Errors
    /// [`PipelineError`] names the one that does not.
    pub fn check(&self) -> Result<(), PipelineError> {
        self.silhouette.check().map_err(PipelineError::Silhouettes)?;
        if let Some(v) = self.hull.voxel_mm
            && !(v.is_finite() && v > 0.0)
        {
            return Err(grainrig_core::hull::HullError::Voxel(v).into());
        }
        self.mesh.controls(1.0).check()?;
        Ok(())
    }
}
