//! A compression of which nothing is kept but its curve: one of many.

use super::{CompressInput, CompressSettings, JobError, PIECE, Placing, body, press};
use grainrig_core::contact::CurvePoint;
use std::sync::atomic::{AtomicBool, Ordering};

/// What came of it.
pub(in crate::jobs) struct Alone {
    /// Force against the approach of the plates, from where the plates held the grain on.
    pub curve: Vec<CurvePoint>,
    /// The approach that went into turning the grain before, mm.
    pub rocked_mm: f64,
    /// Tetrahedra.
    pub elements: usize,
}

/// Meshes a body and presses it to the end; none where `stop` was set before. `told` hears how much is done, 0 to 1.
///
/// # Errors
/// [`JobError`]: a body that cannot be meshed, an element that fails.
pub(in crate::jobs) fn alone(
    input: &CompressInput,
    placing: &Placing,
    mut settings: CompressSettings,
    stop: &AtomicBool,
    told: &dyn Fn(f64),
) -> Result<Option<Alone>, JobError> {
    let placed = body::placed(input, placing, settings.friction, &mut |_, _| ())?;
    settings.middle_mm = placed.middle_mm;
    settings.gap_mm = placed.gap_mm;
    settings.rocking = placed.rocking;
    let mut press = press(&placed.mesh, &settings)?;
    while !press.finished() {
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        if press.advance(PIECE)? {
            told(press.done());
        }
    }
    let start = CurvePoint { approach_mm: press.begins_mm(), force_n: 0.0 };
    let curve = std::iter::once(start).chain(press.samples().iter().map(CurvePoint::from)).collect();
    let rocked_mm = settings.rocked_mm();
    Ok(Some(Alone { curve, rocked_mm, elements: press.body().elements() }))
}
