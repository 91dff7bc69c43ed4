//! Files of surfaces and meshes by their endings.

use super::mesh::Unit;
use super::usage;
use crate::export::{glb, inp, inp_read, msh, ply, stl, vtu};
use crate::geometry::TriangleMesh;
use crate::mesh::{MOST_TRIANGLES, MeshError, TetMesh};
use crate::report::Sheet;
use crate::session::write_whole;
use anyhow::{Context as _, Result};
use std::path::Path;

/// Endings of surfaces that are read, and of everything that is written.
pub(super) const READ: [&str; 4] = ["stl", "ply", "inp", "msh"];
pub(super) const WRITTEN: [&str; 8] = ["inp", "vtu", "msh", "stl", "ply", "glb", "svg", "png"];

/// The ending of a file's name, in small letters.
pub(super) fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

/// Reads a surface, or the surface of a mesh, in mm; and the file's bytes.
pub(super) fn read(path: &Path, unit: Unit) -> Result<(TriangleMesh, Vec<u8>)> {
    let name = || path.display().to_string();
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}; check the path", name()))?;
    let of_mesh = |mesh: TetMesh| -> Result<TriangleMesh> {
        mesh.check().with_context(|| format!("{}: its tetrahedra are no mesh", name()))?;
        Ok(mesh.surface().triangles)
    };
    let mut surface = match ending(path).as_str() {
        "ply" => ply::read(&bytes).with_context(name)?,
        "inp" => of_mesh(inp_read::read(&bytes).with_context(name)?)?,
        "msh" => of_mesh(msh::read(&bytes).with_context(name)?)?,
        _ => {
            // Said before the file is taken apart, which takes memory.
            if let Some(count) = stl::announced(&bytes).filter(|n| *n > MOST_TRIANGLES) {
                return Err(MeshError::Triangles { count, limit: MOST_TRIANGLES }).with_context(name);
            }
            stl::read(&bytes).with_context(name)?
        }
    };
    surface.vertices.iter_mut().for_each(|p| p.coords *= unit.in_mm());
    Ok((surface, bytes))
}

/// What is written of a mesh.
pub(super) struct Made<'a> {
    pub(super) mesh: &'a TetMesh,
    pub(super) order: inp::Order,
    /// How far the contact sets reach, mm.
    pub(super) band_mm: f64,
    pub(super) provenance: &'a [String],
    pub(super) sheet: &'a Sheet,
}

impl Made<'_> {
    /// Writes a file, whose ending says what.
    pub(super) fn write(&self, path: &Path) -> Result<()> {
        let (mesh, says) = (self.mesh, self.provenance);
        let second = self.order == inp::Order::Second;
        let mut out = Vec::new();
        match ending(path).as_str() {
            "inp" => inp::write_order(mesh, self.order, says, self.band_mm, &mut out)?,
            "msh" => msh::write(mesh, second, says, &mut out)?,
            "vtu" if second => vtu::write_second(&mesh.second_order(), says, &mut out)?,
            "vtu" => vtu::write_plain(mesh, says, &mut out)?,
            "ply" => ply::write(&mesh.surface().triangles, says, &mut out)?,
            "glb" => glb::write(&mesh.surface().triangles, says, &mut out)?,
            "svg" => out = self.sheet.svg(),
            "png" => out = self.sheet.png().context("cannot draw the histograms")?,
            _ => {
                // The header has room for a part of the hash.
                let hash = says.iter().find_map(|line| line.strip_prefix("sha256 of the input "));
                let short = hash.map_or(String::new(), |h| format!("from sha256 {h:.24}"));
                stl::write_from(&mesh.surface().triangles, &short, &mut out)?;
            }
        }
        whole(path, &out)
    }
}

/// Writes a file, which appears whole or not at all.
pub(super) fn whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    write_whole(folder, &name, bytes).map(|_| ()).with_context(|| format!("cannot write {}", path.display()))
}

/// Refuses a file to write whose kind is not known, or that is the one that is read.
pub(super) fn check_output(path: &Path, input: &Path) -> Result<()> {
    if !WRITTEN.contains(&ending(path).as_str()) {
        let all = WRITTEN.map(|e| format!(".{e}")).join(", ");
        return Err(usage(format!("{}: the ending must be one of {all}", path.display())));
    }
    let read = input.canonicalize().ok();
    if read.is_some() && path.canonicalize().ok() == read {
        return Err(usage(format!(
            "{}: this is the file that is read; give --out another name",
            path.display()
        )));
    }
    Ok(())
}
