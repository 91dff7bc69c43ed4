//! The scene: lights, surfaces, background and lens blur; a view of it as grey levels.

use super::grain;
use super::optics::Optics;
use super::random::{self, Purpose};
use super::raster::{Shades, View, Window};
use super::settings::Settings;
use crate::rig::RigError;
use grainrig_core::geometry::{Angle, TriangleMesh, Vector};
use grainrig_core::silhouette::ToneCurve;
use rayon::prelude::*;

/// Everything before the shutter that does not move.
pub struct Scene {
    /// The settings it was made from.
    pub settings: Settings,
    /// The grain in the table's frame at angle 0.
    pub body: TriangleMesh,
    /// The lens.
    pub optics: Optics,
    surface: Vec<Facet>,
    across: Vec<f32>,
    down: Vec<f32>,
}

/// A triangle's outward normal and how much of the light it gives back.
struct Facet {
    normal: Vector,
    albedo: f32,
}

/// The part of a picture that holds grain and pedestal, before noise; `[row, column]`, row-major.
pub struct Patch {
    /// Where it lies in the picture.
    pub window: Window,
    /// Grey level, 0 to 255.
    pub level: Vec<f32>,
    /// How much of the pixel is grain, 0 to 1: the grain has a tint.
    pub grain: Vec<f32>,
}

/// What spoils one exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spoiled {
    /// Standard deviation of the blur beside the lens's own, pixels.
    pub defocus_px: f64,
    /// How far the picture moves to the right during the exposure, pixels.
    pub shake_px: f64,
    /// Light, of what it should be.
    pub light: f32,
    /// Whether something hangs into the picture.
    pub obstructed: bool,
}

impl Default for Spoiled {
    fn default() -> Self {
        Self { defocus_px: 0.0, shake_px: 0.0, light: 1.0, obstructed: false }
    }
}

/// How the camera's files code light.
const CODING: ToneCurve = ToneCurve::Srgb;
/// Width of what hangs into the picture, as a share of the grain's size.
const OBSTACLE: f64 = 0.15;

/// Grey levels of the three things in a picture.
struct Levels {
    background: f32,
    grain: f32,
    pedestal: f32,
}

impl Levels {
    fn of(settings: &Settings) -> Self {
        if settings.bright_background {
            Self { background: 216.0, grain: 118.0, pedestal: 32.0 }
        } else {
            Self { background: 20.0, grain: 205.0, pedestal: 84.0 }
        }
    }
}

impl Scene {
    /// Builds the scene.
    ///
    /// # Errors
    /// [`RigError::Device`] where a setting is outside its limits, the STL is bad or the grain does not fit
    /// the picture.
    pub fn new(settings: &Settings) -> Result<Self, RigError> {
        settings.check()?;
        let body = grain::placed(settings)?;
        let optics = Optics::before(settings, &body)?;
        let mottle = random::key(settings.seed, Purpose::Texture);
        let facets = (0..body.triangles.len())
            .map(|t| {
                let [a, b, c] = body.corners(t);
                let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector::zeros);
                let middle = (a.coords + b.coords + c.coords) / (3.0 * settings.grain_size_mm);
                Facet { normal, albedo: albedo(mottle, &middle) }
            })
            .collect();
        let (across, down) = unevenness(settings);
        Ok(Self { settings: settings.clone(), body, optics, surface: facets, across, down })
    }

    /// The background's grey level at a pixel.
    #[inline]
    pub fn background(&self, column: usize, row: usize) -> f32 {
        self.across[column] * self.down[row]
    }

    /// The background's factors along a row: its level is this times [`Self::background_down`].
    pub fn background_across(&self) -> &[f32] {
        &self.across
    }

    /// The background's factor of a row.
    pub fn background_down(&self, row: usize) -> f32 {
        self.down[row]
    }

    /// The sideways shift of the `exposure`-th view, pixels.
    pub fn wobble_px(&self, exposure: usize, normal: &random::Normal) -> f64 {
        let bits = random::bits(random::key(self.settings.seed, Purpose::Wobble), exposure as u64);
        f64::from(normal.pick(bits)) * self.settings.wobble_px
    }

    /// Grain and pedestal at a true angle, blurred by the lens and by what spoils the exposure.
    pub fn patch(&self, angle: Angle, wobble_px: f64, spoiled: &Spoiled) -> Patch {
        let levels = Levels::of(&self.settings);
        let view = View::new(&self.body, &self.optics, angle, wobble_px);
        let sd = self.settings.blur_px.hypot(spoiled.defocus_px) as f32;
        let mut window = view.whole_window(f64::from(4.0 * sd) + spoiled.shake_px + 2.0);
        let grain_top = window.origin[1];
        if spoiled.obstructed {
            window.size[1] += grain_top;
            window.origin[1] = 0;
        }
        let (sin, cos) = angle.rad().sin_cos();
        let mut shade = vec![0.0; self.body.triangles.len()];
        for &t in view.front() {
            let Facet { normal: n, albedo } = &self.surface[t as usize];
            let turned = Vector::new(n.x * cos - n.y * sin, n.x * sin + n.y * cos, n.z);
            shade[t as usize] = levels.grain * albedo * light(&turned);
        }
        let pedestal = |facing: f64| levels.pedestal * (0.7 + 0.5 * (facing as f32).powi(2));
        let layers = view.layers(window, &Shades { body: &shade, pedestal });
        let w = window.size[0];
        // Light mixes, in a pixel and in the lens; the file holds it coded.
        let of = |level: f32| CODING.decode(level);
        let mut level: Vec<f32> = (0..layers.all.len())
            .map(|k| {
                let behind = self.background(window.origin[0] + k % w, window.origin[1] + k / w);
                let low = (layers.all[k] - layers.grain[k]).max(0.0);
                of(behind) * (1.0 - layers.all[k])
                    + layers.grain[k] * of(layers.grain_level[k])
                    + low * of(layers.low_level[k])
            })
            .collect();
        let mut grain = layers.grain;
        if spoiled.obstructed {
            let reach = 0.5 * (grain_top as f64 + self.optics.axis_row_px);
            let half = 0.5 * OBSTACLE * self.settings.grain_size_mm / self.settings.mm_per_px;
            let middle = self.optics.axis_column_px - window.origin[0] as f64;
            for (k, v) in level.iter_mut().enumerate() {
                if ((k / w) as f64) < reach && ((k % w) as f64 - middle).abs() < half {
                    *v = of(levels.grain);
                }
            }
        }
        for plane in [&mut level, &mut grain] {
            blur(plane, window.size, sd);
            smear(plane, window.size, spoiled.shake_px);
        }
        level.par_iter_mut().for_each(|v| *v = CODING.encode(*v));
        Patch { window, level, grain }
    }
}

/// How bright a surface with this (turned) normal is: a lamp at the upper left, a weaker one at the right,
/// the room, and a sheen. The camera is at −y.
fn light(n: &Vector) -> f32 {
    let lamp = n.dot(&Vector::new(-0.58, -0.62, 0.53)).max(0.0);
    let fill = n.dot(&Vector::new(0.75, -0.6, 0.28)).max(0.0);
    // Half-way between the lamp and the camera.
    let sheen = n.dot(&Vector::new(-0.322, -0.9, 0.294)).max(0.0).powi(40);
    (0.46 + 0.52 * lamp + 0.2 * fill + 0.14 * sheen) as f32
}

/// Mottling of the grain's surface: smooth noise at two scales and a few dark specks.
fn albedo(key: u64, p: &Vector) -> f32 {
    let coarse = random::lattice(key, &(p * 5.0));
    let fine = random::lattice(key ^ 1, &(p * 17.0));
    let speck = if random::lattice(key ^ 2, &(p * 11.0)) > 0.62 { 0.82 } else { 1.0 };
    ((1.0 + 0.16 * coarse + 0.13 * fine) * speck) as f32
}

/// The background as a factor for each column times a level for each row: a vignette and a lean of the light.
fn unevenness(settings: &Settings) -> (Vec<f32>, Vec<f32>) {
    let k = settings.background_unevenness;
    let profile = |n: usize, lean: f64| -> Vec<f64> {
        (0..n)
            .map(|i| {
                let x = (2.0 * i as f64 + 1.0) / n as f64 - 1.0;
                1.0 - k * (0.3 * x * x + 0.2 * (1.0 + lean * x))
            })
            .collect()
    };
    let (across, down) = (profile(settings.width, 0.8), profile(settings.height, -0.5));
    let level = f64::from(Levels::of(settings).background);
    let greatest = |v: &[f64]| v.iter().copied().fold(0.0, f64::max);
    let (a, d) = (greatest(&across), greatest(&down));
    (across.iter().map(|x| (x / a) as f32).collect(), down.iter().map(|x| (x / d * level) as f32).collect())
}

/// The mean over a stretch of each row: what an even motion does during the exposure.
fn smear(values: &mut [f32], [w, _]: [usize; 2], length_px: f64) {
    let half = (0.5 * length_px) as usize;
    if half == 0 {
        return;
    }
    values.par_chunks_mut(w).for_each(|row| {
        let source = row.to_vec();
        for (i, x) in row.iter_mut().enumerate() {
            let stretch = &source[i.saturating_sub(half)..(i + half + 1).min(w)];
            *x = stretch.iter().sum::<f32>() / stretch.len() as f32;
        }
    });
}

/// Gaussian blur along rows, then along columns; the picture goes on beyond its edge as it was there.
fn blur(values: &mut [f32], [w, h]: [usize; 2], sd: f32) {
    if sd < 0.05 {
        return;
    }
    let reach = (4.0 * sd).ceil() as usize;
    let mut kernel: Vec<f32> =
        (0..=2 * reach).map(|i| (-0.5 * ((i as f32 - reach as f32) / sd).powi(2)).exp()).collect();
    let sum: f32 = kernel.iter().sum();
    for x in &mut kernel {
        *x /= sum;
    }
    values.par_chunks_mut(w).for_each(|row| {
        let source = row.to_vec();
        for (i, x) in row.iter_mut().enumerate() {
            *x = (kernel.iter().enumerate())
                .map(|(k, weight)| weight * source[(i + k).saturating_sub(reach).min(w - 1)])
                .sum();
        }
    });
    let source = values.to_vec();
    values.par_chunks_mut(w).enumerate().for_each(|(j, row)| {
        row.fill(0.0);
        for (k, weight) in kernel.iter().enumerate() {
            let from = (j + k).saturating_sub(reach).min(h - 1);
            for (x, y) in row.iter_mut().zip(&source[from * w..(from + 1) * w]) {
                *x += weight * y;
            }
        }
    });
}
