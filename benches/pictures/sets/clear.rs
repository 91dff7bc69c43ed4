//! Clear and cloudy grains.

use super::shapes::{ANGULAR, BALL, CRUSHED, ELLIPSOID, FLAT, ROUND};
use crate::plan::{Curve, Pose, Row};

const SIDES: &[(f64, f64, f64)] = &[(-75.0, 20.0, 0.7), (80.0, 10.0, 0.5)];
/// Behind the grain, at both sides: the light goes through it.
const BEHIND: &[(f64, f64, f64)] = &[(-130.0, 25.0, 0.9), (140.0, 15.0, 0.7)];

/// The sets.
pub fn rows() -> Vec<Row> {
    vec![
        Row::new("quartz_flat_panel", FLAT)
            .size(1.35, 314.0)
            .panel(40.0, 0.82)
            .clear(0.8)
            .curve(Curve::Linear)
            .balls(),
        Row::new("quartz_dark_field", ANGULAR[0]).clear(1.0).dark_field(SIDES),
        Row::new("quartz_upright_panel", ANGULAR[1]).clear(0.8).pose(Pose::Upright),
        Row::new("milky_panel", ROUND).clear(6.0).pose(Pose::Tipped(15.0)),
        Row::new("glass_small_panel", ANGULAR[2]).clear(0.1).panel(12.0, 0.85).with(|r| r.light.room = 0.02),
        Row::new("quartz_frosted", CRUSHED).clear(0.8).rough(0.3).curve(Curve::Film),
        Row::new("quartz_wide_panel", ANGULAR[3]).clear(0.6).panel(50.0, 0.8),
        Row::new("quartz_needle", ANGULAR[0]).clear(0.8).pedestal(0.15, 0.1).pose(Pose::Tipped(30.0)),
        Row::new("milky_dark_field", FLAT).clear(5.0).dark_field(&[(-60.0, 30.0, 0.8)]),
        Row::new("quartz_small", ANGULAR[3]).clear(1.0).size(1.0, 90.0).pedestal(0.4, 0.12),
        Row::new("amber_colour", ANGULAR[1]).clear(2.5).colour([1.0, 0.97, 0.9], [1.0, 0.6, 0.2]),
        Row::new("quartz_glue", ROUND).clear(0.8).glue(0.07, 0.5).panel(35.0, 0.8),
        Row::new("quartz_hanging", ANGULAR[2])
            .clear(0.8)
            .size(1.8, 380.0)
            .hanging([0.15, -0.1])
            .pose(Pose::Tipped(20.0)),
        Row::new("quartz_telecentric", ANGULAR[0]).clear(0.8).camera(0.0, 0.0, -0.6).pose(Pose::Upright),
        Row::new("quartz_jpeg_75", FLAT).clear(1.2).file(75, 2.0).pose(Pose::Tipped(10.0)),
        Row::new("glass_ball", BALL).clear(0.05).size(1.0, 260.0),
        Row::new("quartz_lit_from_behind", ANGULAR[1]).clear(0.8).rough(0.1).dark_field(BEHIND),
        Row::new("quartz_large_film", ANGULAR[3]).clear(0.7).size(1.6, 560.0).curve(Curve::Film),
        Row::new("cloudy_ellipsoid_upright", ELLIPSOID).clear(3.0).pose(Pose::Upright).size(1.2, 230.0),
    ]
}
