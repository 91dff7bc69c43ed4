//! Whole runs of the real program with a camera that fails, and with its process killed at any instant: the run ends
//! complete, with what a run without faults gives, or says what is to be done; nothing captured is lost.

use crate::kit::{Lab, Ran, VIEWS, pictures};
use crate::ptp_camera::{Fault, Personality, PtpCamera, Setup, speaks_ptpip};
use grainrig::session::event::EventKind;
use grainrig::session::{Recording, State};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// A laboratory with a camera on the network before the simulated stage.
struct Rig {
    lab: Lab,
    body: PtpCamera,
    config: String,
}

/// The view that the run is at, by its journal.
fn view(session: &Path) -> usize {
    let moving = |what: &EventKind| match what {
        EventKind::Moving { view, .. } => Some(*view),
        _ => None,
    };
    let recording = Recording::read(session).unwrap();
    recording.events().iter().rev().find_map(|e| moving(&e.what)).unwrap()
}

impl Rig {
    /// `more` are further settings of the camera.
    fn new(setup: Setup, more: &[&str]) -> Self {
        pictures();
        let lab = Lab::new();
        let session: PathBuf = lab.session("a");
        let body = PtpCamera::start(setup, move |_| pictures()[view(&session)].clone());
        let (model, port) = (format!("model = '{}'", body.model()), format!("port = '{}'", body.address()));
        let rig = ["kind = 'hardware'", "stage = 'simulated'", "camera = 'gphoto2'"];
        let camera =
            ["set = { iso = '100' }", "shot_s = 6.0", "busy_s = 1.0", "quiet_s = 0.2", &model, &port];
        let rig = rig.map(|line| ("rig", line));
        let camera = camera.iter().chain(more).map(|line| ("gphoto2", *line));
        let config = lab.config(&rig.into_iter().chain(camera).collect::<Vec<_>>());
        Self { lab, body, config }
    }

    fn capture(&self) -> Ran {
        self.lab.run(&["--config", &self.config, "capture", "a"])
    }

    /// The session is complete and sound, each view is of its own angle, and the surface is that of a run without faults.
    fn assert_whole(&self, what: &str) {
        let recording = self.lab.recording("a");
        assert_eq!((recording.state(), recording.views().len()), (State::Complete, VIEWS), "{what}");
        for n in 0..VIEWS {
            assert!(
                recording.frame(n).unwrap().bytes == pictures()[n],
                "{what}: view {n} shows another angle"
            );
        }
        self.lab.assert_sound("a");
        let made = self.lab.products("a");
        let clean = clean();
        assert_eq!((&made["grain.stl"], &made["grain.inp"]), (&clean.0, &clean.1), "{what}");
    }
}

/// Hashes of surface and mesh of a run with which nothing was wrong.
fn clean() -> &'static (String, String) {
    static MADE: std::sync::OnceLock<(String, String)> = std::sync::OnceLock::new();
    MADE.get_or_init(|| {
        let rig = Rig::new(Setup::new(Personality::Eos), &[]);
        rig.capture().succeeds();
        let made = rig.lab.products("a");
        (made["grain.stl"].clone(), made["grain.inp"].clone())
    })
}

/// Every fault, as it meets one exposure.
fn faults() -> Vec<Fault> {
    let slow = Fault::Slow(Duration::from_millis(500));
    let die = Fault::Die { refusals: 1 };
    vec![
        Fault::Busy,
        Fault::Stall,
        Fault::NoEvent,
        die,
        Fault::RawWithoutJpeg,
        Fault::Truncated,
        slow,
        Fault::Drift,
    ]
}

#[test]
fn a_run_gets_over_every_fault_that_passes() {
    if !speaks_ptpip() {
        return;
    }
    for (n, fault) in faults().into_iter().enumerate() {
        let personality = if n % 2 == 0 { Personality::Eos } else { Personality::Generic };
        let rig = Rig::new(Setup::new(personality).with(fault, 2), &["retry_s = [0.02, 0.05]"]);
        rig.capture().succeeds();
        rig.assert_whole(&format!("{personality:?} {fault:?}"));
    }
}

#[test]
fn a_run_that_meets_a_fault_that_stays_is_suspended_with_its_remedy_and_goes_on_once_that_is_done() {
    if !speaks_ptpip() {
        return;
    }
    let remedies = [
        (Fault::FullCard, "delete pictures from the card"),
        (Fault::NoEvent, "set the lens to manual focus"),
        (Fault::Die { refusals: 1000 }, "check the cable"),
    ];
    for (fault, remedy) in remedies {
        let setup = Setup::new(Personality::Eos).with_many(fault, 2, 1000);
        let rig = Rig::new(setup, &["retry_s = [0.02]", "shot_s = 3.0"]);
        rig.capture().fails(1, &["view 2: ", remedy, "(the next try is due in "]);
        let recording = rig.lab.recording("a");
        assert_eq!((recording.state(), recording.views().len()), (State::Failed, 2), "{fault:?}");
        rig.body.mend();
        rig.lab.run(&["resume", "a"]).succeeds();
        rig.assert_whole(&format!("{fault:?}"));
    }
}

#[test]
fn raw_files_are_archived_beside_their_views_and_go_from_the_card() {
    if !speaks_ptpip() {
        return;
    }
    let rig = Rig::new(Setup { raw: true, ..Setup::new(Personality::Eos) }, &[]);
    rig.capture().succeeds();
    rig.assert_whole("raw");
    for v in rig.lab.recording("a").views() {
        let file = format!("view_{:03}_raw.cr2", v.view);
        assert_eq!(v.others.iter().map(|o| &o.file).collect::<Vec<_>>(), [&file]);
    }
    assert_eq!(rig.body.pictures(), Vec::<String>::new());
    rig.lab.run(&["replay", "a"]).succeeds();
}

/// The camera's process of a program, where it runs.
fn worker(program: u32) -> Option<rustix::process::Pid> {
    let parent = |pid: u32| -> Option<(u32, String)> {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        let parent = stat.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()?;
        Some((parent, std::fs::read_to_string(format!("/proc/{pid}/cmdline")).ok()?))
    };
    let all = std::fs::read_dir("/proc").unwrap().flatten();
    let numbers = all.filter_map(|e| e.file_name().to_str()?.parse::<u32>().ok());
    let mut mine =
        numbers.filter(|pid| parent(*pid).is_some_and(|(p, c)| p == program && c.contains("camera-worker")));
    mine.next().and_then(|pid| rustix::process::Pid::from_raw(pid as i32))
}

/// Kills in one run: it takes a while to open a camera, and a run that never gets so far has no end.
const KILLS_A_RUN: usize = 5;

/// Kills the camera's process of a run at random instants; how often.
fn kill_at_random(rig: &Rig, random: &mut u64) -> usize {
    let running = rig.lab.start(&["--config", &rig.config, "capture", "a"]);
    let program = running.id();
    let (over, ended) = std::sync::mpsc::channel::<()>();
    let mut seed = *random;
    let killing = std::thread::spawn(move || {
        let mut killed = 0;
        loop {
            // Numerical Recipes' generator; its high bits are good enough for an instant.
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let wait = Duration::from_millis(5 + (seed >> 16) % 900);
            let over = ended.recv_timeout(wait) != Err(std::sync::mpsc::RecvTimeoutError::Timeout);
            if over || killed == KILLS_A_RUN {
                return (killed, seed);
            }
            let gone = |pid| rustix::process::kill_process(pid, rustix::process::Signal::KILL).is_ok();
            killed += usize::from(worker(program).is_some_and(gone));
        }
    });
    let ran = running.end();
    drop(over);
    let (killed, seed) = killing.join().unwrap();
    *random = seed;
    ran.succeeds();
    killed
}

#[test]
fn killing_the_cameras_process_at_any_instant_changes_nothing_but_time() {
    if !speaks_ptpip() {
        return;
    }
    let wanted = std::env::var("GRAINRIG_KILLS").map_or(20, |n| n.parse().unwrap());
    let (mut killed, mut random, mut runs) = (0, 60_2026, 0);
    while killed < wanted {
        let personality = [Personality::Eos, Personality::Generic][runs % 2];
        let target = ["target = 'card'", "target = 'ram'"][runs / 2 % 2];
        let patience = format!("retry_s = [{}]", "0.0, ".repeat(KILLS_A_RUN));
        let rig = Rig::new(Setup { raw: runs % 3 == 0, ..Setup::new(personality) }, &[&patience, target]);
        killed += kill_at_random(&rig, &mut random);
        rig.assert_whole(&format!("{killed} kills, {personality:?}, {target}"));
        runs += 1;
    }
    println!("{killed} kills in {runs} runs");
}
