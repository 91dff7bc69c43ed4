//! Report of a segmentation: thresholds, areas, pedestal, what a person checks it by.

use super::{Channel, Polarity, ToneCurve};
use serde::Serialize;

/// How a silhouette was found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The combination of colours used.
    pub channel: Channel,
    /// Which of grain and background was the brighter one; never `auto`.
    pub polarity: Polarity,
    /// Otsu's threshold for two classes, grey levels away from the background towards the grain.
    #[serde(rename = "threshold_two_levels")]
    pub threshold_two: f64,
    /// Otsu's two thresholds for three classes, in the same unit.
    #[serde(rename = "thresholds_three_levels")]
    pub thresholds_three: [f64; 2],
    /// The threshold that the first, pixel-accurate mask was cut at, in the same unit.
    #[serde(rename = "threshold_used_levels")]
    pub threshold_used: f64,
    /// Otsu's separability (between-class over total variance, 0 … 1) for two classes.
    pub separability_two: f64,
    /// The same for three classes.
    pub separability_three: f64,
    /// Mean distance of the grain from the background, grey levels.
    #[serde(rename = "contrast_levels")]
    pub contrast: f64,
    /// Standard deviation of the background about its model, grey levels.
    #[serde(rename = "noise_levels")]
    pub noise: f64,
    /// Area inside the outline, square pixels.
    pub area_px: f64,
    /// Length of the outline, pixels.
    pub outline_length_px: f64,
    /// Area that Otsu's threshold for two classes alone gives the same object, cut at the same pedestal: its pixels,
    /// counted.
    pub area_otsu_two_px: f64,
    /// The same with the lower of the two thresholds for three classes (background, grain, pedestal), as the method
    /// was published.
    pub area_otsu_three_px: f64,
    /// How far outside the outline the mask of `area_otsu_two_px` ends in the mean, pixels: the difference of the
    /// areas over the outline's length. Pixels inside that are as bright as the background count against it.
    pub shift_otsu_two_px: f64,
    /// The same for `area_otsu_three_px`.
    pub shift_otsu_three_px: f64,
    /// Openings left inside the outline.
    pub holes_open: usize,
    /// Columns and rows of the picture that hold a picture: `[first column, first row, end column, end row]`;
    /// less than the whole where a black frame was cut off.
    #[serde(rename = "frame_px")]
    pub frame: [usize; 4],
    /// How the grey values were taken to code light; never `auto`.
    pub tone_curve: ToneCurve,
    /// What that was taken from.
    pub tone_curve_from: ToneSource,
    /// How far the outline was moved outwards of half-way because the grain's rim mirrors the background, pixels.
    pub rim_px: f64,
    /// Area that was added because the other views hold it, where little tells the grain from the background, square pixels.
    #[serde(rename = "held_px2")]
    pub held_px: f64,
    /// The pedestal, where one was cut off.
    pub pedestal: Option<PedestalOutline>,
    /// Width of the outline one pixel above the pedestal's top, where the grain stands on it, pixels.
    pub contact_width_px: Option<f64>,
    /// Whether the grain reaches the left, right, top, bottom end of the picture: then part of it is not
    /// seen, and what lies outside counts as background.
    pub touches_border: [bool; 4],
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// Where a tone curve was taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ToneSource {
    /// It was set.
    Setting,
    /// The file states it.
    File,
    /// Edges are more alike on both sides under it than under another.
    Edges,
    /// Neither file nor edges say anything: it is the usual one.
    Custom,
}

/// A pedestal's outline in one view: top line, centre and half width, pixels of the picture; it was cut off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PedestalOutline {
    /// Row of its top at its centre column, pixels (subpixel).
    #[serde(rename = "top_row_px")]
    pub top_row: f64,
    /// Slope of its top, rows per column: the camera's roll.
    pub top_slope: f64,
    /// Its centre column at its top, pixels.
    #[serde(rename = "centre_column_px")]
    pub centre_column: f64,
    /// Half its width, pixels.
    #[serde(rename = "half_width_px")]
    pub half_width: f64,
    /// Whether the view itself shows the top; else it is taken where the sides end, or from other views.
    pub top_seen: bool,
    /// Whether its slope was read off its sides or its top; else it was only found standing still, and is taken for upright.
    pub slope_seen: bool,
    /// Standard deviation of the blur of its sides, pixels: above its top its light mixes with the grain's as far.
    #[serde(rename = "blur_px")]
    pub blur: f64,
}

impl PedestalOutline {
    /// Length of the sides that its slope was read off in a picture of so many rows, pixels; 0 where they are shorter
    /// than the pedestal is wide, so that the slope is its top's, which grain and glue disturb, or where no slope was read off at all.
    pub fn side_px(&self, rows: usize) -> f64 {
        let length = rows as f64 - self.top_row;
        if !self.slope_seen || length < 2.0 * self.half_width { 0.0 } else { length }
    }
}

/// A side of the picture, in the order of [`Report::touches_border`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Column 0.
    Left,
    /// The last column.
    Right,
    /// Row 0.
    Top,
    /// The last row.
    Bottom,
}

impl Side {
    /// All, in the order of [`Report::touches_border`].
    pub const ALL: [Self; 4] = [Self::Left, Self::Right, Self::Top, Self::Bottom];

    /// Its name in a sentence.
    pub fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Top => "top",
            Self::Bottom => "bottom",
        }
    }
}
