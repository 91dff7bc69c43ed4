//! `ParaView`'s collection (`.pvd`): grids at several moments as one series.

use super::ExportError;
use std::io::Write;

/// Writes a collection of files, each with what stands for its time; `time` names that, with its unit.
///
/// # Errors
/// [`ExportError::Io`].
pub fn write(grids: &[(f64, String)], time: &str, mut out: impl Write) -> Result<(), ExportError> {
    writeln!(out, "<?xml version=\"1.0\"?>")?;
    // Two hyphens would end a comment.
    writeln!(out, "<!-- timestep: {} -->", time.replace("--", "- -"))?;
    writeln!(out, "<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\">\n<Collection>")?;
    for (time, file) in grids {
        let file = file.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;");
        writeln!(out, "<DataSet timestep=\"{time}\" group=\"\" part=\"0\" file=\"{file}\"/>")?;
    }
    writeln!(out, "</Collection>\n</VTKFile>")?;
    Ok(out.flush()?)
}
