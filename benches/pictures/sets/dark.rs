//! Grains before a dark background, lit from the side.

use super::shapes::{ANGULAR, CRUSHED, ELLIPSOID, FACETS, FLAT, ROUND};
use crate::plan::{Curve, Part, Pose, Row};

const ONE: &[(f64, f64, f64)] = &[(-65.0, 25.0, 0.9)];
const TWO: &[(f64, f64, f64)] = &[(-70.0, 25.0, 0.7), (75.0, 15.0, 0.4)];
const ABOVE: &[(f64, f64, f64)] = &[(-20.0, 65.0, 0.9)];

/// The sets.
pub fn rows() -> Vec<Row> {
    vec![
        Row::new("dark_field_angular_one_lamp", ANGULAR[0]).dark_field(ONE),
        Row::new("dark_field_two_lamps", ROUND).dark_field(TWO).balls(),
        Row::new("dark_field_glossy", ANGULAR[1]).dark_field(TWO).glossy(0.3).pose(Pose::Upright),
        Row::new("dark_field_linear_flat", FLAT).dark_field(TWO).curve(Curve::Linear).opaque(0.6),
        Row::new("dark_field_two_halves", ANGULAR[2]).dark_field(TWO).opaque(0.6).two(0.12, Part::Half),
        Row::new("dark_field_bright_pedestal", ANGULAR[3])
            .dark_field(TWO)
            .with(|r| r.pedestal.albedo = 0.45)
            .pose(Pose::Tipped(15.0)),
        Row::new("dark_field_lifted_uneven", CRUSHED).dark_field(ONE).with(|r| {
            (r.light.background, r.light.gradient, r.light.ambient) = (0.05, 1.0, 0.3);
        }),
        Row::new("dark_field_tipped_film", ANGULAR[1])
            .dark_field(ONE)
            .curve(Curve::Film)
            .pose(Pose::Tipped(30.0)),
        Row::new("dark_field_dark_grain", ANGULAR[0])
            .dark_field(&[(-60.0, 30.0, 2.0), (70.0, 20.0, 1.5)])
            .opaque(0.1),
        Row::new("dark_field_lamp_above", ANGULAR[2])
            .size(1.2, 210.0)
            .dark_field(ABOVE)
            .opaque(0.55)
            .pose(Pose::Upright),
        Row::new("dark_field_spots_noisy", ROUND)
            .dark_field(TWO)
            .opaque(0.6)
            .two(0.1, Part::Spots)
            .file(90, 4.0),
        Row::new("dark_field_lit_dust", ANGULAR[3]).dark_field(TWO).dirt(40, 0, None),
        Row::new("dark_field_hanging", ANGULAR[2]).dark_field(TWO).size(1.9, 420.0).hanging([-0.12, 0.12]),
        Row::new("dark_field_small", ANGULAR[1]).dark_field(TWO).size(0.8, 110.0).pedestal(0.35, 0.03),
        Row::new("dark_field_ellipsoid", ELLIPSOID).dark_field(ONE).opaque(0.5).size(1.2, 240.0).rough(0.2),
        Row::new("dark_field_colour_cast", FLAT)
            .dark_field(TWO)
            .colour([1.0, 0.85, 0.6], [1.0, 0.85, 0.7])
            .pose(Pose::Tipped(20.0)),
        Row::new("dark_field_facets_defocused", FACETS[0]).dark_field(TWO).blur(0.6, 2.5),
        Row::new("dark_field_needle", ANGULAR[0]).dark_field(TWO).pedestal(0.15, 0.05).pose(Pose::Upright),
    ]
}
