//! A home folder for the child: libgphoto2 keeps settings below `$HOME/.gphoto`, and takes some of its own from there.

use std::fs::{self, DirBuilder};
use std::io::{Error, ErrorKind, Result};
use std::os::unix::fs::DirBuilderExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// How often a name that is taken is changed.
const MOST_NAMES: u32 = 1000;

/// The library's settings. It believes for two seconds in a value that it has read once, unless an event says otherwise,
/// and some ways of events pass it by: an exposure that changed by itself would not be seen.
const SETTINGS: &str = "ptp2=cachetime=0\n";

/// A folder of this account's own, which goes away with the child.
#[derive(Debug)]
pub(super) struct Home(PathBuf);

impl Home {
    pub(super) fn make() -> Result<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        for _ in 0..MOST_NAMES {
            let number = COUNT.fetch_add(1, Ordering::Relaxed);
            let path = std::env::temp_dir().join(format!("grainrig-camera-{}-{number}", std::process::id()));
            match DirBuilder::new().mode(0o700).create(&path) {
                Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
                made => {
                    made?;
                    let home = Self(path);
                    fs::create_dir(home.0.join(".gphoto"))?;
                    fs::write(home.0.join(".gphoto/settings"), SETTINGS)?;
                    return Ok(home);
                }
            }
        }
        Err(Error::from(ErrorKind::AlreadyExists))
    }

    pub(super) fn path(&self) -> &Path {
        &self.0
    }
}

impl Drop for Home {
    fn drop(&mut self) {
        // What stays is a line of settings in the folder for temporary files.
        let _ = fs::remove_dir_all(&self.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_child_has_a_home_of_its_own_that_goes_away() {
        let (a, b) = (Home::make().unwrap(), Home::make().unwrap());
        assert_ne!(a.path(), b.path());
        let path = a.path().to_owned();
        assert_eq!(fs::read_to_string(path.join(".gphoto/settings")).unwrap(), SETTINGS);
        drop(a);
        assert!(!path.exists() && b.path().exists());
    }
}
