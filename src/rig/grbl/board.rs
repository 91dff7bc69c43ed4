//! What is said to a GRBL board, and what it says (GRBL 1.1 interface: lines answered by `ok` or `error:N`, `?` by `<…>`).

use super::settings::Settings;
use crate::rig::RigError;
use crate::rig::serial::Port;
use std::path::Path;
use std::time::{Duration, Instant};

/// Resets the board's program and nothing else.
const SOFT_RESET: u8 = 0x18;
/// Stops along the ramp.
const FEED_HOLD: u8 = b'!';
/// Time between two looks at a motor on its way.
const LOOK: Duration = Duration::from_millis(15);
/// A move may take this much longer than at constant speed, and this long in any case.
const PATIENCE: f64 = 2.0;
const GRACE: Duration = Duration::from_secs(3);
/// How often a state is asked for before the board counts as gone.
const ASKS: usize = 5;
/// Relative difference allowed between the board's number of steps for a degree and the configured one.
const STEPS_APART: f64 = 1e-4;

/// A board that answers.
pub(super) struct Board {
    settings: Settings,
    port: Port,
    line: Vec<u8>,
    version: String,
    /// The machine position of angle zero, degrees; `None` before homing and after the board has started anew.
    zero_deg: Option<f64>,
}

/// What a line is answered by.
enum Answer {
    /// `ok`, and what came before it.
    Done(Vec<String>),
    /// `error:N`, in words.
    Refused(String),
    /// Nothing in time.
    Nothing,
}

/// What `?` is answered by.
#[derive(Debug, Clone, PartialEq)]
struct State {
    /// `Idle`, `Jog`, `Run`, `Alarm` …
    name: String,
    /// Machine position of the stage's axis, degrees.
    position_deg: f64,
}

impl State {
    /// Of `<Idle|MPos:0.000,0.000,0.000|…>`.
    fn of(line: &str, axis: usize) -> Option<Self> {
        let mut fields = line.strip_prefix('<')?.strip_suffix('>')?.split('|');
        let name = fields.next()?.split(':').next()?.to_owned();
        let position = fields.find_map(|f| f.strip_prefix("MPos:"))?.split(',').nth(axis)?;
        Some(Self { name, position_deg: position.parse().ok()? })
    }
}

/// What the number after `ALARM:` means.
fn alarm(number: &str) -> &'static str {
    match number {
        "1" => "a limit switch was hit",
        "2" => "the target is beyond its soft limits ($130 to $132)",
        "3" => "it was reset while it moved: the position is lost",
        "6" | "7" | "8" | "9" => "homing did not find its switch",
        _ => "see GRBL's list of alarms",
    }
}

impl Board {
    pub fn open(settings: &Settings) -> Result<Self, RigError> {
        let port = Port::open(Path::new(&settings.port), settings.baud)?;
        let mut board = Self {
            settings: settings.clone(),
            port,
            line: Vec::new(),
            version: String::new(),
            zero_deg: None,
        };
        // Opening resets most boards; one that it does not is reset now, which it bears at rest.
        let patience = Duration::from_millis(settings.boot_ms);
        let mut welcome = board.welcomed(patience)?;
        if welcome.is_none() {
            board.send(&[SOFT_RESET])?;
            welcome = board.welcomed(Duration::from_millis(settings.reply_ms))?;
        }
        let Some(version) = welcome else {
            return Err(
                board.fault("no GRBL answers", "check the baud rate, and that GRBL 1.1 is on the board")
            );
        };
        board.version = version;
        board.check_steps()?;
        Ok(board)
    }

    pub fn version(&self) -> &str {
        &self.version
    }

    fn fault(&self, what: &str, remedy: &str) -> RigError {
        RigError::fault(format!("GRBL board on {}: {what}", self.settings.port), remedy)
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), RigError> {
        tracing::trace!(line = %bytes.escape_ascii(), "sent");
        self.port
            .send(bytes)
            .map_err(|e| self.fault(&format!("the line broke: {e}"), "check the cable, then resume"))
    }

    /// The next whole line; `None` where none came in time.
    fn read(&mut self, deadline: Instant) -> Result<Option<String>, RigError> {
        loop {
            let byte = self.port.byte(deadline).map_err(|e| {
                RigError::fault(
                    format!("GRBL board on {}: the line broke: {e}", self.settings.port),
                    "check the cable, then resume",
                )
            })?;
            match byte {
                None => return Ok(None),
                Some(b'\n' | b'\r') => {
                    let text = String::from_utf8_lossy(&std::mem::take(&mut self.line)).trim().to_owned();
                    if !text.is_empty() {
                        tracing::trace!(line = text, "heard");
                    }
                    if text.starts_with("Grbl ") && !self.version.is_empty() {
                        self.zero_deg = None;
                        return Err(self.fault(
                            "it has started anew: the angle is lost",
                            "check its power supply, then capture the grain anew",
                        ));
                    }
                    if let Some(number) = text.strip_prefix("ALARM:") {
                        self.zero_deg = None;
                        return Err(self.fault(
                            &format!("alarm {number}: {}", alarm(number)),
                            "mend the cause and home the stage again",
                        ));
                    }
                    if !text.is_empty() {
                        return Ok(Some(text));
                    }
                }
                // A line is never this long: noise.
                Some(_) if self.line.len() > 200 => self.line.clear(),
                Some(byte) => self.line.push(byte),
            }
        }
    }

    fn welcomed(&mut self, within: Duration) -> Result<Option<String>, RigError> {
        let deadline = Instant::now() + within;
        while let Some(line) = self.read(deadline)? {
            if let Some(rest) = line.strip_prefix("Grbl ") {
                return Ok(Some(format!("Grbl {}", rest.split(' ').next().unwrap_or(""))));
            }
        }
        Ok(None)
    }

    /// Sends a line and waits for what it is answered by.
    fn command(&mut self, text: &str, within: Duration) -> Result<Answer, RigError> {
        self.send(format!("{text}\n").as_bytes())?;
        let deadline = Instant::now() + within;
        let mut said = Vec::new();
        while let Some(line) = self.read(deadline)? {
            if line == "ok" {
                return Ok(Answer::Done(said));
            }
            if let Some(number) = line.strip_prefix("error:") {
                let hint = match number {
                    "5" => ": homing is not turned on ($22=1)",
                    "9" => ": it is locked after an alarm",
                    "15" => ": the target is beyond its soft limits ($130 to $132)",
                    _ => "",
                };
                return Ok(Answer::Refused(format!("error {number} to {text:?}{hint}")));
            }
            said.push(line);
        }
        Ok(Answer::Nothing)
    }

    /// Has it do what is to be done once only: what it said before its `ok`.
    fn done(&mut self, text: &str, within: Duration) -> Result<Vec<String>, RigError> {
        match self.command(text, within)? {
            Answer::Done(said) => Ok(said),
            Answer::Refused(why) => Err(self.fault(&why, "mend what it names, then resume")),
            Answer::Nothing => {
                let s = within.as_secs_f64();
                Err(self.fault(&format!("no answer to {text:?} within {s:.1} s"), "check cable and power"))
            }
        }
    }

    fn reply(&self) -> Duration {
        Duration::from_millis(self.settings.reply_ms)
    }

    fn check_steps(&mut self) -> Result<(), RigError> {
        let within = self.reply();
        let key = format!("${}=", 100 + self.settings.axis as usize);
        let all = self.done("$$", within)?;
        let set: Option<f64> = all.iter().find_map(|l| l.strip_prefix(&key)?.split(' ').next()?.parse().ok());
        let wanted = self.settings.steps_per_deg;
        match set {
            // The board shows three decimals.
            Some(set) if (set / wanted - 1.0).abs() <= STEPS_APART => Ok(()),
            Some(set) => Err(self.fault(
                &format!(
                    "it makes {set} steps for a unit of axis {} ({key}{set}), grbl.steps_per_deg is {wanted:.3}",
                    self.settings.axis
                ),
                &format!("set one as the other (\"{key}{wanted:.3}\")"),
            )),
            None => Err(self.fault(&format!("it does not show its setting {key}"), "GRBL 1.1 is needed")),
        }
    }

    /// Where it is: asked until an answer is whole.
    fn state(&mut self) -> Result<State, RigError> {
        let axis = self.settings.axis as usize;
        for _ in 0..ASKS {
            self.send(b"?")?;
            let deadline = Instant::now() + self.reply();
            while let Some(line) = self.read(deadline)? {
                if let Some(state) = State::of(&line, axis) {
                    return Ok(state);
                }
                // Damaged: the next one comes soon.
                if line.starts_with('<') {
                    break;
                }
            }
        }
        let ms = self.settings.reply_ms;
        Err(self
            .fault(&format!("no state in answer to {ASKS} questions, {ms} ms each"), "check cable and power"))
    }

    fn idle(&mut self, longest: Duration, what: &str) -> Result<State, RigError> {
        let deadline = Instant::now() + longest + GRACE;
        loop {
            let state = self.state()?;
            match state.name.as_str() {
                "Idle" => return Ok(state),
                "Alarm" => {
                    return Err(self.fault("it is locked after an alarm", "home it, or unlock it with $X"));
                }
                "Door" => return Err(self.fault("its safety door is open", "close it, then resume")),
                _ => {}
            }
            if Instant::now() >= deadline {
                let _ = self.send(&[FEED_HOLD]);
                return Err(self.fault(
                    &format!(
                        "{what} did not end within {:.1} s ({} at {:.3}°)",
                        (longest + GRACE).as_secs_f64(),
                        state.name,
                        state.position_deg
                    ),
                    "check power and speed",
                ));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Where it stands now is this angle, degrees.
    pub fn stands_at(&mut self, deg: f64) -> Result<(), RigError> {
        let mut state = self.state()?;
        if state.name == "Alarm" {
            // Locked from its start, where homing is turned on; here nobody asks where it was before.
            let within = self.reply();
            self.done("$X", within)?;
            state = self.idle(Duration::ZERO, "unlocking")?;
        }
        self.zero_deg = Some(self.whole_step(state.position_deg - deg));
        Ok(())
    }

    /// The board shows three decimals; it stands on a whole step.
    fn whole_step(&self, deg: f64) -> f64 {
        (deg * self.settings.steps_per_deg).round() / self.settings.steps_per_deg
    }

    pub fn find_switch(&mut self) -> Result<(), RigError> {
        let seconds = self.settings.homing_s;
        self.done("$H", Duration::from_secs(seconds))?;
        let state = self.idle(Duration::ZERO, "homing")?;
        self.zero_deg = Some(self.whole_step(state.position_deg));
        Ok(())
    }

    /// Goes to an angle, from below; the angle reached, degrees.
    pub fn go_from_below(&mut self, deg: f64) -> Result<f64, RigError> {
        let zero = self
            .zero_deg
            .ok_or_else(|| self.fault("it does not know where zero is", "home the stage first"))?;
        let now = self.state()?.position_deg - zero;
        let step = 1.0 / self.settings.steps_per_deg;
        if (now - deg).abs() > 0.5 * step && deg < now && self.settings.backlash_deg > 0.0 {
            self.go(zero, deg - self.settings.backlash_deg)?;
        }
        self.go(zero, deg)
    }

    fn go(&mut self, zero: f64, deg: f64) -> Result<f64, RigError> {
        // What lies between the steps no board can reach.
        let target = self.whole_step(zero + deg);
        let half = 0.5 / self.settings.steps_per_deg;
        let (axis, speed) = (self.settings.axis, self.settings.speed_deg_per_s);
        let line = format!("$J=G53 G90 {axis}{target:.4} F{:.1}", 60.0 * speed);
        let mut told = String::new();
        // A lost line or a lost `ok`: the position says which, and the target is absolute.
        for _ in 0..ASKS {
            let from = self.state()?.position_deg;
            if (from - target).abs() > half {
                let within = self.reply();
                match self.command(&line, within)? {
                    Answer::Done(_) => {}
                    Answer::Nothing => "no answer".clone_into(&mut told),
                    // Perhaps damaged on its way, so that it made no sense.
                    Answer::Refused(why) => told = why,
                }
            }
            let time = Duration::from_secs_f64((target - from).abs() / speed * PATIENCE);
            let state = self.idle(time, "a move")?;
            if (state.position_deg - target).abs() <= half {
                return Ok(target - zero);
            }
        }
        let at = self.state()?.position_deg;
        Err(self.fault(
            &format!("it stays at {:.3}° where {deg:.3}° was asked for ({told})", at - zero),
            "check motor and limits",
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_read() {
        let state = |line| State::of(line, 0);
        let idle = state("<Idle|MPos:12.500,0.000,-1.000|FS:0,0|WCO:0.000,0.000,0.000>").unwrap();
        assert!(idle.name == "Idle" && (idle.position_deg - 12.5).abs() < 1e-12);
        assert_eq!(state("<Hold:0|MPos:-3.000,0.000,0.000>").unwrap().name, "Hold");
        let third = State::of("<Idle|MPos:1.000,2.000,3.000>", 2).unwrap();
        assert!((third.position_deg - 3.0).abs() < 1e-12);
        for bad in ["ok", "<Idle", "<Idle|WPos:1.000,0.000,0.000>", "<Idle|MPos:x,0.000,0.000>", "<>"] {
            assert_eq!(state(bad), None, "{bad}");
        }
    }
}
