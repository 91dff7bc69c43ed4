//! What is at fault where something was not done: one answer, for the command line's exit code and for HTTP's status.

use super::{BackgroundError, JobError, studying};
use crate::config::ConfigError;
use crate::pipeline::PipelineError;
use crate::session::SessionError;
use grainrig_core::calibrate::ScaleError;
use grainrig_core::contact::ContactError;
use grainrig_core::mesh::MeshError;
use grainrig_core::plausible::Doubt;
use std::error::Error;

/// What is at fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// What was asked makes no sense.
    Usage,
    /// Something else has what it needs, or it is not in the state for this.
    Busy,
    /// There is nothing of that name.
    Absent,
    /// It was tried and failed.
    Failed,
}

impl ErrorKind {
    /// Of an error of this program; of any other nothing is known.
    pub fn of(error: &(dyn Error + 'static)) -> Option<Self> {
        let session = || error.downcast_ref().map(of_session);
        let mesh = || error.downcast_ref().map(of_mesh);
        let contact = || error.downcast_ref().map(of_contact);
        let job = || error.downcast_ref().map(JobError::kind);
        let usage = || (error.is::<ConfigError>() || error.is::<Doubt>()).then_some(Self::Usage);
        job().or_else(session).or_else(mesh).or_else(contact).or_else(usage)
    }

    fn usage_if(is_usage: bool) -> Self {
        if is_usage { Self::Usage } else { Self::Failed }
    }
}

fn of_session(error: &SessionError) -> ErrorKind {
    match error {
        SessionError::Name { .. } | SessionError::Setting { .. } => ErrorKind::Usage,
        SessionError::Locked { .. } => ErrorKind::Busy,
        SessionError::Absent { .. } => ErrorKind::Absent,
        _ => ErrorKind::Failed,
    }
}

fn of_mesh(error: &MeshError) -> ErrorKind {
    ErrorKind::usage_if(matches!(error, MeshError::Control { .. } | MeshError::TooMany { .. }))
}

fn of_contact(error: &ContactError) -> ErrorKind {
    use ContactError::{Doubt, NoRest, Parameter, Setting, Unstable};
    let asked =
        matches!(error, Setting { .. } | Parameter { .. } | Unstable { .. } | NoRest { .. } | Doubt(_));
    ErrorKind::usage_if(asked)
}

impl JobError {
    /// What is at fault.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Of { source, .. } => source.kind(),
            Self::NotNow(_) | Self::Busy(_) => ErrorKind::Busy,
            Self::NoCompression => ErrorKind::Absent,
            Self::Study(e) => ErrorKind::usage_if(studying::is_asked_for(e)),
            Self::Config(_)
            | Self::Usage(_)
            | Self::Name { .. }
            | Self::Unfinished { .. }
            | Self::Calibration { .. }
            | Self::Angles { .. }
            | Self::OtherSize { .. }
            | Self::NotFree { .. }
            | Self::Taken { .. }
            | Self::OneSession { .. }
            | Self::MergedAlready { .. }
            | Self::Doubt(_)
            | Self::Pipeline(
                PipelineError::Setting { .. } | PipelineError::Silhouettes(_) | PipelineError::Doubt(_),
            ) => ErrorKind::Usage,
            Self::Scale(e) => {
                ErrorKind::usage_if(matches!(e, ScaleError::Length { .. } | ScaleError::TooNear { .. }))
            }
            Self::Contact(e) => of_contact(e),
            Self::Session(e) => of_session(e),
            Self::Mesh(e) | Self::Pipeline(PipelineError::Mesh(e)) => of_mesh(e),
            Self::Queue(e) => e.kind(),
            _ => ErrorKind::Failed,
        }
    }
}

impl BackgroundError {
    /// What is at fault.
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Absent => ErrorKind::Absent,
            Self::Full { .. } | Self::Closed | Self::Unstoppable => ErrorKind::Busy,
        }
    }
}
