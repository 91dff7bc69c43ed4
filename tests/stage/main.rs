//! The stage on a serial line: the real driver against the real firmware on a simulated chip. Wherever an angle is asserted, it is
//! the one that the pins reached.

#[path = "../support/board/mod.rs"]
mod board;
mod conformance;
mod grbl;
#[path = "../support/kit/mod.rs"]
mod kit;
mod protocol;
#[path = "../support/random.rs"]
mod random;
mod run;
#[path = "../support/skip.rs"]
mod skip;

use board::Board;
use grainrig::rig::controller::{ControllerStage, Reference, Settings, open};
use grainrig::rig::{RigError, RotationStage, Shutter as _};
use grainrig_core::geometry::Angle;
use random::Random;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The board resets only when it is told to, so nobody waits for its banner; it turns fast.
fn settings(board: &Board) -> Settings {
    Settings {
        port: board.port.to_string_lossy().into_owned(),
        boot_ms: 0,
        speed_deg_per_s: 450.0,
        acceleration_deg_per_s2: 9000.0,
        homing_deg_per_s: 180.0,
        ..Settings::default()
    }
}

fn deg(angle: f64) -> Angle {
    Angle::from_deg(angle)
}

/// What a view's angle is in microsteps: eight full steps of eight.
fn microsteps(view: i64) -> i64 {
    view * 64
}

#[test]
fn the_pins_go_to_every_view() {
    let Some(mut board) = Board::start(0, -1_000_000) else { return };
    let mut stage = open(&settings(&board)).unwrap();
    assert_eq!(stage.home().unwrap(), deg(0.0));
    assert_eq!(board.position(), 0);
    for view in 0..=25 {
        let target = 7.2 * view as f64;
        let reached = stage.move_to(deg(target)).unwrap();
        assert!((reached.deg() - target).abs() < 1e-9, "{reached}");
        assert_eq!(board.position(), microsteps(view));
    }
    let before = board.state();
    assert_eq!(before["idle_steps"], 0);
    assert_eq!(before["current"], true);
    for bad in [-10.1, 370.1, f64::NAN, f64::INFINITY] {
        assert!(matches!(stage.move_to(deg(bad)), Err(RigError::OutOfLimits { .. })), "{bad}");
    }
    // Going back, the drive's play is taken up from below.
    stage.move_to(deg(90.0)).unwrap();
    let after = board.state();
    assert_eq!(after["position"], 800);
    assert_eq!(after["steps"].as_i64().unwrap() - before["steps"].as_i64().unwrap(), 1600 - 792 + 8);
    drop(stage);
    assert_eq!(board.state()["current"], false, "the motor is let go when the run is over");
}

#[test]
fn the_reference_is_where_the_switch_opens() {
    for at in [700, -300, 0] {
        let Some(mut board) = Board::start(at, -40) else { return };
        let mut stage = open(&Settings { reference: Reference::Switch, ..settings(&board) }).unwrap();
        for _ in 0..2 {
            stage.home().unwrap();
            // The first microstep at which it is open.
            assert_eq!(board.position(), -39, "from {at}");
        }
        stage.move_to(deg(7.2)).unwrap();
        assert_eq!(board.position(), -39 + 64);
    }
}

/// Held by a test that loads the computer and by one whose chip must keep its pace: side by side the chip falls behind.
static PACE: Mutex<()> = Mutex::new(());

#[test]
fn a_switch_that_says_nothing_is_an_error_that_says_what_to_check() {
    let _alone = PACE.lock().unwrap_or_else(PoisonError::into_inner);
    for broken in ["switch open", "switch stuck"] {
        let Some(mut board) = Board::start(0, -40) else { return };
        board.tell(broken);
        let fast = Settings { reference: Reference::Switch, homing_deg_per_s: 450.0, ..settings(&board) };
        let mut stage = open(&fast).unwrap();
        let told = loop {
            let began = board.time();
            let told = stage.home().unwrap_err().to_string();
            // On a busy computer the chip may have had too little time of its own to turn so far: it is waited for 7 s.
            let had = board.time().saturating_sub(began);
            if !told.contains("did not end within") || had > Duration::from_secs(6) {
                break told;
            }
        };
        for part in ["reference switch was not found within 378°", "D2", "reference = \"here\""] {
            assert!(told.contains(part), "{part:?} is missing from {told}");
        }
        assert!(stage.move_to(deg(7.2)).is_err());
    }
}

/// `GRAINRIG_MOVES=10000 cargo test --release --test stage noise -- --nocapture` makes as many.
#[test]
fn noise_on_the_line_costs_time_and_no_step() {
    let _alone = PACE.lock().unwrap_or_else(PoisonError::into_inner);
    let moves: usize = std::env::var("GRAINRIG_MOVES").map_or(150, |n| n.parse().unwrap());
    let Some(mut board) = Board::start(0, -1_000_000) else { return };
    let quick = Settings {
        reply_ms: 15,
        tries: 100,
        backlash_deg: 0.0,
        acceleration_deg_per_s2: 20_000.0,
        speed_deg_per_s: 800.0,
        ..settings(&board)
    };
    let patience = Duration::from_millis(quick.reply_ms) * quick.tries;
    let mut stage = open(&quick).unwrap();
    stage.home().unwrap();
    board.tell("noise 0.01 7");
    let mut draw = Random::new(11);
    let mut given_up = 0;
    for k in 0..moves {
        let target = (draw.bits() % 3200) as i64;
        // Mostly short ways: it is the talking that is tried.
        let target = if k % 20 == 0 { target } else { (board.position() + target % 65 - 32).clamp(0, 3200) };
        let reached = loop {
            let began = board.time();
            match stage.move_to(deg(target as f64 * 0.1125)) {
                Ok(reached) => break reached,
                // On a busy computer the chip may have had hardly any time of its own to answer or to move in.
                Err(e) => {
                    let (had, told) = (board.time().saturating_sub(began), e.to_string());
                    let late =
                        ["no whole answer", "did not end within"].iter().any(|part| told.contains(part));
                    assert!(late && had < patience, "move {k}: {e} ({had:?})");
                    given_up += 1;
                }
            }
        };
        assert!((reached.deg() / 0.1125 - target as f64).abs() < 1e-6);
        assert_eq!(board.position(), target, "move {k}");
    }
    let state = board.state();
    println!(
        "{moves} moves; bytes flipped {}, dropped {}; {given_up} times the chip had no time to answer",
        state["flipped"], state["dropped"]
    );
    assert!(state["flipped"].as_u64().unwrap() + state["dropped"].as_u64().unwrap() > moves as u64 / 10);
    assert_eq!(state["idle_steps"], 0);
}

#[test]
fn a_shot_is_taken_once_however_often_it_has_to_be_asked_for() {
    let Some(mut board) = Board::start(0, -40) else { return };
    let contact = board.shutter();
    let quick = Settings { reply_ms: 15, tries: 100, focus_ms: 1, shutter_ms: 2, ..settings(&board) };
    let stage = open(&quick).unwrap();
    let mut shutter = stage.shutter();
    board.tell("noise 0.02 5");
    for _ in 0..60 {
        // The one before may still be at work.
        shutter.release().unwrap();
        assert_eq!(contact.recv(), Ok(0));
    }
    let state = board.state();
    assert!(state["flipped"].as_u64().unwrap() + state["dropped"].as_u64().unwrap() > 20, "{state}");
    // The stage can be let go while the release is still there, which then says so.
    drop(stage);
    assert!(shutter.release().unwrap_err().to_string().contains("has ended"));
    assert_eq!(contact.try_recv().ok(), None);
    assert_eq!(board.state()["steps"], 0);
    // Another program's shots are none of these.
    board.tell("noise 0 5");
    let again = open(&quick).unwrap();
    again.shutter().release().unwrap();
    assert_eq!(contact.recv(), Ok(0));
}

/// A run, in the midst of which the board starts anew.
fn interrupted(reference: Reference) -> Option<(Board, Result<Angle, RigError>)> {
    let mut board = Board::start(0, -40)?;
    let mut stage = open(&Settings { reference, ..settings(&board) }).unwrap();
    stage.home().unwrap();
    stage.move_to(deg(36.0)).unwrap();
    board.tell("reset");
    let then = stage.move_to(deg(43.2));
    if then.is_ok() {
        // It is as before.
        stage.move_to(deg(50.4)).unwrap();
        stage.move_to(deg(43.2)).unwrap();
    }
    Some((board, then))
}

#[test]
fn a_board_that_starts_anew_is_homed_again_where_that_is_possible() {
    let Some((mut board, then)) = interrupted(Reference::Switch) else { return };
    assert!((then.unwrap().deg() - 43.2).abs() < 1e-9);
    assert_eq!(board.position(), -39 + 384);
    let Some((mut board, then)) = interrupted(Reference::Here) else { return };
    let told = then.unwrap_err().to_string();
    for part in ["started anew", "angle is lost", "without a reference switch", "capture the grain anew"] {
        assert!(told.contains(part), "{part:?} is missing from {told}");
    }
    assert_eq!(board.position(), 320, "nothing moved");
}

#[test]
fn a_silent_board_is_an_error_in_time() {
    let Some(mut board) = Board::start(0, -40) else { return };
    let brief = Settings { reply_ms: 250, tries: 3, ..settings(&board) };
    let mut stage: ControllerStage = open(&brief).unwrap();
    stage.home().unwrap();
    board.tell("mute on");
    let told = stage.move_to(deg(7.2)).unwrap_err().to_string();
    assert!(told.contains("no whole answer to 3 requests, 250 ms each; check cable and power"), "{told}");
    board.tell("mute off");
    stage.move_to(deg(7.2)).unwrap();
    assert_eq!(board.position(), 64);
}

#[test]
fn a_port_is_held_by_one_and_the_other_is_told_by_whom() {
    let Some(board) = Board::start(0, -40) else { return };
    let stage = open(&settings(&board)).unwrap();
    let refused = open(&settings(&board)).err().expect("it is held").to_string();
    assert!(
        refused.contains("cannot open")
            && refused.contains("process")
            && refused.contains("has it open: end it first"),
        "{refused}"
    );
    drop(stage);
    open(&settings(&board)).unwrap();
    let missing = Settings { port: "/dev/serial/by-id/none".into(), ..settings(&board) };
    let told = open(&missing).err().unwrap().to_string();
    assert!(told.contains("it is not there") && told.contains("/dev/serial/by-id"), "{told}");
}
