//! What stands before the camera: the pedestal, a foot of glue, the grain; and what a ray meets first.

use super::chance::Mottle;
use super::light::Room;
use super::plan::{Pedestal, Row};
use super::shape::Body;
use super::view::View;
use nalgebra::Vector3;

type V = Vector3<f64>;

/// Rays begin this far off the surface that they leave, mm.
pub const OFF_MM: f64 = 2e-4;
/// Steps in which a ray is followed through the glue's height.
const GLUE_STEPS: usize = 40;

/// What a ray meets.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Nothing.
    Background,
    /// The pedestal.
    Pedestal,
    /// The glue.
    Glue,
    /// The grain.
    Grain,
}

/// Light along a ray: as it is, and what takes the grain's colour.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Sample {
    /// Without the grain's colour.
    pub white: f64,
    /// With it.
    pub tinted: f64,
}

/// A row's scene.
pub struct Scene<'a> {
    /// What it is.
    pub row: &'a Row,
    /// The grain, in the table's frame.
    pub body: Option<&'a Body>,
    /// The light.
    pub room: Room,
    /// The grain's unevenness of colour.
    pub mottle: Mottle,
    /// Roughness, one for each component of the normal.
    pub bumps: [Mottle; 3],
    /// Middle of the grain, mm.
    pub middle: V,
    /// Half its height, mm.
    pub half_height: f64,
    /// Radius about the axis and lowest and highest place of all but the pedestal, mm.
    pub reach: (f64, f64, f64),
}

impl<'a> Scene<'a> {
    /// A row's pedestal with a body, or without.
    pub fn new(row: &'a Row, body: Option<&'a Body>) -> Self {
        let bounds = body.and_then(|b| b.mesh.bounds());
        let (low, high, wide) = body.map_or((0.0, 0.0, 0.0), Body::reach);
        let mottles = [0, 1, 2].map(|k| Mottle::new(row.seed + 100 + k));
        Self {
            row,
            body,
            room: Room::new(&row.light),
            mottle: Mottle::new(row.seed),
            bumps: mottles,
            middle: bounds.map_or_else(V::zeros, |b| b.center().coords),
            half_height: bounds.map_or(0.0, |b| 0.5 * b.size().z),
            reach: (wide, low, high),
        }
    }

    /// What a ray of the room meets, and its light. Of the background only that it is seen.
    pub fn follow(&self, view: &View, origin: &V, direction: &V) -> (Kind, Sample) {
        let stand = self.pedestal_hit(origin, direction).map(|(t, n)| (t, n, Kind::Pedestal));
        let glue = self.glue_hit(origin, direction).map(|(t, n)| (t, n, Kind::Glue));
        let nearest = [stand, glue].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
        let far = nearest.map_or(f64::INFINITY, |n| n.0);
        if let Some(body) = self.body {
            let (o, d) = (view.to_table(origin), view.to_table(direction));
            if let Some((t, n)) = body.hit(&o, &d, 0.0, far) {
                return (Kind::Grain, self.shade(view, body, &(o + d * t), &n, &d));
            }
        }
        let Some((t, normal, kind)) = nearest else { return (Kind::Background, Sample::default()) };
        let place = origin + direction * t;
        let white = self.stand(view, &place, &normal, direction, kind, true);
        (kind, Sample { white, tinted: 0.0 })
    }

    /// Light from the pedestal or the glue at a place of the room.
    fn stand(&self, view: &View, p: &V, normal: &V, direction: &V, kind: Kind, has_shadows: bool) -> f64 {
        let Pedestal { albedo, mirror, glue, .. } = self.row.pedestal;
        let albedo = if kind == Kind::Glue { glue.map_or(albedo, |g| g.1) } else { albedo };
        let mut light = self.room.around(normal);
        for (to, strength) in &self.room.lamps {
            let facing = normal.dot(to);
            if facing > 0.0 && (!has_shadows || !self.is_shaded(view, p, normal, to)) {
                light += strength * facing;
            }
        }
        // Marks of the lathe, a few hundredths of a millimetre apart.
        let mark = if kind == Kind::Pedestal { 1.0 + 0.05 * (p.z * 190.0).sin() } else { 1.0 };
        let mut level = albedo * light * mark;
        if mirror > 0.0 && kind == Kind::Pedestal {
            let seen = direction - normal * (2.0 * direction.dot(normal));
            level += mirror * self.room.seen(&seen);
        }
        level
    }

    /// Whether the grain keeps a lamp's light off a place of the room.
    pub fn is_shaded(&self, view: &View, p: &V, normal: &V, to: &V) -> bool {
        let start = p + normal * (10.0 * OFF_MM);
        let body = self.body.is_some_and(|b| b.is_hit(&view.to_table(&start), &view.to_table(to), OFF_MM));
        body || (p.z > 0.0 && self.pedestal_hit(&start, to).is_some())
    }

    /// What is seen from the grain along a direction of the room: the pedestal, or the room.
    pub fn outside(&self, view: &View, p: &V, direction: &V) -> f64 {
        match self.pedestal_hit(p, direction) {
            Some((t, normal)) => {
                self.stand(view, &(p + direction * t), &normal, direction, Kind::Pedestal, false)
            }
            None => self.room.seen(direction),
        }
    }

    /// Where a ray meets the pedestal, a cylinder below z = 0, from outside, and its normal there.
    fn pedestal_hit(&self, o: &V, d: &V) -> Option<(f64, V)> {
        let radius = 0.5 * self.row.pedestal.diameter_mm;
        if d.z < 0.0 && o.z >= 0.0 {
            let t = -o.z / d.z;
            let at = o + d * t;
            if at.x.hypot(at.y) < radius {
                return Some((t, V::z()));
            }
        }
        let (a, b) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y);
        let inside = b * b - a * (o.x * o.x + o.y * o.y - radius * radius);
        if inside <= 0.0 || a == 0.0 {
            return None;
        }
        let t = (-b - inside.sqrt()) / a;
        let at = o + d * t;
        (t > OFF_MM && at.z < 0.0).then(|| (t, V::new(at.x / radius, at.y / radius, 0.0)))
    }

    /// Where a ray meets the glue: a foot whose radius falls from the pedestal's edge to half of that, steeply first.
    fn glue_hit(&self, o: &V, d: &V) -> Option<(f64, V)> {
        let (height, _) = self.row.pedestal.glue?;
        let radius = 0.48 * self.row.pedestal.diameter_mm;
        // Above 0 outside.
        let outside = |p: &V| {
            let up = (1.0 - p.z / height).clamp(0.0, 1.0);
            if p.z > height { p.z } else { p.x.hypot(p.y) - radius * (0.45 + 0.55 * up * up) }
        };
        let (a, b) = (d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y);
        let inside = b * b - a * (o.x * o.x + o.y * o.y - radius * radius);
        if inside <= 0.0 || a == 0.0 {
            return None;
        }
        let mut span = [(-b - inside.sqrt()) / a, (-b + inside.sqrt()) / a];
        if d.z != 0.0 {
            let (low, high) = (-o.z / d.z, (height - o.z) / d.z);
            span = [span[0].max(low.min(high)), span[1].min(low.max(high))];
        } else if !(0.0..=height).contains(&o.z) {
            return None;
        }
        if span[0] >= span[1] || span[0] < 0.0 {
            return None;
        }
        let at = |k: usize| span[0] + (span[1] - span[0]) * k as f64 / GLUE_STEPS as f64;
        let first = (0..=GLUE_STEPS).find(|&k| outside(&(o + d * at(k))) < 0.0)?;
        let (mut low, mut high) = (at(first.saturating_sub(1)), at(first));
        for _ in 0..12 {
            let middle = f64::midpoint(low, high);
            if outside(&(o + d * middle)) < 0.0 { high = middle } else { low = middle }
        }
        let p = o + d * high;
        let up = (1.0 - p.z / height).clamp(0.0, 1.0);
        let flat = V::new(p.x, p.y, 0.0).try_normalize(1e-12).unwrap_or_else(V::x);
        let normal = flat + V::z() * (1.1 * radius * up / height);
        Some((high, normal.normalize()))
    }
}
