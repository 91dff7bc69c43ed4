//! The acquisition: from a plan to durable pictures.
//!
//! [`PlanSettings::check`] makes the plan, [`run()`] carries it out on any stage and camera, a [`FrameSink`]
//! refuses what is no use and keeps the rest while the stage turns, a [`Control`] pauses, resumes and aborts.

mod clock;
mod control;
mod error;
mod plan;
mod quality;
mod run;
mod sink;

pub use clock::{Clock, SystemClock};
pub use control::{Control, Phase};
pub use error::{AcquireError, PlanError};
pub use plan::PlanSettings;
pub use quality::{AcquireSettings, QualityMode};
pub use run::{Outcome, run};
pub use sink::{Earlier, FrameSink, Judge, SessionSink, StoreOutcome};
