//! Where the configuration comes from: the file that was named, else the first that is there of a few usual places, else the
//! built-in default.

use super::{Config, ConfigError};
use std::ffi::OsString;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// The file's name below the usual places.
const NAME: &str = "grainrig/config.toml";

/// What led to a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// `--config`.
    Flag,
    /// `GRAINRIG_CONFIG`.
    Environment,
    /// The account's own folder of configurations.
    User,
    /// The computer's.
    System,
    /// No file at all.
    BuiltIn,
}

impl Place {
    /// In a word or two.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Flag => "--config",
            Self::Environment => "GRAINRIG_CONFIG",
            Self::User => "user",
            Self::System => "system",
            Self::BuiltIn => "built-in default",
        }
    }

    /// Why a file is read, for whoever is told that it can't be.
    pub(super) const fn why(self) -> &'static str {
        match self {
            Self::Flag => "it was given to --config",
            Self::Environment => "GRAINRIG_CONFIG names it",
            Self::User | Self::System | Self::BuiltIn => {
                "it is looked for where no other is named: --config FILE takes another"
            }
        }
    }
}

/// The configuration that is to be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// What led to it.
    pub place: Place,
    /// The file; none is the built-in default.
    pub path: Option<PathBuf>,
    /// Places that were looked at before, and had none.
    pub absent: Vec<PathBuf>,
}

impl Found {
    /// The named file, whether or not it is there; without one the first that is there of `usual`, else the built-in default.
    ///
    /// # Errors
    /// [`ConfigError::Read`] where nobody can know whether a file is there.
    pub fn of(named: Option<(Place, PathBuf)>, usual: Vec<(Place, PathBuf)>) -> Result<Self, ConfigError> {
        if let Some((place, path)) = named {
            return Ok(Self { place, path: Some(path), absent: Vec::new() });
        }
        let mut absent = Vec::new();
        for (place, path) in usual {
            // A link that leads nowhere is there: reading it says so.
            match path.symlink_metadata() {
                Ok(_) => return Ok(Self { place, path: Some(path), absent }),
                Err(e) if matches!(e.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                    absent.push(path);
                }
                Err(source) => return Err(ConfigError::Read { path, why: place.why(), source }),
            }
        }
        Ok(Self { place: Place::BuiltIn, path: None, absent })
    }

    /// Reads it.
    ///
    /// # Errors
    /// As [`Config::read`].
    pub fn read(&self) -> Result<Config, ConfigError> {
        self.path.as_deref().map_or_else(|| Ok(Config::default()), |path| Config::read_as(path, self.place))
    }
}

impl std::fmt::Display for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.path {
            Some(path) => write!(f, "{} ({})", path.display(), self.place.name()),
            None => f.write_str(self.place.name()),
        }
    }
}

/// The usual places, by the environment's `XDG_CONFIG_HOME` and `HOME`: the account's folder of configurations, then the
/// computer's. A folder that is no absolute path counts as not given (XDG Base Directory Specification 0.8).
pub fn usual_places(xdg_config_home: Option<OsString>, home: Option<OsString>) -> Vec<(Place, PathBuf)> {
    let folder = |given: Option<OsString>| given.map(PathBuf::from).filter(|p| p.is_absolute());
    let user = folder(xdg_config_home).or_else(|| folder(home).map(|home| home.join(".config")));
    let user = user.map(|folder| (Place::User, folder.join(NAME)));
    user.into_iter().chain([(Place::System, Path::new("/etc").join(NAME))]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_file_that_is_there_wins_and_a_named_one_before_all() {
        let dir = tempfile::tempdir().unwrap();
        let place = |name: &str| dir.path().join(name);
        let usual = || vec![(Place::User, place("user.toml")), (Place::System, place("system.toml"))];
        let none = Found::of(None, usual()).unwrap();
        assert_eq!((none.place, none.absent.len()), (Place::BuiltIn, 2));
        assert_eq!(none.read().unwrap(), Config::default());
        std::fs::write(place("system.toml"), "[plan]\nviews = 7\n").unwrap();
        let system = Found::of(None, usual()).unwrap();
        assert_eq!((system.place, system.absent), (Place::System, vec![place("user.toml")]));
        std::fs::write(place("user.toml"), "[plan]\nviews = 9\n").unwrap();
        assert_eq!(Found::of(None, usual()).unwrap().read().unwrap().plan.views, 9);
        let named = Found::of(Some((Place::Environment, place("nowhere.toml"))), usual()).unwrap();
        let error = named.read().unwrap_err().to_string();
        assert!(error.contains("nowhere.toml") && error.contains("GRAINRIG_CONFIG"), "{error}");
    }

    #[test]
    fn what_is_there_and_cannot_be_read_is_not_passed_over() {
        let dir = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("nowhere", dir.path().join("link.toml")).unwrap();
        for name in ["link.toml", "."] {
            let usual = vec![(Place::User, dir.path().join(name))];
            let error = Found::of(None, usual).unwrap().read().unwrap_err().to_string();
            assert!(error.contains("cannot read") && error.contains("--config FILE"), "{error}");
        }
        let endless = vec![(Place::User, dir.path().join("x".repeat(300)))];
        assert!(matches!(Found::of(None, endless), Err(ConfigError::Read { .. })));
    }

    #[test]
    fn the_accounts_folder_is_the_environments() {
        let of = |xdg: Option<&str>, home: Option<&str>| -> Vec<String> {
            let places = usual_places(xdg.map(Into::into), home.map(Into::into));
            places.into_iter().map(|(_, path)| path.display().to_string()).collect()
        };
        let system = "/etc/grainrig/config.toml";
        assert_eq!(of(Some("/x"), Some("/h")), ["/x/grainrig/config.toml", system]);
        for none in [None, Some(""), Some("relative")] {
            assert_eq!(of(none, Some("/h")), ["/h/.config/grainrig/config.toml", system]);
            assert_eq!(of(none, None), [system]);
        }
    }
}
