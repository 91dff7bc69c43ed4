//! From silhouettes to the visual hull: a ball of 1 mm before parallel rays, seen in 25 views over half a turn.
//!
//! `cargo run --release -p grainrig-core --example silhouettes_to_hull`

use grainrig_core::calibrate::Turntable;
use grainrig_core::geometry::Angle;
use grainrig_core::hull::{Cone, HullGrid, find_bounds};
use grainrig_core::silhouette::Silhouette;
use std::error::Error;
use std::sync::Arc;

const VIEWS: u32 = 25;
const DIAMETER_MM: f64 = 1.0;
const MM_PER_PX: f64 = 0.01;
const SIZE_PX: usize = 128;

/// A photograph of a ball shows a disc: the share of each pixel that it covers, row by row. From a photograph,
/// [`grainrig_core::silhouette::find`] makes the outline instead.
fn disc() -> Vec<f32> {
    let (middle, radius) = (0.5 * (SIZE_PX - 1) as f64, 0.5 * DIAMETER_MM / MM_PER_PX);
    (0..SIZE_PX * SIZE_PX)
        .map(|k| {
            let from_middle = ((k % SIZE_PX) as f64 - middle).hypot((k / SIZE_PX) as f64 - middle);
            (0.5 + radius - from_middle).clamp(0.0, 1.0) as f32
        })
        .collect()
}

/// Runs it; the hull's volume over the ball's.
///
/// # Errors
/// Views that have no body in common.
pub fn run() -> Result<f64, Box<dyn Error>> {
    // The outline: for every pixel how far it is from it, negative inside.
    let outline = Arc::new(Silhouette::of_coverage([SIZE_PX; 2], &disc()).ok_or("the disc is empty")?);
    // The rig: a camera that looks at the axis squarely, from so far away that its rays are parallel.
    let rig = Turntable {
        mm_per_px: MM_PER_PX,
        axis_column_px: 0.5 * (SIZE_PX - 1) as f64,
        origin_row_px: 0.5 * (SIZE_PX - 1) as f64,
        elevation_rad: 0.0,
        roll_rad: 0.0,
        camera_distance_mm: None,
    };
    // Each view, at its angle, allows the grain to be in a cone (here a cylinder) and nowhere else.
    let cones: Vec<Cone> = (0..VIEWS)
        .map(|n| Angle::from_deg(7.2 * f64::from(n)))
        .map(|angle| Cone::new(rig.view(angle, 0.0), Arc::clone(&outline)))
        .collect();
    // What all of them allow, on a grid of 10 µm.
    let mut hull = HullGrid::new(&find_bounds(&cones)?, MM_PER_PX)?;
    hull.carve_all(&cones, &mut |_| ());
    let measures = hull.measures();
    let ball_mm3 = std::f64::consts::PI / 6.0 * DIAMETER_MM.powi(3);
    let ratio = measures.volume_mm3 / ball_mm3;
    println!(
        "{VIEWS} views: hull {:.4} mm³, {ratio:.4} of the ball's {ball_mm3:.4} mm³",
        measures.volume_mm3
    );
    // A hull is an upper bound: around its axis a ball becomes a body of 50 sides.
    Ok(ratio)
}

#[allow(dead_code)]
fn main() -> Result<(), Box<dyn Error>> {
    run().map(|_| ())
}
