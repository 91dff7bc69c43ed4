//! From a surface to coverage and shading: how much of each pixel the body covers, and how bright it is there.
//!
//! Coverage is exact along rows: in each of [`SUBROWS`] lines through a pixel row the union of all triangles'
//! spans is measured to its ends, so that an outline is nowhere pulled to a grid of samples.

use super::optics::Optics;
use grainrig_core::geometry::{Angle, TriangleMesh};
use rayon::prelude::*;

/// Lines measured in each pixel row.
const SUBROWS: usize = 8;
/// Spans closer than this (pixels) are one: they belong to triangles that share an edge.
const TOUCHING_PX: f64 = 1e-6;

/// A rectangle of the picture's pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Column and row of its first pixel.
    pub origin: [usize; 2],
    /// Its width and height, pixels.
    pub size: [usize; 2],
}

impl Window {
    /// The pixels within `margin_px` of a box of places, as far as they are in the picture.
    fn around([low, high]: [[f64; 2]; 2], margin_px: f64, picture: [usize; 2]) -> Self {
        let first = |k: usize| ((low[k] - margin_px).floor().max(0.0) as usize).min(picture[k] - 1);
        let last = |k: usize| ((high[k] + margin_px).ceil().max(0.0) as usize).min(picture[k] - 1);
        let origin = [first(0), first(1)];
        Self { origin, size: [last(0) - origin[0] + 1, last(1) - origin[1] + 1] }
    }
}

/// One view of the body: its triangles that face the camera, in the picture.
pub struct View<'a> {
    mesh: &'a TriangleMesh,
    optics: &'a Optics,
    wobble_px: f64,
    places: Vec<[f64; 2]>,
    nearness: Vec<f64>,
    front: Vec<u32>,
}

/// How bright the surfaces are, in grey levels.
pub struct Shades<'a, P> {
    /// Each triangle of the body.
    pub body: &'a [f32],
    /// The pedestal, by the part of its normal that faces the camera.
    pub pedestal: P,
}

/// What each pixel of a window shows; all vectors are `[row, column]`, row-major.
pub struct Layers {
    /// Coverage by the body above the pedestal's top, 0 to 1.
    pub grain: Vec<f32>,
    /// Coverage by body and pedestal together, 0 to 1.
    pub all: Vec<f32>,
    /// Brightness of the body above the pedestal's top.
    pub grain_level: Vec<f32>,
    /// Brightness of what lies below it.
    pub low_level: Vec<f32>,
}

impl<'a> View<'a> {
    /// Projects the body at a stage angle and with the view's own sideways shift.
    pub fn new(mesh: &'a TriangleMesh, optics: &'a Optics, angle: Angle, wobble_px: f64) -> Self {
        let projection = optics.projection(angle, wobble_px);
        // `Optics::before` has seen to it that no vertex comes near the camera.
        let places: Vec<[f64; 2]> =
            mesh.vertices.iter().map(|p| projection.project(p).unwrap_or([f64::NAN; 2])).collect();
        let nearness = mesh.vertices.iter().map(|p| optics.nearness(angle, p)).collect();
        let front = (0..mesh.triangles.len() as u32)
            .filter(|&t| {
                let [a, b, c] = mesh.triangles[t as usize].map(|v| places[v as usize]);
                // Rows run downwards, so what is counter-clockwise from outside is negative here.
                (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0
            })
            .collect();
        Self { mesh, optics, wobble_px, places, nearness, front }
    }

    /// The numbers of the triangles that face the camera.
    pub fn front(&self) -> &[u32] {
        &self.front
    }

    /// The window around the body alone.
    pub fn body_window(&self, margin_px: f64) -> Window {
        Window::around(self.body_box(), margin_px, self.optics.picture)
    }

    /// The window around the body and the pedestal, which leaves the picture at its bottom.
    pub fn whole_window(&self, margin_px: f64) -> Window {
        let [mut low, mut high] = self.body_box();
        let bottom = self.optics.picture[1] as f64;
        let rim = self.optics.axis_row_px
            - self.optics.elevation_rad.sin().abs() * self.optics.pedestal_half_width_px();
        low[1] = low[1].min(rim);
        for row in [rim, bottom] {
            let half = self.optics.pedestal_half_width_px() / self.optics.roll_rad.cos();
            let lean = (row - self.optics.axis_row_px) * self.optics.roll_rad.tan();
            let middle = self.optics.axis_column_px + self.wobble_px + lean;
            low[0] = low[0].min(middle - half);
            high[0] = high[0].max(middle + half);
        }
        high[1] = bottom;
        Window::around([low, high], margin_px, self.optics.picture)
    }

    fn body_box(&self) -> [[f64; 2]; 2] {
        let mut out = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for q in &self.places {
            for k in 0..2 {
                out[0][k] = out[0][k].min(q[k]);
                out[1][k] = out[1][k].max(q[k]);
            }
        }
        out
    }

    /// For each row of the window the front triangles that touch it.
    fn rows(&self, window: Window) -> Vec<Vec<u32>> {
        let mut rows = vec![Vec::new(); window.size[1]];
        for &t in &self.front {
            let r = self.mesh.triangles[t as usize].map(|v| self.places[v as usize][1]);
            let first = r[0].min(r[1]).min(r[2]) - 0.5 - window.origin[1] as f64;
            let last = r[0].max(r[1]).max(r[2]) + 0.5 - window.origin[1] as f64;
            if last < 0.0 || first > rows.len() as f64 {
                continue;
            }
            let last = (last.ceil() as usize).min(rows.len() - 1);
            for row in &mut rows[first.floor().max(0.0) as usize..=last] {
                row.push(t);
            }
        }
        rows
    }

    /// The columns that triangle `t` covers on the line at `row`.
    fn span(&self, t: u32, row: f64) -> Option<[f64; 2]> {
        let [a, b, c] = self.mesh.triangles[t as usize];
        let mut out = [f64::INFINITY, f64::NEG_INFINITY];
        for (i, j) in [(a, b), (b, c), (c, a)] {
            // Both triangles of an edge see its ends in the same order, so their spans meet exactly.
            let (p, q) = (self.places[i.min(j) as usize], self.places[i.max(j) as usize]);
            if (p[1] <= row) != (q[1] <= row) {
                let column = p[0] + (row - p[1]) / (q[1] - p[1]) * (q[0] - p[0]);
                out = [out[0].min(column), out[1].max(column)];
            }
        }
        (out[0] <= out[1]).then_some(out)
    }

    /// The body's spans on the line at `row`, united and in order.
    fn spans(&self, triangles: &[u32], row: f64) -> Vec<[f64; 2]> {
        let mut spans: Vec<[f64; 2]> = triangles.iter().filter_map(|&t| self.span(t, row)).collect();
        unite(&mut spans);
        spans
    }

    /// Coverage by the body above the pedestal's top alone: what a perfect segmentation would find.
    pub fn grain_coverage(&self, window: Window) -> Vec<f32> {
        let rows = self.rows(window);
        let mut out = vec![0.0; window.size[0] * window.size[1]];
        out.par_chunks_mut(window.size[0]).zip(&rows).enumerate().for_each(|(j, (grain, triangles))| {
            for row in subrows(window, j) {
                let spans = self.spans(triangles, row);
                add_above(grain, window, &spans, self.optics.below_top(row, self.wobble_px));
            }
        });
        out
    }

    /// Coverage and shading in a window.
    pub fn layers<P: Fn(f64) -> f32 + Sync>(&self, window: Window, shades: &Shades<'_, P>) -> Layers {
        let rows = self.rows(window);
        let w = window.size[0];
        let n = w * window.size[1];
        let (mut grain, mut all) = (vec![0.0; n], vec![0.0; n]);
        let (mut grain_level, mut low_level) = (vec![f32::NAN; n], vec![f32::NAN; n]);
        (grain.par_chunks_mut(w).zip(all.par_chunks_mut(w)))
            .zip(grain_level.par_chunks_mut(w).zip(low_level.par_chunks_mut(w)))
            .zip(&rows)
            .enumerate()
            .for_each(|(j, (((grain, all), (grain_level, low_level)), triangles))| {
                for row in subrows(window, j) {
                    let mut spans = self.spans(triangles, row);
                    add_above(grain, window, &spans, self.optics.below_top(row, self.wobble_px));
                    let pedestal = self.optics.pedestal_span(row, self.wobble_px);
                    if pedestal[0] < pedestal[1] {
                        spans.push(pedestal);
                        unite(&mut spans);
                    }
                    for s in &spans {
                        add(all, window, *s);
                    }
                }
                self.shade_row(window, j, triangles, shades, [grain_level, low_level]);
            });
        spread(&mut grain_level, w);
        spread(&mut low_level, w);
        Layers { grain, all, grain_level, low_level }
    }

    /// Brightness of one pixel row from 2 × 2 samples a pixel with a depth buffer; NaN where nothing is hit.
    fn shade_row<P: Fn(f64) -> f32>(
        &self,
        window: Window,
        j: usize,
        triangles: &[u32],
        shades: &Shades<'_, P>,
        [grain_level, low_level]: [&mut [f32]; 2],
    ) {
        let w = window.size[0];
        let mut sums = vec![[0f32; 4]; w];
        for quarter in [-0.25, 0.25] {
            let row = (window.origin[1] + j) as f64 + quarter;
            let mut buffer = vec![(f64::NEG_INFINITY, 0f32); 2 * w];
            // Sample i lies at column origin − 0.25 + i / 2.
            let column = |i: usize| window.origin[0] as f64 - 0.25 + 0.5 * i as f64;
            for &t in triangles {
                let Some([low, high]) = self.span(t, row) else { continue };
                let [slope, at] = self.nearness_along(t, row);
                let first = ((low - column(0)) * 2.0).ceil().max(0.0) as usize;
                let last = ((high - column(0)) * 2.0).floor().min((2 * w - 1) as f64);
                if last < 0.0 {
                    continue;
                }
                for (i, sample) in buffer.iter_mut().enumerate().take(last as usize + 1).skip(first) {
                    let near = at + slope * column(i);
                    if near > sample.0 {
                        *sample = (near, shades.body[t as usize]);
                    }
                }
            }
            for (i, &(near, shade)) in buffer.iter().enumerate() {
                let [u, v] = self.optics.unrolled([column(i), row], self.wobble_px);
                let sum = &mut sums[i / 2];
                let hit = near > f64::NEG_INFINITY;
                if v < 0.0 {
                    if hit {
                        sum[0] += shade;
                        sum[1] += 1.0;
                    } else if self.optics.elevation_rad != 0.0
                        && let Some((_, facing)) = self.optics.pedestal_front(u)
                    {
                        sum[2] += (shades.pedestal)(facing);
                        sum[3] += 1.0;
                    }
                    continue;
                }
                let low = match self.optics.pedestal_front(u) {
                    Some((front, facing)) if !hit || front >= near => Some((shades.pedestal)(facing)),
                    _ => hit.then_some(shade),
                };
                if let Some(shade) = low {
                    sum[2] += shade;
                    sum[3] += 1.0;
                }
            }
        }
        for (i, [a, an, b, bn]) in sums.into_iter().enumerate() {
            grain_level[i] = a / an;
            low_level[i] = b / bn;
        }
    }

    /// Nearness on the line at `row` as slope and value: slope × column + value.
    fn nearness_along(&self, t: u32, row: f64) -> [f64; 2] {
        let v = self.mesh.triangles[t as usize];
        let [a, b, c] = v.map(|v| self.places[v as usize]);
        let [na, nb, nc] = v.map(|v| self.nearness[v as usize]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let (nb, nc) = (nb - na, nc - na);
        let by_column = (nb * (c[1] - a[1]) - nc * (b[1] - a[1])) / area;
        let by_row = (nc * (b[0] - a[0]) - nb * (c[0] - a[0])) / area;
        [by_column, na + by_row * (row - a[1]) - by_column * a[0]]
    }
}

/// The lines measured in row `j` of a window.
fn subrows(window: Window, j: usize) -> impl Iterator<Item = f64> {
    let middle = (window.origin[1] + j) as f64;
    (0..SUBROWS).map(move |k| middle - 0.5 + (k as f64 + 0.5) / SUBROWS as f64)
}

/// Sorts spans and joins those that overlap or touch.
fn unite(spans: &mut Vec<[f64; 2]>) {
    spans.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    spans.dedup_by(|next, kept| {
        let joined = next[0] <= kept[1] + TOUCHING_PX;
        if joined {
            kept[1] = kept[1].max(next[1]);
        }
        joined
    });
}

/// Adds what lies outside `below` (an interval that is unbounded on one side at least) of all spans.
fn add_above(line: &mut [f32], window: Window, spans: &[[f64; 2]], below: [f64; 2]) {
    for &[low, high] in spans {
        if below[0] > below[1] {
            add(line, window, [low, high]);
            continue;
        }
        add(line, window, [low, high.min(below[0])]);
        add(line, window, [low.max(below[1]), high]);
    }
}

/// Adds one line's span to the coverage of the pixels it crosses.
fn add(line: &mut [f32], window: Window, [low, high]: [f64; 2]) {
    // Pixel i of the line reaches from i to i + 1 here.
    let shift = 0.5 - window.origin[0] as f64;
    let (low, high) = ((low + shift).max(0.0), (high + shift).min(line.len() as f64));
    if low >= high {
        return;
    }
    let weight = 1.0 / SUBROWS as f32;
    let (first, last) = (low as usize, (high as usize).min(line.len() - 1));
    if first == last {
        line[first] += (high - low) as f32 * weight;
        return;
    }
    line[first] += ((first + 1) as f64 - low) as f32 * weight;
    line[first + 1..last].iter_mut().for_each(|x| *x += weight);
    line[last] += (high - last as f64) as f32 * weight;
}

/// Gives pixels without a brightness the mean of their neighbours', so that an outline's pixel that no
/// sample hit is as bright as the body beside it. What is still unknown is not covered: zero.
fn spread(level: &mut [f32], width: usize) {
    let known = level.to_vec();
    let height = known.len() / width;
    for (k, x) in level.iter_mut().enumerate().filter(|(_, x)| x.is_nan()) {
        let (i, j) = (k % width, k / width);
        let (mut sum, mut count) = (0.0, 0.0);
        for jj in j.saturating_sub(1)..(j + 2).min(height) {
            for y in &known[jj * width + i.saturating_sub(1)..jj * width + (i + 2).min(width)] {
                if !y.is_nan() {
                    sum += y;
                    count += 1.0;
                }
            }
        }
        *x = if count > 0.0 { sum / count } else { 0.0 };
    }
}
