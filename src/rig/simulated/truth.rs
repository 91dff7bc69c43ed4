//! What the simulated rig knows and a real one does not: where the grain stood, and what it is.

use super::Shared;
use super::optics::Optics;
use super::raster::{View, Window};
use super::scene::Scene;
use super::settings::Settings;
use super::stage::lock;
use crate::rig::RigError;
use grainrig_core::formats::stl;
use grainrig_core::geometry::{Angle, Projection, TriangleMesh};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex};

/// The record of the truth; lengths mm, angles as their names say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Truth {
    /// The settings, the seed among them.
    pub settings: Settings,
    /// The camera.
    pub camera: Optics,
    /// Volume of the whole grain, mm³.
    pub grain_volume_mm3: f64,
    /// Volume of the part above the pedestal's top, which is all that silhouettes can show, mm³.
    pub volume_above_pedestal_mm3: f64,
    /// Height of the pedestal's top in the table's frame, mm: zero by definition.
    pub pedestal_top_mm: f64,
    /// Every exposure so far, failed ones too.
    pub exposures: Vec<Exposure>,
}

/// The truth of one exposure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exposure {
    /// Its number, from 0.
    pub number: usize,
    /// The angle by which the grain was truly turned (a slip included), degrees.
    pub true_angle_deg: f64,
    /// The view's own sideways shift, pixels.
    pub wobble_px: f64,
    /// When it ended, seconds of the rig's (computed) time.
    pub time_s: f64,
}

/// How much of each pixel the grain above the pedestal's top covers: what a perfect segmentation finds.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// The rectangle of the picture that holds it; nothing is covered outside.
    pub window: Window,
    /// `[row, column]`, row-major: 0 to 1.
    pub coverage: Vec<f32>,
}

impl Coverage {
    /// The silhouette's area, square pixels.
    pub fn area_px(&self) -> f64 {
        self.coverage.iter().map(|x| f64::from(*x)).sum()
    }
    /// The silhouette's centroid: column and row in the whole picture, pixels. NaN where it is empty.
    pub fn centroid_px(&self) -> [f64; 2] {
        let mut sum = [0.0; 2];
        for (k, x) in self.coverage.iter().enumerate() {
            let place = [k % self.window.size[0], k / self.window.size[0]];
            for i in 0..2 {
                sum[i] += f64::from(*x) * (self.window.origin[i] + place[i]) as f64;
            }
        }
        sum.map(|s| s / self.area_px())
    }
}

/// The way to the truth of a running simulation.
#[derive(Clone)]
pub struct TruthHandle {
    scene: Arc<Scene>,
    shared: Arc<Mutex<Shared>>,
}

impl TruthHandle {
    pub(super) fn new(scene: Arc<Scene>, shared: Arc<Mutex<Shared>>) -> Self {
        Self { scene, shared }
    }

    /// The truth up to now.
    pub fn truth(&self) -> Truth {
        Truth {
            settings: self.scene.settings.clone(),
            camera: self.scene.optics.clone(),
            grain_volume_mm3: self.scene.body.volume_mm3(),
            volume_above_pedestal_mm3: self.scene.body.volume_above_zero_mm3(),
            pedestal_top_mm: 0.0,
            exposures: lock(&self.shared).exposures.clone(),
        }
    }

    /// The grain's surface in the table's frame at angle 0, mm.
    pub fn truth_mesh(&self) -> &TriangleMesh {
        &self.scene.body
    }

    /// Turns the table to a true angle: another stage than the simulated one carries the grain.
    pub fn turn_to(&self, angle: Angle) {
        lock(&self.shared).stage_angle = angle;
    }

    /// The true camera at a true angle and with a view's own sideways shift (see [`Exposure`]).
    pub fn projection(&self, true_angle: Angle, wobble_px: f64) -> Projection {
        self.scene.optics.projection(true_angle, wobble_px)
    }

    /// The silhouette at a true angle and with a view's own sideways shift, without blur and noise.
    pub fn true_silhouette(&self, true_angle: Angle, wobble_px: f64) -> Coverage {
        let view = View::new(&self.scene.body, &self.scene.optics, true_angle, wobble_px);
        let window = view.body_window(2.0);
        Coverage { window, coverage: view.grain_coverage(window) }
    }

    /// The files that keep the truth: `truth.json` (a [`Truth`]) and `truth.stl` (the grain at angle 0, mm).
    ///
    /// # Errors
    /// [`RigError::Device`] where a figure does not fit its format.
    pub fn files(&self) -> Result<[(&'static str, Vec<u8>); 2], RigError> {
        let json = serde_json::to_vec_pretty(&self.truth())
            .map_err(|e| RigError::Device(format!("the rig's truth cannot be encoded: {e}")))?;
        let mut surface = Vec::new();
        stl::write(&self.scene.body, &mut surface).map_err(|e| RigError::Device(e.to_string()))?;
        Ok([("truth.json", json), ("truth.stl", surface)])
    }
}
