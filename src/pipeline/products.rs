//! The products of a session, as bytes.

use super::convergence::{CONVERGENCE, drawn};
use super::pictures::{SHEET, sheet_files};
use super::{PipelineError, Reconstruction};
use grainrig_core::formats::{inp, stl, vtu};
use grainrig_core::mesh::{Controls, TetMesh};
use grainrig_core::report::Sheet;

/// One product.
#[derive(Debug, Clone)]
pub struct Product {
    /// What it is: `inp`, `vtu`, `stl`, `calibration`, `calibration_png`, `convergence`, `convergence_png`, `outline_00` and so on.
    pub kind: String,
    /// Its file name.
    pub file: String,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// The mesh as Abaqus input, `ParaView` grid and STL surface; the drawings, where they were asked for. The same reconstruction gives the same bytes.
///
/// # Errors
/// [`PipelineError`] where a format can't hold the mesh or the drawing.
pub fn products(made: &Reconstruction, software: &str, session: &str) -> Result<Vec<Product>, PipelineError> {
    let mut provenance =
        vec![format!("made by {software} from session {session}, {} views", made.views.len())];
    match made.scale_mm_per_px {
        Some(scale) => provenance.push(format!("{scale} mm per pixel, z = 0 at the foot of the grain")),
        None => provenance.push("in the frame of the given cameras".into()),
    }
    if made.hull.volume_mm3.is_none() {
        provenance.push("NOT METRIC: the cameras have no unit of length".into());
    }
    let mut out =
        of_mesh(&made.tetrahedra, &made.controls, &provenance, made.hull.contact_patch.map(|p| p.height_mm))?;
    if let Some(sheet) = &made.sheet {
        let title = format!("Calibration of session {session} ({software})");
        out.extend(sheet_files(SHEET, &Sheet { title, ..sheet.clone() })?);
        if let Some(sheet) = drawn(&made.hull.convergence) {
            let title = format!("Convergence of the hull of session {session} ({software})");
            out.extend(sheet_files(CONVERGENCE, &Sheet { title, ..sheet })?);
        }
    }
    out.extend(made.outlines.iter().cloned());
    Ok(out)
}

/// The mesh as Abaqus input, `ParaView` grid and STL surface; its pedestal hid it up to a height, mm, where it stood on one.
pub(super) fn of_mesh(
    mesh: &TetMesh,
    controls: &Controls,
    provenance: &[String],
    hidden_mm: Option<f64>,
) -> Result<Vec<Product>, PipelineError> {
    let mut deck = Vec::new();
    inp::write_standing(mesh, provenance, controls.surface_size_mm, hidden_mm, &mut deck)?;
    let mut grid = Vec::new();
    let volumes: Vec<f64> = mesh.tet_volumes_mm3().collect();
    let column = vtu::Column { name: "volume_mm3", components: 1, values: &volumes };
    vtu::write(mesh, &[], &[column], &mut grid)?;
    let mut triangles = Vec::new();
    stl::write(&mesh.surface().triangles, &mut triangles)?;
    Ok([("inp", deck), ("vtu", grid), ("stl", triangles)]
        .map(|(kind, bytes)| Product { kind: kind.into(), file: format!("grain.{kind}"), bytes })
        .into())
}
