//! The camera itself, through libgphoto2.

use super::super::message::{Failure, FailureKind, Reply};
use super::super::settings::{Settings, Target, seconds};
use super::NamedFile;
use super::control::{self, drain, failure};
use super::files::fetch;
use crate::rig::holder::{holder, usb_device};
use gphoto2::camera::CameraEvent;
use gphoto2::list::CameraDescriptor;
use gphoto2::widget::Widget;
use gphoto2::{Camera, Context};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// How long each look for events takes at most. The library asks a Canon, then sleeps for 50 ms or up to this, and asks again:
/// so this is how late a picture may be noticed.
const LOOK: Duration = Duration::from_millis(10);
/// Part of the time for a picture after which no file is waited for any more: what remains is for fetching.
const WAITING_SHARE: f64 = 0.7;
/// A card with less room than a large picture takes is full.
const LEAST_FREE: u64 = 32 << 20;
/// How much longer than the usual rest a file is waited for that the exposure before had and this one lacks.
const LATE: u32 = 8;

/// An open camera.
pub(super) struct Body {
    context: Context,
    camera: Camera,
    settings: Settings,
    /// What the camera has settings for.
    names: BTreeSet<String>,
    /// Folder and name of each file of the last picture.
    delivered: Vec<(String, String)>,
    /// Files of the first exposure, and so of every later one.
    usual: Option<usize>,
    /// Nothing has been taken since it was opened in good order.
    untouched: bool,
}

impl Body {
    /// Finds and opens the camera.
    pub(super) fn open(settings: Settings, after_failure: bool) -> Result<(Self, Reply), Failure> {
        let context = Context::new().map_err(|e| failure("begin", &e))?;
        let (camera, port) = find(&context, &settings)?;
        let names = control::names(&camera)?;
        let model = known(&camera, &names, "cameramodel")?;
        let serial = known(&camera, &names, "serialnumber")?;
        let body = Self {
            context,
            camera,
            settings,
            names,
            delivered: Vec::new(),
            usual: None,
            untouched: !after_failure,
        };
        body.end_live_view(true)?;
        body.choose_target()?;
        body.prepare()?;
        let library = gphoto2::library_version().unwrap_or("of unknown version").to_owned();
        Ok((body, Reply::Opened { model, serial, port, library }))
    }

    /// Takes a picture and fetches its files; and what is worth a line in the log.
    pub(super) fn capture(&mut self) -> Result<(Vec<NamedFile>, Vec<String>), Failure> {
        let began = Instant::now();
        let notes = self.ready()?;
        let released = self.trigger();
        Ok((self.deliver(released, began, "the camera was released")?, notes))
    }

    /// The shutter was released from elsewhere: the files of that exposure.
    pub(super) fn released(&mut self) -> Result<Vec<NamedFile>, Failure> {
        self.deliver(Ok(()), Instant::now(), "the camera was released by the controller")
    }

    /// Makes everything as it must be for a picture; what is worth a line in the log.
    pub(super) fn ready(&mut self) -> Result<Vec<String>, Failure> {
        // A release that nobody waited for has left its events; a camera just opened is not to be bothered.
        let left = if self.untouched { Vec::new() } else { drain(&self.camera, Duration::from_millis(1))? };
        self.untouched = false;
        let mut notes: Vec<String> =
            left.iter().map(|(_, name)| format!("{name} is of an earlier release and is not used")).collect();
        self.end_live_view(false)?;
        notes.extend(self.prepare()?);
        Ok(notes)
    }

    /// The files of an exposure that was begun, or why there are none.
    fn deliver(
        &mut self,
        released: Result<(), Failure>,
        began: Instant,
        how: &str,
    ) -> Result<Vec<NamedFile>, Failure> {
        let until = began + seconds(self.settings.shot_s).mul_f64(WAITING_SHARE);
        self.delivered = match released.and_then(|()| self.collect(until, how)) {
            Ok(files) => files,
            Err(failure) => return Err(self.full().unwrap_or(failure)),
        };
        self.check_exposure()?;
        let fetched = self.delivered.iter().map(|(folder, name)| {
            let bytes = fetch(&self.camera, &self.context, folder, name)?;
            Ok((name.clone(), bytes))
        });
        fetched.collect()
    }

    /// A picture of live view, and nothing to be said of it. Live view stays on until a picture is taken.
    pub(super) fn preview(&mut self) -> Result<(Vec<NamedFile>, Vec<String>), Failure> {
        self.untouched = false;
        let failed = |e| failure("show live view", &e);
        let shown = self.camera.capture_preview().wait().map_err(|e| match e.kind() {
            gphoto2::error::ErrorKind::NotSupported => Failure::new(
                FailureKind::Unsupported,
                "this camera has no live view that the library can show",
            ),
            _ => failed(e),
        })?;
        let bytes = Vec::from(shown.get_data(&self.context).wait().map_err(failed)?);
        Ok((vec![("preview.jpg".to_owned(), bytes)], Vec::new()))
    }

    /// Live view that was shown is ended: the mirror comes down.
    pub(super) fn leave(&self) {
        if let Err(failure) = self.end_live_view(false) {
            eprintln!("live view stays on: {}", failure.cause);
        }
    }

    /// The last picture is durable: the camera forgets it.
    pub(super) fn kept(&mut self) {
        for (folder, name) in std::mem::take(&mut self.delivered) {
            // What was held in its RAM is forgotten by the camera already, and by the library only so.
            if (self.settings.delete || self.settings.target == Target::Ram)
                && let Err(e) = self.camera.fs().delete_file(&folder, &name).wait()
            {
                eprintln!("{name} stays on the camera: {e}");
            }
        }
    }

    fn has(&self, name: &str) -> bool {
        self.names.contains(name)
    }

    /// Live view leaves the mirror up, and the next still fails. At the beginning nobody knows whether it is on.
    fn end_live_view(&self, anyway: bool) -> Result<(), Failure> {
        if !self.has("viewfinder") {
            return Ok(());
        }
        if let Widget::Toggle(toggle) = control::fresh(&self.camera, "viewfinder")?
            && (anyway || toggle.toggled() != Some(false))
        {
            toggle.set_toggled(false);
            self.camera.set_config(&toggle).wait().map_err(|e| failure("end live view", &e))?;
        }
        Ok(())
    }

    /// Pictures go to the card or to RAM: by what the choices are called, as makers call them otherwise.
    fn choose_target(&self) -> Result<(), Failure> {
        if !self.has("capturetarget") {
            return Ok(());
        }
        let wanted = match self.settings.target {
            Target::Card => "card",
            Target::Ram => "ram",
        };
        let choices = control::choices(&control::fresh(&self.camera, "capturetarget")?);
        let choice = choices.iter().find(|c| c.to_ascii_lowercase().contains(wanted)).ok_or_else(|| {
            let cause = format!("the camera has no target {wanted:?}, only {}", choices.join(", "));
            Failure::new(FailureKind::Setting, cause)
        })?;
        control::assert(&self.camera, "capturetarget", choice).map(|_| ())
    }

    /// Everything is set as it must be; what was otherwise, where it should not have been.
    fn prepare(&self) -> Result<Vec<String>, Failure> {
        let mut notes = Vec::new();
        for (name, wanted) in &self.settings.require {
            let is = known(&self.camera, &self.names, self.must_have(name)?)?;
            if is != *wanted {
                let cause = format!("the camera's {name} is {is:?}, {wanted:?} is required");
                return Err(Failure::new(FailureKind::Setting, cause));
            }
        }
        for (name, wanted) in &self.settings.set {
            if let Some(before) = control::assert(&self.camera, self.must_have(name)?, wanted)? {
                notes.push(format!("{name} was {before:?} and is {wanted:?} now"));
            }
        }
        Ok(notes)
    }

    fn must_have<'a>(&self, name: &'a str) -> Result<&'a str, Failure> {
        if self.has(name) {
            return Ok(name);
        }
        let cause = format!("the camera has no setting {name:?}; `gphoto2 --list-config` shows what it has");
        Err(Failure::new(FailureKind::Setting, cause))
    }

    /// Whether the picture was taken with what was set: a camera may change it by itself.
    fn check_exposure(&self) -> Result<(), Failure> {
        for (name, wanted) in &self.settings.set {
            let is = known(&self.camera, &self.names, name)?;
            if is != *wanted {
                let cause = format!("the camera's {name} was {is:?} at the exposure, {wanted:?} was set");
                return Err(Failure::new(FailureKind::BadPicture, cause));
            }
        }
        Ok(())
    }

    /// Releases the shutter; a camera that is busy is asked again for a while.
    fn trigger(&self) -> Result<(), Failure> {
        let end = Instant::now() + seconds(self.settings.busy_s);
        loop {
            match self.press() {
                Err(busy) if busy.kind == FailureKind::Busy => {
                    if Instant::now() > end {
                        let cause = format!("the camera says that it is busy for {} s", self.settings.busy_s);
                        return Err(Failure::new(FailureKind::Busy, cause));
                    }
                    drain(&self.camera, LOOK)?;
                }
                other => return other,
            }
        }
    }

    /// That the card is full, where it is: a release that fails for this reason does not say so.
    fn full(&self) -> Option<Failure> {
        if self.settings.target == Target::Ram {
            return None;
        }
        let stores = self.camera.storages().wait().ok()?;
        // Bytes, whatever the crate calls them.
        let most = stores.iter().filter_map(gphoto2::filesys::StorageInfo::free_kb).max()?;
        let cause = || format!("the camera's card is full: it has {} MB left", most / 1_000_000);
        (most < LEAST_FREE).then(|| Failure::new(FailureKind::Full, cause()))
    }

    fn press(&self) -> Result<(), Failure> {
        if !(self.settings.release_at_once && self.has("eosremoterelease")) {
            return self.camera.trigger_capture().wait().map_err(|e| failure("release its shutter", &e));
        }
        for button in ["Immediate", "Release Full"] {
            if let Widget::Radio(radio) = control::fresh(&self.camera, "eosremoterelease")? {
                radio.set_choice(button).map_err(|e| failure(button, &e))?;
                self.camera.set_config(&radio).wait().map_err(|e| failure("release its shutter", &e))?;
            }
        }
        Ok(())
    }

    /// Takes events until the camera is done and no further file comes.
    ///
    /// How many files an exposure makes shows the first one, for which a rest is waited out. From then on that number
    /// and the camera's word end the wait, and a file that is missing is waited for longer.
    fn collect(&mut self, end: Instant, how: &str) -> Result<Vec<(String, String)>, Failure> {
        let rest = seconds(self.settings.quiet_s);
        let (mut files, mut complete, mut last) = (Vec::new(), false, Instant::now());
        loop {
            let due = self.usual.map_or(1, |usual| usual);
            let all = files.len() >= due;
            let patience = if all { rest } else { rest * LATE };
            let quiet = last.elapsed() >= patience && !files.is_empty();
            if (complete && all && self.usual.is_some()) || quiet {
                break;
            }
            let now = Instant::now();
            if now >= end {
                if !files.is_empty() {
                    break;
                }
                let after = seconds(self.settings.shot_s).mul_f64(WAITING_SHARE).as_secs_f64();
                let cause = format!("{how} and made no file within {after:.1} s");
                return Err(Failure::new(FailureKind::NoPicture, cause));
            }
            let look = LOOK.min(end - now);
            match self.camera.wait_event(look).wait().map_err(|e| failure("tell its events", &e))? {
                CameraEvent::NewFile(path) => {
                    files.push((path.folder().into_owned(), path.name().into_owned()));
                    last = Instant::now();
                }
                CameraEvent::CaptureComplete => {
                    complete = true;
                    last = Instant::now();
                }
                _ => {}
            }
        }
        self.usual.get_or_insert(files.len());
        Ok(files)
    }
}

/// The value of a setting, where the camera has it.
fn known(camera: &Camera, names: &BTreeSet<String>, name: &str) -> Result<String, Failure> {
    if names.contains(name) { Ok(control::value(&control::fresh(camera, name)?)) } else { Ok(String::new()) }
}

/// The camera of the settings, and its port.
fn find(context: &Context, settings: &Settings) -> Result<(Camera, String), Failure> {
    let found: Vec<CameraDescriptor> = if settings.port.is_empty() {
        context.list_cameras().wait().map_err(|e| failure("be found", &e))?.collect()
    } else {
        vec![CameraDescriptor { model: settings.model.clone(), port: settings.port.clone() }]
    };
    let fits = |d: &&CameraDescriptor| settings.model.is_empty() || d.model == settings.model;
    let fitting: Vec<&CameraDescriptor> = found.iter().filter(fits).collect();
    let all = || found.iter().map(|d| format!("{} at {}", d.model, d.port)).collect::<Vec<_>>().join(", ");
    let asked = if settings.model.is_empty() { "any camera" } else { settings.model.as_str() };
    let absent = |why: &str| {
        let there = if found.is_empty() { "none is there".to_owned() } else { format!("there is {}", all()) };
        Failure::new(FailureKind::Absent, format!("{asked} is looked for, {there}{why}"))
    };
    if settings.serial.is_empty() && fitting.len() > 1 {
        return Err(absent("; set gphoto2.serial"));
    }
    let mut last = absent("");
    for descriptor in fitting {
        let open = || -> Result<(Camera, String), Failure> {
            let at = format!("open at {}", descriptor.port);
            let camera = context.get_camera(descriptor).wait().map_err(|e| failure(&at, &e))?;
            let names = control::names(&camera)?;
            Ok((camera.clone(), known(&camera, &names, "serialnumber")?))
        };
        match open() {
            Ok((camera, serial)) if settings.serial.is_empty() || serial == settings.serial => {
                return Ok((camera, descriptor.port.clone()));
            }
            Ok((_, serial)) => {
                last = absent(&format!(" with serial number {serial}, {} is set", settings.serial));
            }
            Err(mut failure) => {
                if failure.kind == FailureKind::Claimed
                    && let Some(who) = usb_device(&descriptor.port).and_then(|device| holder(&device))
                {
                    failure.cause = format!("{}; {who} holds it", failure.cause);
                }
                last = failure;
            }
        }
    }
    Err(last)
}
