//! A camera whose pictures another program saves into a folder: any maker's tethering software, a cloud client, a person with a
//! card reader.
//!
//! ```text
//!  capture ──▶ what is there now is old ──▶ release, where the stage has one ──▶ a new picture, whole ──▶ its other files
//! ```
//!
//! The folder is looked through again and again, not watched: that also works on what a network or a virtual machine mounts. Files
//! are read and never changed.

use super::discovery::{Found, Role};
use super::driver::{FRAME_BYTES, OpenCamera, RAW_BYTES};
use super::{Before, Camera, CameraDriver, Driver, Encoding, Frame, OtherFile, RigError, Shutter};
use crate::system::remedy;
use grainrig_core::formats::Photograph;
use rustix::fs::OFlags;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::io::{Error, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Longest time that any setting may ask for, seconds.
const LONGEST_S: f64 = 3600.0;
/// A larger file is no picture, bytes.
const LARGEST: u64 = 1 << 30;
/// Endings of pictures that can be measured; what else has a picture's name is archived beside it.
const PICTURES: [&str; 5] = ["jpg", "jpeg", "png", "tif", "tiff"];
/// Longest ending of a file's name that is kept.
const LONGEST_EXTENSION: usize = 8;
/// Rest between two looks into the folder.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);
/// What to do where nothing, or nothing of use, comes.
const LOOK_THERE: &str = "release the shutter once for each view, and see that the other program saves JPEG files to folder.path at once";

/// The `[folder]` settings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The folder that the other program saves to.
    pub path: PathBuf,
    /// Longest time for a picture, from the moment that it is wanted until it is whole, seconds.
    pub shot_s: f64,
    /// Rest after which a file is not being written any more, and no further file of an exposure is waited for, seconds.
    pub quiet_s: f64,
    /// After how long a suspended run tries again, seconds.
    pub suspend_s: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { path: PathBuf::new(), shot_s: 60.0, quiet_s: 1.0, suspend_s: 60.0 }
    }
}

impl Driver for Settings {
    fn check(&self) -> Result<(), RigError> {
        if self.path.as_os_str().is_empty() {
            let remedy = "set the folder that the other program saves its pictures to";
            return Err(RigError::fault("folder.path is empty", remedy));
        }
        for (key, value, least) in [
            ("quiet_s", self.quiet_s, 0.0),
            ("shot_s", self.shot_s, self.quiet_s),
            ("suspend_s", self.suspend_s, 0.01),
        ] {
            // Written so that a NaN is refused.
            if !(least..=LONGEST_S).contains(&value) {
                let remedy = format!("set {least} to {LONGEST_S} s (quiet_s lies within shot_s)");
                return Err(RigError::fault(format!("folder.{key} is {value} s"), remedy));
            }
        }
        Ok(())
    }
}

impl CameraDriver for Settings {
    fn found(&self, _root: &Path) -> Result<Vec<Found>, RigError> {
        let named = !self.path.as_os_str().is_empty();
        Ok(named.then(|| Found::computed(Role::Camera, self.describe())).into_iter().collect())
    }

    fn takes_release(&self) -> bool {
        true
    }

    fn view_bytes(&self) -> u64 {
        FRAME_BYTES + RAW_BYTES
    }

    fn open(&self, _before: Before, shutter: Option<Box<dyn Shutter>>) -> Result<OpenCamera, RigError> {
        FolderCamera::open(self, shutter).map(OpenCamera::of)
    }
}

impl Settings {
    fn describe(&self) -> String {
        format!("pictures that appear in {}", self.path.display())
    }
}

/// A camera whose pictures appear in a folder.
pub struct FolderCamera {
    settings: Settings,
    /// What releases it; without one whoever waits for the run does.
    shutter: Option<Box<dyn Shutter>>,
}

impl FolderCamera {
    /// Opens the camera; `shutter` releases it where there is one.
    ///
    /// # Errors
    /// [`RigError`] for a setting that makes no sense, and for a folder that can't be read.
    pub fn open(settings: &Settings, shutter: Option<Box<dyn Shutter>>) -> Result<Self, RigError> {
        settings.check()?;
        let camera = Self { settings: settings.clone(), shutter };
        camera.names()?;
        Ok(camera)
    }

    /// Names of the files that are there. Hidden ones are another program's own business.
    fn names(&self) -> Result<BTreeSet<String>, RigError> {
        let told = |e: Error| {
            RigError::fault(
                format!("folder.path {} can't be read: {e}", self.settings.path.display()),
                remedy(&e),
            )
        };
        let mut names = BTreeSet::new();
        for entry in fs::read_dir(&self.settings.path).map_err(told)? {
            let name = entry.map_err(told)?.file_name();
            names.extend(name.into_string().ok().filter(|name| !name.starts_with('.')));
        }
        Ok(names)
    }

    /// The next picture beside the files that were there before, once it is whole.
    fn picture(&self, before: &BTreeSet<String>) -> Result<Frame, RigError> {
        let end = Instant::now() + Duration::from_secs_f64(self.settings.shot_s);
        let quiet = Duration::from_secs_f64(self.settings.quiet_s);
        let mut rests = (Vec::new(), Instant::now());
        loop {
            let new: Vec<(String, u64)> = (self.names()?.difference(before))
                .filter_map(|name| Some((name.clone(), size(&self.settings.path.join(name))?)))
                .collect();
            if new != rests.0 {
                rests = (new, Instant::now());
            }
            let mut unfinished = None;
            if rests.1.elapsed() >= quiet && !rests.0.is_empty() {
                match self.exposure(&rests.0)? {
                    Ok(frame) => return Ok(frame),
                    Err(why) => unfinished = Some(why),
                }
            }
            if Instant::now() >= end {
                let came = unfinished.unwrap_or_else(|| match &rests.0[..] {
                    [] => "no new file".to_owned(),
                    new => format!("only files that are still being written ({})", listed(new)),
                });
                return Err(self.suspended(format!(
                    "{came} came into {} within {} s",
                    self.settings.path.display(),
                    self.settings.shot_s
                )));
            }
            std::thread::sleep(BETWEEN_LOOKS);
        }
    }

    /// The picture among an exposure's files and the others beside it; or why it is none yet.
    fn exposure(&self, files: &[(String, u64)]) -> Result<Result<Frame, String>, RigError> {
        let pictures: Vec<&str> = files
            .iter()
            .map(|(name, _)| name.as_str())
            .filter(|n| PICTURES.contains(&&*extension(n)))
            .collect();
        let name = match pictures[..] {
            [] => return Ok(Err(format!("no JPEG, PNG or TIFF file, only {},", listed(files)))),
            [name] => name,
            // Nobody could tell which of them shows the grain as it stands.
            _ => {
                return Err(
                    self.suspended(format!("more than one new picture came: {}", pictures.join(", ")))
                );
            }
        };
        let read = |name: &str| self.read(name);
        let bytes = match read(name) {
            Ok(bytes) => bytes,
            Err(e) => return Ok(Err(format!("{name}, which can't be read ({e}),"))),
        };
        let encoding = match (Encoding::sniff(&bytes), Photograph::open(&bytes)) {
            (Some(encoding), Ok(_)) => encoding,
            (_, Err(why)) => {
                return Ok(Err(format!(
                    "{name} of {} bytes, which is no whole picture ({why}),",
                    bytes.len()
                )));
            }
            (None, Ok(_)) => return Ok(Err(format!("{name}, which is no JPEG, PNG or TIFF file,"))),
        };
        let mut frame = Frame::new(bytes, encoding);
        for (other, _) in files.iter().filter(|(other, _)| other != name && stem(other) == stem(name)) {
            match read(other) {
                Ok(bytes) => frame.others.push(OtherFile { extension: extension(other), bytes }),
                Err(e) => return Ok(Err(format!("{other}, which can't be read ({e}),"))),
            }
        }
        Ok(Ok(frame))
    }

    fn read(&self, name: &str) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        // Whatever takes the place of a plain file meanwhile is not waited for.
        let flags = (OFlags::NOFOLLOW | OFlags::NONBLOCK).bits().cast_signed();
        let file =
            fs::OpenOptions::new().read(true).custom_flags(flags).open(self.settings.path.join(name))?;
        file.take(LARGEST).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    fn suspended(&self, cause: String) -> RigError {
        let retry = Duration::from_secs_f64(self.settings.suspend_s);
        RigError::Suspended { cause, remedy: LOOK_THERE.to_owned(), retry }
    }
}

/// The size of a plain file of at most [`LARGEST`] bytes; nothing else is waited for or opened.
fn size(path: &Path) -> Option<u64> {
    let about = path.symlink_metadata().ok()?;
    (about.is_file() && about.len() <= LARGEST).then_some(about.len())
}

fn listed(files: &[(String, u64)]) -> String {
    files.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ")
}

/// A file's name without its ending.
fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// The ending of a file's name in small letters, as it may stand in ours.
fn extension(name: &str) -> String {
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending).to_ascii_lowercase();
    let fits =
        (1..=LONGEST_EXTENSION).contains(&ending.len()) && ending.bytes().all(|b| b.is_ascii_alphanumeric());
    if fits { ending } else { "bin".to_owned() }
}

impl Camera for FolderCamera {
    fn capture(&mut self) -> Result<Frame, RigError> {
        let before = self.names()?;
        if let Some(shutter) = &mut self.shutter {
            shutter.release()?;
        } else {
            // Whoever is to release it must know when.
            let folder = self.settings.path.display();
            tracing::warn!("release the shutter: a new picture is waited for in {folder}");
        }
        self.picture(&before)
    }

    fn describe(&self) -> String {
        self.settings.describe()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(folder: &Path) -> FolderCamera {
        // One look: what is not there then does not come.
        let settings = Settings { path: folder.into(), shot_s: 0.0, quiet_s: 0.0, ..Settings::default() };
        FolderCamera::open(&settings, None).unwrap()
    }

    fn png(shade: u8) -> Vec<u8> {
        let mut out = std::io::Cursor::new(Vec::new());
        let picture = image::GrayImage::from_pixel(16, 16, image::Luma([shade]));
        image::DynamicImage::from(picture).write_to(&mut out, image::ImageFormat::Png).unwrap();
        out.into_inner()
    }

    fn cause(refused: Result<Frame, RigError>) -> String {
        match refused {
            Err(RigError::Suspended { cause, remedy, .. }) if remedy == LOOK_THERE => cause,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_picture_counts_once_it_is_new_and_whole() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, bytes: &[u8]| fs::write(dir.path().join(name), bytes).unwrap();
        let camera = camera(dir.path());
        put("old.png", &png(1));
        let before = camera.names().unwrap();
        let where_and_when = format!("came into {} within 0 s", dir.path().display());
        assert_eq!(cause(camera.picture(&before)), format!("no new file {where_and_when}"));
        // The other program's own files, folders and links are no pictures.
        put(".new.png", &png(2));
        fs::create_dir(dir.path().join("new.png")).unwrap();
        std::os::unix::fs::symlink("old.png", dir.path().join("link.png")).unwrap();
        assert_eq!(cause(camera.picture(&before)), format!("no new file {where_and_when}"));
        let whole = png(3);
        put("view.png", &whole[..whole.len() / 2]);
        let told = cause(camera.picture(&before));
        assert!(told.contains("view.png of") && told.contains("no whole picture"), "{told}");
        put("view.png", &whole);
        assert_eq!(camera.picture(&before).unwrap(), Frame::new(whole, Encoding::Png));
    }

    #[test]
    fn raw_files_are_kept_beside_the_picture_of_their_name_and_two_pictures_are_none() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, bytes: &[u8]| fs::write(dir.path().join(name), bytes).unwrap();
        let camera = camera(dir.path());
        let before = camera.names().unwrap();
        put("IMG_7.CR2", b"II*\0");
        let told = cause(camera.picture(&before));
        assert!(told.starts_with("no JPEG, PNG or TIFF file, only IMG_7.CR2,"), "{told}");
        put("IMG_7.PNG", &png(7));
        put("notes.txt", b"another program's");
        let raw = OtherFile { extension: "cr2".into(), bytes: b"II*\0".to_vec() };
        assert_eq!(camera.picture(&before).unwrap().others, [raw]);
        put("IMG_8.PNG", &png(8));
        let told = cause(camera.picture(&before));
        assert_eq!(told, "more than one new picture came: IMG_7.PNG, IMG_8.PNG");
    }

    #[test]
    fn settings_that_make_no_sense_and_a_folder_that_is_not_there_are_refused() {
        let d = || Settings { path: "/tmp".into(), ..Settings::default() };
        d().check().unwrap();
        for bad in [
            Settings::default(),
            Settings { shot_s: 0.5, ..d() },
            Settings { quiet_s: f64::NAN, ..d() },
            Settings { suspend_s: 1e9, ..d() },
        ] {
            let text = bad.check().unwrap_err().to_string();
            assert!(text.starts_with("folder.") && text.contains("; set "), "{text}");
        }
        let absent = Settings { path: "/nonexistent".into(), ..d() };
        let text = FolderCamera::open(&absent, None).err().unwrap().to_string();
        assert!(text.contains("/nonexistent can't be read") && text.contains("check the path"), "{text}");
    }
}
