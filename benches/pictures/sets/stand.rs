//! Pedestals, needles, glue, and how the grain stands on them.

use super::shapes::{ANGULAR, CRUSHED, FLAT, ROUND};
use crate::plan::{Curve, Pose, Row};

/// The sets.
pub fn rows() -> Vec<Row> {
    vec![
        Row::new("opaque_wide_hanging", ROUND).size(2.2, 480.0).hanging([0.1, 0.1]).curve(Curve::Linear),
        Row::new("pedestal_as_bright_as_background", ANGULAR[0]).pedestal(0.5, 0.95),
        Row::new("needle_overhang", ANGULAR[1]).pedestal(0.15, 0.1).off([0.15, 0.1]),
        Row::new("glue_bright", ANGULAR[2]).glue(0.08, 0.8).pose(Pose::Tipped(40.0)),
        Row::new("pedestal_as_dark_as_grain", ANGULAR[3]).opaque(0.12).pedestal(0.5, 0.12),
        Row::new("pedestal_of_steel", FLAT).with(|r| r.pedestal.mirror = 0.6),
        Row::new("hanging_tipped", ANGULAR[1]).size(1.8, 400.0).hanging([0.2, 0.0]).pose(Pose::Tipped(25.0)),
        Row::new("pedestal_as_bright_as_grain", ANGULAR[2])
            .size(1.2, 220.0)
            .opaque(0.45)
            .pedestal(0.6, 0.45)
            .pose(Pose::Upright),
        Row::new("overhanging_crushed", CRUSHED).off([0.3, 0.15]).pose(Pose::Tipped(20.0)),
        Row::new("pedestal_wider_than_grain", ANGULAR[0]).size(0.9, 240.0).pedestal(1.5, 0.15),
        Row::new("glue_dark_needle", ANGULAR[3]).pedestal(0.25, 0.1).glue(0.1, 0.1),
        Row::new("glossy_steel_pedestal", ANGULAR[2])
            .glossy(0.25)
            .with(|r| (r.pedestal.mirror, r.pedestal.diameter_mm) = (0.55, 0.8))
            .pose(Pose::Tipped(10.0)),
        Row::new("looking_down_on_pedestal", ANGULAR[1]).pedestal(0.7, 0.3).camera(120.0, -1.5, 0.3),
        Row::new("upright_on_needle_glue", ANGULAR[0])
            .pose(Pose::Upright)
            .pedestal(0.2, 0.12)
            .glue(0.06, 0.5),
        Row::new("white_pedestal_white_grain", FLAT).opaque(0.6).pedestal(0.6, 0.75).curve(Curve::Film),
        Row::new("hanging_film_wide", CRUSHED).size(2.0, 430.0).hanging([-0.2, -0.1]).curve(Curve::Film),
        Row::new("black_pedestal_dark_grain", ANGULAR[2])
            .size(1.2, 220.0)
            .opaque(0.07)
            .pedestal(0.6, 0.02)
            .pose(Pose::Upright),
    ]
}
