//! Tone curve: how much light a grey value stands for.
//!
//! Light mixes linearly: half-way over an edge, a pixel has half of the light of either side. The grey values of a camera's
//! file are no measure of light; they are coded by a curve, most often that of sRGB. Half-way between two coded values lies
//! up to two thirds of the blur's standard deviation beside the edge, towards the darker side.
//!
//! ```text
//! light(v) = v / 12.92                      for v ≤ 0.04045       v: grey value over 255
//!            ((v + 0.055) / 1.055)^2.4      above                 light: over that of 255
//! ```
//!
//! Source: IEC 61966-2-1:1999 (sRGB).

use serde::{Deserialize, Serialize};

/// The greatest grey value of a file of eight bits.
const FULL: f32 = 255.0;

/// How grey values code light.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ToneCurve {
    /// As the file says; where it does not, what the edges show.
    #[default]
    Auto,
    /// Grey values are proportional to light: a scientific camera, a developed raw file.
    Linear,
    /// The curve of sRGB, near enough to that of Adobe RGB and of video: a camera's JPEG.
    Srgb,
}

impl ToneCurve {
    /// Light, 0 … 255, that grey values 0 … 255 stand for; `auto` as `linear`.
    pub(super) fn light(self) -> Light {
        let of = |value: f32| match self {
            Self::Auto | Self::Linear => value,
            Self::Srgb => FULL * srgb_light(value / FULL),
        };
        Light { table: (0..=256).map(|v| of(v as f32)).collect() }
    }

    /// The light, 0 … 1, that a grey value 0 … 255 stands for; `auto` as `linear`.
    pub fn decode(self, grey: f32) -> f32 {
        let share = grey / FULL;
        if self == Self::Srgb { srgb_light(share) } else { share }
    }

    /// The grey value that stands for light: the inverse of [`Self::decode`].
    pub fn encode(self, light: f32) -> f32 {
        FULL * match self {
            Self::Auto | Self::Linear => light,
            Self::Srgb if light <= 0.003_130_8 => 12.92 * light,
            Self::Srgb => 1.055 * light.powf(1.0 / 2.4) - 0.055,
        }
    }
}

/// The light of every grey value.
pub(super) struct Light {
    table: Vec<f32>,
}

impl Light {
    /// Light at a grey value between whole ones; what lies outside 0 … 255 goes on as the curve ends there.
    #[inline]
    pub(super) fn at(&self, value: f32) -> f32 {
        let k = (value.max(0.0) as usize).min(255);
        self.table[k] + (value - k as f32) * (self.table[k + 1] - self.table[k])
    }
}

fn srgb_light(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_has_its_known_values_and_goes_on_beyond_its_ends() {
        let light = ToneCurve::Srgb.light();
        for (grey, share) in
            [(0.0, 0.0), (10.0, 0.003_035), (128.0, 0.215_86), (188.0, 0.502_9), (255.0, 1.0)]
        {
            assert!((light.at(grey) / 255.0 - share).abs() < 1e-4, "{grey}: {}", light.at(grey) / 255.0);
        }
        for grey in [0.0, 3.5, 20.0, 220.0, 255.0] {
            let back = ToneCurve::Srgb.encode(ToneCurve::Srgb.decode(grey));
            assert!((back - grey).abs() < 1e-3, "{grey}: {back}");
        }
        assert!(light.at(-3.0) < 0.0 && light.at(258.0) > 255.0);
        assert_eq!(ToneCurve::Linear.light().at(77.25).to_bits(), 77.25_f32.to_bits());
    }
}
