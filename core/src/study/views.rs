//! A body's ideal pictures at a given size of a pixel.

use super::Body;
use crate::calibrate::Turntable;
use crate::geometry::Angle;
use crate::hull::Cone;
use crate::hull::slices::{RowGrid, SliceError, Strips};
use crate::silhouette::Silhouette;
use std::sync::Arc;

/// Lines of a row of pixels whose coverage is averaged.
const LINES: usize = 8;
/// Pixels of background around the body.
const MARGIN: usize = 4;

/// The picture that all views share.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub pixel_mm: f64,
    /// Width and height, pixels; the axis lies between the two middle columns.
    pub size: [usize; 2],
    /// Height of the first row's middle, mm; rows go down.
    top_mm: f64,
}

impl Frame {
    pub(super) fn around(body: &Body, pixel_mm: f64) -> Self {
        let b = body.bounds();
        let half = (body.reach_mm() / pixel_mm).ceil() as usize + MARGIN;
        let below = (-b.min.z / pixel_mm).ceil() as usize + MARGIN;
        let above = (b.max.z / pixel_mm).ceil() as usize + MARGIN;
        // Middles of pixels lie half a pixel off the body's own middle, so that sizes of whole pixels meet none.
        Self { pixel_mm, size: [2 * half, above + below], top_mm: (above as f64 - 0.5) * pixel_mm }
    }

    /// The rows' middles from the lowest up.
    pub(super) fn row_grid(&self) -> RowGrid {
        let rows = self.size[1];
        RowGrid { first_mm: self.top_mm - (rows - 1) as f64 * self.pixel_mm, pitch_mm: self.pixel_mm, rows }
    }

    /// The axis' column.
    pub(super) fn axis(&self) -> f64 {
        0.5 * (self.size[0] - 1) as f64
    }

    /// Column (fractional) of a point across the axis.
    fn column(&self, u: f64) -> f64 {
        u / self.pixel_mm + self.axis()
    }

    /// The pixels of each row, lowest first, whose middles the body covers: runs [first, last].
    pub(super) fn pixels(&self, body: &Body, angle_rad: f64) -> Vec<Vec<[usize; 2]>> {
        let runs = |row: &Vec<[f64; 2]>| -> Vec<[usize; 2]> {
            let mut runs: Vec<[usize; 2]> = Vec::new();
            for [a, b] in row {
                // A middle on the right end is outside: two bodies side by side share no pixel.
                let (first, end) = (self.column(*a).ceil() as usize, self.column(*b).ceil() as usize);
                if end <= first {
                    continue;
                }
                match runs.last_mut() {
                    Some(run) if run[1] + 1 >= first => run[1] = run[1].max(end - 1),
                    _ => runs.push([first, end - 1]),
                }
            }
            runs
        };
        body.intervals(self.row_grid(), angle_rad).iter().map(runs).collect()
    }

    /// The strips that those pixels are.
    pub(super) fn pixel_strips(&self, body: &Body, angle_rad: f64) -> Result<Strips, SliceError> {
        let pixels = self.pixels(body, angle_rad);
        let edge = |column: f64| (column - self.axis()) * self.pixel_mm;
        let mut rows = pixels.iter();
        Strips::from_fn(self.row_grid(), angle_rad, |_, out| {
            out.extend(
                rows.next()
                    .into_iter()
                    .flatten()
                    .map(|[a, b]| [edge(*a as f64 - 0.5), edge(*b as f64 + 0.5)]),
            );
        })
    }

    /// The view as the hull of any cameras takes it: its outline between the pixels.
    pub(super) fn cone(&self, body: &Body, angle_rad: f64) -> Option<Cone> {
        let [width, height] = self.size;
        let coarse = self.row_grid();
        let pitch_mm = self.pixel_mm / LINES as f64;
        let fine = RowGrid {
            first_mm: coarse.first_mm + (0.5 / LINES as f64 - 0.5) * self.pixel_mm,
            pitch_mm,
            rows: height * LINES,
        };
        let mut coverage = vec![0f32; width * height];
        for (k, row) in body.intervals(fine, angle_rad).iter().enumerate() {
            let line = &mut coverage[(height - 1 - k / LINES) * width..][..width];
            for [a, b] in row {
                let (a, b) = (self.column(*a) + 0.5, self.column(*b) + 0.5);
                for (x, c) in line.iter_mut().enumerate().take(b.ceil() as usize).skip(a.floor() as usize) {
                    *c += (((x + 1) as f64).min(b) - (x as f64).max(a)).max(0.0) as f32 / LINES as f32;
                }
            }
        }
        let camera = Turntable {
            mm_per_px: self.pixel_mm,
            axis_column_px: self.axis(),
            origin_row_px: self.top_mm / self.pixel_mm,
            elevation_rad: 0.0,
            roll_rad: 0.0,
            camera_distance_mm: None,
        };
        let silhouette = Silhouette::of_coverage(self.size, &coverage)?;
        Some(Cone::new(camera.view(Angle::from_deg(angle_rad.to_degrees()), 0.0), Arc::new(silhouette)))
    }
}
