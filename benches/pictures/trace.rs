//! A view's picture before the lens: how much light of what kind each pixel gets.

use super::scene::{Kind, Sample, Scene};
use super::shape::Body;
use super::view::View;

/// Rays along either side of a pixel that an edge passes through.
const EDGE: usize = 4;
/// Where a pixel whose light changes fast has a ray beside that through its middle.
const BESIDE: [f64; 2] = [0.5, 0.5];
/// Room around the grain and the pedestal that is traced, pixels.
const MARGIN: f64 = 6.0;

/// A rectangle of the picture.
#[derive(Debug, Clone, Copy)]
pub struct Window {
    /// First column and row.
    pub origin: [usize; 2],
    /// Columns and rows.
    pub size: [usize; 2],
}

/// What each pixel of a window gets: white light, light that takes the grain's colour, and its share of the background.
pub struct Traced {
    /// Where it is.
    pub window: Window,
    /// `[row, column]`.
    pub pixels: Vec<[f32; 3]>,
}

/// The middles of a pixel's parts, from its own middle.
fn parts(side: usize) -> impl Iterator<Item = [f64; 2]> {
    let at = move |k: usize| (k as f64 + 0.5) / side as f64 - 0.5;
    (0..side * side).map(move |k| [at(k % side), at(k / side)])
}

/// Pixels beside which, or in which, one of another kind is seen.
fn edges<T: PartialEq>(size: [usize; 2], seen: &[T]) -> impl Iterator<Item = bool> {
    let [w, h] = size;
    (0..w * h).map(move |k| {
        let (x, y) = (k % w, k / w);
        let columns = x.saturating_sub(1)..(x + 2).min(w);
        (y.saturating_sub(1)..(y + 2).min(h)).any(|row| columns.clone().any(|c| seen[row * w + c] != seen[k]))
    })
}

impl Scene<'_> {
    /// The part of the picture that grain and pedestal may be in.
    fn window(&self, view: &View) -> Window {
        let (wide, low, high) = self.reach;
        let glue = self.row.pedestal.glue.map_or(0.0, |g| g.0);
        let wide = wide.max(0.5 * self.row.pedestal.diameter_mm);
        let camera = &self.row.camera;
        let bottom = -(camera.height as f64) * self.row.mm_per_px();
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for x in [-wide, wide] {
            for y in [-wide, wide] {
                for z in [bottom, low, glue, high] {
                    // A turn of the table changes nothing of a cylinder about its axis.
                    let p = view.project(&view.to_table(&nalgebra::Vector3::new(x, y, z)));
                    for k in 0..2 {
                        ends[k] = [ends[k][0].min(p[k] - MARGIN), ends[k][1].max(p[k] + MARGIN)];
                    }
                }
            }
        }
        let whole = [camera.width, camera.height];
        let first = [0, 1].map(|k| (ends[k][0].max(0.0) as usize).min(whole[k] - 1));
        let end = [0, 1].map(|k| (ends[k][1].max(0.0) as usize + 1).min(whole[k]));
        Window { origin: first, size: [0, 1].map(|k| end[k].saturating_sub(first[k])) }
    }

    /// Traces a view.
    pub fn trace(&self, view: &View) -> Traced {
        let window = self.window(view);
        let before = self.reach.0.max(self.row.pedestal.diameter_mm) + 1.0;
        let [w, h] = window.size;
        let follow = |k: usize, [dx, dy]: [f64; 2]| {
            let (x, y) = (window.origin[0] + k % w, window.origin[1] + k / w);
            let (o, d) = view.ray([x as f64 + dx, y as f64 + dy], before);
            self.follow(view, &o, &d)
        };
        let once: Vec<_> = (0..w * h).map(|k| follow(k, [0.0; 2])).collect();
        let kinds: Vec<Kind> = once.iter().map(|o| o.0).collect();
        let is_smooth = self.row.is_opaque() && self.row.skin.bump == 0.0;
        let pixels = (edges(window.size, &kinds).enumerate())
            .map(|(k, is_edge)| {
                let (mut sum, mut rays) = ([0f32; 3], 0f32);
                let mut add = |(kind, light): (Kind, Sample)| {
                    let share = if kind == Kind::Background { 1.0 } else { 0.0 };
                    let of = [light.white as f32, light.tinted as f32, share];
                    (0..3).for_each(|c| sum[c] += of[c]);
                    rays += 1.0;
                };
                if is_edge {
                    parts(EDGE).for_each(|part| add(follow(k, part)));
                } else {
                    add(once[k]);
                    if kinds[k] == Kind::Grain && !is_smooth {
                        let (kind, light) = follow(k, BESIDE);
                        add((Kind::Grain, if kind == Kind::Grain { light } else { once[k].1 }));
                    }
                }
                sum.map(|s| s / rays)
            })
            .collect();
        Traced { window, pixels }
    }

    /// How much of each pixel of the whole picture the grain covers, `[row, column]`, whatever is before it.
    pub fn coverage(&self, view: &View, body: &Body) -> Vec<f32> {
        let camera = &self.row.camera;
        let window = self.window(view);
        let [w, h] = window.size;
        let is_hit = |k: usize, [dx, dy]: [f64; 2]| {
            let (x, y) = (window.origin[0] + k % w, window.origin[1] + k / w);
            let (o, d) = view.ray([x as f64 + dx, y as f64 + dy], self.reach.0 + 1.0);
            body.is_hit(&view.to_table(&o), &view.to_table(&d), 0.0)
        };
        let once: Vec<bool> = (0..w * h).map(|k| is_hit(k, [0.0; 2])).collect();
        let mut out = vec![0f32; camera.width * camera.height];
        for (k, is_edge) in edges(window.size, &once).enumerate() {
            let at = (window.origin[1] + k / w) * camera.width + window.origin[0] + k % w;
            out[at] = if is_edge {
                let hits = parts(EDGE).filter(|part| is_hit(k, *part)).count();
                hits as f32 / (EDGE * EDGE) as f32
            } else {
                f32::from(u8::from(once[k]))
            };
        }
        out
    }
}
