//! A session's grain, and the places of its compressions.

use super::asked::{Asked, asked, is_finished};
use super::{Claim, CompressInput, CompressRequest, JobError};
use crate::session::{Recording, State, check_name};
use grainrig_core::formats::stl;
use std::path::Path;

/// The surface of a session's grain.
const SURFACE: &str = "grain.stl";

/// Claims a place among a session's compressions: under the name of its material, with a number where there is one already.
/// Where `goes_on`, the very same one that was interrupted is gone on with. The name comes with it.
///
/// # Errors
/// [`JobError`] for figures that make no sense, and for a session without a finished grain.
pub(super) fn claim_of(
    recording: &Recording,
    request: &CompressRequest,
    goes_on: bool,
) -> Result<(String, Claim), JobError> {
    let settings = request.settings()?;
    let input = grain(recording)?;
    let placing = request.placing();
    let wanted = Asked::new(&input, &placing, &settings)?;
    let is_same =
        |folder: &Path| asked(folder).is_some_and(|before| before == wanted) && !is_finished(folder);
    let first = request.material.0.name;
    let mut name = first.to_owned();
    for number in 2.. {
        let folder = recording.compression_path(&name)?;
        if folder.symlink_metadata().is_err() || (goes_on && is_same(&folder)) {
            return Ok((name, Claim::new(&folder, input, &placing, &settings)?));
        }
        name = format!("{first}-{number}");
        check_name("compression", &name)?;
    }
    Err(JobError::NoCompression)
}

/// The session's grain as it was recorded.
///
/// # Errors
/// [`JobError::Unfinished`] for a session without one; [`JobError::Session`] where it is not the recorded one any more.
pub(super) fn grain(recording: &Recording) -> Result<CompressInput, JobError> {
    let session = &recording.manifest().name;
    let record = recording.products().find(|p| p.file == SURFACE);
    let record = record.filter(|_| recording.state() == State::Complete);
    let record = record.ok_or_else(|| JobError::Unfinished { session: session.clone() })?;
    let bytes = recording.product(&record.file)?;
    let surface = stl::read(&bytes)?;
    // What of it the pedestal hid; views without a pedestal hid nothing.
    let hidden_mm = recording.result().and_then(|r| r.pointer("/hull/contact_patch/height_mm")?.as_f64());
    Ok(CompressInput::Surface { surface, name: format!("session {session}"), hidden_mm })
}
