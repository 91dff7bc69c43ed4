//! Exact outlines of a mesh before level, parallel rays, as coverage of pixels.

use grainrig_core::calibrate::Turntable;
use grainrig_core::geometry::{Angle, TriangleMesh};
use grainrig_core::hull::Cone;
use grainrig_core::silhouette::Silhouette;
use std::sync::Arc;

/// Lines at which the outline is crossed in each row of pixels.
const LINES: usize = 8;
/// Background around the grain, pixels.
const MARGIN: f64 = 4.0;

/// An edge of a mesh as its triangles run along it.
#[derive(Clone, Copy)]
struct Edge {
    /// The lesser vertex and the greater.
    ends: [u32; 2],
    triangle: u32,
    /// 1 where the triangle runs from the lesser vertex to the greater, else −1.
    along: i32,
}

/// A mesh's edges, those between the same vertices side by side.
pub struct Edges(Vec<Edge>);

impl Edges {
    pub fn of(mesh: &TriangleMesh) -> Self {
        let mut edges: Vec<Edge> = (mesh.triangles.iter().zip(0..))
            .flat_map(|(&[a, b, c], triangle)| {
                [(a, b), (b, c), (c, a)].map(|(p, q)| {
                    let along = if p < q { 1 } else { -1 };
                    Edge { ends: [p.min(q), p.max(q)], triangle, along }
                })
            })
            .collect();
        edges.sort_by_key(|e| (e.ends, e.triangle));
        Self(edges)
    }
}

/// Views of a body (mm) at these angles (degrees), a pixel being so large.
pub fn views(mesh: &TriangleMesh, edges: &Edges, angles_deg: &[f64], mm_per_px: f64) -> Vec<Cone> {
    let bounds = mesh.bounds().expect("a body has vertices");
    let reach = mesh.vertices.iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max) / mm_per_px;
    let size = [2.0 * reach + 2.0 * MARGIN, bounds.size().z / mm_per_px + 2.0 * MARGIN]
        .map(|edge| edge.ceil() as usize);
    let table = Turntable {
        mm_per_px,
        axis_column_px: 0.5 * (size[0] as f64 - 1.0),
        origin_row_px: bounds.max.z / mm_per_px + MARGIN,
        elevation_rad: 0.0,
        roll_rad: 0.0,
        camera_distance_mm: None,
    };
    let view = |degrees: &f64| {
        let camera = table.view(Angle::from_deg(*degrees), 0.0);
        let points: Vec<[f64; 2]> =
            mesh.vertices.iter().map(|p| camera.project(p).expect("parallel rays see all")).collect();
        let outline = Silhouette::of_coverage(size, &coverage(mesh, edges, &points, size));
        Cone::new(camera, Arc::new(outline.expect("as many pixels as the picture has")))
    };
    angles_deg.iter().map(view).collect()
}

/// The share of each pixel that the body covers.
///
/// A place is covered where the edges of the triangles that face the camera wind around it: edges between two of them
/// cancel, and what is left is the outline, with what of it lies inside.
fn coverage(
    mesh: &TriangleMesh,
    edges: &Edges,
    points: &[[f64; 2]],
    [width, height]: [usize; 2],
) -> Vec<f32> {
    let at = |v: u32| points[v as usize];
    let faces_us: Vec<bool> = (mesh.triangles.iter())
        .map(|&[a, b, c]| {
            let ([ax, ay], [bx, by], [cx, cy]) = (at(a), at(b), at(c));
            (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0.0
        })
        .collect();
    let line_of = |row: f64| (row + 0.5) * LINES as f64 - 0.5;
    let mut lines: Vec<Vec<(f64, i32)>> = vec![Vec::new(); height * LINES];
    for beside in edges.0.chunk_by(|e, f| e.ends == f.ends) {
        let winding: i32 = beside.iter().filter(|e| faces_us[e.triangle as usize]).map(|e| e.along).sum();
        let [[ax, ay], [bx, by]] = beside[0].ends.map(at);
        if winding == 0 || ay.to_bits() == by.to_bits() {
            continue;
        }
        let (low, high, sense) = if ay < by { (ay, by, winding) } else { (by, ay, -winding) };
        for line in line_of(low).ceil() as usize..line_of(high).ceil() as usize {
            let row = (line as f64 + 0.5) / LINES as f64 - 0.5;
            lines[line].push((ax + (bx - ax) * (row - ay) / (by - ay), sense));
        }
    }
    let mut covered = vec![0f32; width * height];
    for (line, crossings) in lines.iter_mut().enumerate() {
        crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let row = &mut covered[line / LINES * width..][..width];
        let (mut winding, mut from) = (0, 0.0);
        for &(x, sense) in crossings.iter() {
            let before = winding;
            winding += sense;
            if before == 0 {
                from = x;
            } else if winding == 0 {
                fill(row, from + 0.5, x + 0.5);
            }
        }
    }
    covered
}

/// Adds what one line covers between two places, pixels from the row's left edge.
fn fill(row: &mut [f32], from: f64, to: f64) {
    for (x, covered) in row.iter_mut().enumerate().take(to.ceil() as usize).skip(from as usize) {
        let part = to.min(x as f64 + 1.0) - from.max(x as f64);
        *covered += (part.max(0.0) / LINES as f64) as f32;
    }
}
