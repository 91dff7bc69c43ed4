//! The settings of a run, and the plan that they make.

use super::PlanError;
use crate::session::event::Role;
use crate::session::{Plan, PlannedView};
use serde::{Deserialize, Serialize};

/// Fewer views make no hull.
const FEWEST_VIEWS: u32 = 2;
/// More are a slip of the pen: 2000 views are 0.18° apart in a full turn.
const MOST_VIEWS: u32 = 2000;
/// A stepper's full step is 0.9° or 1.8°; a coarse geared stage stays below this too.
const COARSEST_STEP_DEG: f64 = 45.0;
/// Finer than any microstepping on a motor of 0.9°.
const FINEST_STEP_DEG: f64 = 1e-4;
/// A grain that rocks for a minute is not going to rest.
const LONGEST_SETTLE_MS: u64 = 60_000;
/// A camera that delivers this many bad pictures in a row is broken.
const MOST_RETAKES: u32 = 20;

/// The `[plan]` settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PlanSettings {
    /// Views of the grain, without the closing view.
    pub views: u32,
    /// Full steps of the motor between two views.
    pub steps_per_view: u32,
    /// One full step at the grain, degrees.
    pub step_deg: f64,
    /// Time between the end of a move and the exposure, ms.
    pub settle_ms: u64,
    /// Whether one more view is taken at 180°: the mirror image of the first, which shows the axis.
    pub closing_view: bool,
    /// How often a bad picture of one view is taken again before the run fails.
    pub retakes: u32,
    /// Greatest difference between the angle reached and the angle commanded, degrees.
    pub tolerance_deg: f64,
}

impl Default for PlanSettings {
    /// 25 views of eight steps of 0.9°: 7.2° apart, 0° to 172.8°, and the closing view at 180°.
    fn default() -> Self {
        Self {
            views: 25,
            steps_per_view: 8,
            step_deg: 0.9,
            settle_ms: 300,
            closing_view: true,
            retakes: 3,
            // Half a step: more is a lost step.
            tolerance_deg: 0.45,
        }
    }
}

impl PlanSettings {
    /// The plan that these settings make.
    ///
    /// # Errors
    /// [`PlanError`] for a setting that is not finite, zero, beyond its limit, or that does not fit the others.
    pub fn check(&self) -> Result<Plan, PlanError> {
        let refuse = |setting, value: String, remedy: String| Err(PlanError { setting, value, remedy });
        if !(FEWEST_VIEWS..=MOST_VIEWS).contains(&self.views) {
            let remedy = format!("set {FEWEST_VIEWS} to {MOST_VIEWS} views");
            return refuse("views", self.views.to_string(), remedy);
        }
        if !(FINEST_STEP_DEG..=COARSEST_STEP_DEG).contains(&self.step_deg) {
            let remedy =
                format!("set {FINEST_STEP_DEG} to {COARSEST_STEP_DEG} degrees, as on the motor's label");
            return refuse("step_deg", format!("{}°", self.step_deg), remedy);
        }
        // The last view may not come round to the first again.
        let most_steps = 360.0 / (f64::from(self.views) * self.step_deg);
        if self.steps_per_view == 0 || f64::from(self.steps_per_view) > most_steps * (1.0 + 1e-9) {
            let remedy = format!(
                "set 1 to {} steps, so that {} views of {}° steps stay within one turn of 360°",
                most_steps.floor(),
                self.views,
                self.step_deg
            );
            return refuse("steps_per_view", self.steps_per_view.to_string(), remedy);
        }
        if self.settle_ms > LONGEST_SETTLE_MS {
            let remedy = format!("set 0 to {LONGEST_SETTLE_MS} ms");
            return refuse("settle_ms", format!("{} ms", self.settle_ms), remedy);
        }
        if self.retakes > MOST_RETAKES {
            let remedy = format!("set 0 to {MOST_RETAKES} retakes");
            return refuse("retakes", self.retakes.to_string(), remedy);
        }
        let increment_deg = f64::from(self.steps_per_view) * self.step_deg;
        if (increment_deg - 180.0).abs() < 1e-6 {
            let remedy = "views from opposite sides show the same outline, which bounds no volume; set another number of \
                          steps, so that the views look from other directions"
                .to_owned();
            return refuse("steps_per_view", self.steps_per_view.to_string(), remedy);
        }
        if !(self.tolerance_deg > 0.0 && self.tolerance_deg <= 0.5 * increment_deg) {
            let remedy = format!(
                "set more than 0 and at most {}°, half of the {increment_deg}° between two views",
                0.5 * increment_deg
            );
            return refuse("tolerance_deg", format!("{}°", self.tolerance_deg), remedy);
        }
        let half_turn = (180.0 / self.step_deg).round();
        if self.closing_view && (half_turn * self.step_deg - 180.0).abs() > 1e-6 {
            let remedy = "180° must be a whole number of steps for the closing view; change step_deg or set \
                          closing_view = false"
                .to_owned();
            return refuse("step_deg", format!("{}°", self.step_deg), remedy);
        }
        Ok(self.plan(half_turn as i64))
    }

    fn plan(&self, half_turn: i64) -> Plan {
        let grain = (0..i64::from(self.views)).map(|i| (Role::Grain, i * i64::from(self.steps_per_view)));
        let closing = self.closing_view.then_some((Role::Closing, half_turn));
        let views = grain
            .chain(closing)
            .enumerate()
            .map(|(index, (role, steps))| PlannedView {
                index,
                role,
                angle_deg: angle_deg(steps, self.step_deg),
                steps: Some(steps),
            })
            .collect();
        Plan { views, settle_ms: self.settle_ms, retakes: self.retakes, tolerance_deg: self.tolerance_deg }
    }
}

/// 8 × 0.9 is 7.2 and not 7.2 + 2⁻⁵⁰: the plan is read by people.
fn angle_deg(steps: i64, step_deg: f64) -> f64 {
    (steps as f64 * step_deg * 1e9).round() / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_25_views_of_7_2_degrees_and_the_closing_view() {
        let plan = PlanSettings::default().check().unwrap();
        assert_eq!(plan.views.len(), 26);
        assert_eq!(plan.views[3].angle_deg.to_string(), "21.6");
        assert_eq!((plan.views[24].angle_deg, plan.views[24].steps), (172.8, Some(192)));
        let last = &plan.views[25];
        assert_eq!((last.role, last.angle_deg, last.steps), (Role::Closing, 180.0, Some(200)));
    }

    #[test]
    fn absurd_settings_are_refused_with_value_limit_and_remedy() {
        let d = PlanSettings::default;
        let bad = [
            PlanSettings { views: 0, ..d() },
            PlanSettings { views: u32::MAX, ..d() },
            PlanSettings { step_deg: f64::NAN, ..d() },
            PlanSettings { step_deg: f64::INFINITY, ..d() },
            PlanSettings { step_deg: 0.0, ..d() },
            PlanSettings { step_deg: -0.9, ..d() },
            PlanSettings { step_deg: 0.7, ..d() },
            PlanSettings { steps_per_view: 0, ..d() },
            PlanSettings { steps_per_view: 17, ..d() },
            PlanSettings { views: 2, steps_per_view: 200, ..d() },
            PlanSettings { steps_per_view: u32::MAX, ..d() },
            PlanSettings { settle_ms: u64::MAX, ..d() },
            PlanSettings { retakes: 1000, ..d() },
            PlanSettings { tolerance_deg: f64::NAN, ..d() },
            PlanSettings { tolerance_deg: 0.0, ..d() },
            PlanSettings { tolerance_deg: 5.0, ..d() },
        ];
        for settings in bad {
            let e = settings.check().unwrap_err();
            assert!(e.to_string().contains(" is ") && e.remedy.contains("set "), "{e}");
        }
        PlanSettings { step_deg: 0.7, closing_view: false, ..d() }.check().unwrap();
        PlanSettings { views: 50, ..d() }.check().unwrap();
    }

    #[test]
    fn an_unknown_setting_is_refused() {
        assert!(serde_json::from_str::<PlanSettings>("{\"veiws\": 3}").is_err());
        assert_eq!(serde_json::from_str::<PlanSettings>("{}").unwrap(), PlanSettings::default());
    }
}
