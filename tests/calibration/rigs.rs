//! Random simulated rigs: photographs through the real encoder, decoder and silhouettes.

use crate::random::Random;
use crate::skip::shared_data;
use grainrig::rig::simulated::{Faults, Settings, Slip, Truth, open};
use grainrig::rig::{Camera as _, RotationStage as _};
use grainrig_core::calibrate::{
    Axis, Calibration, Known, Measured, PedestalObservation, SeenView, calibrate,
};
use grainrig_core::formats::decode;
use grainrig_core::geometry::Angle;
use grainrig_core::silhouette::{self, PedestalOutline, Segmentation, pedestal_consensus};
use rayon::prelude::*;

/// Numbers for one rig: neighbouring seeds have nothing in common.
pub fn random_of(seed: u64) -> Random {
    Random::new(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
}

/// Views of half a turn; one more closes it.
pub const VIEWS: usize = 25;

/// What goes wrong while the grain turns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wrong {
    Nothing,
    Slip(usize, f64),
    LostStep(usize),
    StepRatio(f64),
}

/// A rig as it stands in the laboratory: in focus, well lit, its wobble below half a pixel; the rest at random.
pub fn laboratory(seed: u64, wrong: Wrong) -> Settings {
    let mut draw = random_of(seed ^ 0x1ab);
    let rig = random(seed, wrong);
    Settings {
        mm_per_px: 0.0033,
        wobble_px: draw.between(0.0, 0.5),
        blur_px: draw.between(0.6, 1.2),
        noise_sd: draw.between(0.5, 2.0),
        bright_background: true,
        ..rig
    }
}

/// As in the laboratory, with a grain of so many pixels.
pub fn small(seed: u64, size_px: f64, wrong: Wrong) -> Settings {
    let picture = |share: f64| (share * size_px) as usize + 120;
    Settings {
        mm_per_px: 0.9 / size_px,
        width: picture(1.8),
        height: picture(1.5),
        roll_deg: 0.2 * (seed % 9) as f64 - 0.8,
        axis_offset_px: 3.0 * (seed % 7) as f64 - 9.0,
        ..laboratory(seed, wrong)
    }
}

/// A rig anywhere within wide limits.
pub fn random(seed: u64, wrong: Wrong) -> Settings {
    let mut draw = random_of(seed);
    let folder = shared_data("grains");
    let shapes = [
        "sand_ma107_00002",
        "sand_ma107_00107",
        "gravel_az_00002",
        "ct_cement140_02210",
        "ct_ma160_00357",
        "ct_ma160_00593",
        "ct_ma160_02444",
        "lsdem_sand",
    ]
    .map(|name| folder.as_ref().map(|folder| folder.join(format!("{name}.stl"))));
    let shape = if draw.unit() < 0.6 && folder.is_some() { draw.pick(&shapes) } else { None };
    let mut settings = Settings {
        seed,
        grain_stl: shape,
        grain_size_mm: 0.9,
        eccentricity_mm: [draw.between(-0.05, 0.05), draw.between(-0.05, 0.05)],
        width: 640,
        height: 560,
        mm_per_px: draw.between(0.0033, 0.0045),
        camera_distance_mm: draw.pick(&[None, Some(60.0), Some(90.0), Some(150.0), Some(300.0)]),
        axis_offset_px: draw.between(-40.0, 40.0),
        roll_deg: draw.between(-2.0, 2.0),
        wobble_px: draw.between(0.0, 2.0),
        blur_px: draw.between(0.5, 3.0),
        noise_sd: draw.between(0.0, 4.0),
        bright_background: draw.unit() < 0.5,
        ..Settings::default()
    };
    match wrong {
        Wrong::Nothing => {}
        Wrong::Slip(at, deg) => {
            settings.faults = Faults { slip: Some(Slip { at, deg }), ..Faults::default() }
        }
        Wrong::LostStep(at) => settings.faults = Faults { lost_step_at: Some(at), ..Faults::default() },
        Wrong::StepRatio(ratio) => settings.step_ratio = ratio,
    }
    settings
}

/// A rig anywhere within wide limits whose camera looks up or down as well, whose steps are all a little too large or too
/// small, and whose distance was noted wrong; with that distance, mm.
pub fn misread(seed: u64) -> (Settings, Option<f64>) {
    let mut draw = random_of(seed ^ 0x9c7);
    let rig = random(seed, Wrong::StepRatio(draw.between(0.99, 1.01)));
    let elevation_deg = draw.between(-1.0, 1.0);
    let given = draw.between(0.7, 1.6) * rig.camera_distance_mm.unwrap_or(250.0);
    let given = draw.pick(&[None, Some(given), Some(given)]);
    (Settings { elevation_deg, ..rig }, given)
}

/// A session: all views, and the truth behind them.
pub struct Captured {
    pub angles: Vec<Angle>,
    pub found: Vec<Segmentation>,
    /// The pedestal as each view saw it by itself.
    pub own: Vec<Option<PedestalOutline>>,
    pub truth: Truth,
}

/// Turns through half a turn in [`VIEWS`] views and one that closes it.
pub fn capture(settings: &Settings) -> Result<Captured, String> {
    capture_views(settings, VIEWS)
}

/// Turns and photographs; an error where the body does not fit the picture or a silhouette cannot be found.
pub fn capture_views(settings: &Settings, views: usize) -> Result<Captured, String> {
    let (mut stage, mut camera, truth) = open(settings).map_err(|e| e.to_string())?;
    stage.home().map_err(|e| e.to_string())?;
    let mut angles = Vec::new();
    let mut pictures = Vec::new();
    // Whole full steps, as a plan has them.
    let step_deg = 0.9 * (200.0 / views as f64).floor();
    for view in 0..=views {
        let angle = Angle::from_deg(if view == views { 180.0 } else { step_deg * view as f64 });
        if view > 0 {
            stage.move_to(angle).map_err(|e| e.to_string())?;
        }
        pictures.push(camera.capture().map_err(|e| e.to_string())?.bytes);
        angles.push(angle);
    }
    let mut found: Vec<Segmentation> = (pictures.par_iter())
        .map(|bytes| {
            let picture = decode(bytes)?;
            silhouette::find(&picture, None, &silhouette::Settings::default()).map_err(|e| e.to_string())
        })
        .collect::<Result<_, String>>()?;
    // As in the pipeline: every view is cut where all of them show the pedestal's top.
    let seen: Vec<Option<PedestalOutline>> = found.iter().map(|f| f.report.pedestal).collect();
    if let Some(stand) = pedestal_consensus(&seen) {
        for f in &mut found {
            f.recut(stand.seen_by(f.report.pedestal));
        }
    }
    Ok(Captured { angles, found, own: seen, truth: truth.truth() })
}

/// What nobody told the program: only the scale.
pub fn known(captured: &Captured) -> Known {
    let tops: Vec<f64> = captured.found.iter().filter_map(|f| f.report.pedestal.map(|p| p.top_row)).collect();
    let origin = if tops.is_empty() {
        captured.truth.camera.axis_row_px
    } else {
        tops.iter().sum::<f64>() / tops.len() as f64
    };
    Known {
        mm_per_px: Measured::given(captured.truth.settings.mm_per_px, None),
        origin_row_px: origin,
        camera_distance_mm: None,
        axis_column_px: None,
        roll_deg: None,
        clockwise: false,
        full_step_deg: 0.9,
        refine: true,
    }
}

/// The calibration of a captured session.
pub fn calibrated(captured: &Captured, known: &Known) -> (Calibration, Axis) {
    let views: Vec<SeenView> = (captured.found.iter().enumerate())
        .map(|(index, f)| SeenView {
            index,
            angle: captured.angles[index],
            silhouette: &f.silhouette,
            bad: false,
            pedestal: captured.own[index].map(|p| PedestalObservation {
                top_px: [p.centre_column, p.top_row],
                lean_rad: -p.top_slope.atan(),
                length_px: p.side_px(f.silhouette.picture[1]),
            }),
        })
        .collect();
    calibrate(&views, known).expect("a closing view shows the axis")
}
