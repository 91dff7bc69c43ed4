//! The camera as the acquisition sees it: it delivers a picture, or says what is to be done.

use super::message::{Failure, FailureKind, Reply, Request};
use super::policy;
use super::settings::{Settings, seconds};
use super::supervisor::Worker;
use crate::rig::{Camera, Encoding, Frame, OtherFile, RigError, Shutter};
use std::time::Instant;

pub use super::supervisor::Launch;

/// Longest ending of a camera's file name that is kept.
const LONGEST_EXTENSION: usize = 8;

/// A DSLR.
pub struct GphotoCamera {
    settings: Settings,
    launch: Launch,
    worker: Option<Worker>,
    /// What releases it, where that is not done over its own cable.
    shutter: Option<Box<dyn Shutter>>,
    /// A child failed since the last picture.
    after_failure: bool,
    /// How often in a row the camera was given up.
    suspensions: u32,
    /// As it describes itself.
    description: String,
}

impl GphotoCamera {
    /// Opens the camera that the settings name.
    ///
    /// # Errors
    /// [`RigError::Device`] for a setting that makes no sense, [`RigError::Suspended`] where there is no such camera, it
    /// does not answer, or it is not set as required.
    pub fn open(settings: &Settings, launch: Launch) -> Result<Self, RigError> {
        settings.check()?;
        let mut camera = Self {
            settings: settings.clone(),
            launch,
            worker: None,
            shutter: None,
            after_failure: false,
            suspensions: 0,
            description: String::new(),
        };
        camera.persist(|camera| camera.worker().map(|_| ()))?;
        Ok(camera)
    }

    /// The same camera, released from elsewhere: its files come over its own cable as before.
    #[must_use]
    pub fn released_by(mut self, shutter: Box<dyn Shutter>) -> Self {
        self.shutter = Some(shutter);
        self
    }

    /// The child with the camera open; started where there is none.
    fn worker(&mut self) -> Result<&mut Worker, Failure> {
        if self.worker.is_none() {
            self.worker = Some(self.start()?);
        }
        let gone = || Failure::new(FailureKind::Transport, "the camera's process is gone");
        self.worker.as_mut().ok_or_else(gone)
    }

    fn start(&mut self) -> Result<Worker, Failure> {
        let mut worker = Worker::start(&self.launch, seconds(self.settings.start_s))?;
        let settings = Box::new(self.settings.clone());
        let request = Request::Open { settings, after_failure: self.after_failure };
        let opened = worker.ask(&request, "open", seconds(self.settings.open_s)).inspect_err(|_| {
            worker.kill();
        })?;
        match opened {
            (Reply::Opened { model, serial, port, library }, _) => {
                self.description =
                    format!("{model}, serial number {}, {port}, libgphoto2 {library}", known(&serial));
                if !serial.is_empty() {
                    // It is this camera from now on, wherever it turns up: its USB port changes when it comes back.
                    self.settings.serial = serial;
                    if self.settings.port.starts_with("usb:") {
                        self.settings.port.clear();
                    }
                }
                Ok(worker)
            }
            (other, _) => {
                Err(Failure::new(FailureKind::Transport, format!("opening was answered by {other:?}")))
            }
        }
    }

    fn shot(&mut self) -> Result<Frame, Failure> {
        // Starting a child has its own time.
        self.worker()?;
        let end = Instant::now() + seconds(self.settings.shot_s);
        let request = if self.shutter.is_some() {
            self.release(end)?;
            Request::Collect
        } else {
            Request::Capture
        };
        self.picture(&request, end)
    }

    /// A picture of live view.
    fn show(&mut self) -> Result<Frame, Failure> {
        self.worker()?;
        self.picture(&Request::Preview, Instant::now() + seconds(self.settings.shot_s))
    }

    fn picture(&mut self, request: &Request, end: Instant) -> Result<Frame, Failure> {
        let left = end.saturating_duration_since(Instant::now());
        match self.worker()?.ask(request, "deliver a picture", left)? {
            (Reply::Shot { names, notes }, files) => {
                warn(&notes);
                frame(&names, files)
            }
            (other, _) => Err(out_of_turn(&other)),
        }
    }

    /// Has the camera get ready, and what releases it from elsewhere do so.
    fn release(&mut self, end: Instant) -> Result<(), Failure> {
        let left = end.saturating_duration_since(Instant::now());
        match self.worker()?.ask(&Request::Ready, "get ready", left)? {
            (Reply::Ready { notes }, _) => warn(&notes),
            (other, _) => return Err(out_of_turn(&other)),
        }
        let released = self.shutter.as_mut().map_or(Ok(()), |shutter| shutter.release());
        released.map_err(|e| Failure::new(FailureKind::Release, e.to_string()))
    }

    /// Tries something as often as its failures deserve. A camera that was given up gets one try.
    fn persist<T>(
        &mut self,
        mut attempt: impl FnMut(&mut Self) -> Result<T, Failure>,
    ) -> Result<T, RigError> {
        let mut tries = 0;
        loop {
            let failure = match attempt(self) {
                Ok(done) => {
                    (self.suspensions, self.after_failure) = (0, false);
                    return Ok(done);
                }
                Err(failure) => failure,
            };
            if policy::needs_new_child(failure.kind)
                && let Some(mut worker) = self.worker.take()
            {
                worker.kill();
                self.after_failure = true;
            }
            let waits = policy::waits(failure.kind, &self.settings);
            match waits.get(tries).filter(|_| self.suspensions == 0) {
                Some(wait) => {
                    tracing::warn!("{}; trying again in {} s", failure.cause, wait.as_secs_f64());
                    tries += 1;
                    std::thread::sleep(*wait);
                }
                None => return Err(self.given_up(&failure, tries + 1)),
            }
        }
    }

    fn given_up(&mut self, failure: &Failure, tries: usize) -> RigError {
        self.suspensions += 1;
        let often = if tries > 1 { format!(" ({tries} tries)") } else { String::new() };
        RigError::Suspended {
            cause: format!("{}{often}", failure.cause),
            remedy: policy::remedy(failure.kind).to_owned(),
            retry: policy::suspension(&self.settings, self.suspensions),
        }
    }
}

fn warn(notes: &[String]) {
    notes.iter().for_each(|note| tracing::warn!("camera: {note}"));
}

fn out_of_turn(reply: &Reply) -> Failure {
    Failure::new(FailureKind::Transport, format!("the camera's process answered something else: {reply:?}"))
}

/// A serial number, or that there is none.
fn known(serial: &str) -> &str {
    if serial.is_empty() { "not told" } else { serial }
}

/// The picture among an exposure's files, and the others beside it.
fn frame(names: &[String], mut files: Vec<Vec<u8>>) -> Result<Frame, Failure> {
    if names.len() != files.len() {
        let cause = format!("{} files were announced, {} came", names.len(), files.len());
        return Err(Failure::new(FailureKind::Transport, cause));
    }
    let picture = files.iter().position(|bytes| Encoding::sniff(bytes) == Some(Encoding::Jpeg));
    let picture = picture.ok_or_else(|| {
        Failure::new(FailureKind::BadPicture, format!("no JPEG came with {}", names.join(", ")))
    })?;
    let bytes = files.remove(picture);
    let others = names.iter().enumerate().filter(|(i, _)| *i != picture).map(|(_, name)| extension(name));
    let others = others.zip(files).map(|(extension, bytes)| OtherFile { extension, bytes }).collect();
    Ok(Frame { bytes, encoding: Encoding::Jpeg, others })
}

/// The ending of a camera's file name, as it may stand in ours.
fn extension(name: &str) -> String {
    let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending).to_ascii_lowercase();
    let fits =
        (1..=LONGEST_EXTENSION).contains(&ending.len()) && ending.bytes().all(|b| b.is_ascii_alphanumeric());
    if fits { ending } else { "bin".to_owned() }
}

impl Camera for GphotoCamera {
    fn capture(&mut self) -> Result<Frame, RigError> {
        self.persist(Self::shot)
    }

    fn preview(&mut self) -> Result<Frame, RigError> {
        self.persist(Self::show)
    }

    fn kept(&mut self) {
        // Nobody waits for it: the camera deletes while the stage turns. What fails shows at the next picture.
        if let Some(worker) = &mut self.worker
            && let Err(failure) = worker.tell(&Request::Kept)
        {
            tracing::warn!("the picture stays on the camera: {}", failure.cause);
        }
    }

    fn describe(&self) -> String {
        self.description.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JPEG: [u8; 5] = [0xff, 0xd8, 0xff, 0xe0, 0];

    #[test]
    fn the_jpeg_is_the_picture_wherever_it_stands_and_the_rest_is_kept_beside_it() {
        let names = ["IMG_1.CR2".to_owned(), "IMG_1.JPG".into()];
        let made = frame(&names, vec![b"II*\0".to_vec(), JPEG.to_vec()]).unwrap();
        let raw = OtherFile { extension: "cr2".into(), bytes: b"II*\0".to_vec() };
        assert_eq!((made.bytes, made.others), (JPEG.to_vec(), vec![raw]));
        let alone = frame(&names[..1], vec![b"II*\0".to_vec()]).unwrap_err();
        assert_eq!(alone.kind, FailureKind::BadPicture);
    }

    #[test]
    fn a_cameras_file_name_never_leads_out_of_the_session() {
        for name in ["x.../../etc", "x.", "x", "x.verylongending", "x.c/2", "x.ä"] {
            assert_eq!(extension(name), "bin", "{name}");
        }
        assert_eq!(extension("IMG_0001.CR2"), "cr2");
    }

    #[test]
    fn a_program_that_is_no_camera_process_is_an_error_with_a_remedy_and_no_hang() {
        let settings = Settings { retry_s: vec![0.0], start_s: 0.1, ..Settings::default() };
        // One ends at once, one says something else, one says nothing at all, one is not there.
        for program in ["/bin/true", "/bin/ls", "/bin/cat", "/nonexistent"] {
            let launch = Launch { program: program.into() };
            let Err(RigError::Suspended { cause, remedy, .. }) = GphotoCamera::open(&settings, launch) else {
                panic!("{program} opened")
            };
            assert!(cause.contains("2 tries") && remedy.contains("cable"), "{program}: {cause}; {remedy}");
        }
    }
}
