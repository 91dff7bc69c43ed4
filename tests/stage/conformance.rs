//! What every stage must do, whatever turns it.

use super::board::Board;
use super::grbl::{Faults, Grbl};
use grainrig::rig::{RigError, RotationStage, controller, grbl, simulated};
use grainrig_core::geometry::Angle;

/// `stands` says where the grain truly stands, degrees, by no word of the stage; `step_deg` is what the stage can tell apart.
fn conforms(name: &str, stage: &mut dyn RotationStage, step_deg: f64, stands: &mut dyn FnMut() -> f64) {
    let half = 0.5 * step_deg + 1e-6;
    assert!(!stage.describe().is_empty() && !stage.describe().contains('\n'), "{name}");
    assert_eq!(stage.home().unwrap(), Angle::default(), "{name}");
    let zero = stands();
    let views = (0..=25).map(|k| 7.2 * f64::from(k));
    // There, back again, to where it stands already, and to places between the steps.
    for target in views.chain([180.0, 90.0, 90.0, 0.0, 0.03, 359.97, 0.0]) {
        let reached =
            stage.move_to(Angle::from_deg(target)).unwrap_or_else(|e| panic!("{name} to {target}°: {e}"));
        assert!((reached.deg() - target).abs() <= half, "{name} says {reached} for {target}°");
        let truth = stands() - zero;
        assert!(
            (truth - reached.deg()).abs() < 1e-6 + 1e-3 * step_deg,
            "{name} says {reached} and stands at {truth}°"
        );
    }
    let before = stands();
    for bad in [-1e3, 1e3, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let refused = stage.move_to(Angle::from_deg(bad));
        assert!(matches!(refused, Err(RigError::OutOfLimits { .. })), "{name} at {bad}°: {refused:?}");
        assert!((stands() - before).abs() < 1e-9, "{name} moved for {bad}°");
    }
    // A refusal spoils nothing, and homing ends where it ended before.
    stage.move_to(Angle::from_deg(7.2)).unwrap();
    stage.home().unwrap();
    let zero = stands();
    let reached = stage.move_to(Angle::from_deg(14.4)).unwrap();
    // What was interrupted there is taken up, by its reference or by where it stands; angles are what they were.
    stage.take_up(reached).unwrap();
    let reached = stage.move_to(Angle::from_deg(21.6)).unwrap();
    let truth = stands() - zero;
    assert!(
        (truth - reached.deg()).abs() < 1e-6 + 1e-3 * step_deg,
        "{name} says {reached}, stands at {truth}°"
    );
}

#[test]
fn the_simulated_stage_conforms() {
    let settings = simulated::Settings { step_error: 0.0, ..simulated::Settings::default() };
    let (mut stage, mut camera, truth) = simulated::open(&settings).unwrap();
    // Where it stands only a picture tells.
    let mut stands = || {
        grainrig::rig::Camera::capture(&mut camera).unwrap();
        truth.truth().exposures.last().unwrap().true_angle_deg
    };
    let step = 0.9 / f64::from(settings.microsteps);
    conforms("simulated", &mut stage, step, &mut stands);
}

#[test]
fn the_controllers_stage_conforms() {
    for reference in [controller::Reference::Here, controller::Reference::Switch] {
        let Some(mut board) = Board::start(0, -40) else { return };
        let settings = controller::Settings { reference, ..super::settings(&board) };
        let mut stage = controller::open(&settings).unwrap();
        conforms("controller", &mut stage, 0.1125, &mut || board.position() as f64 * 0.1125);
    }
}

#[test]
fn a_grbl_boards_stage_conforms() {
    for reference in [grbl::Reference::Here, grbl::Reference::Switch] {
        let board = Grbl::start(Faults::default());
        let settings = grbl::Settings { reference, ..super::grbl::settings(&board) };
        let mut stage = grbl::open(&settings).unwrap();
        let step = 1.0 / settings.steps_per_deg;
        conforms("GRBL", &mut stage, step, &mut || board.steps() as f64 * step);
    }
}
