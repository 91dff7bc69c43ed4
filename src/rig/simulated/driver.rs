//! The simulated rig as the table of drivers has it: a stage to try a camera out, a camera to try a stage out.

use super::{Settings, SimulatedStage, open, take_up};
use crate::rig::discovery::{Found, Role};
use crate::rig::driver::{OpenCamera, OpenStage};
use crate::rig::{
    Before, Camera as _, CameraDriver, Driver, RigError, RotationStage as _, Shutter, StageDriver,
};
use grainrig_core::plausible::{self, Doubt};
use std::path::Path;

impl Driver for Settings {
    fn check(&self) -> Result<(), RigError> {
        Self::check(self)
    }

    fn doubts(&self) -> Vec<Doubt> {
        let mut doubts: Vec<Doubt> = plausible::GRAIN_SIZE.doubt(self.grain_size_mm).into_iter().collect();
        doubts.extend(self.sphere_diameter_mm.and_then(|d| plausible::SPHERE.doubt(d)));
        doubts.extend(plausible::MM_PER_PX.named("simulated.mm_per_px").doubt(self.mm_per_px));
        let distance = plausible::CAMERA_DISTANCE.named("simulated.camera_distance_mm");
        doubts.extend(self.camera_distance_mm.and_then(|d| distance.doubt(d)));
        doubts
    }

    /// A file of the daemon's computer.
    fn fixed(&self) -> &'static [&'static str] {
        &["/grain_stl"]
    }
}

impl StageDriver for Settings {
    fn found(&self, _root: &Path) -> Result<Vec<Found>, RigError> {
        let stage = SimulatedStage::new(self, std::sync::Arc::default(), 0);
        Ok(vec![Found::computed(Role::Stage, stage.describe())])
    }

    fn means(&self, _found: &Found) -> bool {
        true
    }

    fn open(&self, before: Before) -> Result<OpenStage, RigError> {
        take_up(self, before).map(|(stage, ..)| OpenStage::alone(stage))
    }
}

impl CameraDriver for Settings {
    fn found(&self, _root: &Path) -> Result<Vec<Found>, RigError> {
        Ok(vec![Found::computed(Role::Camera, open(self)?.1.describe())])
    }

    fn open(&self, before: Before, _shutter: Option<Box<dyn Shutter>>) -> Result<OpenCamera, RigError> {
        let (_, camera, truth) = take_up(self, before)?;
        Ok(OpenCamera { camera: Box::new(camera), truth: Some(truth) })
    }
}
