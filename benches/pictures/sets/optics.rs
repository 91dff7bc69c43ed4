//! Sizes, blur, noise, files, colours, dirt, and where the camera is.

use super::shapes::{ANGULAR, CRUSHED, ELLIPSOID, FACETS, FLAT, ROUND};
use crate::plan::{Camera, Curve, Hair, Pose, Row};

/// The sets.
pub fn rows() -> Vec<Row> {
    vec![
        Row::new("opaque_50_px", ANGULAR[0]).size(1.0, 50.0),
        Row::new("opaque_800_px", ROUND).size(1.6, 650.0).with(|r| {
            r.camera = Camera { width: 1200, height: 900, foot: [0.5, 0.86], ..r.camera };
        }),
        Row::new("defocused_disc_4_px", ANGULAR[2]).blur(0.6, 4.0),
        Row::new("hair_beside", ANGULAR[3]).dirt(0, 0, Some(Hair::Beside)),
        Row::new("jpeg_70", ROUND).file(70, 2.0).opaque(0.35),
        Row::new("warm_cast", FLAT).colour([1.0, 0.8, 0.5], [1.0, 0.75, 0.55]).pose(Pose::Tipped(15.0)),
        Row::new("noise_8", ANGULAR[0]).file(95, 8.0).pose(Pose::Upright),
        Row::new("telecentric", ANGULAR[2]).camera(0.0, 0.0, -1.0).pose(Pose::Tipped(15.0)),
        Row::new("dust_and_sensor_spots", ANGULAR[1]).dirt(40, 12, None),
        Row::new("blur_2_5", CRUSHED).blur(2.5, 0.0),
        Row::new("opaque_80_px_linear", FLAT).size(1.0, 80.0).curve(Curve::Linear),
        Row::new("near_camera_pitch", ANGULAR[3]).camera(60.0, -1.0, 1.5),
        Row::new("near_camera_down", CRUSHED).camera(80.0, -3.0, -3.0),
        Row::new("far_camera_up", ANGULAR[0]).camera(200.0, 4.0, 1.0),
        Row::new("small_grain_camera_up", CRUSHED).size(0.8, 60.0).camera(100.0, 3.0, 0.0),
        Row::new("cloudy_telecentric_up", ELLIPSOID)
            .clear(8.0)
            .camera(0.0, 2.0, 0.5)
            .pose(Pose::Tipped(30.0)),
        Row::new("hair_touching", ROUND).dirt(5, 0, Some(Hair::Touching)).pose(Pose::Tipped(25.0)),
        Row::new("png_sharp_no_noise", ANGULAR[2]).file(0, 0.0).blur(0.45, 0.0),
        Row::new("red_grain_blue_background", ANGULAR[0]).colour([0.95, 1.0, 1.0], [1.0, 0.35, 0.25]).with(
            |r| {
                r.file.backdrop = [0.55, 0.75, 1.0];
            },
        ),
        Row::new("roll_2_5_far", ANGULAR[1]).camera(250.0, 0.5, 2.5),
        Row::new("shot_noise", FACETS[1])
            .with(|r| (r.file.shot, r.file.noise) = (6.0, 1.0))
            .pose(Pose::Upright),
        Row::new("opaque_120_px_jpeg_80", ANGULAR[3]).size(1.0, 120.0).file(80, 1.5).pose(Pose::Tipped(30.0)),
        Row::new("green_cast_4_2_0", CRUSHED).colour([0.75, 1.0, 0.7], [0.9, 0.85, 0.8]).file(85, 2.0),
        Row::new("off_the_axis", ANGULAR[2]).pedestal(0.8, 0.12).off([0.35, -0.25]),
        Row::new("with_empty_and_dust", ANGULAR[0]).dirt(30, 6, Some(Hair::Touching)).with_empty(),
        Row::new("with_empty_dark_field", ANGULAR[1])
            .dark_field(&[(-70.0, 25.0, 0.7), (75.0, 15.0, 0.4)])
            .with_empty()
            .pose(Pose::Tipped(15.0)),
        Row::new("blur_1_5_linear", ROUND).blur(1.5, 0.0).curve(Curve::Linear).pose(Pose::Upright),
        Row::new("wobble_1_px", ANGULAR[3]).with(|r| r.wobble_sd_px = 1.0),
        Row::new("opaque_500_px", FLAT).size(1.5, 500.0).file(92, 2.0),
    ]
}
