//! Colour channels and differences of channels.

use serde::{Deserialize, Serialize};

/// A combination of the colours of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// The one that separates grain and background best.
    #[default]
    Auto,
    /// Brightness, about as ITU-R BT.601 weighs it: (5 R + 9 G + 2 B) / 16.
    Luma,
    /// Red alone.
    Red,
    /// Green alone.
    Green,
    /// Blue alone.
    Blue,
    /// Red minus blue: before a blue screen.
    RedMinusBlue,
    /// Red minus green: before a green screen.
    RedMinusGreen,
    /// Green minus blue.
    GreenMinusBlue,
}

impl Channel {
    /// Those that `auto` chooses from.
    pub(super) const CANDIDATES: [Self; 7] = [
        Self::Luma,
        Self::Red,
        Self::Green,
        Self::Blue,
        Self::RedMinusBlue,
        Self::RedMinusGreen,
        Self::GreenMinusBlue,
    ];

    /// Weights of red, green and blue, in sixteenths.
    pub(super) fn weights(self) -> [i16; 3] {
        match self {
            Self::Auto | Self::Luma => [5, 9, 2],
            Self::Red => [16, 0, 0],
            Self::Green => [0, 16, 0],
            Self::Blue => [0, 0, 16],
            Self::RedMinusBlue => [16, 0, -16],
            Self::RedMinusGreen => [16, -16, 0],
            Self::GreenMinusBlue => [0, 16, -16],
        }
    }

    /// Whether it is a difference of two colours, in which brightness cancels.
    pub(super) fn is_difference(self) -> bool {
        matches!(self, Self::RedMinusBlue | Self::RedMinusGreen | Self::GreenMinusBlue)
    }

    /// By how much (a share of the grain's pixels) it must be surer than brightness: cameras store colour
    /// at half the resolution of brightness (4:2:0), so an outline in colour is less sharp and has to earn
    /// its place.
    pub(super) fn handicap(self) -> f64 {
        match self {
            Self::Auto | Self::Luma => 0.0,
            _ => 0.03,
        }
    }
}
