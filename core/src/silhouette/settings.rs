//! Settings of the segmentation; the defaults suit a backlit grain, a blue screen and a black one.

use super::{Channel, SilhouetteError, ToneCurve};
use serde::{Deserialize, Serialize};

/// Settings of [`find`](super::find()).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Which combination of colours separates grain from background.
    pub channel: Channel,
    /// Whether the background is brighter or darker than the grain in that channel.
    pub polarity: Polarity,
    /// How the first threshold, which the outline is then placed about, is sought.
    pub classes: Classes,
    /// Whether a pedestal under the grain is looked for and cut off.
    pub pedestal: PedestalMode,
    /// What happens to openings inside the outline.
    pub holes: Holes,
    /// How grey values code light: outlines lie half-way in light.
    pub tone_curve: ToneCurve,
    /// The least area of a grain, square pixels of the picture; anything smaller is dust.
    pub min_area_px: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            channel: Channel::Auto,
            polarity: Polarity::Auto,
            classes: Classes::Auto,
            pedestal: PedestalMode::Auto,
            holes: Holes::Auto,
            tone_curve: ToneCurve::Auto,
            min_area_px: 400.0,
        }
    }
}

impl Settings {
    /// Whether every number makes sense.
    ///
    /// # Errors
    /// Names the setting that does not.
    pub fn check(&self) -> Result<(), SilhouetteError> {
        if !(self.min_area_px >= 1.0 && self.min_area_px.is_finite()) {
            return Err(SilhouetteError::Setting {
                name: "min_area_px",
                value: self.min_area_px,
                limit: "a finite number of square pixels, at least 1",
            });
        }
        Ok(())
    }
}

/// Which of grain and background is the brighter one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Polarity {
    /// What the picture's border shows is background; the other one is the grain.
    #[default]
    Auto,
    /// A dark grain before a bright background (backlight).
    BrightBackground,
    /// A bright grain before a dark background.
    DarkBackground,
}

/// How many classes the grey values fall into, for the first threshold.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Classes {
    /// The valley threshold between the background's noise and Otsu's threshold for two classes: the one
    /// that the fewest pixels lie near. It keeps the grain's shaded sides and its paler colours.
    #[default]
    Auto,
    /// Otsu's threshold for two: grain and background.
    Two,
    /// Otsu's lower threshold for three: grain, background, and the pedestal or the grain's own shadows.
    Three,
}

/// Whether a pedestal is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PedestalMode {
    /// Cut off what rises from the lower border with straight, upright sides and a level top.
    #[default]
    Auto,
    /// There is none, or it is to be kept.
    None,
}

/// What happens to openings inside the outline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Holes {
    /// As `background` where a difference of two colours separates grain from background, else as `fill`: by
    /// brightness alone a clear grain's highlight, or a shadow, cannot be distinguished from a see-through gap.
    #[default]
    Auto,
    /// Fill every opening.
    Fill,
    /// Leave open what is large enough and looks like the background; fill the rest.
    Background,
}
