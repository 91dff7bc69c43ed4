//! Errors of segmentation.

use super::Channel;

/// Why a picture gave no silhouette. Each message has the value, its unit, the limit and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SilhouetteError {
    /// The bytes do not fill the stated size.
    #[error(
        "a picture of {width}×{height} px with {channels} channel(s) needs width×height×channels bytes but \
         has {bytes}; check how it was decoded"
    )]
    PictureBytes {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// Bytes per pixel.
        channels: usize,
        /// Bytes handed in.
        bytes: usize,
    },
    /// Neither grey nor red-green-blue.
    #[error("a picture has 1 (grey) or 3 (RGB) channels, not {channels}; convert it first")]
    PictureChannels {
        /// Channels handed in.
        channels: usize,
    },
    /// Too small to hold a grain, or too large to address.
    #[error("a picture of {width}×{height} px is outside {least} … {greatest} px a side; scale or crop it")]
    PictureSize {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// Least side, pixels.
        least: usize,
        /// Greatest side, pixels.
        greatest: usize,
    },
    /// The picture of the empty stage does not fit the picture of the grain.
    #[error(
        "the background picture has {background:?} (width, height, channels) but the picture has \
         {picture:?}; take both with the same camera settings"
    )]
    BackgroundMismatch {
        /// Width, height, channels of the background.
        background: [usize; 3],
        /// Width, height, channels of the picture.
        picture: [usize; 3],
    },
    /// A colour channel was asked of a grey picture.
    #[error("channel {channel:?} needs a colour picture, but this one is grey; set channel to auto or luma")]
    NoColour {
        /// The channel asked for.
        channel: Channel,
    },
    /// A setting that makes no sense.
    #[error("setting {name} is {value} but must be {limit}; correct the configuration")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        limit: &'static str,
    },
    /// Nothing in the picture differs enough from the background.
    #[error(
        "no grain in view: the strongest contrast is {contrast:.1} grey levels where at least {limit:.1} are \
         needed (background noise {noise:.1}); check the lamp, the focus, and that the grain is still there"
    )]
    NoContrast {
        /// Contrast found, grey levels.
        contrast: f64,
        /// Contrast needed, grey levels.
        limit: f64,
        /// Standard deviation of the background, grey levels.
        noise: f64,
    },
    /// Something is there, but it is too small to be the grain.
    #[error(
        "no grain in view: the largest object covers {area_px:.0} px where at least {limit_px:.0} px are \
         needed; check that the grain is still there, or lower min_area_px"
    )]
    TooSmall {
        /// Area found, square pixels.
        area_px: f64,
        /// Area needed, square pixels.
        limit_px: f64,
    },
    /// What is there does not look like one object before a background.
    #[error(
        "no grain in view: what differs from the background covers {share:.0} % of the picture where at \
         most {limit:.0} % can be told from it; check the light and the focus, or give a background picture"
    )]
    NoBackground {
        /// Share of the picture, percent.
        share: f64,
        /// Greatest share, percent.
        limit: f64,
    },
}
