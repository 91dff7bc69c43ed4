//! Pictures that another program saves into a folder.

use crate::bench::Bench;
use crate::conformance::conforms;
use crate::kit::{Lab, VIEWS, pictures};
use grainrig::rig::folder::{FolderCamera, Settings};
use grainrig::rig::{RigError, Shutter};
use grainrig::session::State;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// The other program: saves a numbered picture, of which nobody sees a half, and what else the camera makes.
struct Tethering {
    folder: PathBuf,
    saved: usize,
}

impl Tethering {
    fn save(&mut self, scene: usize) {
        let put = |name: String, bytes: &[u8]| {
            let hidden = self.folder.join(format!(".{name}"));
            std::fs::write(&hidden, bytes).unwrap();
            std::fs::rename(hidden, self.folder.join(name)).unwrap();
        };
        put(format!("DSC_{:04}.NEF", self.saved), b"raw");
        put(format!("DSC_{:04}.JPG", self.saved), &pictures()[scene]);
        self.saved += 1;
    }
}

/// The camera's remote release: the picture of what is before it then is saved.
struct Release(Tethering, Arc<AtomicUsize>);

impl Shutter for Release {
    fn release(&mut self) -> Result<(), RigError> {
        self.0.save(self.1.load(Ordering::Relaxed));
        Ok(())
    }
}

#[test]
fn pictures_of_another_program_conform() {
    let lab = Lab::new();
    let folder = lab.path("tethered");
    std::fs::create_dir(&folder).unwrap();
    let mut other = Tethering { folder: folder.clone(), saved: 0 };
    // Somebody tried the camera before.
    other.save(3);
    let scene = Arc::new(AtomicUsize::new(0));
    let release = Box::new(Release(other, Arc::clone(&scene)));
    let settings = Settings { path: folder, quiet_s: 0.0, ..Settings::default() };
    let camera = Box::new(FolderCamera::open(&settings, Some(release)).unwrap());
    let set = move |n| scene.store(n, Ordering::Relaxed);
    conforms("folder", Bench { camera, set: Box::new(set) });
}

#[test]
fn a_run_asks_for_each_picture_and_archives_what_the_other_program_saved() {
    let lab = Lab::new();
    let folder = lab.path("tethered");
    std::fs::create_dir(&folder).unwrap();
    let path = format!("path = '{}'", folder.display());
    let rig = ["kind = 'hardware'", "stage = 'simulated'", "camera = 'folder'"].map(|line| ("rig", line));
    let camera = [&path, "quiet_s = 0.1"].map(|line| ("folder", line));
    let config = lab.config(&[&rig[..], &camera[..]].concat());
    let list = lab.run(&["--config", &config, "devices"]).succeeds().stdout;
    assert!(list.contains("* camera  folder              pictures that appear in /"), "{list}");
    let mut other = Tethering { folder, saved: 0 };
    let mut running = lab.start(&["--config", &config, "capture", "a"]);
    while let Some(line) = running.next_line() {
        if line.contains("release the shutter") {
            other.save(other.saved);
        }
    }
    running.end().succeeds();
    let recording = lab.recording("a");
    assert_eq!((recording.state(), recording.views().len(), other.saved), (State::Complete, VIEWS, VIEWS));
    for (n, picture) in pictures().iter().enumerate() {
        assert!(recording.frame(n).unwrap().bytes == *picture, "view {n} is another picture");
        let raw = &recording.view(n).unwrap().others[0];
        assert_eq!((raw.file.as_str(), raw.bytes), (format!("view_{n:03}_raw.nef").as_str(), 3));
    }
    lab.assert_sound("a");
    // Nothing more comes: the run ends with the remedy, and goes on once somebody has released the shutter.
    let config = lab.config(&[&rig[..], &camera[..], &[("folder", "shot_s = 0.1")]].concat());
    lab.run(&["--config", &config, "capture", "b"])
        .fails(1, &["no new file came into", "release the shutter once"]);
}
