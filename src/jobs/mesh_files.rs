//! Files of surfaces and meshes by their endings.

use super::JobError;
use super::error::Of as _;
use crate::session::{SessionError, write_whole};
use grainrig_core::formats::{FORMATS, Format, Particulars, Reader, Reads, Writes, endings, nrrd, stl};
use grainrig_core::geometry::{Aabb, ImplicitBody, Point, TriangleMesh, Vector};
use grainrig_core::mesh::{MOST_TRIANGLES, MeshError, Solid, TetMesh, Voxels, check_extent};
use grainrig_core::report::Sheet;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Endings of the drawings of a mesh's quality, which are written beside the formats of meshes.
const DRAWN: [&str; 2] = ["svg", "png"];

/// What is read of a file, by its ending.
pub(super) fn reads(path: &Path) -> Option<Reads> {
    Format::of(path)?.reads
}

/// The endings of the files that are read, in a sentence.
pub(super) fn read_endings() -> String {
    endings(|f| f.reads.is_some(), " or ")
}

/// What may be meshed, for a help text.
pub(super) fn input_help() -> String {
    format!(
        "A closed surface ({}), a mesh whose surface is taken ({}), voxels ({}), or a session",
        endings(|f| matches!(f.reads, Some(Reads::Surface(_))), ", "),
        endings(|f| matches!(f.reads, Some(Reads::Volume(_))), ", "),
        endings(|f| matches!(f.reads, Some(Reads::Voxels(_))), ", "),
    )
}

/// What may be written, for a help text.
pub(super) fn output_help() -> String {
    let volumes = FORMATS.iter().filter(|f| matches!(f.writes, Some(Writes::Volume(_))));
    let volumes: Vec<String> = volumes.map(|f| format!(".{} ({})", f.endings[0], f.name)).collect();
    format!(
        "Files to write; the ending says what: {}, {} (surfaces), .svg, .png (histograms of its quality). By default NAME.inp \
         here for a surface; a session has its products in its own folder",
        volumes.join(", "),
        endings(|f| matches!(f.writes, Some(Writes::Surface(_))), ", "),
    )
}

/// Units of length; files do not say theirs.
#[derive(
    Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, utoipa::ToSchema, clap::ValueEnum,
)]
#[serde(rename_all = "snake_case")]
pub enum Unit {
    /// Micrometres.
    Um,
    /// Millimetres.
    #[default]
    Mm,
    /// Metres.
    M,
}

impl Unit {
    /// One of it, mm.
    pub fn in_mm(self) -> f64 {
        match self {
            Self::Um => 1e-3,
            Self::Mm => 1.0,
            Self::M => 1e3,
        }
    }
}

/// The ending of a file's name, in small letters.
pub fn ending(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase()
}

/// Reads a surface, or the surface of a mesh, in mm; and the file's bytes.
pub(super) fn read(path: &Path, unit: Unit) -> Result<(TriangleMesh, Vec<u8>), JobError> {
    if ending(path) == "stl" {
        // Said before the file is read, which takes memory.
        let (header, length) = crate::system::read_head(path, stl::HEADER)?;
        let count = stl::announced(&header, length).filter(|n| *n > MOST_TRIANGLES);
        if let Some(count) = count.filter(|n| (stl::HEADER + stl::TRIANGLE * n) as u64 <= length) {
            return Err(MeshError::Triangles { count, limit: MOST_TRIANGLES }).of(path);
        }
    }
    let bytes = crate::system::read(path)?;
    let of_mesh = |mesh: TetMesh| -> Result<TriangleMesh, JobError> {
        mesh.check().map_err(|e| JobError::Content(format!("its tetrahedra are no mesh: {e}"))).of(path)?;
        Ok(mesh.surface().triangles)
    };
    let of_mesh = |mesh: TetMesh| -> Result<TriangleMesh, JobError> {
        // Said before its tetrahedra are looked at, whose volumes would be no numbers.
        let scaled = mesh.nodes.iter().map(|p| p * unit.in_mm());
        if let Some(bounds) = Aabb::of(scaled).filter(|b| b.farthest().is_finite()) {
            check_extent(&bounds).of(path)?;
        }
        of_mesh(mesh)
    };
    let mut surface = match reads(path) {
        Some(Reads::Volume(read)) => of_mesh(read(&bytes).of(path)?)?,
        Some(Reads::Surface(read)) => read(&bytes).of(path)?,
        _ => stl::read(&bytes).of(path)?,
    };
    surface.vertices.iter_mut().for_each(|p| p.coords *= unit.in_mm());
    Ok((surface, bytes))
}

/// A body as a file has it.
pub(super) struct Input {
    pub(super) body: Box<dyn ImplicitBody>,
    pub(super) volume_mm3: f64,
    /// What `volume_mm3` is the volume of.
    pub(super) what: &'static str,
    pub(super) box_mm: Vector,
    /// Where the body's own origin is in the file's frame, mm: one that lies far away is computed with near its own.
    pub(super) moved_mm: Vector,
    /// Places on its surface, from which distances to a mesh are measured.
    pub(super) places: Vec<Point>,
    /// Whether its triangles faced inwards and were turned.
    pub(super) turned: bool,
    /// What a person should know of the file.
    pub(super) warnings: Vec<String>,
    pub(super) bytes: Vec<u8>,
}

/// Opens a body: a closed surface, the surface of a mesh, or voxels.
pub(super) fn open(path: &Path, unit: Unit, threshold: Option<f64>) -> Result<Input, JobError> {
    if let Some(Reads::Voxels(read)) = reads(path) {
        return voxels(path, read, unit, threshold);
    }
    if threshold.is_some() {
        return Err(JobError::Usage(format!(
            "{}: --threshold goes with voxels ({})",
            path.display(),
            endings(|f| matches!(f.reads, Some(Reads::Voxels(_))), " or ")
        )));
    }
    let (mut surface, bytes) = read(path, unit)?;
    let moved_mm = surface.bounds().map_or_else(Vector::zeros, |b| away(&b));
    if moved_mm != Vector::zeros() {
        surface.bounds().as_ref().map_or(Ok(()), check_extent).of(path)?;
        surface.vertices.iter_mut().for_each(|p| *p -= moved_mm);
    }
    let (solid, turned) = outwards(surface, path)?;
    let surface = solid.surface();
    let middles = (0..surface.triangles.len())
        .map(|t| surface.corners(t))
        .map(|[a, b, c]| Point::from((a.coords + b.coords + c.coords) / 3.0));
    Ok(Input {
        volume_mm3: surface.volume_mm3(),
        what: "surface",
        box_mm: solid.bounds().size(),
        moved_mm,
        places: middles.chain(surface.vertices.iter().copied()).collect(),
        turned,
        warnings: turned.then(|| TURNED.to_owned()).into_iter().collect(),
        bytes,
        body: Box::new(solid),
    })
}

/// What is said of a surface that was inside out.
pub(super) const TURNED: &str = "it was inside out; all its triangles are turned outwards";

/// The closed surface of a file, facing outwards, and whether it was inside out.
pub(super) fn outwards(surface: TriangleMesh, path: &Path) -> Result<(Solid, bool), JobError> {
    let (solid, inwards) = Solid::turned_outwards(surface).of(path)?;
    if let Some([first, second]) = solid.crossing() {
        let point = solid.surface().corners(first)[0];
        return Err(MeshError::Crossing { first, second, point }).of(path);
    }
    Ok((solid, inwards))
}

/// Voxels: what is above the threshold is the body.
fn voxels(
    path: &Path,
    read: Reader<nrrd::Volume>,
    unit: Unit,
    threshold: Option<f64>,
) -> Result<Input, JobError> {
    if let Some(t) = threshold.filter(|t| !t.is_finite()) {
        return Err(JobError::Usage(format!(
            "--threshold {t}: it must be a finite number, in the file's grey values"
        )));
    }
    let bytes = crate::system::read(path)?;
    let volume = read(&bytes).of(path)?;
    let in_mm = match volume.unit.as_deref() {
        None => unit.in_mm(),
        Some(word) => match word.to_lowercase().as_str() {
            "mm" | "millimeter" | "millimeters" | "millimetre" | "millimetres" => 1.0,
            "um" | "µm" | "μm" | "micron" | "microns" | "micrometer" | "micrometers" => 1e-3,
            "m" | "meter" | "meters" | "metre" | "metres" => 1e3,
            _ => {
                return Err(JobError::Content(format!(
                    "its unit is `{word}`, not mm, µm or m: correct its `space units`"
                )))
                .of(path);
            }
        },
    };
    let pitch = volume.pitch.ok_or_else(|| {
        JobError::Content(
            "it does not say how large its voxels are: add a field `spacings: P P P`, P in the unit that --unit says".into(),
        )
    });
    let pitch_mm = pitch.of(path)? * in_mm;
    let least = threshold.or_else(|| volume.between_two_values()).ok_or_else(|| {
        let (low, high) = volume
            .samples()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), s| (low.min(s), high.max(s)));
        JobError::Content(format!("its values are not just two, but from {low} to {high}: say with --threshold above which one the grain is"))
    });
    let least = least.of(path)?;
    let inside: Vec<bool> = volume.samples().map(|s| s > least).collect();
    let origin = Point::from(volume.origin) * in_mm;
    let size = volume.size;
    drop(volume);
    let edges = Vector::from(size.map(|n| n as f64)) * pitch_mm;
    let bounds = Aabb { min: origin, max: origin + edges };
    check_extent(&bounds).of(path)?;
    let moved_mm = away(&bounds);
    let origin = origin - moved_mm;
    let body = Voxels::new(origin, pitch_mm, size, &inside).of(path)?;
    let volume_mm3 = body.volume_mm3();
    if volume_mm3 == 0.0 {
        return Err(JobError::Content(format!("no voxel is above {least}: give another --threshold")))
            .of(path);
    }
    let mut warnings = Vec::new();
    let sides = sides_reached(&inside, size);
    if !sides.is_empty() {
        warnings.push(format!(
            "the grain reaches the volume's edge at {}: it is cut off flat there; a volume with some of its surroundings on \
             every side has all of it",
            sides.join(", ")
        ));
    }
    let (box_mm, places) = (edges, body.surface_points());
    let what = "voxels";
    Ok(Input {
        volume_mm3,
        what,
        box_mm,
        moved_mm,
        places,
        turned: false,
        warnings,
        bytes,
        body: Box::new(body),
    })
}

/// The middle of a box that lies farther from the origin than a thousand of its lengths, where rounding begins to tell; else
/// nought.
fn away(bounds: &Aabb) -> Vector {
    const FAR: f64 = 1000.0;
    if bounds.farthest() > FAR * bounds.size().max() { bounds.center().coords } else { Vector::zeros() }
}

/// What is written of a mesh.
pub(super) struct Made<'a> {
    pub(super) mesh: &'a TetMesh,
    pub(super) particulars: Particulars<'a>,
    pub(super) sheet: &'a Sheet,
}

impl Made<'_> {
    /// Writes a file, whose ending says what.
    pub(super) fn write(&self, path: &Path) -> Result<(), JobError> {
        let mut out = Vec::new();
        match (Format::of(path), ending(path).as_str()) {
            (Some(format), _) => format.write(self.mesh, &self.particulars, &mut out)?,
            (None, "svg") => out = self.sheet.svg(),
            (None, _) => {
                out = self
                    .sheet
                    .png()
                    .map_err(|e| JobError::Content(format!("the histograms cannot be drawn: {e}")))?;
            }
        }
        whole(path, &out)
    }
}

/// Writes a file, which appears whole or not at all.
pub(super) fn whole(path: &Path, bytes: &[u8]) -> Result<(), JobError> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let unwritten = |e: SessionError| JobError::Of {
        name: format!("cannot write {}", path.display()),
        source: Box::new(e.into()),
    };
    write_whole(folder, &name, bytes).map(drop).map_err(unwritten)
}

/// Refuses a file to write whose kind is not known, or that is the one that is read.
pub(super) fn check_output(path: &Path, input: &Path, force: bool) -> Result<(), JobError> {
    let is_written = Format::of(path).is_some_and(|f| f.writes.is_some());
    if !is_written && !DRAWN.contains(&ending(path).as_str()) {
        let all = endings(|f| f.writes.is_some(), ", ");
        return Err(JobError::Usage(format!(
            "{}: the ending must be one of {all}, .svg, .png",
            path.display()
        )));
    }
    let read = input.canonicalize().ok();
    if read.is_some() && path.canonicalize().ok() == read {
        return Err(JobError::Usage(format!(
            "{}: this is the file that is read; give --out another name",
            path.display()
        )));
    }
    if !force && path.symlink_metadata().is_ok() {
        return Err(JobError::Usage(format!(
            "{} is there already; give --out another name, or --force to write over it",
            path.display()
        )));
    }
    Ok(())
}

/// At which of the volume's sides there are voxels of the body.
fn sides_reached(inside: &[bool], size: [usize; 3]) -> Vec<&'static str> {
    const SIDES: [[&str; 2]; 3] = [["x = 0", "the last x"], ["y = 0", "the last y"], ["z = 0", "the last z"]];
    let mut reached = [[false; 2]; 3];
    for (i, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
        let at = [i % size[0], i / size[0] % size[1], i / size[0] / size[1]];
        for k in 0..3 {
            reached[k][0] |= at[k] == 0;
            reached[k][1] |= at[k] + 1 == size[k];
        }
    }
    SIDES
        .iter()
        .zip(reached)
        .flat_map(|(names, is)| (0..2).filter(move |e| is[*e]).map(|e| names[e]))
        .collect()
}
