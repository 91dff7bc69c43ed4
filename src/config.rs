//! The configuration file: TOML, every key documented in `config/`, unknown keys refused.

mod search;

pub use search::{Found, Place, usual_places};

use crate::acquire::{AcquireSettings, PlanSettings};
use crate::pipeline::{self, HullSettings, MeshSettings, ReportSettings, TurntableSettings};
use crate::rig::{CameraDriver, Driver, StageDriver};
use grainrig_core::plausible::{self, Doubt};
use grainrig_core::silhouette;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub use crate::rig::{CameraKind, StageKind};

/// Makes the configuration with a section for each driver of the rig's table, and what finds the driver of a kind.
macro_rules! config {
    (
        sections { $($(#[$about:meta])* $section:ident: $settings:ty,)* }
        stages { $($(#[$_of_stage:meta])* $Stage:ident = $stage:ident,)* }
        cameras { $($(#[$_of_camera:meta])* $Camera:ident = $camera:ident,)* }
    ) => {
        /// Everything that a person may set.
        #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        pub struct Config {
            /// Whether figures that look like slips of unit (a pixel of 4.3 mm) are meant so.
            pub as_given: bool,
            /// Which devices turn and photograph the grain.
            pub rig: RigSettings,
            /// How many views, how far apart.
            pub plan: PlanSettings,
            /// What becomes of pictures that are no good.
            pub acquire: AcquireSettings,
            /// What is known of the camera.
            pub optics: TurntableSettings,
            /// How the grain is told from pedestal and background.
            pub silhouette: silhouette::Settings,
            /// How finely the hull is measured.
            pub hull: HullSettings,
            /// The mesh's three controls.
            pub mesh: MeshSettings,
            /// What is drawn for a person's eye.
            pub report: ReportSettings,
            $($(#[$about])* pub $section: $settings,)*
            /// The web service.
            pub serve: ServeSettings,
        }

        impl Config {
            fn stage_of(&self, kind: StageKind) -> &dyn StageDriver {
                match kind { $(StageKind::$Stage => &self.$stage,)* }
            }

            fn camera_of(&self, kind: CameraKind) -> &dyn CameraDriver {
                match kind { $(CameraKind::$Camera => &self.$camera,)* }
            }

            /// Every section that sets a driver, by its name.
            pub fn drivers(&self) -> Vec<(&'static str, &dyn Driver)> {
                vec![$((stringify!($section), &self.$section),)*]
            }
        }
    };
}

crate::rig::drivers!(config);

/// Which devices turn and photograph the grain.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RigSettings {
    /// The kind of rig.
    pub kind: RigKind,
    /// What turns the grain, of a hardware rig.
    pub stage: StageKind,
    /// What photographs it, of a hardware rig.
    pub camera: CameraKind,
    /// What releases the shutter of a DSLR.
    pub release: Release,
}

/// The kinds of rig.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RigKind {
    /// A rendered grain on a computed stage: no hardware needed.
    #[default]
    Simulated,
    /// A stage and a camera of this world.
    Hardware,
}

/// What releases a DSLR's shutter.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Release {
    /// The camera itself, asked over its own cable.
    #[default]
    Camera,
    /// The controller's output at the camera's remote socket; the pictures come over the camera's own cable all the same.
    Controller,
}

/// The web service.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ServeSettings {
    /// Address and port to listen on.
    pub listen: String,
    /// Token that a client must show; required off loopback.
    pub token: Option<String>,
    /// Host names, beside loopback's, under which browsers may reach the service.
    pub allowed_hosts: Vec<String>,
}

impl Default for ServeSettings {
    fn default() -> Self {
        Self { listen: "127.0.0.1:7272".into(), token: None, allowed_hosts: Vec::new() }
    }
}

/// Why the configuration can't be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file can't be read.
    #[error(
        "cannot read the configuration {}: {source}; {} ({why})",
        path.display(), crate::system::remedy(source)
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// Why it was to be read.
        why: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is no configuration.
    #[error("{}: {reason}; config/simulated.toml shows every key with its unit and default", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, key and what is wrong.
        reason: String,
    },
    /// A value is outside its limits.
    #[error("{0}")]
    Value(String),
}

impl Config {
    /// Reads a configuration file.
    ///
    /// # Errors
    /// [`ConfigError`] for a file that can't be read, or has an unknown key or a value of the wrong kind.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        Self::read_as(path, Place::Flag)
    }

    fn read_as(path: &Path, place: Place) -> Result<Self, ConfigError> {
        let why = place.why();
        let bytes =
            std::fs::read(path).map_err(|source| ConfigError::Read { path: path.into(), why, source })?;
        let parse = |reason| ConfigError::Parse { path: path.into(), reason };
        let text = String::from_utf8(bytes).map_err(|e| {
            let readable = &e.as_bytes()[..e.utf8_error().valid_up_to()];
            parse(format!("line {}: it is not UTF-8 text", readable.split(|b| *b == b'\n').count()))
        })?;
        toml::from_str(&text).map_err(|e| parse(explain(&text, &e)))
    }

    /// Whether every value makes sense.
    ///
    /// # Errors
    /// [`ConfigError::Value`] names the first that does not, its limit and the remedy.
    pub fn check(&self) -> Result<(), ConfigError> {
        fn value_error(error: impl std::fmt::Display) -> ConfigError {
            ConfigError::Value(error.to_string())
        }
        let doubts = self.doubts();
        plausible::slips(&doubts, self.as_given).map_err(value_error)?;
        self.plan.check().map_err(value_error)?;
        self.optics.check().map_err(value_error)?;
        self.computation().check().map_err(value_error)?;
        self.stage().check().map_err(value_error)?;
        self.check_release()?;
        self.camera().check().map_err(value_error)?;
        plausible::settle(doubts, self.as_given).map(|_| ()).map_err(value_error)
    }

    /// What of the figures no laboratory has. Sizes of elements are held against the grain's once that is known.
    pub fn doubts(&self) -> Vec<Doubt> {
        let turn = f64::from(self.plan.steps_per_view) * self.plan.step_deg;
        let mut doubts = self.optics.doubts();
        doubts.extend(plausible::VIEW_STEP.doubt(turn));
        doubts.extend(self.hull.voxel_mm.and_then(|v| plausible::VOXEL.doubt(v)));
        doubts.extend(self.camera().doubts());
        doubts
    }

    /// Which kind of driver turns the grain.
    pub fn stage_kind(&self) -> StageKind {
        match self.rig.kind {
            RigKind::Simulated => StageKind::Simulated,
            RigKind::Hardware => self.rig.stage,
        }
    }

    /// Which kind of driver photographs it.
    pub fn camera_kind(&self) -> CameraKind {
        match self.rig.kind {
            RigKind::Simulated => CameraKind::Simulated,
            RigKind::Hardware => self.rig.camera,
        }
    }

    /// What turns the grain.
    pub fn stage(&self) -> &dyn StageDriver {
        self.stage_of(self.stage_kind())
    }

    /// What photographs it.
    pub fn camera(&self) -> &dyn CameraDriver {
        self.camera_of(self.camera_kind())
    }

    /// Every driver that could turn the grain, by its name.
    pub fn stages(&self) -> impl Iterator<Item = (&'static str, &dyn StageDriver)> {
        StageKind::ALL.iter().map(|kind| (kind.name(), self.stage_of(*kind)))
    }

    /// Every driver that could photograph the grain, by its name.
    pub fn cameras(&self) -> impl Iterator<Item = (&'static str, &dyn CameraDriver)> {
        CameraKind::ALL.iter().map(|kind| (kind.name(), self.camera_of(*kind)))
    }

    /// Whether the stage can release the camera, where it is to.
    fn check_release(&self) -> Result<(), ConfigError> {
        let of_stage = self.rig.kind == RigKind::Hardware && self.rig.release == Release::Controller;
        if !of_stage || (self.stage().has_release() && self.camera().takes_release()) {
            return Ok(());
        }
        let stages = self.stages().filter(|(_, d)| d.has_release()).map(|(name, _)| format!("{name:?}"));
        let cameras = self.cameras().filter(|(_, d)| d.takes_release()).map(|(name, _)| format!("{name:?}"));
        Err(ConfigError::Value(format!(
            "rig.release is \"controller\", which needs stage = {} and camera = {}; set \"camera\"",
            stages.collect::<Vec<_>>().join(" or "),
            cameras.collect::<Vec<_>>().join(" or "),
        )))
    }

    /// This configuration with some keys set otherwise, for one run: `{"plan": {"views": 50}}`.
    ///
    /// # Errors
    /// [`ConfigError::Value`] for an unknown key or a value of the wrong kind or outside its limits.
    pub fn with(&self, overrides: serde_json::Map<String, serde_json::Value>) -> Result<Self, ConfigError> {
        let unreadable = |e: serde_json::Error| {
            ConfigError::Value(format!(
                "{e}; config/simulated.toml shows every key with its unit and default"
            ))
        };
        let mut all = serde_json::to_value(self).map_err(unreadable)?;
        merge(&mut all, serde_json::Value::Object(overrides));
        let changed: Self = serde_json::from_value(all).map_err(unreadable)?;
        changed.check()?;
        Ok(changed)
    }

    /// The part that the computation needs.
    pub fn computation(&self) -> pipeline::Settings {
        pipeline::Settings {
            as_given: self.as_given,
            silhouette: self.silhouette.clone(),
            hull: self.hull.clone(),
            mesh: self.mesh.clone(),
            report: self.report,
        }
    }
}

/// Line, its text, what is wrong with it and, for a key that is not known, the one that was meant.
fn explain(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().trim().replace('\n', " ");
    let at = error.span().map_or(0, |s| s.start).min(text.len());
    let before = text.get(..at).unwrap_or("");
    let line = before.matches('\n').count();
    let shown: String = text.lines().nth(line).unwrap_or("").trim().chars().take(80).collect();
    format!("line {} ({shown}): {message}{}", line + 1, meant(&message))
}

/// For "unknown field `a`, expected one of `b`, `c`": the nearest of the known ones, where one is near.
fn meant(message: &str) -> String {
    let mut names = message.split('`').skip(1).step_by(2);
    let Some(wrong) = names.next().filter(|_| message.starts_with("unknown ")) else { return String::new() };
    let nearest = names.map(|known| (edits(wrong, known), known)).min();
    match nearest {
        Some((distance, known)) if distance <= 2.max(wrong.len() / 3) => format!("; did you mean `{known}`?"),
        _ => String::new(),
    }
}

/// Letters to insert, remove or change to get from one word to the other (Levenshtein 1966).
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

fn merge(into: &mut serde_json::Value, from: serde_json::Value) {
    use serde_json::Value;
    match (into, from) {
        (Value::Object(into), Value::Object(from)) => {
            for (key, value) in from {
                merge(into.entry(key).or_insert(Value::Null), value);
            }
        }
        (into, from) => *into = from,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_profile_of_a_camera_makes_sense() {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/canon-eos-60d.toml");
        let mut config = Config::read(&shipped).unwrap();
        assert_eq!((config.rig.kind, config.rig.camera), (RigKind::Hardware, CameraKind::Gphoto2));
        // The stage's port is each laboratory's own.
        config.rig.stage = StageKind::Simulated;
        config.check().unwrap();
    }

    #[test]
    fn the_shipped_configuration_is_the_default_and_unknown_keys_are_named() {
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/simulated.toml");
        assert_eq!(Config::read(&shipped).unwrap(), Config::default());
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("bad.toml");
        std::fs::write(&path, "[plan]\nvews = 25\n").unwrap();
        let text = Config::read(&path).unwrap_err().to_string();
        for part in ["bad.toml", "line 2", "`vews`", "did you mean `views`?"] {
            assert!(text.contains(part), "{part} is missing: {text}");
        }
    }

    #[test]
    fn a_driver_is_called_the_same_wherever_it_is_named() {
        let config = serde_json::to_value(Config::default()).unwrap();
        let named = |kind: serde_json::Value, name: &str| {
            assert_eq!(kind, name);
            assert!(config.get(name).is_some_and(serde_json::Value::is_object), "no section {name}");
        };
        StageKind::ALL.iter().for_each(|k| named(serde_json::to_value(k).unwrap(), k.name()));
        CameraKind::ALL.iter().for_each(|k| named(serde_json::to_value(k).unwrap(), k.name()));
        // And every section sets something.
        let kinds = StageKind::ALL.iter().map(|k| k.name()).chain(CameraKind::ALL.iter().map(|k| k.name()));
        let kinds: Vec<&str> = kinds.collect();
        assert!(Config::default().drivers().iter().all(|(name, _)| kinds.contains(name)));
    }
}
