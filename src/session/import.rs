//! A folder of photographs becomes a session.
//!
//! Everything is looked at before anything is written, and the session appears whole or not at all.

use super::disk::{check_space, sha256_hex};
use super::event::{EventKind, Role};
use super::manifest::{ArchivedFile, Manifest, Origin, Plan, PlannedView, required_bytes};
use super::name::few;
use super::open::read_named;
use super::pattern::Pattern;
use super::picture::{FILE_LIMIT, PictureFault, Size, decode_check};
use super::{Session, SessionError, Store, cameras};
use crate::rig::{Encoding, Frame};
use grainrig_core::geometry::{Angle, Projection};
use serde::{Deserialize, Serialize};
use std::cmp::Ordering;
use std::path::{Path, PathBuf};

/// Longest camera file, bytes: 100,000 cameras.
const CAMERAS_LIMIT: u64 = 64 << 20;

/// Which way the grain turned, seen from above.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, utoipa::ToSchema, clap::ValueEnum,
)]
#[serde(rename_all = "lowercase")]
pub enum Rotation {
    /// Counter-clockwise: stage angles grow.
    #[default]
    Ccw,
    /// Clockwise: stage angles fall.
    Cw,
}

/// What is to be imported.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportRequest {
    /// The folder; its sub-folders are not looked at.
    pub folder: PathBuf,
    /// Glob over file names, such as `grain_*.png`.
    pub pattern: String,
    /// Angle between two views, degrees, above 0.
    pub step_deg: f64,
    /// Stage angle of the first view, degrees.
    pub first_deg: f64,
    /// Which way the grain turned.
    pub rotation: Rotation,
    /// Which of the pictures, in order and from 0, is the view half a turn after the first.
    pub closing_view: Option<usize>,
    /// A picture without the grain; left out of the views where the pattern matches it too.
    pub background: Option<PathBuf>,
    /// A camera for each picture: see [`cameras`].
    pub cameras: Option<PathBuf>,
}

impl ImportRequest {
    /// All pictures of a folder that match a pattern, 7.2° apart counter-clockwise from 0°.
    pub fn new(folder: impl Into<PathBuf>, pattern: impl Into<String>) -> Self {
        Self {
            folder: folder.into(),
            pattern: pattern.into(),
            step_deg: 7.2,
            first_deg: 0.0,
            rotation: Rotation::Ccw,
            closing_view: None,
            background: None,
            cameras: None,
        }
    }
}

/// Photographs that were looked at and can be imported.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// The photographs, in the order of the views.
    pub images: Vec<SourceImage>,
    /// The picture without the grain.
    pub background: Option<SourceImage>,
    /// Size of every picture.
    pub size: Size,
    /// The plan that they make.
    pub plan: Plan,
    /// A camera for each photograph, by file name, in the same order; empty where no camera file was given.
    pub cameras: Vec<(String, Projection)>,
}

/// A photograph that was looked at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceImage {
    /// Where it lies.
    pub path: PathBuf,
    /// Its file name.
    pub name: String,
    /// What kind of file it is.
    pub encoding: Encoding,
    /// Its size.
    pub bytes: u64,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
}

/// Finds and decodes the photographs of a request; writes nothing.
///
/// # Errors
/// [`SessionError`] that names the setting or the file, its value, the limit and what to do.
pub fn scan(request: &ImportRequest) -> Result<Scan, SessionError> {
    check_settings(request)?;
    let paths = matching(&request.folder, &request.pattern, request.background.as_deref())?;
    let plan = plan(request, paths.len())?;
    let Photographs { images, background, size } = look_at_all(paths, request.background.as_deref())?;
    let cameras = match &request.cameras {
        Some(path) => {
            let bytes = read_named(path, CAMERAS_LIMIT)?;
            let no_text = |e| std::io::Error::new(std::io::ErrorKind::InvalidData, e);
            let text =
                String::from_utf8(bytes).map_err(no_text).map_err(SessionError::io("read", path, 0))?;
            let names: Vec<&str> = images.iter().map(|i| i.name.as_str()).collect();
            cameras::parse(&text, &names, size)?
        }
        None => Vec::new(),
    };
    Ok(Scan { images, background, size, plan, cameras })
}

/// Photographs of a folder that were looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct Photographs {
    /// The photographs, in the order of the numbers in their names; at least one.
    pub images: Vec<SourceImage>,
    /// The picture without the grain.
    pub background: Option<SourceImage>,
    /// Size of every picture.
    pub size: Size,
}

/// Finds and decodes the photographs of a folder whose names match a glob; a background among them is left out.
///
/// # Errors
/// [`SessionError`] where none matches, or one cannot be used.
pub fn photographs(
    folder: &Path,
    pattern: &str,
    background: Option<&Path>,
) -> Result<Photographs, SessionError> {
    let paths = matching(folder, pattern, background)?;
    if paths.is_empty() {
        let there = "only the background picture does".to_owned();
        return Err(SessionError::NoMatch { folder: folder.to_owned(), pattern: pattern.to_owned(), there });
    }
    look_at_all(paths, background)
}

fn look_at_all(
    paths: Vec<(String, PathBuf)>,
    background: Option<&Path>,
) -> Result<Photographs, SessionError> {
    let mut size = None;
    let mut images = Vec::with_capacity(paths.len());
    for (name, path) in paths {
        let (image, found) = look_at(name, path, size)?;
        size = Some(found);
        images.push(image);
    }
    let background = match background {
        Some(path) => Some(look_at(path.display().to_string(), path.to_owned(), size)?.0),
        None => None,
    };
    Ok(Photographs { images, background, size: size.unwrap_or_default() })
}

impl Scan {
    /// Makes the session: copies the original bytes and journals each. `config` and `geometry` go into the
    /// manifest as they are.
    ///
    /// # Errors
    /// [`SessionError`] where the name is not allowed or taken, a file has changed since it was looked at, or
    /// the disk is full or fails; nothing is left of the session then.
    pub fn import(
        &self,
        store: &Store,
        name: &str,
        config: serde_json::Value,
        geometry: serde_json::Value,
    ) -> Result<Session, SessionError> {
        let mut manifest = Manifest::new(name, Origin::Import, self.plan.clone(), config);
        manifest.geometry = geometry;
        manifest.sources = self.images.iter().map(|i| i.name.clone()).collect();
        manifest.background = self.background.as_ref().map(|b| ArchivedFile {
            file: format!("background.{}", b.encoding.extension()),
            bytes: b.bytes,
            sha256: b.sha256.clone(),
        });
        store.folder(name)?;
        let total: u64 = self.images.iter().chain(&self.background).map(|i| i.bytes).sum();
        check_space(store.data(), required_bytes(1, total))?;
        let mut staged = store.stage(&manifest)?;
        let session = staged.session();
        if let (Some(source), Some(archived)) = (&self.background, &manifest.background) {
            session.archive(&archived.file, &source.read()?.bytes)?;
        }
        let views = self.images.len();
        session.append(EventKind::Started { session: name.to_owned(), views, already_captured: 0 })?;
        for (view, (image, planned)) in self.images.iter().zip(&self.plan.views).enumerate() {
            session.record_frame(view, Angle::from_deg(planned.angle_deg), &image.read()?, None)?;
        }
        session.append(EventKind::AcquisitionComplete { views })?;
        staged.publish()
    }
}

impl SourceImage {
    /// The file's bytes, the same that were looked at.
    ///
    /// # Errors
    /// [`SessionError`] where the file cannot be read any more, or has changed.
    pub fn read(&self) -> Result<Frame, SessionError> {
        let bytes = read_named(&self.path, FILE_LIMIT)?;
        let found = sha256_hex(&bytes);
        if found != self.sha256 {
            let recorded = self.sha256.clone();
            return Err(SessionError::Changed { path: self.path.clone(), found, recorded });
        }
        Ok(Frame::new(bytes, self.encoding))
    }
}

fn setting(setting: &'static str, value: &dyn ToString, remedy: &str) -> SessionError {
    SessionError::Setting { setting, value: value.to_string(), remedy: remedy.to_owned() }
}

fn check_settings(request: &ImportRequest) -> Result<(), SessionError> {
    if !(request.step_deg > 0.0 && request.step_deg <= 180.0) {
        let remedy =
            "set more than 0° and at most 180°; for a grain that turned clockwise set the rotation to cw";
        return Err(setting("step_deg", &format!("{}°", request.step_deg), remedy));
    }
    if !(-360.0..=360.0).contains(&request.first_deg) {
        return Err(setting("first_deg", &format!("{}°", request.first_deg), "set −360° to 360°"));
    }
    Ok(())
}

/// The files of a folder that match a glob, without the background, sorted naturally by name.
fn matching(
    folder: &Path,
    pattern: &str,
    background: Option<&Path>,
) -> Result<Vec<(String, PathBuf)>, SessionError> {
    let glob = Pattern::new(pattern)?;
    let mut names: Vec<String> = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(SessionError::io("list", folder, 0))? {
        let entry = entry.map_err(SessionError::io("list", folder, 0))?;
        // Only plain files, or links to them: a pipe would keep the reader for ever.
        if entry.path().is_file()
            && let Ok(name) = entry.file_name().into_string()
        {
            names.push(name);
        }
    }
    names.sort_by(|a, b| natural(a, b));
    let (found, others): (Vec<_>, Vec<_>) = names.into_iter().partition(|n| glob.matches(n));
    if found.is_empty() {
        let there = match others.len() {
            0 => "it has no files".to_owned(),
            n => format!("it has {n} files: {}", few(others.iter().map(String::as_str))),
        };
        let (folder, pattern) = (folder.to_owned(), pattern.to_owned());
        return Err(SessionError::NoMatch { folder, pattern, there });
    }
    let background = background.and_then(|p| p.canonicalize().ok());
    let paths = found.into_iter().map(|n| (n.clone(), folder.join(n)));
    Ok(paths.filter(|(_, p)| background.is_none() || p.canonicalize().ok() != background).collect())
}

fn plan(request: &ImportRequest, images: usize) -> Result<Plan, SessionError> {
    if images < 2 {
        return Err(setting("number of pictures", &images, "at least 2 are needed; widen the pattern"));
    }
    if let Some(closing) = request.closing_view.filter(|&c| c >= images) {
        let remedy = format!("the pictures are numbered 0 to {}", images - 1);
        return Err(setting("closing_view", &closing, &remedy));
    }
    let sign = match request.rotation {
        Rotation::Ccw => 1.0,
        Rotation::Cw => -1.0,
    };
    let mut grain_views = 0_u32;
    let view = |index| {
        let closing = request.closing_view == Some(index);
        let turned_deg = if closing {
            180.0
        } else {
            grain_views += 1;
            f64::from(grain_views - 1) * request.step_deg
        };
        let angle_deg = ((request.first_deg + sign * turned_deg) * 1e9).round() / 1e9;
        let role = if closing { Role::Closing } else { Role::Grain };
        PlannedView { index, role, angle_deg, steps: None }
    };
    // The angles are what was asked for: there is no reading to compare with.
    let tolerance_deg = 0.5 * request.step_deg;
    Ok(Plan { views: (0..images).map(view).collect(), settle_ms: 0, retakes: 0, tolerance_deg })
}

fn look_at(name: String, path: PathBuf, others: Option<Size>) -> Result<(SourceImage, Size), SessionError> {
    let fail = |fault| SessionError::Picture { file: path.display().to_string(), fault };
    let bytes = match read_named(&path, FILE_LIMIT) {
        Err(SessionError::TooLong { bytes, .. }) => return Err(fail(PictureFault::TooLarge { bytes })),
        other => other?,
    };
    let (encoding, size) = decode_check(&bytes, others).map_err(fail)?;
    let sha256 = sha256_hex(&bytes);
    Ok((SourceImage { path, name, encoding, bytes: bytes.len() as u64, sha256 }, size))
}

/// Orders names as a person does: runs of digits by their number, of any length.
fn natural(a: &str, b: &str) -> Ordering {
    let (mut x, mut y) = (a.as_bytes(), b.as_bytes());
    while let (Some(&p), Some(&q)) = (x.first(), y.first()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n) = (number(&mut x), number(&mut y));
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
        } else {
            (x, y) = (&x[1..], &y[1..]);
            p.cmp(&q)
        };
        if order.is_ne() {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

/// Takes the digits off the front; without leading zeros.
fn number<'a>(text: &mut &'a [u8]) -> &'a [u8] {
    let end = text.iter().position(|b| !b.is_ascii_digit()).unwrap_or(text.len());
    let (digits, rest) = text.split_at(end);
    *text = rest;
    &digits[digits.iter().position(|&b| b != b'0').unwrap_or(digits.len())..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_as_a_person_sorts_them() {
        let mut names =
            ["v10.png", "v9.png", "v1.png", "w.png", "v010b.png", "v99999999999999999999999.png", "v2"];
        names.sort_by(|a, b| natural(a, b));
        let want =
            ["v1.png", "v2", "v9.png", "v10.png", "v010b.png", "v99999999999999999999999.png", "w.png"];
        assert_eq!(names, want);
    }

    #[test]
    fn the_closing_view_takes_no_place_among_the_others() {
        let mut request = ImportRequest::new("x", "*");
        request.closing_view = Some(2);
        request.rotation = Rotation::Cw;
        request.first_deg = 10.0;
        let angles: Vec<f64> = plan(&request, 4).unwrap().views.iter().map(|v| v.angle_deg).collect();
        assert_eq!(angles, [10.0, 2.8, -170.0, -4.4]);
    }
}
