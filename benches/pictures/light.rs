//! The room: what light comes from where. Directions are the room's: the camera looks along +y.

use super::plan::Light;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// Width of the panel's edge, radians.
const PANEL_EDGE: f64 = 0.03;
/// How wide a lamp is seen in a mirror: the square of its distance, on the unit sphere, at which it fades.
const LAMP_SIZE: f64 = 0.06;
/// A lamp's own level over its light on a white surface.
const LAMP_LEVEL: f64 = 3.0;
/// Where the softbox is.
const SOFTBOX: [f64; 3] = [-0.75, -0.55, 0.35];

/// A row's light, ready for use.
pub struct Room {
    light: Light,
    /// Directions to the lamps, and their strength.
    pub lamps: Vec<(V, f64)>,
}

impl Room {
    /// Of a row's light.
    pub fn new(light: &Light) -> Self {
        let lamps = light.lamps.iter().map(|lamp| {
            let (azimuth, height) = (lamp.azimuth_deg.to_radians(), lamp.height_deg.to_radians());
            let flat = height.cos();
            (V::new(azimuth.sin() * flat, -azimuth.cos() * flat, height.sin()), lamp.strength)
        });
        Self { lamps: lamps.collect(), light: light.clone() }
    }

    /// The level seen in a direction: the panel behind the grain, the softbox, lamps, walls, a dark bench.
    pub fn seen(&self, d: &V) -> f64 {
        let light = &self.light;
        let mut level = if d.z < -0.5 { 0.4 * light.room } else { light.room };
        if light.panel_deg > 0.0 && d.y > 0.0 {
            let aside = d.x.atan2(d.y).abs().max(d.z.atan2(d.y).abs());
            let beyond = (aside - light.panel_deg.to_radians()) / PANEL_EDGE;
            level += light.background / (1.0 + beyond.clamp(-40.0, 40.0).exp());
        }
        let lobe = |to: &V, size: f64| (-(d - to).norm_squared() / size).exp();
        if light.softbox > 0.0 {
            level += light.softbox * lobe(&V::from(SOFTBOX), 0.08);
        } else {
            for (to, strength) in &self.lamps {
                level += LAMP_LEVEL * strength * lobe(to, LAMP_SIZE);
            }
        }
        level
    }

    /// Light on a surface of this normal from everywhere but the lamps: the room's, and the panel's around the body's edge.
    pub fn around(&self, normal: &V) -> f64 {
        let light = &self.light;
        let half = light.panel_deg.to_radians().sin();
        let facing = ((normal.y + half) / (1.0 + half)).max(0.0);
        light.ambient * (0.75 + 0.25 * normal.z) + light.background * (half * facing).powi(2)
    }

    /// What glows inside a cloudy body of white clouds.
    pub fn glow(&self) -> f64 {
        let light = &self.light;
        let panel = if light.panel_deg > 0.0 { 0.3 * light.background } else { 0.0 };
        let lamps: f64 = self.lamps.iter().map(|(_, strength)| strength).sum();
        panel + if light.softbox > 0.0 { 0.05 } else { 0.3 } * lamps + 0.5 * light.ambient
    }
}
