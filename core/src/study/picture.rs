//! The study as a table and as figures like the paper's 5 (silhouettes), 6 (shapes) and 7 (curves).

use super::views::Frame;
use super::{Row, Study, StudyError};
use crate::mesh::{Controls, mesh};
use crate::report::{Panel, Point as Dot, Series, Sheet, Tile, Tiles, from_the_side, shaded};
use std::fmt::Write as _;

/// From where the shapes are seen: turned about z, then looked down upon, radians.
const TURNED: f64 = 0.5;
const DOWN: f64 = 0.45;
/// Facets of a shape that is drawn, times the usual ones' size.
const DRAWN: f64 = 1.5;

/// One of the ways to a volume; not all bodies have all.
type Way = fn(&Row) -> Option<f64>;

/// The rows as CSV (RFC 4180), with a line of names; `vr_over_vm` is the real over the reconstructed volume.
pub fn table(rows: &[Row]) -> String {
    let mut out = String::from(
        "body,views,angle_deg,vr_over_vm_voxel,vr_over_vm_exact,vr_over_vm_coarse_mesh,vr_over_vm_fine_mesh,\
         vr_over_vm_analytic\n",
    );
    for r in rows {
        let v = &r.vr_over_vm;
        let analytic = r.analytic.map_or_else(String::new, |a| format!("{a:.6}"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "\"{}\",{},{:.4},{:.6},{:.6},{:.6},{:.6},{analytic}",
            r.body.replace('"', "\"\""),
            r.views,
            r.angle_deg,
            v.voxel,
            v.exact,
            v.coarse_mesh,
            v.fine_mesh
        );
    }
    out
}

/// `V_R/V_M`, real over reconstructed volume, against the number of views: for each body a diagram, and one from where the
/// curve is nearly level.
pub fn curves(rows: &[Row]) -> Sheet {
    let mut bodies: Vec<&str> = Vec::new();
    for r in rows {
        if !bodies.contains(&r.body.as_str()) {
            bodies.push(&r.body);
        }
    }
    let ways: [(&str, Way); 5] = [
        ("voxels", |r| Some(r.vr_over_vm.voxel)),
        ("exact", |r| Some(r.vr_over_vm.exact)),
        ("coarse mesh", |r| Some(r.vr_over_vm.coarse_mesh)),
        ("fine mesh", |r| Some(r.vr_over_vm.fine_mesh)),
        ("analytic", |r| r.analytic),
    ];
    let panel = |body: &str, least: usize, title: String| Panel {
        title,
        abscissa: "views".into(),
        series: (ways.iter())
            .map(|(name, value)| Series {
                name: (*name).into(),
                points: (rows.iter().filter(|r| r.body == body && r.views >= least))
                    .filter_map(|r| Some(Dot { x: r.views as f64, y: value(r)?, sigma: None }))
                    .collect(),
                joined: true,
            })
            .filter(|s| !s.points.is_empty())
            .collect(),
        marks: Vec::new(),
    };
    let panels = bodies.iter().flat_map(|body| {
        [
            panel(body, 0, format!("{body}: V_R/V_M")),
            panel(body, 10, format!("{body}: V_R/V_M from 10 views on")),
        ]
    });
    Sheet {
        title: "V_R/V_M, real over reconstructed volume, against the number of views over half a turn".into(),
        panels: panels.collect(),
        figures: Vec::new(),
        warnings: Vec::new(),
    }
}

/// The silhouettes of a body at a few angles, pixel by pixel.
pub fn silhouettes(study: &Study) -> Tiles {
    let frame = Frame::around(&study.body, study.pixel_mm);
    let middle = frame.axis();
    let row_grid = frame.row_grid();
    let tile = |degrees: f64| Tile {
        caption: format!("{degrees:.0}°"),
        polygons: (frame.pixels(&study.body, degrees.to_radians()).iter().enumerate())
            .flat_map(|(k, runs)| {
                let row = row_grid.height(k) / study.pixel_mm;
                runs.iter().map(move |[a, b]| {
                    let (a, b) = (*a as f64 - 0.5 - middle, *b as f64 + 0.5 - middle);
                    (vec![[a, row - 0.5], [b, row - 0.5], [b, row + 0.5], [a, row + 0.5]], 0)
                })
            })
            .collect(),
    };
    Tiles {
        title: format!("{}: silhouettes, pixels of {:.1} µm", study.name, 1e3 * study.pixel_mm),
        tiles: [0.0, 36.0, 72.0, 108.0, 144.0].map(tile).into(),
    }
}

/// What is reconstructed from a few, some and many views.
///
/// # Errors
/// [`StudyError::Mesh`].
pub fn shapes(study: &Study, views: &[usize]) -> Result<Tiles, StudyError> {
    let usual = Controls::for_size(study.body.diameter_mm());
    let controls = Controls {
        surface_size_mm: DRAWN * usual.surface_size_mm,
        tet_volume_mm3: DRAWN.powi(3) * usual.tet_volume_mm3,
        ..usual
    };
    let tile = |n: &usize| -> Result<Tile, StudyError> {
        let made = mesh(&study.hull(*n), &controls, &mut |_| {})
            .map_err(|error| StudyError::Mesh { views: *n, error })?;
        let surface = made.surface().triangles;
        let triangles = (0..surface.triangles.len()).map(|t| surface.corners(t));
        Ok(Tile { caption: format!("{n} views"), polygons: shaded(triangles, &from_the_side(TURNED, DOWN)) })
    };
    Ok(Tiles {
        title: format!("{}: shapes from views over half a turn", study.name),
        tiles: views.iter().map(tile).collect::<Result<_, _>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{Body, sensitivity};

    #[test]
    fn a_table_has_a_line_for_each_row_and_the_figures_are_the_same_each_time() {
        let study = Study { name: "a \"ball\"".into(), body: Body::Ball(0.5), pixel_mm: 0.02 };
        let rows = sensitivity(&study, &[2, 6], &mut |_| {}).unwrap();
        let csv = table(&rows);
        assert_eq!(csv.lines().count(), 3);
        assert!(csv.lines().nth(2).unwrap().starts_with("\"a \"\"ball\"\"\",6,30.0000,"), "{csv}");
        let drawn = shapes(&study, &[2, 6]).unwrap();
        assert_eq!(drawn.png().unwrap(), shapes(&study, &[2, 6]).unwrap().png().unwrap());
        assert!(drawn.tiles.iter().all(|t| t.polygons.len() > 100));
        let text = String::from_utf8(silhouettes(&study).svg()).unwrap();
        assert!(text.matches("<polygon").count() > 5 * 20);
        assert_eq!(curves(&rows).panels.len(), 2);
    }
}
