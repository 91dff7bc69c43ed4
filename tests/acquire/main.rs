//! The acquisition with something going wrong, or somebody steering, at every one of its steps.

mod overlap;
mod rig;
mod steering;

use grainrig::acquire::{AcquireError, Control, Outcome, Phase};
use grainrig::session::picture::PictureFault;
use grainrig::session::{Recording, SessionError, State};
use rig::{Runs, Script, Step, VIEWS, picture};
use std::sync::{Arc, Mutex};

/// The views that a run without faults captures.
fn all() -> Vec<usize> {
    (0..VIEWS).collect()
}

#[test]
fn a_run_homes_once_and_takes_each_view_in_order() {
    let runs = Runs::new();
    assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS });
    let mut expected = vec!["started".to_owned(), "homed".into()];
    expected.push("moving 0".into());
    // A view is captured while the stage is on its way to the next one.
    expected.extend((1..VIEWS).flat_map(|n| [format!("moving {n}"), format!("captured {}", n - 1)]));
    expected.extend(["captured 3".into(), "acquisition_complete".into()]);
    assert_eq!(runs.events(), expected);
    assert_eq!((runs.durable(), runs.passed_on.lock().unwrap().clone()), (all(), all()));
    assert_eq!(runs.recording().state(), State::Captured);
    // What the bytes are counts, not what the camera's driver says.
    assert_eq!(runs.recording().view(0).unwrap().file, "view_000.jpg");
}

/// A run that fails at a step: its error, and how many views it leaves.
fn failed_at(runs: &Runs, step: Step) -> AcquireError {
    let control = Control::new();
    let script = Script { fails_at: Some(step), ..Script::default() };
    let error = runs.run(script, &control).unwrap_err();
    assert_eq!(control.phase(), Phase::Failed, "{step:?}");
    assert_eq!(runs.durable(), (0..durable_after(step)).collect::<Vec<_>>(), "{step:?}");
    error
}

/// Views that are durable where a run fails at this step.
fn durable_after(step: Step) -> usize {
    match step {
        Step::Begin | Step::Home => 0,
        Step::Move(n) | Step::Settle(n) | Step::Expose(n) | Step::Store(n) => n,
        Step::Kept | Step::Examine(_) | Step::Verdict(_) => unreachable!("nothing is to fail there"),
        // The first is `homed`, then one for each move, then the end.
        Step::Event(n) => n.saturating_sub(1),
    }
}

#[test]
fn a_fault_at_any_step_keeps_what_was_captured_and_the_next_run_takes_the_rest() {
    let each = |step: fn(usize) -> Step| (0..VIEWS).map(step);
    let steps = [Step::Begin, Step::Home]
        .into_iter()
        .chain(each(Step::Move))
        .chain(each(Step::Expose))
        .chain(each(Step::Store))
        .chain((0..VIEWS + 2).map(Step::Event));
    for step in steps {
        let runs = Runs::new();
        let error = failed_at(&runs, step);
        let view = durable_after(step);
        let as_expected = match (step, &error) {
            (Step::Move(_), AcquireError::Stage { view: v, .. })
            | (Step::Expose(_), AcquireError::Camera { view: v, .. }) => *v == view,
            (Step::Home, AcquireError::Home(_))
            | (
                Step::Begin | Step::Store(_) | Step::Event(_),
                AcquireError::Session(SessionError::DiskFull { needed: 70_000, free: 12, .. }),
            ) => true,
            _ => false,
        };
        assert!(as_expected, "{step:?}: {error}");
        let events = runs.events();
        if step == Step::Begin {
            // A fault before the first event leaves nothing but itself.
            assert_eq!(events, ["failed"]);
        } else {
            assert_eq!(events.last().unwrap(), "failed", "{step:?}: {events:?}");
        }
        assert_eq!(runs.recording().state(), State::Failed, "{step:?}");
        // The next run.
        let left = VIEWS - view;
        assert_eq!(runs.run_well(), Outcome::Complete { captured: left }, "{step:?}");
        assert_eq!((runs.durable(), runs.passed_on.lock().unwrap().clone()), (all(), all()), "{step:?}");
        assert_eq!(runs.recording().state(), State::Captured);
        let again = runs.events();
        assert_eq!(again.iter().filter(|e| e.starts_with("captured")).count(), left, "{step:?}: {again:?}");
    }
}

#[test]
fn the_camera_may_forget_a_picture_only_once_it_is_durable() {
    let runs = Runs::new();
    let folder = runs.recording().folder().to_owned();
    let seen = Arc::new(Mutex::new(Vec::new()));
    let told = Arc::clone(&seen);
    let at = move |step| {
        if step == Step::Kept {
            told.lock().unwrap().push(Recording::read(&folder).unwrap().views().len());
        }
    };
    // The second picture is no use, so the camera is told of none.
    let script = Script { at: Box::new(at), pictures: vec![None, Some(Vec::new())], ..Script::default() };
    runs.run(script, &Control::new()).unwrap();
    assert_eq!(*seen.lock().unwrap(), [1, 2, 3, 4]);
}

#[test]
fn a_run_that_fails_again_and_again_loses_nothing() {
    let runs = Runs::new();
    for n in 0..VIEWS {
        // Each run takes one view and fails at the second.
        let script = Script { fails_at: Some(Step::Expose(1)), ..Script::default() };
        let ended = runs.run(script, &Control::new());
        assert_eq!(ended.is_ok(), n + 1 == VIEWS, "{ended:?}");
        assert_eq!(runs.durable(), (0..=n).collect::<Vec<_>>());
    }
}

#[test]
fn a_complete_session_needs_no_device() {
    let runs = Runs::new();
    runs.run_well();
    let script = Script {
        at: Box::new(|step| assert!(matches!(step, Step::Begin | Step::Event(_)))),
        ..Script::default()
    };
    assert_eq!(runs.run(script, &Control::new()).unwrap(), Outcome::Complete { captured: 0 });
    assert_eq!(runs.events(), ["started", "acquisition_complete"]);
}

/// Whether a fault is the expected one.
type Expected = fn(&PictureFault) -> bool;

/// Pictures that are no use, and the fault that each has.
fn bad_pictures() -> Vec<(Vec<u8>, Expected)> {
    let whole = picture(16, 8);
    vec![
        (Vec::new(), |f| *f == PictureFault::Empty),
        (whole[..whole.len() / 2].to_vec(), |f| matches!(f, PictureFault::CutOff { .. })),
        (b"not a picture".to_vec(), |f| matches!(f, PictureFault::Unknown(_))),
        (vec![0xff, 0xd8, 0xff, 0xd9], |f| matches!(f, PictureFault::Undecodable(_))),
        (picture(8, 16), |f| {
            let expected =
                PictureFault::OtherSize { width: 8, height: 16, others_width: 16, others_height: 8 };
            *f == expected
        }),
    ]
}

#[test]
fn a_bad_picture_is_taken_again_as_often_as_the_plan_allows() {
    for (bad, _) in bad_pictures() {
        let runs = Runs::new();
        // The first view is good, so that there is a size; the second takes three attempts.
        let pictures = vec![None, Some(bad.clone()), Some(bad)];
        let script = Script { pictures, ..Script::default() };
        assert_eq!(runs.run(script, &Control::new()).unwrap(), Outcome::Complete { captured: VIEWS });
        assert_eq!(runs.durable(), all());
    }
}

#[test]
fn a_view_of_which_every_picture_is_bad_ends_the_run_with_the_last_ones_fault() {
    for (bad, is_expected) in bad_pictures() {
        let runs = Runs::new();
        let pictures = vec![None, Some(bad.clone()), Some(bad.clone()), Some(bad)];
        let error = runs.run(Script { pictures, ..Script::default() }, &Control::new()).unwrap_err();
        let AcquireError::BadFrames { view: 1, tries: 3, fault } = &error else { panic!("{error}") };
        assert!(is_expected(fault), "{error}");
        assert_eq!((runs.durable(), runs.recording().state()), (vec![0], State::Failed));
        runs.run_well();
        assert_eq!(runs.durable(), all());
    }
}

#[test]
fn a_picture_that_is_no_good_is_taken_again_and_each_time_journalled() {
    let runs = Runs::new();
    // The second view's first picture does not decode, its next one is no good.
    let pictures = vec![None, Some(Vec::new())];
    let script = Script { pictures, unfit: vec![1], ..Script::default() };
    assert_eq!(runs.run(script, &Control::new()).unwrap(), Outcome::Complete { captured: VIEWS });
    let events = runs.events();
    let again = [
        "moving 1",
        "captured 0",
        "rejected 1",
        "moving 2",
        "rejected 1",
        "moving 1",
        "moving 2",
        "captured 1",
        "moving 3",
    ];
    assert_eq!(events[3..12], again);
    assert_eq!(runs.durable(), all());
}

#[test]
fn the_size_of_a_picture_that_is_no_good_binds_no_other() {
    let runs = Runs::new();
    let pictures = vec![Some(picture(32, 8))];
    let script = Script { pictures, unfit: vec![0], ..Script::default() };
    assert_eq!(runs.run(script, &Control::new()).unwrap(), Outcome::Complete { captured: VIEWS });
}

#[test]
fn a_run_that_nobody_attends_ends_where_no_picture_of_a_view_is_good() {
    let runs = Runs::new();
    let script = Script { unfit: vec![1, 2, 3], ..Script::default() };
    let error = runs.run(script, &Control::new()).unwrap_err();
    let AcquireError::Unfit { view: 1, tries: 3, cause } = &error else { panic!("{error}") };
    assert_eq!(cause, "focus is 9 px");
    assert!(error.to_string().contains("grainrig resume"), "{error}");
    assert_eq!((runs.durable(), runs.recording().state()), (vec![0], State::Failed));
    assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - 1 });
    assert_eq!(runs.durable(), all());
}

#[test]
fn a_resumed_run_takes_no_picture_of_another_size_than_the_earlier_ones() {
    let runs = Runs::new();
    failed_at(&runs, Step::Move(1));
    let pictures = vec![Some(picture(32, 8)); 3];
    let error = runs.run(Script { pictures, ..Script::default() }, &Control::new()).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("32 × 8 px, the others have 16 × 8 px"), "{text}");
    assert_eq!(runs.durable(), [0]);
}

#[test]
fn a_stage_that_stands_elsewhere_than_it_was_sent_ends_the_run_before_the_exposure() {
    type Answer = (fn(f64) -> f64, &'static str);
    let answers: [Answer; 4] = [
        (|deg| if deg > 60.0 { deg + 0.46 } else { deg }, "reads 120.460°"),
        (|deg| if deg > 60.0 { deg - 0.9 } else { deg }, "reads 119.100°"),
        (|deg| if deg > 60.0 { f64::NAN } else { deg }, "reads NaN°"),
        (|deg| if deg > 60.0 { f64::INFINITY } else { deg }, "reads inf°"),
    ];
    for (reached, reads) in answers {
        let runs = Runs::new();
        let error =
            runs.run(Script { reached, ..Script::default() }, &Control::new()).unwrap_err().to_string();
        for part in ["view 2: ", "sent to 120.000°", reads, "0.45° off", "check the coupling"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert_eq!(runs.durable(), [0, 1]);
    }
    let runs = Runs::new();
    let script = Script { reached: |deg| deg + 0.44, ..Script::default() };
    runs.run(script, &Control::new()).unwrap();
    let recording = runs.recording();
    let reached = recording.view(1).unwrap();
    assert_eq!((reached.commanded_deg, reached.reached_deg), (60.0, 60.44));
}

#[test]
fn a_picture_that_has_changed_since_ends_the_next_run_before_anything_moves() {
    let runs = Runs::new();
    failed_at(&runs, Step::Move(2));
    let path = runs.recording().folder().join("frames/view_000.jpg");
    std::fs::write(&path, b"something else").unwrap();
    let script = Script { at: Box::new(|step| assert_ne!(step, Step::Home)), ..Script::default() };
    let error = runs.run(script, &Control::new()).unwrap_err().to_string();
    assert!(error.contains("view_000.jpg has changed"), "{error}");
}
