//! Which program holds a device.

use std::fs;
use std::path::Path;
#[cfg(feature = "gphoto2")]
use std::path::PathBuf;

/// The device file of a USB port as libgphoto2 writes it: `usb:001,005`.
#[cfg(feature = "gphoto2")]
pub(super) fn usb_device(port: &str) -> Option<PathBuf> {
    let (bus, device) = port.strip_prefix("usb:")?.split_once(',')?;
    let digits = |s: &str| s.len() == 3 && s.bytes().all(|b| b.is_ascii_digit());
    (digits(bus) && digits(device)).then(|| Path::new("/dev/bus/usb").join(bus).join(device))
}

/// Name and number of another program that has a device file open, as far as this account may see it.
pub(super) fn holder(device: &Path) -> Option<String> {
    let device = device.canonicalize().ok()?;
    let processes = fs::read_dir("/proc").ok()?;
    processes.flatten().find_map(|process| {
        let number: u32 = process.file_name().to_str()?.parse().ok()?;
        let mut open = fs::read_dir(process.path().join("fd")).ok()?.flatten();
        let holds = open.any(|fd| fs::read_link(fd.path()).is_ok_and(|to| to == device));
        let name = fs::read_to_string(process.path().join("comm")).ok()?;
        (holds && number != std::process::id()).then(|| format!("{} (process {number})", name.trim()))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(feature = "gphoto2")]
    fn only_a_usb_port_has_a_device_file() {
        assert_eq!(usb_device("usb:001,005").unwrap(), Path::new("/dev/bus/usb/001/005"));
        for other in ["usb:", "usb:001", "usb:../../x,005", "ptpip:127.0.0.1"] {
            assert_eq!(usb_device(other), None, "{other}");
        }
    }

    #[test]
    fn the_program_that_has_a_file_open_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("device");
        let file = fs::File::create(&path).unwrap();
        let own = format!("(process {})", std::process::id());
        assert!(holder(&path).is_none_or(|who| !who.ends_with(&own)), "this program is no other");
        let mut other = std::process::Command::new("cat");
        let mut other = other.stdin(std::process::Stdio::piped()).stdout(file).spawn().unwrap();
        let named = holder(&path).unwrap();
        // Until it has become `cat` it is called as its parent.
        assert!(named.ends_with(&format!("(process {})", other.id())), "{named}");
        other.kill().unwrap();
        other.wait().unwrap();
    }
}
