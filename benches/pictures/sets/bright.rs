//! Grains that light does not go through, before a bright panel.

use super::shapes::{ANGULAR, BALL, CRUSHED, ELLIPSOID, FACETS, FLAT, ROUND};
use crate::plan::{Curve, Lamp, Part, Pose, Row};

/// The sets.
pub fn rows() -> Vec<Row> {
    vec![
        Row::new("opaque_flat_panel", ROUND).balls(),
        Row::new("glossy_panel", ANGULAR[1]).glossy(0.3),
        Row::new("opaque_two_halves", ANGULAR[0]).opaque(0.08).two(0.6, Part::Half),
        Row::new("dark_grain_panel", ANGULAR[3]).opaque(0.05),
        Row::new("opaque_uneven_background", CRUSHED)
            .with(|r| (r.light.gradient, r.light.gradient_down, r.light.vignette) = (0.7, -0.3, 0.5)),
        Row::new("opaque_film_coding", ANGULAR[2]).size(1.2, 210.0).curve(Curve::Film).pose(Pose::Upright),
        Row::new("glossy_black_upright", ANGULAR[0]).glossy(0.03).pose(Pose::Upright),
        Row::new("opaque_tipped_rough", ANGULAR[1]).rough(0.35).pose(Pose::Tipped(25.0)),
        Row::new("opaque_dark_band", ELLIPSOID).opaque(0.5).two(0.06, Part::Band),
        Row::new("opaque_pale_linear", FLAT).opaque(0.62).curve(Curve::Linear),
        Row::new("opaque_spots_film", ROUND)
            .opaque(0.5)
            .two(0.07, Part::Spots)
            .curve(Curve::Film)
            .pose(Pose::Tipped(35.0)),
        Row::new("dark_grain_dim_panel", ANGULAR[2]).opaque(0.04).panel(20.0, 0.3).pose(Pose::Tipped(12.0)),
        Row::new("glossy_wide_panel", ANGULAR[3]).glossy(0.2).panel(60.0, 0.8).curve(Curve::Film),
        Row::new("opaque_facets", FACETS[0]).opaque(0.35),
        Row::new("opaque_top_dark", FACETS[1]).opaque(0.55).two(0.1, Part::Top).curve(Curve::Linear),
        Row::new("glossy_ball", BALL).glossy(0.15).size(1.0, 280.0),
        Row::new("opaque_strong_vignette", ANGULAR[0]).with(|r| r.light.vignette = 1.1).pose(Pose::Upright),
        Row::new("opaque_lamp_from_above", ANGULAR[2]).with(|r| {
            r.light.lamps = vec![Lamp { azimuth_deg: 20.0, height_deg: 70.0, strength: 1.0 }];
        }),
        // Its lit side comes near the background's level, the other is dark.
        Row::new("opaque_pale_before_grey", ANGULAR[1]).opaque(0.5).panel(25.0, 0.55).curve(Curve::Linear),
    ]
}
