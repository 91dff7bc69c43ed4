//! Recorded pictures for the screen: a DSLR's file is megabytes, and the grain in it a speck.

use super::JobError;
use crate::pipeline::ViewFault;
use crate::session::{Recording, sha256_hex};
use grainrig_core::formats::decode;
use grainrig_core::silhouette::{self, Picture};
use jpeg_encoder::{ColorType, Encoder};
use std::sync::{Arc, Mutex, PoisonError};

/// Widest preview, pixels: as wide as a page shows it on a large screen.
const MOST_COLUMNS: usize = 1280;
/// Height of the cut-out over the grain's own, so that it turns without touching the border.
const MARGIN: f64 = 1.6;
/// Width over height of a cut-out, as of a DSLR's picture.
const ASPECT: f64 = 1.5;
/// Quality of a preview, 1 to 100.
const QUALITY: u8 = 85;
/// Previews that are kept: every client looks at the newest view, some at the whole of it.
const KEPT: usize = 4;

/// What a preview shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PreviewPart {
    /// The whole picture.
    Whole,
    /// The grain and what is near it; the whole picture where no grain is found.
    Grain,
}

/// Makes previews one after the other, so that their memory is bounded by one picture, and keeps the newest.
#[derive(Debug, Default)]
pub struct Previews {
    kept: Mutex<Vec<Kept>>,
}

#[derive(Debug)]
struct Kept {
    /// SHA-256 of the recorded file.
    of: String,
    part: PreviewPart,
    made: Preview,
}

/// A picture for the screen.
#[derive(Debug, Clone)]
pub struct Preview {
    /// A JPEG file.
    pub bytes: Arc<Vec<u8>>,
    /// Its SHA-256, hexadecimal.
    pub sha256: String,
}

impl Previews {
    /// The preview of a captured view.
    ///
    /// # Errors
    /// [`JobError`] where the view's file is missing, has changed, or is no picture.
    pub fn preview(
        &self,
        recording: &Recording,
        view: usize,
        part: PreviewPart,
    ) -> Result<Preview, JobError> {
        let of = recording.view(view).map(|v| v.sha256.clone()).unwrap_or_default();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = kept.iter().find(|k| k.of == of && k.part == part) {
            return Ok(known.made.clone());
        }
        let frame = recording.frame(view)?;
        let config = recording.manifest().config.get("silhouette").cloned().unwrap_or_default();
        // A session from elsewhere may have none: then the usual search is good enough for the screen.
        let settings = serde_json::from_value(config).unwrap_or_default();
        let bytes = frame.bytes.len();
        let failed = |reason| JobError::Pipeline(ViewFault::Decode { bytes, reason }.of(view));
        let jpeg = render(&frame.bytes, &settings, part).map_err(failed)?;
        let made = Preview { sha256: sha256_hex(&jpeg), bytes: Arc::new(jpeg) };
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push(Kept { of, part, made: made.clone() });
        Ok(made)
    }
}

fn render(file: &[u8], settings: &silhouette::Settings, part: PreviewPart) -> Result<Vec<u8>, String> {
    let picture = decode(file)?;
    let window = match part {
        PreviewPart::Whole => None,
        PreviewPart::Grain => silhouette::find(&picture, None, settings).ok().map(|found| {
            let s = found.silhouette;
            around([picture.width(), picture.height()], s.origin, s.size)
        }),
    };
    let window = window.unwrap_or(Window { origin: [0, 0], size: [picture.width(), picture.height()] });
    let (size, data) = reduced(&picture, &window);
    let colour = if picture.channels() == 3 { ColorType::Rgb } else { ColorType::Luma };
    let mut jpeg = Vec::new();
    let [width, height] = size.map(u16::try_from);
    let (Ok(width), Ok(height)) = (width, height) else {
        return Err(format!("a preview of {} × {} px is too large for a JPEG", size[0], size[1]));
    };
    Encoder::new(&mut jpeg, QUALITY).encode(&data, width, height, colour).map_err(|e| e.to_string())?;
    Ok(jpeg)
}

/// A rectangle of pixels.
#[derive(Debug, PartialEq, Eq)]
struct Window {
    origin: [usize; 2],
    size: [usize; 2],
}

/// The window around an object, as far as the picture goes.
fn around(picture: [usize; 2], origin: [usize; 2], size: [usize; 2]) -> Window {
    let height = MARGIN * (size[1] as f64).max(size[0] as f64 / ASPECT);
    let wanted = [ASPECT * height, height];
    let mut window = Window { origin, size };
    for k in 0..2 {
        let length = (wanted[k].ceil() as usize).clamp(1, picture[k]);
        let middle = origin[k] + size[k] / 2;
        window.origin[k] = middle.saturating_sub(length / 2).min(picture[k] - length);
        window.size[k] = length;
    }
    window
}

/// The window's pixels, squares of them averaged into one where it is wider than a preview may be.
fn reduced(picture: &Picture, window: &Window) -> ([usize; 2], Vec<u8>) {
    let factor = window.size[0].div_ceil(MOST_COLUMNS).max(1);
    let size = window.size.map(|length| (length / factor).max(1));
    let (channels, data) = (picture.channels(), picture.data());
    let mut out = Vec::with_capacity(size[0] * size[1] * channels);
    let mut sums = vec![0u32; size[0] * channels];
    // A window narrower than a square is averaged over what there is of it.
    let squares = factor.min(window.size[1]);
    for row in 0..size[1] {
        sums.fill(0);
        for y in 0..squares {
            let start =
                ((window.origin[1] + row * factor + y) * picture.width() + window.origin[0]) * channels;
            for (column, sum) in sums.chunks_exact_mut(channels).enumerate() {
                let first = start + column * factor * channels;
                for pixel in data[first..first + factor * channels].chunks_exact(channels) {
                    sum.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += u32::from(*value));
                }
            }
        }
        let count = (factor * squares) as u32;
        out.extend(sums.iter().map(|sum| ((sum + count / 2) / count) as u8));
    }
    (size, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, channels: usize) -> Picture {
        let value = |k: usize| {
            let (x, y) = (k / channels % width, k / channels / width);
            ((x + y + k % channels) % 200) as u8
        };
        Picture::new(width, height, channels, (0..width * height * channels).map(value).collect()).unwrap()
    }

    #[test]
    fn squares_are_averaged_and_small_windows_keep_their_pixels() {
        let p = picture(2600, 90, 3);
        let whole = Window { origin: [0, 0], size: [2600, 90] };
        let (size, data) = reduced(&p, &whole);
        assert_eq!((size, data.len()), ([866, 30], 866 * 30 * 3));
        // Over the first square of 3 × 3, x + y is 2 in the mean.
        assert_eq!(&data[..3], [2, 3, 4]);
        let window = Window { origin: [2590, 80], size: [10, 10] };
        let (size, data) = reduced(&p, &window);
        assert_eq!((size, data[0]), ([10, 10], ((2590 + 80) % 200) as u8));
        // One row is less than a square.
        let (size, data) = reduced(&picture(5200, 16, 1), &Window { origin: [0, 0], size: [5200, 1] });
        assert_eq!((size, data.len()), ([1040, 1], 1040));
    }

    #[test]
    fn a_window_stays_in_the_picture() {
        assert_eq!(around([600, 400], [280, 180], [40, 40]), Window { origin: [252, 168], size: [96, 64] });
        for (origin, size) in [([0, 0], [40, 40]), ([560, 360], [40, 40]), ([0, 0], [600, 400])] {
            let w = around([600, 400], origin, size);
            assert!((0..2).all(|k| w.origin[k] + w.size[k] <= [600, 400][k] && w.size[k] > 0), "{w:?}");
        }
    }

    #[test]
    fn what_is_no_picture_is_refused_and_a_picture_without_a_grain_is_shown_whole() {
        assert!(render(b"no picture", &silhouette::Settings::default(), PreviewPart::Whole).is_err());
        let mut file = Vec::new();
        let grey = vec![200; 300 * 200];
        Encoder::new(&mut file, 90).encode(&grey, 300, 200, ColorType::Luma).unwrap();
        let jpeg = render(&file, &silhouette::Settings::default(), PreviewPart::Grain).unwrap();
        let shown = decode(&jpeg).unwrap();
        assert_eq!((shown.width(), shown.height()), (300, 200));
    }
}
