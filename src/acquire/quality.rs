//! The `[acquire]` settings: what becomes of a picture that is whole but no good.

use serde::{Deserialize, Serialize};

/// The `[acquire]` settings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AcquireSettings {
    /// What becomes of a picture that is out of focus, shaken, overexposed, obstructed or a copy of another.
    pub quality: QualityMode,
}

/// What becomes of a picture that is no good.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum QualityMode {
    /// It is taken again, as often as the plan allows; then the run is suspended.
    #[default]
    Gate,
    /// It is kept, and labelled in the result.
    Label,
    /// It is not looked for.
    Off,
}
