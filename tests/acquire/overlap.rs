//! Pictures are looked at and stored while the stage turns to the next view.

use super::rig::{Runs, Script, Step, VIEWS};
use grainrig::acquire::{AcquireError, Control, Outcome};
use grainrig::session::{Recording, SessionError, State};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::channel;
use std::time::Duration;

/// Where pictures lie.
fn frames(runs: &Runs) -> PathBuf {
    runs.recording().folder().join("frames")
}

/// The newest run's events from the first move to this view on.
fn events_from(runs: &Runs, name: &str) -> Vec<String> {
    runs.events().into_iter().skip_while(|e| e != name).collect()
}

#[test]
fn a_picture_is_looked_at_while_the_stage_turns_and_durable_before_the_next_exposure() {
    let runs = Runs::new();
    let folder = runs.recording().folder().to_owned();
    let (moved, moves) = channel();
    let (moved, moves) = (Mutex::new(moved), Mutex::new(moves));
    let at = move |step| match step {
        Step::Move(n) if n > 0 => moved.lock().unwrap().send(n).unwrap(),
        // The stage is sent on though nobody has looked at the picture.
        Step::Examine(n) if n + 1 < VIEWS => {
            let began = moves.lock().unwrap().recv_timeout(Duration::from_secs(60));
            assert_eq!(began, Ok(n + 1), "the stage waits for the picture of view {n}");
        }
        Step::Expose(n) => assert_eq!(Recording::read(&folder).unwrap().views().len(), n),
        _ => {}
    };
    let script = Script { at: Box::new(at), ..Script::default() };
    assert_eq!(runs.run(script, &Control::new()).unwrap(), Outcome::Complete { captured: VIEWS });
}

#[test]
fn the_stage_goes_back_for_a_picture_that_is_refused() {
    let runs = Runs::new();
    // Pictures of the second view and, at its first try, of the last one, which the stage has not left.
    let script = Script { unfit: vec![1, 4], reached: |deg| deg + 0.1, ..Script::default() };
    assert_eq!(runs.run(script, &Control::new()).unwrap(), Outcome::Complete { captured: VIEWS });
    let went: Vec<f64> = runs.went.lock().unwrap().iter().map(|deg| deg.round()).collect();
    assert_eq!(went, [0.0, 60.0, 120.0, 60.0, 120.0, 180.0]);
    let recording = runs.recording();
    let at: Vec<[f64; 2]> = recording.views().map(|v| [v.commanded_deg, v.reached_deg]).collect();
    assert_eq!(at, [[0.0, 0.1], [60.0, 60.1], [120.0, 120.1], [180.0, 180.1]]);
    let expected = [
        "moving 2",
        "rejected 1",
        "moving 1",
        "moving 2",
        "captured 1",
        "moving 3",
        "captured 2",
        "rejected 3",
        "captured 3",
        "acquisition_complete",
    ];
    assert_eq!(events_from(&runs, "moving 2"), expected);
}

#[test]
fn a_fault_of_the_stage_keeps_the_picture_in_hand_or_tells_why_it_is_refused() {
    for (unfit, durable, fate) in [(vec![], vec![0, 1], "captured 1"), (vec![1], vec![0], "rejected 1")] {
        let runs = Runs::new();
        let script = Script { fails_at: Some(Step::Move(2)), unfit, ..Script::default() };
        let error = runs.run(script, &Control::new()).unwrap_err();
        assert!(matches!(error, AcquireError::Stage { view: 2, .. }), "{error}");
        assert_eq!(events_from(&runs, "moving 2"), ["moving 2", fate, "failed"]);
        assert_eq!((runs.durable(), runs.passed_on.lock().unwrap().clone()), (durable.clone(), durable));
        runs.run_well();
        assert_eq!(runs.durable().len(), VIEWS);
    }
}

#[test]
fn a_disk_that_fails_behind_ends_the_run_before_the_next_exposure_whatever_else_fails() {
    for fails_at in [None, Some(Step::Move(2))] {
        let runs = Runs::new();
        let there = frames(&runs);
        let away = there.with_file_name("away");
        let (from, to) = (there.clone(), away.clone());
        let at = move |step| match step {
            Step::Examine(1) => std::fs::rename(&from, &to).unwrap(),
            Step::Expose(2) => panic!("a picture was lost, and the next one is taken"),
            _ => {}
        };
        let script = Script { at: Box::new(at), fails_at, ..Script::default() };
        let error = runs.run(script, &Control::new()).unwrap_err();
        assert!(matches!(error, AcquireError::Session(SessionError::Io { .. })), "{error}");
        assert_eq!(events_from(&runs, "moving 2"), ["moving 2", "failed"]);
        std::fs::rename(&away, &there).unwrap();
        assert_eq!((runs.durable(), runs.recording().state()), (vec![0], State::Failed));
        assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - 1 });
    }
}

#[test]
fn a_run_that_is_stopped_says_first_what_became_of_the_picture_in_hand() {
    // Where the stage stands when the picture is refused: on its way to the next view, or where it was taken.
    let cases: [(Step, &[&str], &[&str]); 2] = [
        (Step::Move(2), &["moving 2", "rejected 1"], &["moving 1", "moving 2", "captured 1"]),
        (Step::Expose(1), &["rejected 1"], &["moving 2", "captured 1"]),
    ];
    for (step, before, after) in cases {
        let steer = |wish: fn(&Control), control: &Control| {
            let steering = control.clone();
            let at = move |s| {
                if s == step {
                    wish(&steering);
                }
            };
            Script { unfit: vec![1], at: Box::new(at), ..Script::default() }
        };
        let runs = Runs::new();
        let control = Control::new();
        let ended = runs.run(steer(Control::abort, &control), &control).unwrap();
        assert_eq!(ended, Outcome::Aborted { captured: 1 });
        assert_eq!(runs.events()[5..], [before, &["aborted"]].concat(), "{step:?}");

        let runs = Runs::new();
        let control = Control::new();
        let script = steer(Control::pause, &control);
        let ended = super::steering::when_paused(&runs, script, &control, || control.resume());
        assert_eq!(ended, Outcome::Complete { captured: VIEWS });
        let expected = [before, &["paused", "resumed"], after].concat();
        assert_eq!(runs.events()[5..5 + expected.len()], expected, "{step:?}");
    }
}

#[test]
fn the_grain_settles_while_its_last_picture_is_looked_at() {
    // How long the second view's picture takes, and the whole run of views that settle for a second.
    for (takes_s, whole_s) in [(0.0, 4.0), (0.4, 4.0), (1.0, 4.0), (2.5, 5.5)] {
        let runs = Runs::new();
        let now = std::sync::Arc::clone(&runs.now);
        let at = move |step| {
            if step == Step::Verdict(1) {
                *now.lock().unwrap() += Duration::from_secs_f64(takes_s);
            }
        };
        runs.run(Script { at: Box::new(at), ..Script::default() }, &Control::new()).unwrap();
        assert_eq!(*runs.now.lock().unwrap(), Duration::from_secs_f64(whole_s), "{takes_s} s");
    }
}

#[test]
fn a_panic_behind_ends_the_run_and_loses_nothing_that_was_kept() {
    let runs = Runs::new();
    let at = |step| assert_ne!(step, Step::Examine(1), "on purpose");
    let script = Script { at: Box::new(at), ..Script::default() };
    let ended = catch_unwind(AssertUnwindSafe(|| runs.run(script, &Control::new())));
    let told = ended.unwrap_err().downcast_ref::<String>().cloned().unwrap_or_default();
    assert!(told.contains("on purpose"), "{told}");
    assert_eq!((runs.durable(), runs.recording().state()), (vec![0], State::Interrupted));
    assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - 1 });
}
