//! The file that the camera delivers: a colour JPEG with Exif, written in strips on all cores.
//!
//! Each strip is encoded on its own; a restart marker between strips resets the decoder, so that their
//! entropy-coded data may stand one after another in one file (ITU-T T.81, E.1.4).

use crate::rig::RigError;
use jpeg_encoder::{Encoder, ImageBuffer, JpegColorType, SamplingFactor};
use rayon::prelude::*;

/// Rows of a strip: a multiple of 16, the height of a unit of 4:2:0 colour.
pub const STRIP_ROWS: usize = 128;

/// One strip of the picture as luminance and two chrominances, each `[row, column]`, row-major.
pub struct Strip {
    /// Luminance.
    pub luma: Vec<u8>,
    /// Blue and red chrominance.
    pub chroma: [Vec<u8>; 2],
    /// Width, pixels.
    pub width: usize,
}

impl ImageBuffer for &Strip {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Ycbcr
    }
    fn width(&self) -> u16 {
        self.width as u16
    }
    fn height(&self) -> u16 {
        (self.luma.len() / self.width) as u16
    }
    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        let row = usize::from(y) * self.width..(usize::from(y) + 1) * self.width;
        for (buffer, plane) in buffers.iter_mut().zip([&self.luma, &self.chroma[0], &self.chroma[1]]) {
            buffer.extend_from_slice(&plane[row.clone()]);
        }
    }
}

/// Encodes a picture whose strips are made by `strip` (number of the strip → its pixels; each has
/// [`STRIP_ROWS`] rows, the last the rest).
///
/// # Errors
/// [`RigError::Device`] where the encoder fails.
pub fn encode(
    [width, height]: [usize; 2],
    quality: u8,
    exif: &[u8],
    strip: impl Fn(usize) -> Strip + Sync,
) -> Result<Vec<u8>, RigError> {
    let failed =
        |what: String| RigError::Device(format!("the simulated camera could not write its JPEG: {what}"));
    let strips = (0..height.div_ceil(STRIP_ROWS))
        .into_par_iter()
        .map(|n| {
            let mut bytes = Vec::new();
            let mut encoder = Encoder::new(&mut bytes, quality);
            encoder.set_sampling_factor(SamplingFactor::F_2_2);
            if n == 0 {
                encoder.add_exif_metadata(exif).map_err(|e| failed(e.to_string()))?;
            }
            encoder.encode_image(&strip(n)).map_err(|e| failed(e.to_string()))?;
            Ok(bytes)
        })
        .collect::<Result<Vec<_>, RigError>>()?;
    let unit = 16;
    let interval = width.div_ceil(unit) * (STRIP_ROWS / unit);
    join(&strips, height, interval)
        .ok_or_else(|| failed("the encoder's strips have no frame or scan header".into()))
}

/// Joins strips into one file: the first one's headers with the whole height and a restart interval (units),
/// then the scans of all.
fn join(strips: &[Vec<u8>], height: usize, interval: usize) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(strips.iter().map(Vec::len).sum());
    for (n, bytes) in strips.iter().enumerate() {
        let Headers { frame, scan, data } = Headers::find(bytes)?;
        if n == 0 {
            out.extend_from_slice(bytes.get(..scan)?);
            // SOF: marker, length, precision, then the height.
            out.get_mut(frame + 5..frame + 7)?.copy_from_slice(&u16::try_from(height).ok()?.to_be_bytes());
            out.extend_from_slice(&[0xff, 0xdd, 0, 4]);
            out.extend_from_slice(&u16::try_from(interval).ok()?.to_be_bytes());
            out.extend_from_slice(bytes.get(scan..data)?);
        } else {
            out.extend_from_slice(&[0xff, 0xd0 + ((n - 1) % 8) as u8]);
        }
        // The scan without the end-of-image marker.
        out.extend_from_slice(bytes.get(data..bytes.len().checked_sub(2)?)?);
    }
    out.extend_from_slice(&[0xff, 0xd9]);
    Some(out)
}

/// Where a baseline file's frame header, scan header and scan data begin.
struct Headers {
    frame: usize,
    scan: usize,
    data: usize,
}

impl Headers {
    fn find(bytes: &[u8]) -> Option<Self> {
        let (mut at, mut frame) = (2, None);
        loop {
            let marker = *bytes.get(at + 1)?;
            let length = usize::from(u16::from_be_bytes([*bytes.get(at + 2)?, *bytes.get(at + 3)?]));
            match marker {
                0xc0 => frame = Some(at),
                0xda => return Some(Self { frame: frame?, scan: at, data: at + 2 + length }),
                _ => {}
            }
            at += 2 + length;
        }
    }
}
