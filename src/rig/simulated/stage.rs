//! The simulated stage: a stepper motor with its own fixed step errors.

use super::Shared;
use super::random::{self, Purpose};
use super::settings::Settings;
use crate::rig::{RigError, RotationStage};
use grainrig_core::geometry::Angle;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The stage. It believes in its steps; where it truly stands only the camera sees.
pub struct SimulatedStage {
    settings: Settings,
    shared: Arc<Mutex<Shared>>,
    errors_steps: Vec<f64>,
    /// Where the controller believes the motor to be, microsteps.
    position: i64,
    /// Steps that the motor did not make, microsteps.
    lost: i64,
    moves: usize,
}

/// Locks the state that stage, camera and truth share. A holder that panicked left it whole: every change
/// to it is one assignment or one push.
pub(super) fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

impl SimulatedStage {
    pub(super) fn new(settings: &Settings, shared: Arc<Mutex<Shared>>, moves: usize) -> Self {
        let key = random::key(settings.seed, Purpose::Steps);
        // Homing defines angle 0, so the error of the step it stops at is zero.
        let errors_steps = (0..u64::from(settings.steps_per_turn))
            .map(|k| if k == 0 { 0.0 } else { settings.step_error * (2.0 * random::uniform(key, k) - 1.0) })
            .collect();
        Self { settings: settings.clone(), shared, errors_steps, position: 0, lost: 0, moves }
    }

    fn microsteps_per_turn(&self) -> f64 {
        f64::from(self.settings.steps_per_turn) * f64::from(self.settings.microsteps)
    }

    /// The angle that the controller believes a position to be.
    fn believed(&self, position: i64) -> Angle {
        Angle::from_rad(position as f64 / self.microsteps_per_turn() * std::f64::consts::TAU)
    }

    /// Where the motor truly stands: between full steps the error goes over from one's to the next one's.
    fn truth(&self, position: i64) -> Angle {
        let micro = i64::from(self.settings.microsteps);
        let (full, part) = (position.div_euclid(micro), position.rem_euclid(micro) as f64 / micro as f64);
        let error = |k: i64| self.errors_steps[k.rem_euclid(self.errors_steps.len() as i64) as usize];
        let steps = full as f64 + part + (1.0 - part) * error(full) + part * error(full + 1);
        let turns = self.settings.step_ratio * steps / f64::from(self.settings.steps_per_turn);
        Angle::from_rad(turns * std::f64::consts::TAU)
    }

    /// Goes from here to a position; returns the angle believed.
    fn go(&mut self, position: i64) -> Angle {
        let way_deg = (self.believed(position) - self.believed(self.position)).deg().abs();
        let time_s =
            travel_time_s(way_deg, self.settings.speed_deg_per_s, self.settings.acceleration_deg_per_s2);
        if self.settings.realtime {
            std::thread::sleep(Duration::from_secs_f64(time_s));
        }
        self.position = position;
        let true_angle = self.truth(position - self.lost);
        let mut shared = lock(&self.shared);
        shared.stage_angle = true_angle;
        shared.time_s += time_s;
        drop(shared);
        self.believed(position)
    }
}

/// Time for a way at a trapezoidal speed (triangular where the top speed is not reached), seconds.
fn travel_time_s(way: f64, speed: f64, acceleration: f64) -> f64 {
    let ramps = speed * speed / acceleration;
    if way < ramps { 2.0 * (way / acceleration).sqrt() } else { way / speed + speed / acceleration }
}

impl RotationStage for SimulatedStage {
    fn home(&mut self) -> Result<Angle, RigError> {
        // The reference is found wherever the motor is, so lost steps are found again.
        self.lost = 0;
        Ok(self.go(0))
    }

    fn move_to(&mut self, target: Angle) -> Result<Angle, RigError> {
        let [low, high] = self.settings.limits_deg.map(Angle::from_deg);
        // Written so that a NaN is refused.
        if !(low..=high).contains(&target) {
            return Err(RigError::OutOfLimits { asked: target, low, high });
        }
        let number = self.moves;
        self.moves += 1;
        let faults = &self.settings.faults;
        faults.stage_answers(number)?;
        if faults.lost_step_at == Some(number) {
            self.lost += i64::from(self.settings.microsteps);
        }
        let missed = faults.missed_angle.filter(|m| m.at == number);
        let target = target + Angle::from_deg(missed.map_or(0.0, |m| m.deg));
        let position = (target.rad() / std::f64::consts::TAU * self.microsteps_per_turn()).round();
        Ok(self.go(position as i64))
    }

    fn describe(&self) -> String {
        let s = &self.settings;
        format!(
            "simulated stage, {} steps/turn × {} microsteps, ±{:.1} % step error, seed {}",
            s.steps_per_turn,
            s.microsteps,
            100.0 * s.step_error,
            s.seed
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(settings: &Settings) -> (SimulatedStage, Arc<Mutex<Shared>>) {
        let shared = Arc::new(Mutex::new(Shared::default()));
        (SimulatedStage::new(settings, shared.clone(), 0), shared)
    }

    #[test]
    fn step_errors_stay_within_five_per_cent_and_do_not_add_up() {
        for microsteps in [1, 8] {
            let (mut stage, shared) = stage(&Settings { microsteps, ..Settings::default() });
            let per_turn = 400 * microsteps;
            let mut greatest: f64 = 0.0;
            for k in 0..=per_turn {
                let target = Angle::from_deg(360.0 * f64::from(k) / f64::from(per_turn));
                let believed = stage.move_to(target).unwrap();
                assert!((believed - target).deg().abs() < 1e-9);
                let error = (lock(&shared).stage_angle - believed).deg().abs();
                greatest = greatest.max(error);
            }
            assert!((0.040..=0.045).contains(&greatest), "{greatest}");
            assert_eq!(stage.home().unwrap(), Angle::default());
            assert_eq!(lock(&shared).stage_angle, Angle::default());
        }
    }

    #[test]
    fn what_is_outside_the_limits_is_refused_without_movement() {
        let (mut stage, shared) = stage(&Settings::default());
        stage.move_to(Angle::from_deg(90.0)).unwrap();
        let before = lock(&shared).clone();
        for bad in [-5.1, 365.1, f64::NAN, f64::INFINITY] {
            let refused = stage.move_to(Angle::from_deg(bad));
            assert!(matches!(refused, Err(RigError::OutOfLimits { .. })), "{bad}: {refused:?}");
        }
        assert_eq!(*lock(&shared), before);
    }

    #[test]
    fn a_lost_step_stays_lost_until_homing() {
        let mut settings = Settings { step_error: 0.0, ..Settings::default() };
        settings.faults.lost_step_at = Some(1);
        let (mut stage, shared) = stage(&settings);
        let mut seen = Vec::new();
        for deg in [7.2, 14.4, 21.6] {
            assert!((stage.move_to(Angle::from_deg(deg)).unwrap().deg() - deg).abs() < 1e-9);
            seen.push(lock(&shared).stage_angle.deg());
        }
        stage.home().unwrap();
        stage.move_to(Angle::from_deg(7.2)).unwrap();
        seen.push(lock(&shared).stage_angle.deg());
        for (is, want) in seen.iter().zip([7.2, 13.5, 20.7, 7.2]) {
            assert!((is - want).abs() < 1e-9, "{seen:?}");
        }
    }

    #[test]
    fn the_way_takes_its_time() {
        // 36°/s after 0.2 s and 3.6° of acceleration, and the same to stop.
        assert!((travel_time_s(7.2, 36.0, 180.0) - 0.4).abs() < 1e-12);
        assert!((travel_time_s(43.2, 36.0, 180.0) - 1.4).abs() < 1e-12);
        assert!((travel_time_s(1.8, 36.0, 180.0) - 0.2).abs() < 1e-12);
    }
}
