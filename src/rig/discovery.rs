//! What is plugged in: serial ports, video cameras, and still cameras at the USB. Nothing is opened.

use super::holder::holder;
use super::{CameraDriver, RigError, StageDriver};
use serde::Serialize;
use std::fs;
use std::path::{Path, PathBuf};

/// What a device could be used as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// Turns the grain.
    Stage,
    /// Photographs it.
    Camera,
}

/// A device that is there.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Found {
    /// What it could be used as.
    pub role: Role,
    /// The drivers that could use it.
    pub drivers: Vec<&'static str>,
    /// The device file, by the name that stays where it has one; none of a computed device.
    pub path: Option<PathBuf>,
    /// What it calls itself.
    pub name: String,
    /// Whether this account may open it.
    pub permitted: bool,
    /// Another program that has it open, as far as this account may see.
    pub held_by: Option<String>,
    /// Megabits a second of its USB line, where it has one.
    pub usb_mbit_per_s: Option<f64>,
}

impl Found {
    /// A device that is computed: it is always there.
    pub fn computed(role: Role, name: String) -> Self {
        let drivers = Vec::new();
        Self { role, drivers, path: None, name, permitted: true, held_by: None, usb_mbit_per_s: None }
    }

    /// Whether it is the device of this name, or of another name for the same.
    pub fn is_at(&self, named: &Path) -> bool {
        let real = |path: &Path| path.canonicalize().ok();
        self.path
            .as_deref()
            .is_some_and(|path| path == named || (real(path).is_some() && real(path) == real(named)))
    }
}

/// Every device below a root folder (`/`, or a copy of its `dev` and `sys`) with the names of the drivers that could use it;
/// computed ones first.
///
/// # Errors
/// [`RigError`] where a computed one can't be set up.
pub fn discover<'a>(
    stages: impl IntoIterator<Item = (&'static str, &'a dyn StageDriver)>,
    cameras: impl IntoIterator<Item = (&'static str, &'a dyn CameraDriver)>,
    root: &Path,
) -> Result<Vec<Found>, RigError> {
    let stages = stages.into_iter().map(|(name, driver)| (name, driver.found(root)));
    let cameras = cameras.into_iter().map(|(name, driver)| (name, driver.found(root)));
    let mut all: Vec<Found> = Vec::new();
    for (driver, found) in stages.chain(cameras) {
        for mut one in found? {
            // Nobody sees from outside whose board is behind a serial port.
            if let Some(same) =
                all.iter_mut().find(|f| f.role == one.role && f.path.is_some() && f.path == one.path)
            {
                same.drivers.push(driver);
            } else {
                one.drivers.push(driver);
                all.push(one);
            }
        }
    }
    all.sort_by_key(|f| f.path.is_some());
    Ok(all)
}

fn found(role: Role, path: PathBuf, name: String, usb_mbit_per_s: Option<f64>) -> Found {
    use rustix::fs::{Access, access};
    let permitted = access(&path, Access::READ_OK | Access::WRITE_OK).is_ok();
    let held_by = holder(&path);
    Found { role, drivers: Vec::new(), path: Some(path), name, permitted, held_by, usb_mbit_per_s }
}

/// Names in a folder, in order.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries.filter_map(|e| e.file_name().into_string().ok()).collect();
    names.sort();
    names
}

fn text(path: &Path) -> Option<String> {
    let text = fs::read_to_string(path).ok()?;
    let text = text.trim();
    (!text.is_empty()).then(|| text.to_owned())
}

/// `usb-Arduino__www.arduino.cc__0043_7523230313535161C072-if00` as a person would write it.
fn readable(by_id: &str) -> String {
    let bare = by_id.strip_prefix("usb-").unwrap_or(by_id);
    let bare =
        ["-if00-port0", "-if00", "-video-index0"].iter().find_map(|e| bare.strip_suffix(e)).unwrap_or(bare);
    bare.split('_').filter(|w| !w.is_empty()).collect::<Vec<_>>().join(" ")
}

/// The serial ports that boards have.
pub fn serial_ports(root: &Path) -> Vec<Found> {
    let by_id = root.join("dev/serial/by-id");
    let mut all: Vec<Found> = names(&by_id)
        .into_iter()
        .map(|n| {
            let path = by_id.join(&n);
            let speed = tty_speed(root, &path);
            found(Role::Stage, path, readable(&n), speed)
        })
        .collect();
    // Ports without a name that stays: a board's own serial line, a system without udev.
    let named: Vec<PathBuf> = all.iter().filter_map(|f| f.path.as_ref()?.canonicalize().ok()).collect();
    let dev = root.join("dev");
    for name in names(&dev).into_iter().filter(|n| n.starts_with("ttyUSB") || n.starts_with("ttyACM")) {
        let path = dev.join(&name);
        if !path.canonicalize().is_ok_and(|p| named.contains(&p)) {
            let speed = tty_speed(root, &path);
            all.push(found(Role::Stage, path, name, speed));
        }
    }
    all
}

fn tty_speed(root: &Path, path: &Path) -> Option<f64> {
    let tty = path.canonicalize().ok()?;
    usb_speed(&root.join("sys/class/tty").join(tty.file_name()?).join("device"))
}

/// The speed of the USB device that a folder of `sys` belongs to.
fn usb_speed(device: &Path) -> Option<f64> {
    let device = device.canonicalize().ok()?;
    device.ancestors().take(6).find_map(|folder| text(&folder.join("speed"))?.parse().ok())
}

/// The cameras of the kernel's video drivers.
pub fn video_cameras(root: &Path) -> Vec<Found> {
    let mut nodes: Vec<PathBuf> = Vec::new();
    let mut all: Vec<Found> = Vec::new();
    let sys = root.join("sys/class/video4linux");
    let mut add = |path: PathBuf, by_id: Option<&str>| {
        let Ok(node) = path.canonicalize() else { return };
        if nodes.contains(&node) {
            return;
        }
        let sys = node.file_name().map(|v| sys.join(v));
        let name = sys.as_deref().and_then(|s| text(&s.join("name")));
        let name = name.or(by_id.map(readable)).unwrap_or_else(|| path.display().to_string());
        let speed = sys.and_then(|s| usb_speed(&s.join("device")));
        all.push(found(Role::Camera, path, name, speed));
        nodes.push(node);
    };
    // By its own name; one that has none by the place that it is at; without udev by the kernel's number. Other nodes of the
    // same camera carry data about the pictures.
    let by_id = root.join("dev/v4l/by-id");
    for name in names(&by_id).into_iter().filter(|n| n.ends_with("-video-index0")) {
        add(by_id.join(&name), Some(&name));
    }
    let by_path = root.join("dev/v4l/by-path");
    for name in names(&by_path).into_iter().filter(|n| n.ends_with("-video-index0")) {
        add(by_path.join(name), None);
    }
    for name in names(&sys).into_iter().filter(|n| n.starts_with("video")) {
        if text(&sys.join(&name).join("index")).as_deref() == Some("0") {
            add(root.join("dev").join(name), None);
        }
    }
    all
}

/// USB devices with an interface of the still-image class, which is what PTP cameras have.
pub fn still_cameras(root: &Path) -> Vec<Found> {
    const STILL_IMAGE: &str = "06";
    let devices = root.join("sys/bus/usb/devices");
    let mut all: Vec<Found> = Vec::new();
    for interface in names(&devices).into_iter().filter(|n| n.contains(':')) {
        if text(&devices.join(&interface).join("bInterfaceClass")).as_deref() != Some(STILL_IMAGE) {
            continue;
        }
        let device = devices.join(interface.split(':').next().unwrap_or_default());
        let number = |name| text(&device.join(name)).and_then(|n| n.parse::<u32>().ok());
        let (Some(bus), Some(place)) = (number("busnum"), number("devnum")) else { continue };
        let path = root.join(format!("dev/bus/usb/{bus:03}/{place:03}"));
        let words = ["manufacturer", "product", "serial"].map(|n| text(&device.join(n)));
        let name = words.into_iter().flatten().collect::<Vec<_>>().join(" ");
        let speed = text(&device.join("speed")).and_then(|s| s.parse().ok());
        all.push(found(Role::Camera, path, name, speed));
    }
    all
}

/// Whether a program of this name runs.
pub fn runs(name: &str) -> bool {
    // The kernel keeps 15 letters of a name.
    let short: String = name.chars().take(15).collect();
    names(Path::new("/proc"))
        .iter()
        .filter(|n| n.bytes().all(|b| b.is_ascii_digit()))
        .any(|n| text(&Path::new("/proc").join(n).join("comm")).is_some_and(|c| c == short))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    fn write(root: &Path, path: &str, text: &str) {
        let path = root.join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn boards_and_cameras_are_found_by_names_that_stay() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path();
        for (path, text) in [
            ("dev/ttyACM0", ""),
            ("dev/ttyUSB3", ""),
            ("dev/ttyS0", ""),
            ("dev/video0", ""),
            ("dev/video1", ""),
            ("dev/video2", ""),
            ("dev/video3", ""),
            ("dev/video4", ""),
            ("dev/bus/usb/001/007", ""),
            ("sys/class/video4linux/video0/name", "HD Webcam C615\n"),
            ("sys/class/video4linux/video0/index", "0\n"),
            ("sys/class/video4linux/video1/index", "1\n"),
            ("sys/class/video4linux/video2/name", "Built in\n"),
            ("sys/class/video4linux/video2/index", "0\n"),
            ("sys/class/video4linux/video3/name", "Without udev\n"),
            ("sys/class/video4linux/video3/index", "0\n"),
            ("sys/class/video4linux/video4/index", "1\n"),
            ("sys/bus/usb/devices/1-4/busnum", "1\n"),
            ("sys/bus/usb/devices/1-4/devnum", "7\n"),
            ("sys/bus/usb/devices/1-4/speed", "480\n"),
            ("sys/bus/usb/devices/1-4/manufacturer", "Canon Inc.\n"),
            ("sys/bus/usb/devices/1-4/product", "Canon Digital Camera\n"),
            ("sys/bus/usb/devices/1-4:1.0/bInterfaceClass", "06\n"),
            ("sys/bus/usb/devices/1-5:1.0/bInterfaceClass", "03\n"),
        ] {
            write(root, path, text);
        }
        fs::create_dir_all(root.join("dev/serial/by-id")).unwrap();
        fs::create_dir_all(root.join("dev/v4l/by-id")).unwrap();
        fs::create_dir_all(root.join("dev/v4l/by-path")).unwrap();
        let board = "dev/serial/by-id/usb-Arduino__www.arduino.cc__0043_75232-if00";
        symlink(root.join("dev/ttyACM0"), root.join(board)).unwrap();
        for n in [0, 1] {
            let name = format!("dev/v4l/by-id/usb-046d_HD_Webcam_C615-video-index{n}");
            symlink(root.join(format!("dev/video{n}")), root.join(name)).unwrap();
        }
        for (place, node) in [("pci-0000:00:14.0-usb-0:4:1.0", "video0"), ("platform-isp", "video2")] {
            let name = format!("dev/v4l/by-path/{place}-video-index0");
            symlink(root.join("dev").join(node), root.join(name)).unwrap();
        }
        let config = crate::config::Config::default();
        let discovered = |root: &Path| discover(config.stages(), config.cameras(), root).unwrap();
        let (computed, all): (Vec<Found>, Vec<Found>) =
            discovered(root).into_iter().partition(|f| f.path.is_none());
        let told: Vec<(String, &str)> =
            all.iter().map(|f| (f.drivers.join(" or "), f.name.as_str())).collect();
        assert_eq!(
            told,
            [
                ("controller or grbl", "Arduino www.arduino.cc 0043 75232"),
                ("controller or grbl", "ttyUSB3"),
                ("gphoto2", "Canon Inc. Canon Digital Camera"),
                ("v4l2", "HD Webcam C615"),
                ("v4l2", "Built in"),
                ("v4l2", "Without udev"),
            ]
            .map(|(drivers, name)| (drivers.to_owned(), name))
        );
        let paths: Vec<PathBuf> = all.iter().filter_map(|f| f.path.clone()).collect();
        assert_eq!(paths[0], root.join(board));
        assert_eq!(paths[2], root.join("dev/bus/usb/001/007"));
        assert_eq!(all[2].usb_mbit_per_s, Some(480.0));
        assert_eq!(paths[4], root.join("dev/v4l/by-path/platform-isp-video-index0"));
        assert_eq!(paths[5], root.join("dev/video3"));
        assert!(all.iter().all(|f| f.permitted && f.held_by.is_none()));
        // One device has many names.
        assert!(all[0].is_at(&root.join("dev/ttyACM0")) && !all[0].is_at(&root.join("dev/ttyUSB3")));
        // Where nothing is plugged in there still is what needs no plug.
        assert_eq!(discovered(&root.join("nothing")), computed);
        assert!(computed.iter().all(|f| f.drivers == ["simulated"]) && computed.len() == 2);
    }
}
