//! A GRBL 1.1 board on a pseudo terminal, and the driver against it.

use grainrig::rig::RotationStage as _;
use grainrig::rig::grbl::{Reference, Settings, open};
use grainrig_core::geometry::Angle;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Steps for a degree of the simulated board.
const STEPS: f64 = 8.889;

/// What goes wrong.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    /// Of so many lines to the board one gets lost.
    pub lost_line_each: Option<usize>,
    /// The board starts anew at its move of this number.
    pub reset_at: Option<usize>,
    /// An alarm at the move of this number.
    pub alarm_at: Option<usize>,
    /// Locked when it starts.
    pub locked: bool,
    /// The motor does not turn.
    pub stuck: bool,
}

/// What the board has done.
#[derive(Debug, Default)]
pub struct Done {
    /// Where the motor is, whole steps.
    pub steps: i64,
    pub moves: usize,
}

/// A running board; it ends with its line.
pub struct Grbl {
    pub port: PathBuf,
    pub done: Arc<Mutex<Done>>,
    /// Keeps the terminal there whether or not the driver has it open.
    _other: File,
}

struct Sim {
    line: File,
    faults: Faults,
    done: Arc<Mutex<Done>>,
    target: i64,
    alarm: bool,
    lines: usize,
}

impl Grbl {
    pub fn start(faults: Faults) -> Self {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&ours).unwrap();
        unlockpt(&ours).unwrap();
        let port = PathBuf::from(ptsname(&ours, Vec::new()).unwrap().to_str().unwrap());
        let other = File::options().read(true).write(true).open(&port).unwrap();
        let mut raw = tcgetattr(&other).unwrap();
        raw.make_raw();
        tcsetattr(&other, OptionalActions::Now, &raw).unwrap();
        let done = Arc::new(Mutex::new(Done::default()));
        let alarm = faults.locked;
        let mut sim = Sim { line: File::from(ours), faults, done: done.clone(), target: 0, alarm, lines: 0 };
        std::thread::spawn(move || sim.serve());
        Self { port, done, _other: other }
    }

    pub fn steps(&self) -> i64 {
        self.done.lock().unwrap().steps
    }
}

impl Sim {
    fn say(&mut self, text: &str) {
        let _ = self.line.write_all(format!("{text}\r\n").as_bytes());
    }

    fn serve(&mut self) {
        let (mut byte, mut text) = ([0], String::new());
        while self.line.read_exact(&mut byte).is_ok() {
            match byte[0] {
                b'?' => self.state(),
                0x18 => self.restart(),
                b'\n' => {
                    self.lines += 1;
                    let lost = self.faults.lost_line_each.is_some_and(|n| self.lines.is_multiple_of(n));
                    let line = std::mem::take(&mut text);
                    if !lost {
                        self.obey(&line);
                    }
                }
                other => text.push(char::from(other)),
            }
        }
    }

    fn restart(&mut self) {
        self.target = self.done.lock().unwrap().steps;
        self.alarm = self.faults.locked;
        self.say("Grbl 1.1h ['$' for help]");
        if self.alarm {
            self.say("[MSG:'$H'|'$X' to unlock]");
        }
    }

    /// Each look finds the motor a third of its way on.
    fn state(&mut self) {
        let mut done = self.done.lock().unwrap();
        let left = self.target - done.steps;
        let moving = left != 0 && !self.faults.stuck;
        if moving {
            done.steps += if left.abs() < 8 { left } else { left / 3 };
        }
        let position = done.steps as f64 / STEPS;
        drop(done);
        let name = if self.alarm {
            "Alarm"
        } else if moving {
            "Jog"
        } else {
            "Idle"
        };
        self.say(&format!("<{name}|MPos:{position:.3},0.000,0.000|FS:0,0>"));
    }

    fn obey(&mut self, line: &str) {
        if let Some(words) = line.strip_prefix("$J=G53 G90 X") {
            if self.alarm {
                return self.say("error:9");
            }
            let degrees: f64 = words.split(' ').next().unwrap().parse().unwrap();
            let number = {
                let mut done = self.done.lock().unwrap();
                done.moves += 1;
                done.moves
            };
            if self.faults.reset_at == Some(number) {
                return self.restart();
            }
            if self.faults.alarm_at == Some(number) {
                self.alarm = true;
                return self.say("ALARM:1");
            }
            self.target = (degrees * STEPS).round() as i64;
            return self.say("ok");
        }
        match line {
            "$$" => {
                self.say("$13=0");
                self.say(&format!("$100={STEPS:.3}"));
                self.say("ok");
            }
            "$H" => {
                self.alarm = false;
                self.done.lock().unwrap().steps = -9;
                self.target = -9;
                self.say("ok");
            }
            "$X" => {
                self.alarm = false;
                self.say("[MSG:Caution: Unlocked]");
                self.say("ok");
            }
            _ => self.say("error:3"),
        }
    }
}

pub fn settings(board: &Grbl) -> Settings {
    let port = board.port.to_string_lossy().into_owned();
    Settings { port, steps_per_deg: STEPS, boot_ms: 0, reply_ms: 150, ..Settings::default() }
}

fn steps(deg: f64) -> i64 {
    (deg * STEPS).round() as i64
}

#[test]
fn the_board_goes_to_every_view() {
    for faults in [Faults::default(), Faults { lost_line_each: Some(3), ..Faults::default() }] {
        let board = Grbl::start(faults.clone());
        let mut stage = open(&settings(&board)).unwrap();
        stage.home().unwrap();
        for view in 0..=25 {
            let target = 7.2 * f64::from(view);
            let reached = stage.move_to(Angle::from_deg(target)).unwrap();
            assert_eq!(board.steps(), steps(target), "{faults:?}");
            assert!((reached.deg() - board.steps() as f64 / STEPS).abs() < 1e-9);
        }
        stage.move_to(Angle::from_deg(7.2)).unwrap();
        assert_eq!(board.steps(), steps(7.2));
        assert!(stage.move_to(Angle::from_deg(371.0)).is_err());
        assert!(stage.describe().starts_with("Grbl 1.1h on "), "{}", stage.describe());
    }
}

#[test]
fn homing_ends_where_the_board_says() {
    let board = Grbl::start(Faults { locked: true, ..Faults::default() });
    let mut stage = open(&Settings { reference: Reference::Switch, ..settings(&board) }).unwrap();
    let told = stage.move_to(Angle::from_deg(7.2)).unwrap_err().to_string();
    assert!(told.contains("home the stage first"), "{told}");
    stage.home().unwrap();
    stage.move_to(Angle::from_deg(90.0)).unwrap();
    // The board shows its zero to a thousandth of a degree.
    assert_eq!(board.steps(), -9 + steps(90.0));
}

#[test]
fn what_goes_wrong_is_named_and_nothing_is_guessed() {
    for (faults, parts) in [
        (
            Faults { reset_at: Some(4), ..Faults::default() },
            ["started anew: the angle is lost", "capture the grain anew"],
        ),
        (
            Faults { alarm_at: Some(4), ..Faults::default() },
            ["alarm 1: a limit switch was hit", "home the stage again"],
        ),
    ] {
        let board = Grbl::start(faults);
        let mut stage = open(&settings(&board)).unwrap();
        stage.home().unwrap();
        let failed = (1..6)
            .find_map(|k| stage.move_to(Angle::from_deg(7.2 * f64::from(k))).err())
            .unwrap()
            .to_string();
        for part in parts {
            assert!(failed.contains(part), "{part:?} is missing from {failed}");
        }
        let again = stage.move_to(Angle::from_deg(7.2)).unwrap_err().to_string();
        assert!(again.contains("home the stage first"), "{again}");
    }
    let board = Grbl::start(Faults { stuck: true, ..Faults::default() });
    let mut stage = open(&Settings { backlash_deg: 0.0, ..settings(&board) }).unwrap();
    stage.home().unwrap();
    let told = stage.move_to(Angle::from_deg(7.2)).unwrap_err().to_string();
    assert!(told.contains("stays at 0.000° where 7.200° was asked for"), "{told}");
    let other = Settings { steps_per_deg: 17.78, ..settings(&board) };
    drop(stage);
    let told = open(&other).err().unwrap().to_string();
    assert!(told.contains("8.889 steps") && told.contains("17.78") && told.contains("$100=17.780"), "{told}");
}
