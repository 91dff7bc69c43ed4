//! The video camera as the acquisition sees it: it delivers a picture, or says what is to be done.

#[cfg(feature = "v4l")]
use super::device::Device;
use super::settings::Settings;
#[cfg(not(feature = "v4l"))]
use super::without::Device;
use crate::rig::{Camera, Frame, RigError};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

/// Why the device gave no picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Trouble {
    /// What happened, with value and limit.
    pub cause: String,
    /// What to do.
    pub remedy: &'static str,
    /// Whether the device is to be opened anew before the next try.
    pub reopen: bool,
    /// Whether another try makes no sense.
    pub lasting: bool,
}

impl Trouble {
    /// Trouble that may pass, with a device that is still open.
    #[cfg_attr(not(feature = "v4l"), allow(dead_code))]
    pub(super) fn passing(cause: impl Into<String>, remedy: &'static str) -> Self {
        Self { cause: cause.into(), remedy, reopen: false, lasting: false }
    }
    /// Trouble with the device as a whole: it is opened anew.
    pub(super) fn device(cause: impl Into<String>, remedy: &'static str) -> Self {
        Self { reopen: true, ..Self::passing(cause, remedy) }
    }
    /// Trouble that only a person ends.
    pub(super) fn lasting(cause: impl Into<String>, remedy: &'static str) -> Self {
        Self { lasting: true, ..Self::device(cause, remedy) }
    }
}

/// A video camera.
pub struct V4lCamera {
    settings: Settings,
    owner: Option<Owner>,
    /// Given up once: it gets one try at a time.
    given_up: bool,
    description: String,
}

/// The thread that owns the device.
struct Owner {
    ask: Option<SyncSender<()>>,
    pictures: Receiver<Result<Frame, Trouble>>,
    /// Nothing is ever sent: it hangs up when the thread has closed the device.
    closed: Receiver<()>,
}

/// How long a device may take to close before another is opened in its place.
const CLOSING: Duration = Duration::from_secs(1);

impl Drop for Owner {
    fn drop(&mut self) {
        self.ask = None;
        let _ = self.closed.recv_timeout(CLOSING);
    }
}

/// What to do about a driver that answers nothing.
const STUCK: &str =
    "pull the camera's cable out and put it in again; where that does not help, restart the computer";

impl Owner {
    /// Opens the device on a thread of its own; the owner and how the device describes itself.
    fn start(settings: &Settings) -> Result<(Self, String), Trouble> {
        let (ask, asked) = sync_channel(1);
        let (answer, pictures) = sync_channel(1);
        let (told, opened) = sync_channel(1);
        let (closes, closed) = sync_channel(0);
        let own = settings.clone();
        let begun = std::thread::Builder::new().name("v4l2".into()).spawn(move || {
            // Dropped after the device.
            let _closes: SyncSender<()> = closes;
            let mut device = match Device::open(&own) {
                Ok(device) => device,
                Err(trouble) => return drop(told.send(Err(trouble))),
            };
            let mut goes_on = told.send(Ok(device.describe())).is_ok();
            // Whoever has lost patience is not there any more: then the device is closed.
            while goes_on && asked.recv().is_ok() {
                goes_on = answer.send(device.capture()).is_ok();
            }
        });
        let no_thread =
            |e| Trouble::device(format!("the camera's thread does not start: {e}"), "close other programs");
        begun.map_err(no_thread)?;
        let owner = Self { ask: Some(ask), pictures, closed };
        let description = within(&opened, settings.open_s, "open")??;
        Ok((owner, description))
    }

    fn capture(&self, settings: &Settings) -> Result<Frame, Trouble> {
        // Where the thread is gone, the answer tells.
        let _ = self.ask.as_ref().map(|ask| ask.send(()));
        within(&self.pictures, settings.shot_s, "deliver a picture")?
    }
}

fn within<T>(from: &Receiver<T>, limit_s: f64, what: &str) -> Result<T, Trouble> {
    from.recv_timeout(Duration::from_secs_f64(limit_s)).map_err(|e| match e {
        RecvTimeoutError::Timeout => {
            Trouble::device(format!("the video camera did not {what} within {limit_s} s"), STUCK)
        }
        RecvTimeoutError::Disconnected => {
            Trouble::device(format!("the video camera's driver failed while it was to {what}"), STUCK)
        }
    })
}

impl V4lCamera {
    /// Opens the camera that the settings name.
    ///
    /// # Errors
    /// [`RigError::Device`] for a setting that makes no sense, [`RigError::Suspended`] where there is no such camera, or
    /// it can't be set as asked.
    pub fn open(settings: &Settings) -> Result<Self, RigError> {
        settings.check()?;
        let mut camera =
            Self { settings: settings.clone(), owner: None, given_up: false, description: String::new() };
        camera.persist(|camera| camera.owner().map(|_| ()))?;
        Ok(camera)
    }

    fn owner(&mut self) -> Result<&Owner, Trouble> {
        if self.owner.is_none() {
            let (owner, description) = Owner::start(&self.settings)?;
            (self.owner, self.description) = (Some(owner), description);
        }
        self.owner.as_ref().ok_or_else(|| Trouble::device("the video camera is not open", STUCK))
    }

    fn persist<T>(
        &mut self,
        mut attempt: impl FnMut(&mut Self) -> Result<T, Trouble>,
    ) -> Result<T, RigError> {
        let mut waits = self.settings.retry_s.clone().into_iter();
        let mut tries = 0;
        loop {
            let trouble = match attempt(self) {
                Ok(done) => {
                    self.given_up = false;
                    return Ok(done);
                }
                Err(trouble) => trouble,
            };
            tries += 1;
            if trouble.reopen {
                self.owner = None;
            }
            let Some(wait) = waits.next().filter(|_| !trouble.lasting && !self.given_up) else {
                self.given_up = true;
                let often = if tries > 1 { format!(" ({tries} tries)") } else { String::new() };
                return Err(RigError::Suspended {
                    cause: trouble.cause + &often,
                    remedy: trouble.remedy.to_owned(),
                    retry: Duration::from_secs_f64(self.settings.suspend_s),
                });
            };
            tracing::warn!("{}; trying again in {wait} s", trouble.cause);
            std::thread::sleep(Duration::from_secs_f64(wait));
        }
    }
}

impl Camera for V4lCamera {
    fn capture(&mut self) -> Result<Frame, RigError> {
        self.persist(|camera| {
            let settings = camera.settings.clone();
            camera.owner()?.capture(&settings)
        })
    }

    fn describe(&self) -> String {
        self.description.clone()
    }
}
