//! Curves that are drawn beside a compression's own: the laboratory's test, and other compressions.

use super::{CompressRequest, CompressResult, OtherCurve, RESULT};
use crate::jobs::error::Of as _;
use crate::jobs::{JobError, Names};
use crate::session::Recording;
use crate::system::read_head;
use grainrig_core::contact::experiment::{self, Compliance, Experiment};
use std::path::{Path, PathBuf};

/// The most that is read of an export or of another compression's result, bytes: a million rows.
const MOST_BYTES: usize = 64 << 20;

/// The curves that are asked for; `recording` is the session whose grain is compressed, where it is one's.
pub(in crate::jobs) fn others(
    request: &CompressRequest,
    names: &Names,
    recording: Option<&Recording>,
) -> Result<Vec<OtherCurve>, JobError> {
    let read = |given: &Path| -> Result<Experiment, JobError> {
        experiment::read(&bounded(&names.input(given)?, "a Bluehill export")?).of(given)
    };
    let mut out = Vec::new();
    if let Some(given) = &request.experiment {
        let compliance = match (request.compliance_um_per_n, &request.plate_on_plate) {
            (Some(_), Some(_)) => {
                let text = "give the machine's compliance (compliance_um_per_n) or its test (plate_on_plate), not both";
                return Err(JobError::Usage(text.into()));
            }
            (Some(c), None) => Compliance::given(c).map_err(|e| JobError::Usage(e.to_string()))?,
            (None, Some(plates)) => Compliance::measured(&read(plates)?).of(plates)?,
            (None, None) => Compliance::none(),
        };
        let (points, reading) = read(given)?.read_off(&compliance, request.transition_n).of(given)?;
        let measured = Some((given.display().to_string(), reading));
        out.push(OtherCurve { name: "experiment".into(), points, measured });
    }
    for given in &request.beside {
        let path = folder(given, names, recording)?.join(RESULT);
        let bytes = bounded(&path, "a result of a compression")?;
        let result: CompressResult = serde_json::from_slice(&bytes).map_err(|e| {
            JobError::Content(format!("{} is no result of a compression: {e}", path.display()))
        })?;
        let name = result.settings.material.law().legend;
        out.push(OtherCurve { name: name.into(), points: result.curve, measured: None });
    }
    Ok(out)
}

/// The folder of another compression: as it is named, of the same session, or of the session before the slash.
fn folder(given: &Path, names: &Names, recording: Option<&Recording>) -> Result<PathBuf, JobError> {
    let as_named = names.input(given);
    if let Ok(path) = &as_named
        && path.join(RESULT).exists()
    {
        return as_named;
    }
    let text = given.to_str().unwrap_or_default();
    let in_session = match text.split_once('/') {
        Some((session, name)) => {
            names.store().read(session).ok().and_then(|other| other.compression_path(name).ok())
        }
        None => recording.and_then(|same| same.compression_path(text).ok()),
    };
    in_session.filter(|path| path.join(RESULT).exists()).map_or(as_named, Ok)
}

/// The bytes of a file that holds so much at most: a sparse one may claim any length, and a device has no end.
fn bounded(path: &Path, what: &str) -> Result<Vec<u8>, JobError> {
    let (bytes, length) = read_head(path, MOST_BYTES + 1)?;
    if bytes.len() <= MOST_BYTES {
        return Ok(bytes);
    }
    let size = if length > MOST_BYTES as u64 { format!("has {length} bytes") } else { "does not end".into() };
    Err(JobError::Content(format!(
        "{} {size}: {what} has at most {MOST_BYTES} (a million rows); check the path, or export fewer rows",
        path.display()
    )))
}
