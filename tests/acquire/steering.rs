//! Abort, pause and resume at every step.

use super::rig::{Runs, Script, Step, VIEWS};
use grainrig::acquire::{Control, Outcome, Phase};
use grainrig::session::State;
use grainrig::session::event::EventKind;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Every step of a run at which a person may steer, and the views that are durable once the run stands.
fn steps() -> Vec<(Step, usize)> {
    let mut steps = vec![(Step::Begin, 0), (Step::Home, 0), (Step::Event(0), 0)];
    for n in 0..VIEWS {
        // A picture that is being taken is stored before the run stands.
        steps.extend([
            (Step::Move(n), n),
            (Step::Settle(n), n),
            (Step::Expose(n), n + 1),
            (Step::Store(n), n + 1),
        ]);
    }
    steps
}

/// A script that steers at one step.
fn steered(at: Step, steer: impl Fn() + Send + Sync + 'static) -> Script {
    Script {
        at: Box::new(move |step| {
            if step == at {
                steer();
            }
        }),
        ..Script::default()
    }
}

#[test]
fn an_abort_at_any_step_stores_the_view_in_hand_and_the_next_run_takes_the_rest() {
    for (step, durable) in steps() {
        // After the last view there is nothing to abort: the run is complete, or about to be.
        let runs = Runs::new();
        let control = Control::new();
        let steering = control.clone();
        let ended = runs.run(steered(step, move || steering.abort()), &control).unwrap();
        assert_eq!(runs.durable().len(), durable, "{step:?}");
        if durable == VIEWS {
            assert_eq!(
                (ended, control.phase()),
                (Outcome::Complete { captured: VIEWS }, Phase::Complete),
                "{step:?}"
            );
            continue;
        }
        assert_eq!(
            (ended, control.phase()),
            (Outcome::Aborted { captured: durable }, Phase::Aborted),
            "{step:?}"
        );
        assert_eq!(runs.events().last().unwrap(), "aborted", "{step:?}");
        assert_eq!(runs.recording().state(), State::Aborted);
        assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - durable }, "{step:?}");
        assert_eq!(runs.durable().len(), VIEWS);
    }
}

/// Runs a script on a thread of its own and, once the run is paused, does something.
pub fn when_paused(runs: &Runs, script: Script, control: &Control, then: impl FnOnce()) -> Outcome {
    std::thread::scope(|scope| {
        let running = scope.spawn(|| runs.run(script, control).unwrap());
        if control.wait_for(|p| p == Phase::Paused) == Phase::Paused {
            then();
        }
        running.join().unwrap()
    })
}

#[test]
fn a_pause_at_any_step_stores_the_view_in_hand_and_goes_on_where_it_was() {
    for (step, durable) in steps() {
        let runs = Runs::new();
        let control = Control::new();
        let steering = control.clone();
        let script = steered(step, move || steering.pause());
        let seen = Mutex::new(None);
        let ended = when_paused(&runs, script, &control, || {
            *seen.lock().unwrap() = Some(runs.durable().len());
            control.resume();
        });
        assert_eq!(ended, Outcome::Complete { captured: VIEWS }, "{step:?}");
        let events = runs.events();
        let count = |name: &str| events.iter().filter(|e| *e == name).count();
        if durable < VIEWS {
            assert_eq!(seen.into_inner().unwrap(), Some(durable), "{step:?}");
            assert_eq!((count("paused"), count("resumed")), (1, 1), "{step:?}: {events:?}");
        }
        assert_eq!(events.iter().filter(|e| e.starts_with("captured")).count(), VIEWS, "{events:?}");
        assert_eq!(count("homed"), 1, "{events:?}");
    }
}

#[test]
fn a_paused_run_may_be_aborted() {
    for (step, durable) in steps().into_iter().filter(|s| s.1 < VIEWS) {
        let runs = Runs::new();
        let control = Control::new();
        let steering = control.clone();
        let script = steered(step, move || steering.pause());
        let ended = when_paused(&runs, script, &control, || control.abort());
        assert_eq!(ended, Outcome::Aborted { captured: durable }, "{step:?}");
        let events = runs.events();
        assert_eq!(events[events.len() - 2..], ["paused", "aborted"], "{step:?}");
        assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - durable });
    }
}

#[test]
fn an_abort_is_final_whatever_is_wished_after_it() {
    let runs = Runs::new();
    let control = Control::new();
    let steering = control.clone();
    let script = steered(Step::Move(1), move || {
        steering.abort();
        steering.pause();
        steering.resume();
    });
    assert_eq!(runs.run(script, &control).unwrap(), Outcome::Aborted { captured: 1 });
}

#[test]
fn the_time_left_is_told_from_the_views_so_far_without_the_pauses() {
    let runs = Runs::new();
    let control = Control::new();
    let (steering, now) = (control.clone(), Arc::clone(&runs.now));
    let script = steered(Step::Move(1), move || steering.pause());
    when_paused(&runs, script, &control, || {
        *now.lock().unwrap() += Duration::from_secs(3600);
        control.resume();
    });
    let left = |what: &EventKind| match what {
        EventKind::Captured { remaining_s, .. } => *remaining_s,
        _ => None,
    };
    // Each view settles for a second, and nothing else takes time.
    let told: Vec<f64> = runs.recording().events().iter().filter_map(|e| left(&e.what)).collect();
    assert_eq!(told, [3.0, 2.0, 1.0, 0.0]);
}

#[test]
fn a_suspended_run_goes_on_with_its_view_and_all_its_tries_or_is_aborted() {
    let unfit = || Script { unfit: vec![1, 2, 3, 4, 5], ..Script::default() };
    let runs = Runs::new();
    let control = Control::attended();
    let seen = Mutex::new(Vec::new());
    let ended = when_paused(&runs, unfit(), &control, || {
        *seen.lock().unwrap() = runs.events();
        control.resume();
    });
    assert_eq!(ended, Outcome::Complete { captured: VIEWS });
    let seen = seen.into_inner().unwrap();
    let refused = ["moving 2", "rejected 1", "moving 1"];
    // The stage stands at the view in question before it is suspended.
    assert_eq!(seen[5..], [&refused[..], &refused, &refused, &["suspended 1", "paused"]].concat());
    // Two more are no good after the suspension: the third is kept.
    let after = runs.events()[seen.len()..].to_vec();
    assert_eq!(after[..9], [&["resumed"], &refused[..], &refused, &["moving 2", "captured 1"]].concat());
    assert_eq!(runs.durable().len(), VIEWS);

    let runs = Runs::new();
    let control = Control::attended();
    let ended = when_paused(&runs, unfit(), &control, || control.abort());
    assert_eq!(ended, Outcome::Aborted { captured: 1 });
    assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - 1 });
}

#[test]
fn a_run_whose_camera_is_given_up_waits_and_goes_on_by_itself_or_when_told() {
    let soon = Duration::from_millis(1);
    let suspended = |retry| Script { suspended: (vec![1, 2], retry), ..Script::default() };
    let runs = Runs::new();
    assert_eq!(
        runs.run(suspended(soon), &Control::attended()).unwrap(),
        Outcome::Complete { captured: VIEWS }
    );
    let events = runs.events();
    let again = ["suspended 1", "paused", "resumed"];
    assert_eq!(events[3..5], ["moving 1", "captured 0"]);
    assert_eq!(events[5..13], [&again[..], &again, &["moving 2", "captured 1"]].concat());
    // Nobody waits an hour who is told to go on.
    let runs = Runs::new();
    let control = Control::attended();
    let script = Script { suspended: (vec![1], Duration::from_secs(3600)), ..Script::default() };
    assert_eq!(
        when_paused(&runs, script, &control, || control.resume()),
        Outcome::Complete { captured: VIEWS }
    );
    // A run that nobody attends ends, and says what is to be done.
    let runs = Runs::new();
    let error = runs.run(suspended(soon), &Control::new()).unwrap_err().to_string();
    assert!(error.contains("view 1: it sleeps; wake it (the next try is due in"), "{error}");
    assert_eq!(runs.run_well(), Outcome::Complete { captured: VIEWS - 1 });
}
