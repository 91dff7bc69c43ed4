//! Light from the grain: matt, glossy and clear ones.

use super::plan::{Material, Part, Skin};
use super::scene::{OFF_MM, Sample, Scene};
use super::shape::Body;
use super::view::View;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// Reflections inside a clear grain that are followed.
const BOUNCES: usize = 7;
/// Light that is left when a ray is given up.
const LEAST: f64 = 0.02;
/// Size of a surface's roughness, mm.
const BUMP_MM: f64 = 0.035;
/// A highlight's sharpness (Blinn 1977).
const SHARPNESS: i32 = 60;

impl Scene<'_> {
    /// Light from the grain at a place of the table, with the surface's normal, to a ray that comes along `d`.
    pub fn shade(&self, view: &View, body: &Body, p: &V, normal: &V, d: &V) -> Sample {
        let mut normal = self.roughened(p, normal);
        if normal.dot(d) > 0.0 {
            normal = -normal;
        }
        match self.row.material {
            Material::Opaque => self.matt(view, p, &normal, d),
            Material::Glossy { index } => self.glossy(view, body, p, &normal, d, index),
            Material::Clear { index, cloud } => self.clear(view, body, p, &normal, d, (index, cloud)),
        }
    }

    fn roughened(&self, p: &V, normal: &V) -> V {
        let bump = self.row.skin.bump;
        if bump == 0.0 {
            return *normal;
        }
        let at = p / BUMP_MM;
        let off = V::new(self.bumps[0].at(&at), self.bumps[1].at(&at), self.bumps[2].at(&at));
        (normal + off * bump).normalize()
    }

    /// Share of light that is scattered back at a place of the table.
    fn albedo(&self, p: &V) -> f64 {
        let Skin { albedo, mottle, mottle_mm, second, .. } = self.row.skin;
        let from = p - self.middle;
        let is_second = second.is_some_and(|(_, part)| match part {
            Part::Half => from.x + 0.1 * self.half_height * self.bumps[0].at(&(p / 0.3)) > 0.0,
            Part::Top => from.z > 0.15 * self.half_height * self.bumps[0].at(&(p / 0.3)),
            Part::Band => from.z.abs() < 0.25 * self.half_height,
            Part::Spots => self.bumps[0].at(&(p / 0.22)) > 0.35,
        });
        let own = second.filter(|_| is_second).map_or(albedo, |s| s.0);
        let uneven = 1.0 + mottle * self.mottle.at(&(p / mottle_mm));
        (own * uneven).clamp(0.01, 0.97)
    }

    /// Light on the surface, and the lamps' highlights.
    fn lit(&self, view: &View, p: &V, normal: &V, d: &V) -> (f64, f64) {
        let (n, at, along) = (view.to_room(normal), view.to_room(p), view.to_room(d));
        let (mut light, mut highlight) = (self.room.around(&n), 0.0);
        for (to, strength) in &self.room.lamps {
            let facing = n.dot(to);
            if facing > 0.0 && !self.is_shaded(view, &at, &n, to) {
                light += strength * facing;
                let half = (to - along).normalize();
                highlight += strength * n.dot(&half).max(0.0).powi(SHARPNESS);
            }
        }
        (light, highlight)
    }

    fn matt(&self, view: &View, p: &V, normal: &V, d: &V) -> Sample {
        let (light, highlight) = self.lit(view, p, normal, d);
        Sample { white: self.row.skin.shine * highlight, tinted: self.albedo(p) * light }
    }

    fn glossy(&self, view: &View, body: &Body, p: &V, normal: &V, d: &V, index: f64) -> Sample {
        let (light, _) = self.lit(view, p, normal, d);
        let c = (-normal.dot(d)).clamp(0.0, 1.0);
        let (share, _) = fresnel(c, 1.0, index);
        let mirrored = d + normal * (2.0 * c);
        let start = p + normal * OFF_MM;
        let white = if body.is_hit(&start, &mirrored, OFF_MM) {
            0.3 * self.albedo(p)
        } else {
            self.outside(view, &view.to_room(&start), &view.to_room(&mirrored))
        };
        Sample { white: share * white, tinted: (1.0 - share) * self.albedo(p) * light }
    }

    /// Reflection at the face; refraction, and reflections inside, with clouds on the way.
    fn clear(&self, view: &View, body: &Body, p: &V, normal: &V, d: &V, stuff: (f64, f64)) -> Sample {
        let (index, cloud) = stuff;
        let outside = |p: &V, d: &V| self.outside(view, &view.to_room(p), &view.to_room(d));
        let Skin { albedo, mottle, mottle_mm, .. } = self.row.skin;
        let c = (-normal.dot(d)).clamp(0.0, 1.0);
        let (share, through) = fresnel(c, 1.0, index);
        let mut out = Sample { white: share * outside(p, &(d + normal * (2.0 * c))), tinted: 0.0 };
        let mut left = 1.0 - share;
        let mut along = (d / index + normal * (c / index - through)).normalize();
        let mut at = p + along * OFF_MM;
        for _ in 0..BOUNCES {
            let Some((t, n)) = body.hit(&at, &along, OFF_MM, f64::INFINITY) else { break };
            let end = at + along * t;
            let middle = at + along * (0.5 * t);
            let uneven = (1.0 + 3.0 * mottle * self.mottle.at(&(middle / mottle_mm))).max(0.0);
            let passed = (-cloud * uneven * t).exp();
            out.tinted += left * (1.0 - passed) * self.room.glow() * albedo / 0.45;
            left *= passed;
            let mut n = self.roughened(&end, &n);
            if n.dot(&along) < 0.0 {
                n = -n;
            }
            let c = n.dot(&along).clamp(0.0, 1.0);
            let (share, through) = fresnel(c, index, 1.0);
            if share < 1.0 {
                let leaves = along * index + n * (through - index * c);
                out.white += left * (1.0 - share) * outside(&end, &leaves.normalize());
            }
            left *= share;
            along -= n * (2.0 * c);
            at = end + along * OFF_MM;
            if left < LEAST {
                break;
            }
        }
        out
    }
}

/// Fresnel's share of unpolarised light that is reflected, and the cosine behind the face.
fn fresnel(c: f64, from: f64, to: f64) -> (f64, f64) {
    let square = (from / to).powi(2) * (1.0 - c * c);
    if square >= 1.0 {
        return (1.0, 0.0);
    }
    let through = (1.0 - square).sqrt();
    let upright = (from * c - to * through) / (from * c + to * through);
    let flat = (from * through - to * c) / (from * through + to * c);
    (0.5 * (upright * upright + flat * flat), through)
}
