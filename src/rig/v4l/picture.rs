//! From a video frame to a picture file.

use crate::rig::{Encoding, Frame};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder as _};

/// A JPEG frame, as the camera has it.
///
/// # Errors
/// What is wrong with it: it is empty, none, or cut off.
#[cfg_attr(not(feature = "v4l"), allow(dead_code))]
pub(super) fn jpeg(bytes: &[u8]) -> Result<Frame, String> {
    // A driver's buffer may be longer than the file in it.
    let filled = bytes.iter().rev().take_while(|&&b| b == 0).count();
    let file = &bytes[..bytes.len() - filled];
    match Encoding::sniff(file) {
        Some(Encoding::Jpeg) if file.ends_with(&[0xff, 0xd9]) => {
            Ok(Frame::new(file.to_vec(), Encoding::Jpeg))
        }
        Some(Encoding::Jpeg) => {
            Err(format!("the frame of {} bytes lacks its end: it is cut off", bytes.len()))
        }
        _ => Err(format!("the frame of {} bytes is no JPEG", bytes.len())),
    }
}

/// A frame of brightness and colour as PNG in red, green and blue (ITU-R BT.601, limited range, as UVC cameras deliver).
/// Rows may be longer than their pixels: `stride` bytes each.
///
/// # Errors
/// What is wrong with it: it has fewer bytes than rows.
#[cfg_attr(not(feature = "v4l"), allow(dead_code))]
pub(super) fn yuyv(bytes: &[u8], width: u32, height: u32, stride: usize) -> Result<Frame, String> {
    let (columns, rows) = (width as usize, height as usize);
    let stride = stride.max(2 * columns);
    let needed = (rows.max(1) - 1) * stride + 2 * columns;
    if bytes.len() < needed || !columns.is_multiple_of(2) {
        return Err(format!("the frame has {} bytes, {columns} × {rows} px need {needed}", bytes.len()));
    }
    let mut rgb = Vec::with_capacity(3 * columns * rows);
    for row in bytes.chunks(stride).take(rows) {
        for pair in row[..2 * columns].chunks_exact(4) {
            let (u, v) = (f32::from(pair[1]) - 128.0, f32::from(pair[3]) - 128.0);
            for y in [pair[0], pair[2]] {
                let y = 255.0 / 219.0 * (f32::from(y) - 16.0);
                // `as` stops at 0 and 255.
                let level = |x: f32| (x + 0.5) as u8;
                rgb.extend([level(y + 1.596 * v), level(y - 0.392 * u - 0.813 * v), level(y + 2.017 * u)]);
            }
        }
    }
    let mut file = Vec::new();
    PngEncoder::new_with_quality(&mut file, CompressionType::Fast, FilterType::Up)
        .write_image(&rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|e| format!("the frame can't be written as PNG: {e}"))?;
    Ok(Frame::new(file, Encoding::Png))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_white_and_red_come_out_as_such_and_longer_rows_are_cut() {
        // Two pixels a row, three rows, each row two bytes longer than its pixels.
        let rows = [[16, 128, 16, 128, 9, 9], [235, 128, 235, 128, 9, 9], [81, 90, 81, 240, 9, 9]];
        let made = yuyv(&rows.concat(), 2, 3, 6).unwrap();
        assert_eq!(made.encoding, Encoding::Png);
        let read = image::load_from_memory(&made.bytes).unwrap().to_rgb8();
        assert_eq!((read.get_pixel(0, 0).0, read.get_pixel(1, 1).0), ([0; 3], [255; 3]));
        let [r, g, b] = read.get_pixel(1, 2).0;
        assert!(r >= 253 && g <= 2 && b <= 2, "{r} {g} {b}");
        assert!(yuyv(&rows.concat()[..15], 2, 3, 6).is_err());
    }

    #[test]
    fn a_jpeg_frame_loses_its_padding_and_nothing_else() {
        let whole = [0xff, 0xd8, 0xff, 0xe0, 7, 0, 7, 0xff, 0xd9];
        assert_eq!(jpeg(&[&whole[..], &[0; 5]].concat()).unwrap().bytes, whole);
        for bad in [&whole[..8], &[0; 9], &[], &whole[1..]] {
            assert!(jpeg(bad).is_err());
        }
    }
}
