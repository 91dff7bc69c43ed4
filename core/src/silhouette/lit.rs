//! The plane in light rather than in coded grey values, where the outline is placed.

use super::pedestal::{self, Pedestal};
use super::plane::{PER_LEVEL, Plane};
use super::search::Scene;
use super::tone::ToneCurve;
use rayon::prelude::*;

/// A part of the plane in light.
pub(super) struct Lit {
    /// Distance from the background towards the grain, sixteenths of the light of a grey level at the curve's upper end.
    pub plane: Plane,
    /// The same of the pedestal, in the part's own pixels.
    pub pedestal: Option<Pedestal>,
    /// Light at the threshold, levels.
    pub threshold: f64,
    /// The least light of an outline, levels.
    pub least_level: f64,
    /// Whether it is light: `false` where the grey values are taken for it.
    pub is_light: bool,
}

impl Lit {
    /// A part (in its own pixels, as the pedestal is) of the plane in light; `threshold` and `least_level` in grey levels.
    ///
    /// Above the pedestal's top its light has been taken off the grey values: here it is put back, and taken off the light.
    /// A difference of two colours stays as it is coded: the light of either is not known in it.
    pub(super) fn of(
        mut plane: Plane,
        scene: &Scene,
        curve: ToneCurve,
        pedestal: Option<Pedestal>,
        [threshold, least_level]: [f64; 2],
    ) -> Self {
        if curve != ToneCurve::Srgb || scene.channel.is_difference() {
            return Self { plane, pedestal, threshold, least_level, is_light: false };
        }
        let light = curve.light();
        let sign = if scene.bright_grain { 1.0f32 } else { -1.0 };
        let of =
            |background: f32, level: f32| sign * (light.at(background + sign * level) - light.at(background));
        let mut row = vec![0f32; plane.width];
        let background = |row: &mut [f32], x: f64, y: f64| {
            let y = y.clamp(0.0, (plane.height - 1) as f64) as usize;
            scene.backdrop.row(plane.rect.y0 + y, plane.rect.x0, row);
            row[x.clamp(0.0, (row.len() - 1) as f64) as usize]
        };
        let middle = background(&mut row, 0.5 * plane.width as f64, 0.5 * plane.height as f64);
        let [threshold, least_level] =
            [threshold, least_level].map(|level| f64::from(of(middle, level as f32)));
        let lit_pedestal = pedestal.map(|p| {
            let (centre, half) = p.centre();
            let behind = background(&mut row, centre, p.top_at(centre));
            let [left, middle, right] =
                [-half, 0.0, half].map(|x| f64::from(of(behind, p.level_at(centre + x) as f32)));
            Pedestal { level: middle, level_slope: (right - left) / (2.0 * half.max(1.0)), ..p }
        });
        if let Some(p) = &pedestal {
            pedestal::mix(&mut plane, p);
        }
        let (width, [x0, y0]) = (plane.width, [plane.rect.x0, plane.rect.y0]);
        plane.values.par_chunks_mut(width).enumerate().for_each_init(
            || vec![0f32; width],
            |row, (y, values)| {
                scene.backdrop.row(y0 + y, x0, row);
                for (v, background) in values.iter_mut().zip(&*row) {
                    *v = (PER_LEVEL * of(*background, f32::from(*v) / PER_LEVEL)).round() as i16;
                }
            },
        );
        if let Some(p) = &lit_pedestal {
            pedestal::unmix(&mut plane, p);
        }
        Self { plane, pedestal: lit_pedestal, threshold, least_level, is_light: true }
    }

    /// The values smoothed.
    pub(super) fn smoothed(&self) -> Vec<i16> {
        self.pedestal.as_ref().map_or_else(|| self.plane.smoothed(), |p| pedestal::smoothed(&self.plane, p))
    }
}

/// Grey values of the file that a plane was made of, `[row, column]`.
pub(super) fn grey_values(plane: &Plane, scene: &Scene) -> Vec<f32> {
    let sign = if scene.bright_grain { 1.0f32 } else { -1.0 };
    let mut out = vec![0f32; plane.values.len()];
    out.par_chunks_mut(plane.width).zip(plane.values.par_chunks(plane.width)).enumerate().for_each(
        |(y, (out, values))| {
            scene.backdrop.row(plane.rect.y0 + y, plane.rect.x0, out);
            out.iter_mut().zip(values).for_each(|(o, v)| *o += sign * f32::from(*v) / PER_LEVEL);
        },
    );
    out
}
