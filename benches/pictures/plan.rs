//! What a set of pictures shows and how it is taken: a row of the plan.

use serde::Serialize;

/// A set of pictures. Lengths mm, light from 0 to 1 (white), angles degrees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What it is.
    pub name: &'static str,
    /// The file of its shape.
    pub shape: &'static str,
    /// Diameter of the ball with the grain's volume, mm.
    pub size_mm: f64,
    /// The same in the picture, pixels.
    pub size_px: f64,
    /// How it stands.
    pub pose: Pose,
    /// Whether it rests where it is lowest over the pedestal, so that other parts may hang below the top.
    pub hangs: bool,
    /// Where its centre is beside the axis, mm.
    pub off_mm: [f64; 2],
    /// How deep it sits in the pedestal's top (in glue), mm.
    pub embed_mm: f64,
    /// What it is made of.
    pub material: Material,
    /// Its surface.
    pub skin: Skin,
    /// The light.
    pub light: Light,
    /// The pedestal.
    pub pedestal: Pedestal,
    /// The camera.
    pub camera: Camera,
    /// How the picture is written.
    pub file: File,
    /// What is seen and does not belong there.
    pub dirt: Dirt,
    /// Standard deviation of a step, degrees.
    pub step_sd_deg: f64,
    /// Standard deviation of a view's sideways shift, pixels.
    pub wobble_sd_px: f64,
    /// Whether pictures of a ball belong to it.
    pub has_balls: bool,
    /// Whether the picture of the empty stage is given to the program.
    pub gives_empty: bool,
    /// How far the grain slips before view 13, degrees.
    pub slip_deg: f64,
    /// What its random numbers come from.
    pub seed: u64,
}

/// How a grain stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Pose {
    /// Its shortest axis upright.
    Flat,
    /// Its longest axis upright.
    Upright,
    /// Flat, then tipped about a horizontal axis by so much.
    Tipped(f64),
}

/// What a grain is made of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Material {
    /// Matt, with a highlight.
    Opaque,
    /// A mirror over a matt ground, by Fresnel's equations.
    Glossy {
        /// Its refractive index.
        index: f64,
    },
    /// Light goes through it.
    Clear {
        /// Its refractive index.
        index: f64,
        /// How much light is scattered on the way, 1/mm.
        cloud: f64,
    },
}

/// A surface.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Skin {
    /// Share of light that is scattered back.
    pub albedo: f64,
    /// How much that varies.
    pub mottle: f64,
    /// Over which length, mm.
    pub mottle_mm: f64,
    /// The highlight's strength.
    pub shine: f64,
    /// How far the normal is off what the shape has, by roughness that it lacks.
    pub bump: f64,
    /// Another albedo, and where.
    pub second: Option<(f64, Part)>,
    /// Red, green and blue of what is scattered.
    pub tint: [f64; 3],
}

/// A part of a grain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Part {
    /// One side of an upright plane through the middle.
    Half,
    /// Above the middle height.
    Top,
    /// A band around the middle height.
    Band,
    /// Spots.
    Spots,
}

/// The light in which the grain stands.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Light {
    /// The background's level in the middle of the picture.
    pub background: f64,
    /// How much darker its corners are.
    pub vignette: f64,
    /// How much it grows from left to right.
    pub gradient: f64,
    /// The same from top to bottom.
    pub gradient_down: f64,
    /// Half the angle that the bright panel behind the grain has; 0 without one.
    pub panel_deg: f64,
    /// The walls' level.
    pub room: f64,
    /// Light from everywhere.
    pub ambient: f64,
    /// Level of a large soft light at the left front.
    pub softbox: f64,
    /// Lamps.
    pub lamps: Vec<Lamp>,
}

/// A small lamp, far away.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Lamp {
    /// 0 beside the camera, 90 at the right, 180 behind the grain.
    pub azimuth_deg: f64,
    /// Above the horizon.
    pub height_deg: f64,
    /// Light on a white surface that faces it.
    pub strength: f64,
}

/// A pedestal.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Pedestal {
    /// Its diameter, mm.
    pub diameter_mm: f64,
    /// Share of light that is scattered back.
    pub albedo: f64,
    /// Share of light that is mirrored.
    pub mirror: f64,
    /// Height of a foot of glue on its top, mm, with its albedo.
    pub glue: Option<(f64, f64)>,
}

/// A camera.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Camera {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// From the lens's centre to the axis, mm; 0 for a telecentric lens.
    pub distance_mm: f64,
    /// How far its rays rise, degrees; below 0 it looks down.
    pub pitch_deg: f64,
    /// Its turn, degrees.
    pub roll_deg: f64,
    /// Where the axis' foot is in the picture, shares of its width and height.
    pub foot: [f64; 2],
    /// Standard deviation of the blur, pixels.
    pub blur_px: f64,
    /// Radius of a disc of defocus, pixels.
    pub disc_px: f64,
}

/// How light becomes a file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct File {
    /// How levels are coded.
    pub curve: Curve,
    /// Standard deviation of the noise, grey levels of 255.
    pub noise: f64,
    /// The same for white, of noise that grows as the root of the light.
    pub shot: f64,
    /// JPEG's quality; 0 for PNG.
    pub quality: u8,
    /// Red, green and blue of the light, in a picture in colour.
    pub colour: Option<[f64; 3]>,
    /// Red, green and blue of the background.
    pub backdrop: [f64; 3],
}

/// Codings of light.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Curve {
    /// As it is.
    Linear,
    /// sRGB's.
    Srgb,
    /// A camera's own: a toe, a shoulder, and more contrast in between.
    Film,
}

/// What does not belong there.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Dirt {
    /// Specks on the background.
    pub specks: usize,
    /// Soft spots on the sensor.
    pub sensor: usize,
    /// A hair.
    pub hair: Option<Hair>,
}

/// Where a hair lies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub enum Hair {
    /// Behind the grain, beside it.
    Beside,
    /// Behind the grain, so that it seems to touch it.
    Touching,
}

impl Row {
    /// An opaque grain, flat on a dark pedestal before a bright panel, in a JPEG coded as sRGB.
    pub fn new(name: &'static str, shape: &'static str) -> Self {
        Self {
            name,
            shape,
            size_mm: 1.2,
            size_px: 300.0,
            pose: Pose::Flat,
            hangs: false,
            off_mm: [0.03, -0.04],
            embed_mm: 0.012,
            material: Material::Opaque,
            skin: Skin {
                albedo: 0.45,
                mottle: 0.35,
                mottle_mm: 0.15,
                shine: 0.2,
                bump: 0.0,
                second: None,
                tint: [1.0; 3],
            },
            light: Light {
                background: 0.8,
                vignette: 0.3,
                gradient: 0.1,
                gradient_down: 0.0,
                panel_deg: 25.0,
                room: 0.05,
                ambient: 0.2,
                softbox: 0.8,
                lamps: vec![Lamp { azimuth_deg: -36.0, height_deg: 21.0, strength: 0.75 }],
            },
            pedestal: Pedestal { diameter_mm: 0.5, albedo: 0.12, mirror: 0.0, glue: None },
            camera: Camera {
                width: 1024,
                height: 768,
                distance_mm: 120.0,
                pitch_deg: 0.0,
                roll_deg: 0.4,
                foot: [0.495, 0.76],
                blur_px: 0.8,
                disc_px: 0.0,
            },
            file: File {
                curve: Curve::Srgb,
                noise: 1.5,
                shot: 0.0,
                quality: 95,
                colour: None,
                backdrop: [1.0; 3],
            },
            dirt: Dirt::default(),
            step_sd_deg: 0.05,
            wobble_sd_px: 0.3,
            has_balls: false,
            gives_empty: false,
            slip_deg: 0.0,
            seed: name.bytes().fold(7, |seed, b| (seed * 31 + u64::from(b)) % 1_000_003),
        }
    }

    /// Size of a pixel at the axis, mm.
    pub fn mm_per_px(&self) -> f64 {
        self.size_mm / self.size_px
    }

    /// Column and row of the axis' foot, pixels.
    pub fn foot_px(&self) -> [f64; 2] {
        let [x, y] = self.camera.foot;
        [(x * self.camera.width as f64 * 10.0).round() / 10.0, (y * self.camera.height as f64).round()]
    }

    /// Whether light does not go through it.
    pub fn is_opaque(&self) -> bool {
        !matches!(self.material, Material::Clear { .. })
    }
}
