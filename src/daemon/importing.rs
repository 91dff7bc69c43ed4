//! Somebody's photographs become a session and go the same way as the rig's.

use super::recorded::{computation, compute, conclude};
use super::{DaemonError, Finished, Watcher};
use crate::config::Config;
use crate::pipeline::{Cameras, LengthUnit, TurntableSettings};
use crate::session::Store;
use crate::session::import::{ImportRequest, scan};
use crate::trace;
use grainrig_core::plausible;
use std::path::Path;
use std::sync::{Arc, Mutex};

/// How the photographs see the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ImportGeometry {
    /// One camera that stands still before a turntable.
    Turntable {
        /// What is known of it.
        table: TurntableSettings,
        /// Width and height of the pictures that its scale was measured in, pixels.
        picture_px: Option<[u32; 2]>,
    },
    /// A camera for each photograph, from the request's camera file, whose world has this unit.
    Cameras(LengthUnit),
}

/// Imports photographs as a new session and computes its products. Blocks until all is done.
///
/// # Errors
/// [`DaemonError`]; where a photograph or a camera can't be used, nothing is left of the session. Where only the
/// computation fails the session stays.
pub fn import(
    data: &Path,
    name: &str,
    config: &Config,
    request: &ImportRequest,
    geometry: ImportGeometry,
    watcher: &Watcher,
) -> Result<Finished, DaemonError> {
    trace::job("import", name, || imported(data, name, config, request, geometry, watcher))
}

fn imported(
    data: &Path,
    name: &str,
    config: &Config,
    request: &ImportRequest,
    geometry: ImportGeometry,
    watcher: &Watcher,
) -> Result<Finished, DaemonError> {
    config.check()?;
    if let ImportGeometry::Turntable { table, .. } = geometry {
        let doubts: Vec<_> = (table.doubts().into_iter())
            .chain(plausible::VIEW_STEP.named("step_deg").doubt(request.step_deg))
            .collect();
        plausible::slips(&doubts, config.as_given)?;
        table.check()?;
        plausible::settle(doubts, config.as_given)?;
    }
    let found = scan(request)?;
    let cameras = match geometry {
        ImportGeometry::Turntable { table, picture_px } => {
            if let Some(calibrated) = picture_px.filter(|s| *s != found.size) {
                return Err(DaemonError::OtherSize { calibrated, pictures: found.size });
            }
            Cameras::Turntable(table)
        }
        ImportGeometry::Cameras(unit) => {
            Cameras::Given { projections: found.cameras.iter().map(|c| c.1.clone()).collect(), unit }
        }
    };
    let encode = |e: serde_json::Error| DaemonError::Encode(e.to_string());
    let config = serde_json::to_value(config).map_err(encode)?;
    let cameras = serde_json::to_value(cameras).map_err(encode)?;
    let mut session = found.import(&Store::new(data), name, config, cameras)?;
    // Whoever watches hears of the imported views as of captured ones.
    session.recording().events().iter().for_each(|e| watcher(e));
    let watch = Arc::clone(watcher);
    session.observe(move |e| watch(e));
    let recording = session.recording().clone();
    let (_, pipeline) = computation(&recording)?;
    let session = Mutex::new(session);
    let outcome = compute(&recording, &pipeline, &session);
    conclude(&session, outcome, None)
}
