//! A file comes over from the camera, and is looked at.

use super::super::message::{Failure, FailureKind};
use super::control::failure;
use crate::rig::Encoding;
use gphoto2::{Camera, Context};

/// Fetches a file and checks that it is whole.
pub(super) fn fetch(
    camera: &Camera,
    context: &Context,
    folder: &str,
    name: &str,
) -> Result<Vec<u8>, Failure> {
    let doing = format!("deliver {name}");
    let failed = |e| failure(&doing, &e);
    let file = camera.fs().download(folder, name).wait().map_err(failed)?;
    // Its bytes may not be asked for where there are none.
    if file.size(context).wait().map_err(failed)? == 0 {
        return Err(bad(format!("{name} has 0 bytes")));
    }
    let bytes = Vec::from(file.get_data(context).wait().map_err(failed)?);
    let announced = camera.fs().file_info(folder, name).wait().ok().and_then(|info| info.file().size());
    check(name, &bytes, announced).map_err(bad)?;
    Ok(bytes)
}

fn bad(cause: String) -> Failure {
    Failure::new(FailureKind::BadPicture, cause)
}

/// Whether a file is as long as the camera says and, where it is a JPEG, ends as one.
fn check(name: &str, bytes: &[u8], announced: Option<u64>) -> Result<(), String> {
    if let Some(announced) = announced.filter(|a| *a != bytes.len() as u64) {
        return Err(format!("{name} has {} bytes, the camera announced {announced}", bytes.len()));
    }
    let is_jpeg = name.to_ascii_lowercase().ends_with(".jpg") || name.to_ascii_lowercase().ends_with(".jpeg");
    match Encoding::sniff(bytes) {
        Some(Encoding::Jpeg) => {
            // Some cameras fill the file up with zeros after its end.
            let filled = bytes.iter().rev().take_while(|&&b| b == 0).count();
            if bytes[..bytes.len() - filled].ends_with(&[0xff, 0xd9]) {
                Ok(())
            } else {
                Err(format!("{name} of {} bytes lacks its end: it is cut off", bytes.len()))
            }
        }
        _ if is_jpeg => {
            Err(format!("{name} begins with {:02x?}, no JPEG does", &bytes[..bytes.len().min(4)]))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_cut_off_or_no_jpeg_is_told_from_a_whole_one() {
        let jpeg = [0xff, 0xd8, 0xff, 0xe0, 1, 2, 0xff, 0xd9, 0, 0];
        check("a.JPG", &jpeg, Some(10)).unwrap();
        check("a.JPG", &jpeg, None).unwrap();
        check("a.CR2", b"II*\0", Some(4)).unwrap();
        for (name, bytes, announced) in
            [("a.jpg", &jpeg[..7], None), ("a.jpg", &jpeg[..], Some(11)), ("a.jpg", b"II*\0", Some(4))]
        {
            check(name, bytes, announced).unwrap_err();
        }
    }
}
