//! A camera that fails delivers its picture all the same, or says what is to be done; it never hangs.

use crate::bench::scene;
use crate::network::{Network, WAYS};
use crate::ptp_camera::{Fault, Personality, Setup, speaks_ptpip};
use grainrig::rig::gphoto::Target;
use grainrig::rig::{Camera as _, RigError};
use std::time::{Duration, Instant};

/// Takes three pictures, of which the second meets the fault; each is of what the camera looked at.
fn survives(setup: Setup, target: Target) -> Network {
    let what = format!("{setup:?} {target:?}");
    let network = Network::new(setup, target);
    let mut camera = network.open().unwrap_or_else(|e| panic!("{what}: {e}"));
    for n in 0..3 {
        network.look_at(n);
        let frame = camera.capture().unwrap_or_else(|e| panic!("{what}: picture {n}: {e}"));
        assert_eq!(scene(&frame), n, "{what}");
        camera.kept();
    }
    network
}

/// Takes one picture, then meets a fault that stays; what a person is told.
fn is_given_up(setup: Setup, target: Target) -> (String, String) {
    let what = format!("{setup:?} {target:?}");
    let network = Network::new(setup, target);
    let mut camera = network.open().unwrap_or_else(|e| panic!("{what}: {e}"));
    camera.capture().unwrap_or_else(|e| panic!("{what}: {e}"));
    camera.kept();
    let began = Instant::now();
    let Err(RigError::Suspended { cause, remedy, retry }) = camera.capture() else {
        panic!("{what}: it delivers a picture")
    };
    // A promise, not a measurement: no operation outlives its deadline by two seconds.
    let s = &network.settings;
    let tries = 1.0 + s.retry_s.len() as f64;
    let most = tries * (s.shot_s + s.open_s + s.start_s + 2.0);
    assert!(began.elapsed() < Duration::from_secs_f64(most), "{what}: {:?}", began.elapsed());
    assert_eq!(retry, Duration::from_millis(500), "{what}");
    // Given up twice in a row it is left alone for longer.
    if s.shot_s < 4.0 {
        return (cause, remedy);
    }
    let Err(RigError::Suspended { retry, .. }) = camera.capture() else { panic!("{what}: a picture") };
    assert_eq!(retry, Duration::from_secs(1), "{what}");
    (cause, remedy)
}

#[test]
fn what_passes_is_tried_again() {
    if !speaks_ptpip() {
        return;
    }
    for (personality, target) in WAYS {
        let slow = Fault::Slow(Duration::from_millis(700));
        for fault in [
            Fault::Busy,
            Fault::NoEvent,
            Fault::Die { refusals: 1 },
            Fault::Torn { refusals: 1 },
            slow,
            Fault::Drift,
            Fault::RawWithoutJpeg,
        ] {
            let network = survives(Setup::new(personality).with(fault, 1), target);
            assert_eq!(network.body.iso(), "100", "{personality:?} {target:?} {fault:?}");
        }
        let network =
            survives(Setup { raw: true, ..Setup::new(personality) }.with(Fault::Truncated, 1), target);
        assert!(network.body.releases() >= 4);
    }
}

#[test]
fn a_camera_that_does_not_answer_is_killed_and_asked_again() {
    if !speaks_ptpip() {
        return;
    }
    for (personality, target) in WAYS {
        let network = survives(Setup::new(personality).with(Fault::Stall, 1), target);
        assert_eq!((network.body.releases(), network.body.sessions()), (4, 2));
    }
}

#[test]
fn what_stays_is_told_with_its_remedy() {
    if !speaks_ptpip() {
        return;
    }
    let always = |fault| Setup::new(Personality::Eos).with_many(fault, 1, 1000);
    for (fault, cause, remedy) in [
        (Fault::Busy, "busy for 1 s", "end live view"),
        (Fault::FullCard, "card is full", "delete pictures from the card"),
        (Fault::RawWithoutJpeg, "no JPEG came with IMG_", "RAW + JPEG"),
        (Fault::Truncated, "bytes", "JPEG"),
        (Fault::Drift, "iso was \"800\" at the exposure, \"100\" was set", ""),
        (Fault::Die { refusals: 1000 }, "", "check the cable"),
    ] {
        let told = is_given_up(always(fault), Target::Card);
        assert!(told.0.contains(cause) && told.1.contains(remedy), "{fault:?}: {told:?}");
    }
}

#[test]
fn a_camera_whose_memory_is_small_is_emptied_as_the_pictures_become_durable() {
    if !speaks_ptpip() {
        return;
    }
    for (personality, target) in WAYS {
        let network = Network::new(Setup { capacity: 2, raw: true, ..Setup::new(personality) }, target);
        let mut camera = network.open().unwrap();
        for n in 0..4 {
            network.look_at(n);
            let frame = camera.capture().unwrap();
            assert_eq!((scene(&frame), frame.others.len()), (n, 1), "{personality:?} {target:?}");
            assert_eq!(frame.others[0].extension, "cr2");
            camera.kept();
        }
        // It lets go of the camera in good order, after what it was asked last.
        drop(camera);
        assert_eq!(network.body.pictures(), Vec::<String>::new(), "{personality:?} {target:?}");
    }
}

#[test]
fn pictures_stay_on_the_card_until_they_are_durable() {
    if !speaks_ptpip() {
        return;
    }
    for personality in [Personality::Generic, Personality::Eos] {
        let network = Network::new(Setup { capacity: 2, ..Setup::new(personality) }, Target::Card);
        let mut camera = network.open().unwrap();
        camera.capture().unwrap();
        camera.capture().unwrap();
        assert_eq!(network.body.pictures().len(), 2);
        let Err(RigError::Suspended { remedy, .. }) = camera.capture() else { panic!("the card is full") };
        assert!(remedy.contains("delete pictures from the card"), "{remedy}");
        assert_eq!(network.body.pictures().len(), 2);
    }
}

#[test]
fn live_view_that_somebody_left_on_is_ended_first() {
    if !speaks_ptpip() {
        return;
    }
    survives(Setup { live_view: true, ..Setup::new(Personality::Eos) }, Target::Card);
}

#[test]
fn a_camera_that_is_not_set_as_it_must_be_is_named_at_once() {
    if !speaks_ptpip() {
        return;
    }
    let refused = |change: fn(&mut Network)| -> String {
        let mut network = Network::new(Setup::new(Personality::Eos), Target::Card);
        change(&mut network);
        let Err(e) = network.open() else { panic!("it opened") };
        e.to_string()
    };
    let set =
        |n: &mut Network, name: &str, value: &str| drop(n.settings.set.insert(name.into(), value.into()));
    // A name that the camera lacks crashes the library where it is asked for it.
    let lacks = refused(|n| drop(n.settings.set.insert("no-such-setting".into(), "1".into())));
    assert!(lacks.contains("no setting \"no-such-setting\""), "{lacks}");
    let mode = refused(|n| drop(n.settings.require.insert("autoexposuremode".into(), "Av".into())));
    assert!(mode.contains("autoexposuremode is \"Manual\", \"Av\" is required"), "{mode}");
    let choice = refused(|n| drop(n.settings.set.insert("iso".into(), "3".into())));
    assert!(choice.contains("iso can't be \"3\": it is one of 4 choices: 100, 200"), "{choice}");
    let serial = refused(|n| n.settings.serial = "77".into());
    assert!(serial.contains("0123456789abcdef, 77 is set"), "{serial}");
    // What can be set is set, and shows.
    let mut network = Network::new(Setup::new(Personality::Eos), Target::Card);
    set(&mut network, "iso", "200");
    network.open().unwrap();
    assert_eq!(network.body.iso(), "200");
}
