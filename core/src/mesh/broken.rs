//! A control that a mesh does not keep, and how much finer the next attempt must be.

/// A figure as people read it.
fn figure(x: f64) -> String {
    if (0.01..1e4).contains(&x.abs()) { format!("{x:.4}") } else { format!("{x:.3e}") }
}

/// A control that the mesh does not keep.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "{name} = {} {unit} could not be kept: the last mesh tried has {} {unit} ({what}); {remedy}",
    figure(*promised), figure(*reached)
)]
pub struct BrokenControl {
    /// The control.
    pub name: &'static str,
    /// What was asked for.
    pub promised: f64,
    /// What the mesh has.
    pub reached: f64,
    /// The unit of both.
    pub unit: &'static str,
    /// What was measured.
    pub what: &'static str,
    /// What to change.
    pub remedy: &'static str,
}

impl BrokenControl {
    /// Makes the next attempt's spacings (surface, contact, volume) finer, each a factor of what it was.
    pub(super) fn refine(&self, finer: &mut [f64; 3]) {
        match self.name {
            "facet_angle_deg" => finer.iter_mut().for_each(|f| *f *= 0.97),
            "tet_volume_mm3" => finer[2] *= 0.98 * (self.promised / self.reached).cbrt(),
            // Between flat pieces the distance falls with the size, on curved ones with its square.
            "distance_mm" => finer[0] *= 0.95 * (self.promised / self.reached).powf(0.7),
            "size_at_contact_mm" => finer[1] *= 0.98 * self.promised / self.reached,
            _ => finer[0] *= 0.98 * self.promised / self.reached,
        }
    }
}
