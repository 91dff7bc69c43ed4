//! What the firmware does with frames, and with what is none: said on the raw line.

use super::board::{Board, firmware, frame_reader};
use super::settings;
use crate::random::Random;
use crate::skip::{Lacking, skip};
use grainrig::rig::RotationStage as _;
use grainrig::rig::controller::{Reader, Said, Settings, open, request};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Command, Stdio};

/// The board's line without a driver.
struct Raw(File, Reader);

impl Raw {
    fn open(board: &Board) -> Self {
        let line = File::options().read(true).write(true).open(&board.port).unwrap();
        let mut raw = tcgetattr(&line).unwrap();
        raw.make_raw();
        tcsetattr(&line, OptionalActions::Now, &raw).unwrap();
        Self(line, Reader::default())
    }

    fn send(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).unwrap();
    }

    /// The answer to this request; blocks until it has come.
    fn answer(&mut self, number: u8) -> String {
        let mut byte = [0];
        loop {
            self.0.read_exact(&mut byte).unwrap();
            if let Some(Said::Reply { seq, body }) = self.1.take(byte[0])
                && seq == number
            {
                return body;
            }
        }
    }

    fn ask(&mut self, seq: u8, body: &str) -> String {
        self.send(&request(seq, body));
        self.answer(seq)
    }

    /// Asks for the state until the motor rests.
    fn rest(&mut self, mut seq: u8) -> String {
        loop {
            seq = seq.wrapping_add(1);
            let state = self.ask(seq, "S");
            if state.split(' ').nth(3) == Some("i") {
                return state;
            }
        }
    }
}

#[test]
fn a_request_that_comes_twice_is_obeyed_once_and_answered_twice() {
    let Some(mut board) = Board::start(0, -40) else { return };
    let mut raw = Raw::open(&board);
    assert!(raw.ask(1, "I").starts_with("ok grainrig 1 "));
    assert_eq!(raw.ask(2, "M 100"), "err unconfigured");
    assert_eq!(raw.ask(3, "C 1600 8000 400 -3300 3300 0 0"), "ok");
    assert_eq!(raw.ask(4, "M 100"), "err unhomed");
    assert_eq!(raw.ask(5, "Z"), "ok");
    for _ in 0..3 {
        assert_eq!(raw.ask(6, "M 100"), "ok");
    }
    let state = raw.rest(10);
    assert!(state.starts_with("ok 100 100 i "), "{state}");
    assert_eq!(raw.ask(20, "M 3301"), "err limit");
    for (body, said) in [
        ("M", "err syntax"),
        ("M 1 2", "err syntax"),
        ("M 99999999999", "err syntax"),
        ("M 1x", "err syntax"),
        ("C 9 100 100 0 0 0 0", "err range"),
        ("C 100 100 100 5 4 0 0", "err range"),
        ("P 1 0 0", "err range"),
        ("H 100", "err noswitch"),
        ("Q", "err unknown"),
        ("S 1", "err unknown"),
        ("", "err unknown"),
    ] {
        assert_eq!(raw.ask(21, body), said, "{body:?}");
    }
    assert_eq!(board.state()["steps"], 100);
    // The shutter too: focus for 20 ms, then 250 ms open.
    for seq in [30, 30, 31] {
        assert_eq!(raw.ask(seq, "P 17 20 250"), "ok");
    }
    let mut seq = 32;
    while raw.ask(seq, "S").split(' ').nth(4).map(|f| u8::from_str_radix(f, 16).unwrap() & 16) != Some(0) {
        seq = seq.wrapping_add(1);
    }
    let state = board.state();
    assert_eq!(state["shots"], 1);
    let [shutter, focus] = ["shutter_ms", "focus_ms"].map(|n| state[n].as_f64().unwrap());
    assert!((shutter - 250.0).abs() <= 1.0 && (focus - 270.0).abs() <= 2.0, "{shutter} ms, {focus} ms");
}

#[test]
fn garbage_overlong_lines_and_half_frames_never_move_the_motor() {
    let Some(mut board) = Board::start(0, -40) else { return };
    let mut raw = Raw::open(&board);
    assert_eq!(raw.ask(1, "C 1600 8000 400 -3300 3300 0 0"), "ok");
    assert_eq!(raw.ask(2, "Z"), "ok");
    let good = request(9, "M 640");
    let mut draw = Random::new(5);
    let mut sent = 0;
    for k in 0..400 {
        let mut bytes = match k % 4 {
            0 => (0..draw.bits() % 40).map(|_| draw.bits() as u8).collect(),
            1 => good[..good.len() - 1 - (draw.bits() as usize % 6)].to_vec(),
            2 => [b":09 M 640 ".as_slice(), &[b'7'; 80], b"\n"].concat(),
            _ => good.clone(),
        };
        if k % 4 == 3 {
            let at = 1 + draw.bits() as usize % (bytes.len() - 2);
            bytes[at] ^= 1 << (draw.bits() % 7);
        }
        raw.send(&bytes);
        sent += bytes.len();
        // It takes its time: an answer shows that all of it was read.
        if k % 8 == 7 {
            raw.send(b"\n");
            assert!(raw.ask(100 + (k / 8) as u8, "S").starts_with("ok 0 0 i "), "after {sent} bytes");
        }
    }
    assert_eq!(board.state()["steps"], 0);
}

/// Frames of one round, damaged or not.
const FRAMES: usize = 60_000;
/// Most rounds that can be asked for: about two days.
const MOST_ROUNDS: u64 = 500_000;

/// Both sides' readers see the same frames in any bytes. `GRAINRIG_FUZZ_ROUNDS=1000 cargo test --release --test stage agree`
/// tries a thousand times as many.
#[test]
fn the_firmwares_reader_and_the_drivers_agree_on_any_bytes() {
    let reader = match frame_reader() {
        Ok(reader) => reader,
        Err(why) => return skip(Lacking::Tools, why),
    };
    let rounds = std::env::var("GRAINRIG_FUZZ_ROUNDS").map_or(1, |n| n.parse().unwrap());
    assert!(rounds <= MOST_ROUNDS, "{rounds} rounds are asked for, {MOST_ROUNDS} are the most");
    let frames: usize = (0..rounds).map(|round| agree(&reader, 3 + round)).sum();
    println!("{rounds} rounds, {frames} frames and damaged ones found alike");
}

/// One round; what both sides found.
fn agree(reader: &Path, seed: u64) -> usize {
    let mut draw = Random::new(seed);
    let mut bytes = Vec::new();
    for _ in 0..FRAMES {
        let body: String =
            (0..draw.bits() % 60).map(|_| char::from(b'0' + (draw.bits() % 10) as u8)).collect();
        let mut one = request(draw.bits() as u8, &body);
        for _ in 0..draw.bits() % 3 {
            let at = draw.bits() as usize % one.len();
            match draw.bits() % 3 {
                0 => one[at] ^= 1 << (draw.bits() % 8),
                1 => drop(one.remove(at)),
                _ => one.insert(at, draw.bits() as u8),
            }
        }
        // What is a mark to one side alone is left out.
        bytes.extend(one.iter().map(|b| if matches!(b, b'=' | b'!') { b'-' } else { *b }));
    }
    let mut child = Command::new(reader).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let (mut to, all) = (child.stdin.take().unwrap(), bytes.clone());
    let writer = std::thread::spawn(move || to.write_all(&all).unwrap());
    let mut theirs = String::new();
    child.stdout.take().unwrap().read_to_string(&mut theirs).unwrap();
    writer.join().unwrap();
    assert!(child.wait().unwrap().success());
    // The driver's reader looks for answers.
    let swapped = bytes.iter().map(|b| if *b == b':' { b'=' } else { *b });
    let mut reader = Reader::default();
    let ours: Vec<String> = swapped
        .filter_map(|b| reader.take(b))
        .map(|said| match said {
            Said::Reply { seq, body } => format!("good {seq:02X} {body}"),
            Said::Announcement(_) | Said::Damaged => "bad".to_owned(),
        })
        .collect();
    let theirs: Vec<&str> = theirs.lines().collect();
    let good = theirs.iter().filter(|l| l.starts_with("good")).count();
    assert!(good > 15_000 && theirs.len() - good > 15_000, "{good} of {}", theirs.len());
    let differ = ours.iter().zip(&theirs).position(|(a, b)| a != b);
    assert_eq!(differ.map(|k| (&ours[k], theirs[k])), None, "seed {seed}");
    assert_eq!(ours.len(), theirs.len(), "seed {seed}");
    ours.len()
}

#[test]
fn steps_come_evenly_while_the_line_is_busy() {
    let Some(mut board) = Board::start(0, -1_000_000) else { return };
    // 4000 microsteps a second.
    let even = Settings { speed_deg_per_s: 450.0, acceleration_deg_per_s2: 4500.0, ..settings(&board) };
    let mut stage = open(&even).unwrap();
    stage.home().unwrap();
    board.tell("timing");
    // The driver asks for the state all the while.
    stage.move_to(super::deg(360.0)).unwrap();
    let intervals: Vec<f64> =
        board.state()["intervals_us"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    assert_eq!(intervals.len(), 3199);
    let cruise = &intervals[500..2600];
    let mean = cruise.iter().sum::<f64>() / cruise.len() as f64;
    let worst = cruise.iter().map(|i| (i - 250.0).abs()).fold(0.0, f64::max);
    println!("{} steps at {mean:.3} µs, at worst {worst:.2} µs off", cruise.len());
    assert!((mean - 250.0).abs() < 0.05 && worst <= 5.0, "{mean} µs, {worst} µs");
    // The ramps: evenly faster, evenly slower, and as long up as down.
    let faster = intervals[20..400].windows(2).filter(|w| w[1] > w[0] + 10.0).count();
    assert_eq!(faster, 0);
    // What came before the first step nobody has seen: the last interval has no partner.
    for k in [0, 1, 5, 20, 100] {
        let [up, down] = [intervals[k], intervals[3197 - k]];
        assert!((up / down - 1.0).abs() < 0.05, "{k}: {up} µs up, {down} µs down");
    }
}

#[test]
fn a_host_that_falls_silent_lets_the_motor_go() {
    let Some(mut board) = Board::start(0, -40) else { return };
    let mut raw = Raw::open(&board);
    assert_eq!(raw.ask(1, "C 1600 8000 400 -3300 3300 0 1"), "ok");
    assert_eq!(raw.ask(2, "Z"), "ok");
    assert_eq!(board.state()["current"], true);
    while board.state()["current"] == true {}
    let state = raw.ask(3, "S");
    let flags = u8::from_str_radix(state.split(' ').nth(4).unwrap(), 16).unwrap();
    assert_eq!(flags & 0b1_0011, 0, "{state}: neither homed nor holding");
    assert_eq!(raw.ask(4, "M 64"), "err unhomed");
}

#[test]
fn the_firmware_leaves_room_on_the_chip() {
    let firmware = match firmware() {
        Ok(firmware) => firmware,
        Err(why) => return skip(Lacking::Tools, why),
    };
    let said = Command::new("avr-size").arg("-A").arg(firmware).output().unwrap();
    let text = String::from_utf8(said.stdout).unwrap();
    let size = |name: &str| -> f64 {
        let line = text.lines().find(|l| l.split_whitespace().next() == Some(name));
        line.map_or(0.0, |l| l.split_whitespace().nth(1).unwrap().parse().unwrap())
    };
    let flash = (size(".text") + size(".data")) / 32768.0;
    let ram = (size(".data") + size(".bss")) / 2048.0;
    println!("flash {:.1} %, RAM {:.1} % without the stack", 100.0 * flash, 100.0 * ram);
    assert!(flash <= 0.6 && ram <= 0.6);
}
