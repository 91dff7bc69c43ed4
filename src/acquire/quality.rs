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
#[derive(
    Debug,
    Clone,
    Copy,
    Default,
    PartialEq,
    Eq,
    Serialize,
    Deserialize,
    utoipa::ToSchema,
    schemars::JsonSchema,
    clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum QualityMode {
    /// Take it again; where that does not help, suspend the run.
    #[default]
    Gate,
    /// Keep it and say so in the result.
    Label,
    /// Do not look.
    Off,
}
