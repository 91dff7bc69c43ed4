//! The words that rows of the plan are written in.

use super::plan::{Camera, Curve, Dirt, Hair, Lamp, Light, Material, Part, Pose, Row, Skin};

impl Row {
    /// With anything changed.
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// Its diameter in mm and in the picture.
    pub fn size(self, mm: f64, px: f64) -> Self {
        self.with(|r| (r.size_mm, r.size_px) = (mm, px))
    }

    /// Another pose.
    pub fn pose(self, pose: Pose) -> Self {
        self.with(|r| r.pose = pose)
    }

    /// Matt, of this albedo.
    pub fn opaque(self, albedo: f64) -> Self {
        self.with(|r| r.skin.albedo = albedo)
    }

    /// Glossy over a ground of this albedo.
    pub fn glossy(self, albedo: f64) -> Self {
        self.with(|r| {
            r.material = Material::Glossy { index: 1.6 };
            r.skin = Skin { albedo, shine: 0.0, mottle: 0.25, bump: 0.06, ..r.skin };
        })
    }

    /// Clear, with so much cloud (0.3 as glass, 6 like milk).
    pub fn clear(self, cloud: f64) -> Self {
        self.with(|r| {
            r.material = Material::Clear { index: 1.545, cloud };
            r.skin.mottle_mm = 0.5;
        })
    }

    /// In two colours.
    pub fn two(self, albedo: f64, part: Part) -> Self {
        self.with(|r| r.skin.second = Some((albedo, part)))
    }

    /// With the roughness of a fracture.
    pub fn rough(self, bump: f64) -> Self {
        self.with(|r| r.skin.bump = bump)
    }

    /// Before a panel of this half angle and level.
    pub fn panel(self, half_deg: f64, level: f64) -> Self {
        self.with(|r| (r.light.panel_deg, r.light.background) = (half_deg, level))
    }

    /// Before a dark background, lit by these lamps (azimuth, height, strength).
    pub fn dark_field(self, lamps: &[(f64, f64, f64)]) -> Self {
        self.with(|r| {
            let lamp = |&(azimuth_deg, height_deg, strength)| Lamp { azimuth_deg, height_deg, strength };
            r.light = Light {
                background: 0.012,
                panel_deg: 0.0,
                room: 0.02,
                ambient: 0.18,
                softbox: 0.0,
                lamps: lamps.iter().map(lamp).collect(),
                ..r.light
            };
            r.pedestal.albedo = 0.03;
        })
    }

    /// On another pedestal.
    pub fn pedestal(self, diameter_mm: f64, albedo: f64) -> Self {
        self.with(|r| (r.pedestal.diameter_mm, r.pedestal.albedo) = (diameter_mm, albedo))
    }

    /// With a foot of glue.
    pub fn glue(self, height_mm: f64, albedo: f64) -> Self {
        self.with(|r| r.pedestal.glue = Some((height_mm, albedo)))
    }

    /// Hanging below the pedestal's top.
    pub fn hanging(self, off_mm: [f64; 2]) -> Self {
        self.with(|r| (r.hangs, r.off_mm) = (true, off_mm))
    }

    /// Its centre so far beside the axis.
    pub fn off(self, off_mm: [f64; 2]) -> Self {
        self.with(|r| r.off_mm = off_mm)
    }

    /// Coded otherwise.
    pub fn curve(self, curve: Curve) -> Self {
        self.with(|r| r.file.curve = curve)
    }

    /// With this quality of JPEG (0 for PNG) and noise.
    pub fn file(self, quality: u8, noise: f64) -> Self {
        self.with(|r| (r.file.quality, r.file.noise) = (quality, noise))
    }

    /// In colour: of the light and of the grain.
    pub fn colour(self, light: [f64; 3], grain: [f64; 3]) -> Self {
        self.with(|r| (r.file.colour, r.skin.tint) = (Some(light), grain))
    }

    /// Blurred so far, and by a disc of this radius, pixels.
    pub fn blur(self, sigma_px: f64, disc_px: f64) -> Self {
        self.with(|r| (r.camera.blur_px, r.camera.disc_px) = (sigma_px, disc_px))
    }

    /// Seen from another place.
    pub fn camera(self, distance_mm: f64, pitch_deg: f64, roll_deg: f64) -> Self {
        self.with(|r| r.camera = Camera { distance_mm, pitch_deg, roll_deg, ..r.camera })
    }

    /// With dirt.
    pub fn dirt(self, specks: usize, sensor: usize, hair: Option<Hair>) -> Self {
        self.with(|r| r.dirt = Dirt { specks, sensor, hair })
    }

    /// With pictures of a ball.
    pub fn balls(self) -> Self {
        self.with(|r| r.has_balls = true)
    }

    /// With the empty stage's picture given to the program.
    pub fn with_empty(self) -> Self {
        self.with(|r| r.gives_empty = true)
    }
}
