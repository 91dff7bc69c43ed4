//! A decoded photograph.

use super::{SilhouetteError, ToneCurve};

/// Least side of a picture, pixels: below it there is no room for a grain, its background and a margin.
const LEAST_SIDE: usize = 16;
/// Greatest side, pixels: far above any camera, and small enough that no product of sizes overflows.
const GREATEST_SIDE: usize = 32_768;

/// A decoded photograph of eight bits a channel, grey or red-green-blue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Picture {
    width: usize,
    height: usize,
    channels: usize,
    data: Vec<u8>,
    tone_curve: Option<ToneCurve>,
}

impl Picture {
    /// A picture from its bytes: `[row, column, channel]`, row-major, first row on top; one channel is grey,
    /// three are red, green, blue.
    ///
    /// # Errors
    /// When the size is out of range or the bytes do not fill it.
    pub fn new(width: usize, height: usize, channels: usize, data: Vec<u8>) -> Result<Self, SilhouetteError> {
        if channels != 1 && channels != 3 {
            return Err(SilhouetteError::PictureChannels { channels });
        }
        if !Self::fits(width, height) {
            return Err(SilhouetteError::PictureSize {
                width,
                height,
                least: LEAST_SIDE,
                greatest: GREATEST_SIDE,
            });
        }
        if data.len() != width * height * channels {
            return Err(SilhouetteError::PictureBytes { width, height, channels, bytes: data.len() });
        }
        Ok(Self { width, height, channels, data, tone_curve: None })
    }

    /// The same, whose file states how its grey values code light.
    #[must_use]
    pub fn coded(self, tone_curve: Option<ToneCurve>) -> Self {
        Self { tone_curve, ..self }
    }

    /// How the file said that its grey values code light.
    pub fn stated_tone_curve(&self) -> Option<ToneCurve> {
        self.tone_curve
    }

    /// Whether a picture may have this size: each side has 16 to 32 768 pixels.
    pub fn fits(width: usize, height: usize) -> bool {
        [width, height].iter().all(|side| (LEAST_SIDE..=GREATEST_SIDE).contains(side))
    }

    /// Width, pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height, pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Bytes per pixel: 1 (grey) or 3 (red, green, blue).
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// All bytes, `[row, column, channel]`.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The bytes of columns `from..to` of a row.
    pub(super) fn row(&self, row: usize, from: usize, to: usize) -> &[u8] {
        let start = row * self.width;
        &self.data[(start + from) * self.channels..(start + to) * self.channels]
    }
}
