//! What the simulated rig is made of: every length, error and disturbance, with the limits of each.

use super::Faults;
use crate::rig::RigError;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// The simulated rig's settings; the defaults are a 0.9 mm grain before a DSLR with a 1:1 lens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Drives the built-in grain's shape, the motor's step errors, the wobble and the noise.
    pub seed: u64,
    /// A closed surface to photograph instead of the built-in grain; its z axis stands up. Any unit: it is
    /// scaled to [`Self::grain_size_mm`].
    pub grain_stl: Option<PathBuf>,
    /// Diameter of the sphere that has the grain's volume, mm. Scales the built-in grain and an STL alike.
    pub grain_size_mm: f64,
    /// How the body is turned before it is set on the pedestal: about x, then y, then z of the table's frame, degrees.
    /// Another turn is the same grain with another side down.
    pub grain_rotation_deg: [f64; 3],
    /// A ball of this diameter (mm) instead of a grain: the body of known answers. Excludes `grain_stl`.
    pub sphere_diameter_mm: Option<f64>,
    /// Outer radius of the tube that carries the grain, mm; the tube's top is the plane z = 0.
    pub pedestal_radius_mm: f64,
    /// How deep the grain's lowest point sits below the pedestal's top, mm.
    pub embedded_mm: f64,
    /// Where the grain's centroid stands at angle 0: x and y from the rotation axis, mm.
    pub eccentricity_mm: [f64; 2],
    /// Width of the picture, pixels.
    pub width: usize,
    /// Height of the picture, pixels.
    pub height: usize,
    /// Edge of one pixel in the plane of the rotation axis, mm.
    pub mm_per_px: f64,
    /// Distance from the pinhole to the rotation axis, mm; absent for a telecentric lens.
    pub camera_distance_mm: Option<f64>,
    /// How far the axis's foot lies right of the picture's middle column, pixels.
    pub axis_offset_px: f64,
    /// The picture's roll: how far the projected axis leans, degrees (the top leans left where positive).
    pub roll_deg: f64,
    /// How far the camera looks up: how far its middle ray rises going away, degrees.
    pub elevation_deg: f64,
    /// Standard deviation of each view's own sideways shift (bearing run-out, vibration), pixels.
    pub wobble_px: f64,
    /// Standard deviation of the lens's Gaussian blur, pixels.
    pub blur_px: f64,
    /// Standard deviation of the shot noise at grey level 128; it grows with the level's square root.
    pub noise_sd: f64,
    /// How much darker the background is in the corners than in the brightest place, as a fraction of it.
    pub background_unevenness: f64,
    /// Bright background, mid-grey grain, dark pedestal; where false, dark background, bright grain,
    /// mid-grey pedestal.
    pub bright_background: bool,
    /// Quality of the JPEG files, 1 to 100.
    pub jpeg_quality: u8,
    /// Exposure time, seconds: written into the pictures, and waited for in real time.
    pub exposure_s: f64,
    /// Full steps of the motor in one turn.
    pub steps_per_turn: u32,
    /// Microsteps in one full step: 1, 2, 4, 8 or 16.
    pub microsteps: u32,
    /// A full step as it is over a full step as the controller believes it: a wrong gear or step count where not 1.
    pub step_ratio: f64,
    /// Greatest error of a full step's position, as a fraction of a step. Each position has its own fixed
    /// error, so errors do not add up from step to step (a 0.9° motor's data sheet says ±5 %).
    pub step_error: f64,
    /// The least and the greatest angle that the stage accepts, degrees.
    pub limits_deg: [f64; 2],
    /// Top speed of the stage, degrees per second.
    pub speed_deg_per_s: f64,
    /// Acceleration of the stage, degrees per second squared.
    pub acceleration_deg_per_s2: f64,
    /// Whether moves and exposures take their time; otherwise the time is only computed.
    pub realtime: bool,
    /// What goes wrong, and when.
    pub faults: Faults,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            seed: 1,
            grain_stl: None,
            grain_size_mm: 0.9,
            grain_rotation_deg: [0.0; 3],
            sphere_diameter_mm: None,
            pedestal_radius_mm: 0.25,
            embedded_mm: 0.02,
            eccentricity_mm: [0.03, -0.02],
            width: 5184,
            height: 3456,
            mm_per_px: 0.0043,
            camera_distance_mm: None,
            axis_offset_px: 6.3,
            roll_deg: 0.2,
            elevation_deg: 0.0,
            wobble_px: 0.2,
            blur_px: 1.0,
            noise_sd: 2.0,
            background_unevenness: 0.12,
            bright_background: true,
            jpeg_quality: 95,
            exposure_s: 0.02,
            steps_per_turn: 400,
            microsteps: 1,
            step_ratio: 1.0,
            step_error: 0.05,
            limits_deg: [-5.0, 365.0],
            speed_deg_per_s: 36.0,
            acceleration_deg_per_s2: 180.0,
            realtime: false,
            faults: Faults::default(),
        }
    }
}

impl Settings {
    /// Whether every value is a number within its limits.
    ///
    /// # Errors
    /// [`RigError::Device`] that names the first value outside its limits, the limits and the key to change.
    pub fn check(&self) -> Result<(), RigError> {
        let within = |key: &str, value: f64, unit: &str, low: f64, high: f64| {
            // A NaN is in no range, so it is refused here as well.
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(RigError::fault(
                format!("the simulated rig's {key} is {value}{unit}, it must be {low} to {high}{unit}"),
                format!("change [simulated] {key}"),
            ))
        };
        within("grain_size_mm", self.grain_size_mm, " mm", 1e-3, 1e3)?;
        if let Some(d) = self.sphere_diameter_mm {
            within("sphere_diameter_mm", d, " mm", 1e-3, 1e3)?;
        }
        for r in self.grain_rotation_deg {
            within("grain_rotation_deg", r, "°", -360.0, 360.0)?;
        }
        within("pedestal_radius_mm", self.pedestal_radius_mm, " mm", 1e-4, 1e3)?;
        within("embedded_mm", self.embedded_mm, " mm", 0.0, 1e3)?;
        for e in self.eccentricity_mm {
            within("eccentricity_mm", e, " mm", -1e3, 1e3)?;
        }
        // 65 500 is what a JPEG file can hold.
        within("width", self.width as f64, " px", 32.0, 65_500.0)?;
        within("height", self.height as f64, " px", 32.0, 65_500.0)?;
        within("width × height", self.width as f64 * self.height as f64, " px", 1024.0, 2e8)?;
        within("mm_per_px", self.mm_per_px, " mm", 1e-6, 10.0)?;
        if let Some(d) = self.camera_distance_mm {
            within("camera_distance_mm", d, " mm", 1e-2, 1e6)?;
        }
        within("axis_offset_px", self.axis_offset_px, " px", -65_500.0, 65_500.0)?;
        within("roll_deg", self.roll_deg, "°", -20.0, 20.0)?;
        // The pedestal is drawn as an upright tube.
        within("elevation_deg", self.elevation_deg, "°", -5.0, 5.0)?;
        within("wobble_px", self.wobble_px, " px", 0.0, 1000.0)?;
        within("blur_px", self.blur_px, " px", 0.0, 50.0)?;
        within("noise_sd", self.noise_sd, " grey levels", 0.0, 60.0)?;
        within("background_unevenness", self.background_unevenness, "", 0.0, 0.6)?;
        within("jpeg_quality", f64::from(self.jpeg_quality), "", 1.0, 100.0)?;
        within("exposure_s", self.exposure_s, " s", 1e-6, 60.0)?;
        within("steps_per_turn", f64::from(self.steps_per_turn), "", 4.0, 100_000.0)?;
        if ![1, 2, 4, 8, 16].contains(&self.microsteps) {
            return Err(RigError::fault(
                format!("the simulated rig's microsteps is {}, it must be 1, 2, 4, 8 or 16", self.microsteps),
                "change [simulated] microsteps",
            ));
        }
        within("step_ratio", self.step_ratio, "", 0.5, 2.0)?;
        // At half a step neighbouring positions would change places.
        within("step_error", self.step_error, " steps", 0.0, 0.49)?;
        within("limits_deg", self.limits_deg[0], "°", -1e6, 0.0)?;
        within("limits_deg", self.limits_deg[1], "°", 0.0, 1e6)?;
        within("speed_deg_per_s", self.speed_deg_per_s, "°/s", 1e-3, 1e5)?;
        within("acceleration_deg_per_s2", self.acceleration_deg_per_s2, "°/s²", 1e-3, 1e7)?;
        if let Some(slip) = self.faults.slip {
            within("faults.slip.deg", slip.deg, "°", -360.0, 360.0)?;
        }
        if let Some(missed) = self.faults.missed_angle {
            within("faults.missed_angle.deg", missed.deg, "°", -360.0, 360.0)?;
        }
        if let Some(slow) = self.faults.camera_slow {
            within("faults.camera_slow.seconds", slow.seconds, " s", 0.0, 600.0)?;
        }
        for (key, outage) in self.faults.outages() {
            within(key, outage.tries as f64, " tries", 1.0, 1e6)?;
        }
        within("faults.frame_faults_last", self.faults.frame_faults_last as f64, " exposures", 1.0, 1e6)?;
        within("faults.suspend_s", self.faults.suspend_s, " s", 0.1, 3600.0)?;
        if self.grain_stl.is_some() && self.sphere_diameter_mm.is_some() {
            return Err(RigError::fault(
                "the simulated rig has both grain_stl and sphere_diameter_mm, it photographs one body",
                "remove one of them from [simulated]",
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_within_their_limits_and_survive_toml() {
        let s = Settings::default();
        s.check().unwrap();
        let text = toml::to_string(&s).unwrap();
        assert_eq!(toml::from_str::<Settings>(&text).unwrap(), s);
        assert_eq!(toml::from_str::<Settings>("").unwrap(), s);
        assert!(toml::from_str::<Settings>("grain_sise_mm = 1.0").is_err());
    }

    #[test]
    fn what_is_outside_its_limits_is_named() {
        type Spoil = fn(&mut Settings);
        let bad: [(&str, Spoil); 10] = [
            ("mm_per_px", |s| s.mm_per_px = f64::NAN),
            ("grain_size_mm", |s| s.grain_size_mm = 0.0),
            ("grain_rotation_deg", |s| s.grain_rotation_deg[1] = 1e3),
            ("width", |s| s.width = 0),
            ("width × height", |s| (s.width, s.height) = (65_000, 65_000)),
            ("camera_distance_mm", |s| s.camera_distance_mm = Some(f64::INFINITY)),
            ("microsteps", |s| s.microsteps = 3),
            ("limits_deg", |s| s.limits_deg = [1.0, 2.0]),
            ("jpeg_quality", |s| s.jpeg_quality = 0),
            ("sphere_diameter_mm", |s| {
                (s.grain_stl, s.sphere_diameter_mm) = (Some("a.stl".into()), Some(1.0));
            }),
        ];
        for (key, spoil) in bad {
            let mut s = Settings::default();
            spoil(&mut s);
            let text = s.check().unwrap_err().to_string();
            assert!(text.contains(key) && text.contains("[simulated]"), "{key}: {text}");
        }
    }
}
