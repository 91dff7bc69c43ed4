//! The controller as a machine: identify, configure, home, go, let go; and what to do when it goes away in between.

use super::link::{Link, LinkError};
use super::settings::{Reference, Settings};
use crate::rig::serial::Port;
use crate::rig::{RigError, warn_taken_up};
use std::path::Path;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// What to do where the board does not answer.
const CONNECTION: &str = "check cable and power";
/// The protocol that this program speaks.
const PROTOCOL: &str = "1";
/// A move may take this much longer than it should, and this long in any case.
const PATIENCE: f64 = 1.5;
const GRACE: Duration = Duration::from_secs(2);
/// Time between two looks at a motor that should have arrived.
const LOOK: Duration = Duration::from_millis(4);
/// A reference is looked for over this many turns.
const SEEK_TURNS: f64 = 1.05;
/// A moment before a port that has gone is tried again.
const RETRY: Duration = Duration::from_millis(200);

/// Shots are numbered up to this, and round again.
const SHOTS: u64 = 1 << 30;

/// What the controller says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Status {
    position: i32,
    idle: bool,
    homed: bool,
    silenced: bool,
    boot: String,
}

impl Status {
    /// Of `ok POSITION TARGET STATE FLAGS BOOT`.
    fn of(reply: &str) -> Option<Self> {
        let words: Vec<&str> = reply.split(' ').collect();
        let ["ok", position, _target, state, flags, boot] = words[..] else { return None };
        let flags = u8::from_str_radix(flags, 16).ok()?;
        Some(Self {
            position: position.parse().ok()?,
            idle: state == "i",
            homed: flags & 1 != 0,
            silenced: flags & 32 != 0,
            boot: boot.to_owned(),
        })
    }
}

/// A controller that answers.
pub(super) struct Machine {
    settings: Settings,
    link: Link,
    boot: String,
    version: String,
    /// Whether the position is known, as far as this side knows.
    referenced: bool,
    /// Where the firmware's zero is, microsteps: not at ours after a run was taken up.
    origin: i32,
    /// Number of the last shot.
    shot: u64,
}

impl Machine {
    pub fn open(settings: Settings) -> Result<Self, RigError> {
        let link = line(&settings)?;
        // The firmware takes a shot of the last one's number for the same shot asked for again, and outlives this program.
        let shot = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_millis() as u64 % SHOTS);
        let mut machine = Self {
            settings,
            link,
            boot: String::new(),
            version: String::new(),
            referenced: false,
            origin: 0,
            shot,
        };
        // A board that opening has reset is in its bootloader first, which takes what it hears for a program.
        let wait = Duration::from_millis(machine.settings.boot_ms);
        machine.link.started(wait).map_err(|e| machine.fault(&e.to_string(), CONNECTION))?;
        machine.identify()?;
        Ok(machine)
    }

    fn device(&self, what: &str) -> RigError {
        RigError::Device(format!("stage controller on {}: {what}", self.settings.port))
    }

    fn fault(&self, what: &str, remedy: &str) -> RigError {
        RigError::fault(format!("stage controller on {}: {what}", self.settings.port), remedy)
    }

    pub fn describe(&self) -> String {
        let s = &self.settings;
        format!(
            "stage controller {} on {}, {} steps/turn × {} microsteps, boot {}",
            self.version, s.port, s.steps_per_turn, s.microsteps, self.boot
        )
    }

    /// Who is there, and what it is to do. Its boot number is the one that holds from now on.
    fn identify(&mut self) -> Result<(), RigError> {
        let said = match self.link.ask("I") {
            // Its banner was late.
            Err(LinkError::Restarted) => self.link.ask("I"),
            other => other,
        };
        let said = said.map_err(|e| {
            self.fault(
                &e.to_string(),
                "check that the firmware is on the board (`make -C firmware flash`) and the baud rate",
            )
        })?;
        let words: Vec<&str> = said.split(' ').collect();
        match words[..] {
            ["ok", "grainrig", PROTOCOL, version, boot] => {
                version.clone_into(&mut self.version);
                boot.clone_into(&mut self.boot);
            }
            ["ok", "grainrig", protocol, ..] => {
                return Err(self.fault(
                    &format!("its firmware speaks protocol {protocol}, this program {PROTOCOL}"),
                    "flash the firmware that came with it",
                ));
            }
            _ => return Err(self.device(&format!("it says {said:?}, which is no grainrig controller"))),
        }
        self.configure()
    }

    fn configure(&mut self) -> Result<(), RigError> {
        let s = &self.settings;
        let rate = |deg: f64| (deg / 360.0 * s.per_turn()).round() as i64;
        let flags = u8::from(s.invert) | u8::from(s.reference == Reference::Switch) << 1;
        let [low, high] = s.limits_deg.map(|deg| s.position(deg) - self.origin);
        // Room to approach the least angle from below.
        let low = low - s.position(s.backlash_deg);
        let body = format!(
            "C {} {} {} {low} {high} {flags} {}",
            rate(s.speed_deg_per_s),
            rate(s.acceleration_deg_per_s2),
            rate(s.homing_deg_per_s),
            s.silence_s
        );
        match self.asked(&body)?.as_str() {
            "ok" => Ok(()),
            other => Err(self.device(&format!("it refused its settings ({other} to {body:?})"))),
        }
    }

    /// Asks, and mends what can be mended without moving: a line that broke is opened again.
    fn asked(&mut self, body: &str) -> Result<String, RigError> {
        match self.link.ask(body) {
            Ok(said) => Ok(said),
            Err(LinkError::Gone(why)) => {
                self.reopen(&why.to_string())?;
                self.link.ask(body).map_err(|e| self.fault(&e.to_string(), CONNECTION))
            }
            Err(LinkError::Restarted) => {
                self.link.ask(body).map_err(|e| self.fault(&e.to_string(), CONNECTION))
            }
            Err(e) => Err(self.fault(&e.to_string(), CONNECTION)),
        }
    }

    /// Waits for a port that has gone to come back.
    fn reopen(&mut self, why: &str) -> Result<(), RigError> {
        tracing::warn!(port = self.settings.port, why, "the controller has gone; waiting for it");
        self.link.hang_up();
        let patience = Duration::from_secs(self.settings.return_s);
        let deadline = Instant::now() + patience;
        loop {
            match line(&self.settings) {
                Ok(link) => {
                    self.link = link;
                    let wait = Duration::from_millis(self.settings.boot_ms);
                    if self.link.started(wait).is_ok() {
                        return Ok(());
                    }
                }
                Err(e) if Instant::now() >= deadline => {
                    return Err(self.fault(
                        &format!(
                            "it went away ({why}) and did not come back within {} s ({e})",
                            self.settings.return_s
                        ),
                        "check the cable, then resume",
                    ));
                }
                Err(_) => {}
            }
            std::thread::sleep(RETRY);
        }
    }

    /// Where it is. An error where it has started anew, and its position is lost.
    fn status(&mut self) -> Result<Status, RigError> {
        let said = self.asked("S")?;
        Status::of(&said)
            .map(|status| Status { position: status.position + self.origin, ..status })
            .ok_or_else(|| self.device(&format!("it says {said:?} where its state was asked for")))
    }

    /// Something heard from us, so that it holds its position.
    pub fn keep_alive(&mut self) {
        // What is wrong, the next real request tells.
        let _ = self.link.ask("S");
    }

    pub fn home(&mut self) -> Result<f64, RigError> {
        self.rest()?;
        match self.settings.reference {
            Reference::Here => self.stands_at(0)?,
            Reference::Switch => self.seek()?,
        }
        self.referenced = true;
        self.approach(0)?;
        Ok(0.0)
    }

    /// Takes up where an earlier run left the stage: a switch tells where that is; without one it still stands there.
    pub fn take_up(&mut self, deg: f64) -> Result<f64, RigError> {
        if self.settings.reference == Reference::Switch {
            return self.home();
        }
        self.rest()?;
        warn_taken_up(deg);
        self.stands_at(self.settings.position(deg))?;
        self.referenced = true;
        Ok(deg)
    }

    /// Whoever is there now knows its settings, and rests.
    fn rest(&mut self) -> Result<(), RigError> {
        if self.status()?.boot != self.boot {
            self.identify()?;
        }
        self.settle("a move before")
    }

    /// Where it stands now is this position.
    fn stands_at(&mut self, position: i32) -> Result<(), RigError> {
        if self.origin != position {
            self.origin = position;
            self.configure()?;
        }
        self.obeyed("Z")
    }

    fn obeyed(&mut self, body: &str) -> Result<(), RigError> {
        match self.asked(body)?.as_str() {
            "ok" => Ok(()),
            other => Err(self.device(&format!("it answers {other:?} to {body:?}"))),
        }
    }

    fn seek(&mut self) -> Result<(), RigError> {
        let most = (SEEK_TURNS * self.settings.per_turn()).ceil();
        self.obeyed(&format!("H {most}"))?;
        let degrees = SEEK_TURNS * 360.0;
        // Off the switch, onto it, and off it again at a quarter of the speed.
        let longest = Duration::from_secs_f64(6.0 * degrees / self.settings.homing_deg_per_s);
        let status = self.wait_idle(Duration::ZERO, longest, "homing")?;
        if status.homed {
            return Ok(());
        }
        Err(self.fault(
            &format!("the reference switch was not found within {degrees:.0}°"),
            "check its wiring (D2 to ground), or set controller.reference = \"here\"",
        ))
    }

    /// Waits until the motor rests.
    fn settle(&mut self, what: &str) -> Result<(), RigError> {
        let turn = Duration::from_secs_f64(360.0 / self.settings.speed_deg_per_s);
        self.wait_idle(Duration::ZERO, turn, what).map(|_| ())
    }

    fn wait_idle(&mut self, expected: Duration, longest: Duration, what: &str) -> Result<Status, RigError> {
        let deadline = Instant::now() + longest + GRACE;
        std::thread::sleep(expected);
        loop {
            let status = self.status()?;
            if status.idle || status.boot != self.boot {
                return Ok(status);
            }
            if Instant::now() >= deadline {
                let s = (longest + GRACE).as_secs_f64();
                // It must not go on by itself.
                let _ = self.link.ask("X");
                return Err(self.fault(
                    &format!("{what} did not end within {s:.1} s (at microstep {})", status.position),
                    "check power and speed",
                ));
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Goes to an angle and says where it is, degrees.
    pub fn move_to(&mut self, deg: f64) -> Result<f64, RigError> {
        let position = self.settings.position(deg);
        for _ in 0..2 {
            let status = self.status()?;
            if status.boot != self.boot || !status.homed {
                self.find_again(&status)?;
            }
            if let Some(reached) = self.go_from_below(position)? {
                return Ok(f64::from(reached) * 360.0 / self.settings.per_turn());
            }
        }
        Err(self.fault("it has started anew twice in one move", "check its power supply"))
    }

    /// The position is lost: with a switch it can be found again, without one it cannot.
    fn find_again(&mut self, status: &Status) -> Result<(), RigError> {
        let cause = if status.boot != self.boot {
            format!("it has started anew (boot {} after {})", status.boot, self.boot)
        } else if status.silenced {
            format!("it heard nothing for {} s and let the motor go", self.settings.silence_s)
        } else {
            "it does not know where it is".to_owned()
        };
        if !self.referenced {
            return Err(self.fault(&cause, "home the stage first"));
        }
        if self.settings.reference == Reference::Here {
            self.referenced = false;
            return Err(self.fault(
                &format!(
                    "{cause}: the angle is lost, and without a reference switch it can't be found again"
                ),
                "check its power supply, then capture the grain anew",
            ));
        }
        tracing::warn!(cause, "the angle is lost: looking for the reference again");
        self.home().map(|_| ())
    }

    /// Every position is approached from below; `None` where the controller has started anew on the way.
    fn go_from_below(&mut self, position: i32) -> Result<Option<i32>, RigError> {
        let slack = self.settings.position(self.settings.backlash_deg);
        let now = self.status()?.position;
        if slack > 0 && position < now && self.go(now, position - slack)?.is_none() {
            return Ok(None);
        }
        let from = self.status()?.position;
        self.go(from, position)
    }

    fn approach(&mut self, position: i32) -> Result<(), RigError> {
        let slack = self.settings.position(self.settings.backlash_deg);
        if slack > 0 {
            self.go(position, position - slack)?;
            self.go(position - slack, position)?;
        }
        Ok(())
    }

    fn go(&mut self, from: i32, to: i32) -> Result<Option<i32>, RigError> {
        if from == to {
            return Ok(Some(to));
        }
        let body = format!("M {}", to - self.origin);
        match self.asked(&body)?.as_str() {
            "ok" => {}
            // After a start of its own it knows no position.
            "err unhomed" | "err unconfigured" => return Ok(None),
            "err limit" => {
                let [low, high] = self.settings.limits_deg;
                return Err(self
                    .device(&format!("it refused microstep {to}: beyond its limits of {low}° to {high}°")));
            }
            other => return Err(self.device(&format!("it answers {other:?} to {body:?}"))),
        }
        let time = self.travel(f64::from(to) - f64::from(from));
        let status = self.wait_idle(time, time.mul_f64(PATIENCE), "a move")?;
        if status.boot != self.boot || !status.homed {
            return Ok(None);
        }
        if status.position != to {
            return Err(
                self.device(&format!("it stopped at microstep {} on its way to {to}", status.position))
            );
        }
        Ok(Some(to))
    }

    /// Closes the contacts of the camera's release. A release that is still at work is waited for.
    pub fn photograph(&mut self) -> Result<(), RigError> {
        self.shot = self.shot % SHOTS + 1;
        let (focus, shutter) = (self.settings.focus_ms, self.settings.shutter_ms);
        let body = format!("P {} {focus} {shutter}", self.shot);
        let longest = Duration::from_millis(u64::from(focus) + u64::from(shutter)) + GRACE;
        let deadline = Instant::now() + longest;
        loop {
            match self.asked(&body)?.as_str() {
                "ok" => return Ok(()),
                "err busy" if Instant::now() < deadline => std::thread::sleep(LOOK),
                "err busy" => {
                    let s = longest.as_secs_f64();
                    return Err(self.fault(
                        &format!("the camera's release has been at work for {s:.1} s"),
                        "switch the board off and on",
                    ));
                }
                other => return Err(self.device(&format!("it answers {other:?} to {body:?}"))),
            }
        }
    }

    /// How long a way takes, at a trapezoidal speed.
    fn travel(&self, microsteps: f64) -> Duration {
        let way = microsteps.abs() / self.settings.per_turn() * 360.0;
        let (v, a) = (self.settings.speed_deg_per_s, self.settings.acceleration_deg_per_s2);
        Duration::from_secs_f64(if way < v * v / a { 2.0 * (way / a).sqrt() } else { way / v + v / a })
    }

    /// Turns the motor's current off.
    pub fn release(&mut self) {
        // It does so by itself where it does not hear this.
        let _ = self.link.ask("X");
        let _ = self.link.ask("R");
    }
}

fn line(settings: &Settings) -> Result<Link, RigError> {
    let port = Port::open(Path::new(&settings.port), settings.baud)?;
    Ok(Link::new(port, settings.reply_ms, settings.tries))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_read() {
        let status = Status::of("ok -64 1600 m 2B 0000002A").unwrap();
        assert_eq!(status.position, -64);
        assert!(!status.idle && status.homed && status.silenced);
        assert_eq!(status.boot, "0000002A");
        for bad in ["", "ok", "err limit", "ok x 0 i 00 1", "ok 1 2 i 0G 1", "ok 1 2 i 00 1 more"] {
            assert_eq!(Status::of(bad), None, "{bad}");
        }
    }
}
