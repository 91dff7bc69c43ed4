//! The forms of answers whose values the rig hands over as JSON: what a client may rely on. They may have more than is
//! described here. `tests/http/client.rs` holds the daemon's own answers to them.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

/// A file, byte for byte.
#[derive(Serialize, ToSchema)]
#[schema(value_type = String, format = Binary)]
pub(super) struct FileBytes(Vec<u8>);

/// A session of the data folder.
#[derive(Serialize, ToSchema)]
pub(super) struct SessionLine {
    /// Its name.
    #[schema(example = "leighton-buzzard-07")]
    name: String,
    /// When it was created, UTC; `null` where it is damaged.
    #[schema(value_type = Option<String>, format = DateTime)]
    created: Option<Timestamp>,
    /// `rig` or `import`.
    origin: Option<String>,
    /// Views in its plan.
    planned: usize,
    /// Views whose pictures are durable.
    captured: usize,
    /// `created`, `interrupted`, `aborted`, `failed`, `captured` or `complete`; `null` where it is damaged.
    state: Option<String>,
    /// Whether somebody writes it now.
    busy: bool,
    /// What is wrong with it and what to do.
    damage: Option<String>,
}

/// A picture of a session.
#[derive(Serialize, ToSchema)]
pub(super) struct FrameLine {
    /// Index of the view in the plan, from 0.
    view: usize,
    /// `grain` or `closing`.
    role: String,
    /// File name: `sessions/{session}/frames/{file}`.
    file: String,
    /// Its length, bytes.
    bytes: u64,
    /// Its SHA-256, hexadecimal.
    sha256: String,
    /// Where the stage was sent, degrees.
    commanded_deg: f64,
    /// Where the stage said it was, degrees.
    reached_deg: f64,
}

/// A product of a session.
#[derive(Serialize, ToSchema)]
pub(super) struct ProductLine {
    /// File name: `sessions/{session}/products/{file}`.
    file: String,
    /// Its length, bytes.
    bytes: u64,
    /// Its SHA-256, hexadecimal.
    sha256: String,
}

/// A session.
#[derive(Serialize, ToSchema)]
pub(super) struct SessionDetails {
    /// Its name.
    name: String,
    /// When it was created, UTC.
    #[schema(value_type = String, format = DateTime)]
    created: Timestamp,
    /// The program that created it.
    software: String,
    /// `rig` or `import`.
    origin: String,
    /// The devices, as they described themselves.
    devices: Vec<String>,
    /// How far it has come.
    state: String,
    /// Its pictures.
    frames: Vec<FrameLine>,
    /// Its products.
    products: Vec<ProductLine>,
    /// The newest result; `null` before the first.
    result: Option<GrainResult>,
}

/// The figures of a grain, as `result.json` has them.
#[derive(Serialize, ToSchema)]
pub(super) struct GrainResult {
    /// The program that computed it.
    software: String,
    /// The session's name.
    session: String,
    /// Views that carved.
    views: usize,
    /// Size of a pixel at the axis, mm; `null` where there is no scale.
    scale_mm_per_px: Option<f64>,
    /// The visual hull.
    hull: HullFigures,
    /// The mesh.
    mesh: MeshFigures,
    /// The products' file names by kind.
    products: BTreeMap<String, String>,
    /// What a person should know.
    warnings: Vec<String>,
}

/// The visual hull's measures.
#[derive(Serialize, ToSchema)]
pub(super) struct HullFigures {
    /// Its volume, mm³: an upper bound of the grain's.
    volume_mm3: Option<f64>,
    /// The estimate of the grain's volume, mm³.
    volume_estimate_mm3: Option<f64>,
    /// Its area, mm².
    surface_area_mm2: Option<f64>,
}

/// The mesh's measures.
#[derive(Serialize, ToSchema)]
pub(super) struct MeshFigures {
    /// Nodes.
    nodes: usize,
    /// Triangles of the surface.
    triangles: usize,
    /// Tetrahedra.
    tetrahedra: usize,
    /// Volume, mm³.
    volume_mm3: Option<f64>,
}

/// A device that is there.
#[derive(Serialize, ToSchema)]
pub(super) struct Device {
    /// `stage` or `camera`.
    role: String,
    /// The driver that it is for.
    driver: String,
    /// As it describes itself.
    name: String,
    /// Its device file; none of the simulated ones.
    path: Option<String>,
    /// Whether the daemon's account may open it.
    permitted: bool,
    /// Another program that has it open.
    held_by: Option<String>,
    /// Whether the daemon's configuration uses it.
    configured: bool,
}

/// What a check of the rig found.
#[derive(Serialize, ToSchema)]
pub(super) struct CheckFinding {
    /// What was looked at.
    check: String,
    /// How it came out.
    health: String,
    /// What was found.
    found: String,
    /// What to do about it.
    remedy: Option<String>,
}

/// A compression of a session's grain.
#[derive(Serialize, ToSchema)]
pub(super) struct CompressionLine {
    /// Its name.
    #[schema(example = "elastic")]
    name: String,
    /// `running`, `interrupted` or `complete`.
    state: String,
}

/// A compression with its results.
#[derive(Serialize, ToSchema)]
pub(super) struct CompressionDetails {
    /// Its name.
    name: String,
    /// `running`, `interrupted` or `complete`.
    state: String,
    /// The figures; `null` before its end.
    result: Option<CompressionFigures>,
    /// The files so far.
    files: Vec<CompressionFile>,
}

/// What came of a compression.
#[derive(Serialize, ToSchema)]
pub(super) struct CompressionFigures {
    /// Whether it came to its end.
    finished: bool,
    /// Force against the approach of the plates.
    curve: Vec<ForcePoint>,
    /// Elements of the mesh.
    elements: usize,
    /// Nodes of the mesh.
    nodes: usize,
    /// What a person should know.
    warnings: Vec<String>,
}

/// A point of the curve of force against approach.
#[derive(Serialize, ToSchema)]
pub(super) struct ForcePoint {
    /// Approach of the plates, mm.
    approach_mm: f64,
    /// Force on a plate, N.
    force_n: f64,
}

/// A file of a compression.
#[derive(Serialize, ToSchema)]
pub(super) struct CompressionFile {
    /// File name: `sessions/{session}/compressions/{name}/files/{file}`.
    file: String,
    /// Its length, bytes.
    bytes: u64,
}
