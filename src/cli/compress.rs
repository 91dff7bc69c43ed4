//! `grainrig compress`.

use super::mesh::Unit;
use super::mesh_files::outwards;
use super::output::{print, print_json, say};
use super::{Common, laws, usage};
use crate::daemon::{
    Claim, CompressInput, CompressMaterial, CompressProgress, CompressRequest, CompressResult, Compression,
    DaemonError, OtherCurve, claim_of, experiment_lines, session_grain, transition_line,
};
use crate::session::{Recording, to_json_value};
use anyhow::{Context as _, Result, bail};
use clap::Args;
use grainrig_core::contact::ContactError;
use grainrig_core::contact::CurvePoint;
use grainrig_core::contact::experiment::{self, Compliance};
use grainrig_core::formats::{Format, Reads, endings};
use serde_json::json;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// The most that is read of an export or of another compression's result.
const MOST_BYTES: u64 = 64 << 20;

/// Options of `compress`.
#[derive(Debug, Args)]
pub struct Arguments {
    #[arg(help = input_help(), required_unless_present_any = ["sphere_diameter_mm", "resume"])]
    input: Option<PathBuf>,
    /// A sphere of this diameter instead of an input, mm.
    #[arg(long, value_name = "MM", conflicts_with = "input", allow_negative_numbers = true)]
    sphere_diameter_mm: Option<f64>,
    /// Unit of the file's numbers.
    #[arg(long, value_enum, default_value_t = Unit::Mm)]
    unit: Unit,
    /// How the grain answers; plastic yields at --yield-mpa.
    #[arg(long, value_parser = laws::parser(), default_value = CompressMaterial::default().0.name)]
    material: CompressMaterial,
    /// Young's modulus, MPa.
    #[arg(long, value_name = "MPA", default_value_t = CompressRequest::default().young_mpa, allow_negative_numbers = true)]
    young_mpa: f64,
    /// Poisson's ratio.
    #[arg(long, value_name = "NU", default_value_t = CompressRequest::default().poisson, allow_negative_numbers = true)]
    poisson: f64,
    /// Density, t/mm³.
    #[arg(long, value_name = "RHO", default_value_t = CompressRequest::default().density_t_mm3, allow_negative_numbers = true)]
    density_t_mm3: f64,
    /// Yield stress of a plastic grain, MPa.
    #[arg(long, value_name = "MPA", default_value_t = CompressRequest::default().yield_mpa, allow_negative_numbers = true)]
    yield_mpa: f64,
    /// Slope of the yield stress against the plastic strain, MPa.
    #[arg(long, value_name = "MPA", default_value_t = CompressRequest::default().hardening_mpa, allow_negative_numbers = true)]
    hardening_mpa: f64,
    #[command(flatten)]
    parameters: laws::Parameters,
    /// Coulomb's friction between plates and grain.
    #[arg(long, value_name = "MU", default_value_t = CompressRequest::default().friction, allow_negative_numbers = true)]
    friction: f64,
    /// Stop at this force, N; by default, where no approach is given, at 10 N or four times --transition-n,
    /// whichever is more. From four times on it counts as known that the force does not fall below the
    /// transition again, so a force between the two goes on to there; --to-approach-mm stops wherever it is.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    to_force_n: Option<f64>,
    /// Stop at this approach of the plates, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    to_approach_mm: Option<f64>,
    /// Largest circumradius of a surface facet, mm; by default a fourteenth of the diameter of a ball of
    /// the grain's volume.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    size_mm: Option<f64>,
    /// The same where the plates touch, mm; by default as fine as 120 000 tetrahedra allow, at most an 85th.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    size_at_contact_mm: Option<f64>,
    /// Turn the grain about x, then y, then z (degrees) instead of letting it come to rest on the lower plate.
    #[arg(long, value_name = "DEG", num_args = 3, allow_negative_numbers = true)]
    rotate_deg: Option<Vec<f64>>,
    /// Multiple of the usual speed of the plates.
    #[arg(long, value_name = "FACTOR", default_value_t = CompressRequest::default().speed, allow_negative_numbers = true)]
    speed: f64,
    /// Mass that may be added to the smallest elements, over the grain's.
    #[arg(long, value_name = "SHARE", default_value_t = CompressRequest::default().mass_scaling, allow_negative_numbers = true)]
    mass_scaling: f64,
    /// A time step instead of nine tenths of the stable one, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    time_step_s: Option<f64>,
    /// The force at which the transition to a Hertzian response is read, N.
    #[arg(long, value_name = "N", default_value_t = CompressRequest::default().transition_n, allow_negative_numbers = true)]
    transition_n: f64,
    /// The laboratory's own test: a Bluehill export, drawn and compared.
    #[arg(long, value_name = "FILE")]
    experiment: Option<PathBuf>,
    /// Compliance of the testing machine, µm/N, taken off the measured displacement.
    #[arg(long, value_name = "UM_PER_N", conflicts_with = "plate_on_plate", allow_negative_numbers = true)]
    compliance_um_per_n: Option<f64>,
    /// A Bluehill export of plate on plate, which tells the machine's compliance.
    #[arg(long, value_name = "FILE")]
    plate_on_plate: Option<PathBuf>,
    /// Other compressions (their folders) whose curves are drawn beside.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    beside: Vec<PathBuf>,
    /// The folder of the results; by default a session's own compressions/, where the monitor shows it, and
    /// NAME-compressed here for a file.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on with the interrupted compression of this folder; its own settings hold.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["input", "sphere_diameter_mm", "out"])]
    resume: Option<PathBuf>,
}

pub(super) fn run(common: &Common, a: &Arguments) -> Result<()> {
    let others = others(a)?;
    let stop = super::signals::stop_flag(
        "stopping; the same command again, or `grainrig compress --resume`, goes on from there",
    );
    let bar = super::progress::percent("compressing");
    let mut compression = if let Some(folder) = &a.resume {
        Compression::resume(folder)?
    } else {
        // Said before anything is read: a large surface alone takes seconds.
        let meshing = super::progress::percent("");
        let mut phase = String::new();
        let mut tell = |now: &str, done: f64| set_up(&meshing, &mut phase, now, done);
        tell("reading the body", 0.0);
        let name = a.input.as_ref().map(|path| path.display().to_string());
        let claim = claim(common, a, name.as_deref())?;
        let made = claim.build(&mut tell);
        meshing.finish_and_clear();
        made.map_err(|e| named(e, name.as_deref()))?
    };
    let (elements, nodes, step_s) = compression.size();
    say(format!("{elements} tetrahedra, {nodes} nodes, steps of {:.3} ns", 1e9 * step_s));
    if compression.done() > 0.0 {
        say(format!("going on from the checkpoint at {:.0} %", 100.0 * compression.done()));
    }
    if let Some(line) = compression.settings().goes_on() {
        say(line);
    }
    let mut said = None;
    let result = compression.run(&others, &stop, &mut |p| show(&bar, &mut said, &p));
    bar.finish_and_clear();
    let result = result?;
    for w in &result.warnings {
        say(format!("warning: {w}"));
    }
    let folder = compression.folder();
    if common.json {
        let mut object = to_json_value(&result)?;
        object["folder"] = json!(folder.canonicalize().unwrap_or_else(|_| folder.to_owned()));
        return print_json(&object);
    }
    print(&told(&result, folder))
}

/// What is wrong with a body begins with the name of its file.
fn named(error: DaemonError, name: Option<&str>) -> anyhow::Error {
    let of_body = match &error {
        DaemonError::Mesh(_) | DaemonError::Doubt(_) => true,
        DaemonError::Contact(e) => !matches!(e, ContactError::Setting { .. } | ContactError::Unstable { .. }),
        _ => false,
    };
    let error = anyhow::Error::new(error);
    if let (true, Some(name)) = (of_body, name) { error.context(name.to_owned()) } else { error }
}

/// What is done before the plates move: the bar, or where nobody sees one a line for each thing.
fn set_up(bar: &indicatif::ProgressBar, phase: &mut String, now: &str, done: f64) {
    if phase != now {
        now.clone_into(phase);
        if bar.is_hidden() {
            say(now);
        } else {
            bar.set_message(now.to_owned());
        }
    }
    bar.set_position((100.0 * done) as u64);
}

/// The bar, or where nobody sees one a line for each twentieth of the way.
fn show(bar: &indicatif::ProgressBar, said: &mut Option<u32>, p: &CompressProgress) {
    let s = p.sample;
    let left = p.left_s.map_or_else(String::new, |s| format!(", about {} s left", s.ceil()));
    let line =
        format!("{:.3} µm, {:.3} N, {} contacts{left}", 1e3 * s.approach_mm, s.force_n, s.touches.len());
    bar.set_position((100.0 * p.done) as u64);
    let twentieth = (20.0 * p.done) as u32;
    if !bar.is_hidden() {
        bar.set_message(line);
    } else if said.is_none_or(|said| twentieth > said) {
        // The first sample as well: it shows that the plates move.
        *said = Some(twentieth);
        say(format!("{:3.0} %: {line}", 100.0 * p.done));
    }
}

/// What was asked, as a script or the monitor would ask it.
fn request(a: &Arguments, as_given: bool) -> CompressRequest {
    CompressRequest {
        material: a.material,
        young_mpa: a.young_mpa,
        poisson: a.poisson,
        density_t_mm3: a.density_t_mm3,
        yield_mpa: a.yield_mpa,
        hardening_mpa: a.hardening_mpa,
        parameters: a.parameters.0.clone(),
        friction: a.friction,
        to_force_n: a.to_force_n,
        to_approach_mm: a.to_approach_mm,
        size_mm: a.size_mm,
        size_at_contact_mm: a.size_at_contact_mm,
        rotate_deg: a.rotate_deg.as_ref().map(|r| [r[0], r[1], r[2]]),
        speed: a.speed,
        mass_scaling: a.mass_scaling,
        time_step_s: a.time_step_s,
        transition_n: a.transition_n,
        as_given,
    }
}

/// What is asked, in the folder of its results: a session's own compressions, unless told, as the monitor shows them.
fn claim(common: &Common, a: &Arguments, file: Option<&str>) -> Result<Claim> {
    let request = request(a, common.as_given);
    let settings = request.settings().map_err(usage)?;
    let path = a.input.as_deref().unwrap_or(Path::new("sphere"));
    let (input, name) = if let Some(input) = body(a)? {
        (input, path.file_stem().unwrap_or_default().to_string_lossy())
    } else {
        let recording = Recording::read(&super::session_folder(common, path)?)?;
        if a.out.is_none() {
            let (_, claim) = claim_of(&recording, &request, true)?;
            return Ok(claim);
        }
        (session_grain(&recording)?, path.to_string_lossy())
    };
    let out = a.out.clone().unwrap_or_else(|| PathBuf::from(format!("{name}-compressed")));
    Claim::new(&out, input, &request.placing(), &settings).map_err(|e| named(e, file))
}

/// The body of a file, or a sphere; `None` for a session.
fn body(a: &Arguments) -> Result<Option<CompressInput>> {
    if let Some(d) = a.sphere_diameter_mm {
        if !(d.is_finite() && d > 0.0) {
            return Err(usage(format!("--sphere-diameter-mm {d}: it must be positive, in mm")));
        }
        return Ok(Some(CompressInput::Sphere(d)));
    }
    let Some(path) = &a.input else { bail!("no input") };
    let name = || path.display().to_string();
    match Format::of(path).and_then(|f| f.reads) {
        Some(Reads::Surface(read)) => {
            let mut surface = read(&crate::system::read(path)?).with_context(name)?;
            surface.vertices.iter_mut().for_each(|p| p.coords *= a.unit.in_mm());
            let outwards = outwards(surface, path)?.0.surface().clone();
            Ok(Some(CompressInput::Surface(outwards, name())))
        }
        Some(Reads::Volume(read)) => {
            let mut mesh = read(&crate::system::read(path)?).with_context(name)?;
            mesh.nodes.iter_mut().for_each(|p| p.coords *= a.unit.in_mm());
            if a.size_mm.is_some() || a.size_at_contact_mm.is_some() {
                return Err(usage(
                    "--size-mm and --size-at-contact-mm go with a surface or a session; this file is a mesh already",
                ));
            }
            Ok(Some(CompressInput::Mesh(mesh, name())))
        }
        _ if path.is_file() => Err(usage(format!(
            "{}: a body is read from {}; `grainrig mesh` makes one of them from other files",
            path.display(),
            endings(is_body, " or ")
        ))),
        _ => Ok(None),
    }
}

/// Whether a body to be compressed is read of such files.
fn is_body(format: &Format) -> bool {
    matches!(format.reads, Some(Reads::Surface(_) | Reads::Volume(_)))
}

/// What may be compressed, for a help text.
fn input_help() -> String {
    let volumes = endings(|f| matches!(f.reads, Some(Reads::Volume(_))), ", ");
    let surfaces = endings(|f| matches!(f.reads, Some(Reads::Surface(_))), ", ");
    format!("A session, a mesh of tetrahedra ({volumes}) or a closed surface ({surfaces})")
}

/// The curves to be drawn beside: the laboratory's, and those of other compressions.
fn others(a: &Arguments) -> Result<Vec<OtherCurve>> {
    let read = |path: &Path| -> Result<experiment::Experiment> {
        experiment::read(&bounded(path, "a Bluehill export")?).with_context(|| path.display().to_string())
    };
    let mut out = Vec::new();
    if let Some(path) = &a.experiment {
        let compliance = match (&a.compliance_um_per_n, &a.plate_on_plate) {
            (Some(c), _) => Compliance::given(*c).map_err(usage)?,
            (None, Some(plates)) => {
                Compliance::measured(&read(plates)?).with_context(|| plates.display().to_string())?
            }
            (None, None) => Compliance::none(),
        };
        let (points, reading) =
            read(path)?.read_off(&compliance, a.transition_n).with_context(|| path.display().to_string())?;
        let measured = Some((path.display().to_string(), reading));
        out.push(OtherCurve { name: "experiment".into(), points, measured });
    }
    for folder in &a.beside {
        let path = folder.join("result.json");
        let bytes = bounded(&path, "a result of a compression")?;
        let result: CompressResult = serde_json::from_slice(&bytes)
            .with_context(|| format!("{} is no result of a compression", path.display()))?;
        let name = result.settings.material.law().legend;
        let points: Vec<CurvePoint> = result.curve;
        out.push(OtherCurve { name: name.into(), points, measured: None });
    }
    Ok(out)
}

/// The bytes of a file that holds so much at most: a sparse one may claim any length, and a device has no end.
fn bounded(path: &Path, what: &str) -> Result<Vec<u8>> {
    let reason = || format!("cannot read {}; check the path", path.display());
    let file = File::open(path).with_context(reason)?;
    let length = file.metadata().with_context(reason)?.len();
    let mut bytes = Vec::new();
    if length <= MOST_BYTES {
        file.take(MOST_BYTES + 1).read_to_end(&mut bytes).with_context(reason)?;
    }
    if length > MOST_BYTES || bytes.len() as u64 > MOST_BYTES {
        let size = if length > MOST_BYTES { format!("has {length} bytes") } else { "does not end".into() };
        bail!(
            "{} {size}: {what} has at most {MOST_BYTES} (a million rows); check the path, or export fewer rows",
            path.display()
        );
    }
    Ok(bytes)
}

/// What a person reads.
fn told(r: &CompressResult, folder: &Path) -> String {
    let last = r.curve.last().copied().unwrap_or(CurvePoint { approach_mm: 0.0, force_n: 0.0 });
    let mut lines = vec![
        format!("grain      {}", r.settings.source),
        format!("mesh       {} tetrahedra, {} nodes", r.elements, r.nodes),
        format!(
            "run        {} steps of {:.3} ns in {:.1} s, {:.2} % of mass added",
            r.steps,
            1e9 * r.step_s,
            r.wall_s,
            100.0 * r.added_mass
        ),
        format!("curve      {:.4} N at {:.3} µm of approach", last.force_n, 1e3 * last.approach_mm),
    ];
    match &r.transition {
        Some(t) => lines.push(format!("δ_i        at {} N: {}", r.settings.transition_n, transition_line(t))),
        None => {
            lines
                .push(format!("δ_i        not known: the force does not pass {} N", r.settings.transition_n));
        }
    }
    if let Some(h) = &r.hertz {
        lines.push(format!(
            "Hertz      E* = {:.0} MPa at half the height, or R = {:.4} mm at the material's E*; residual {:.3} N",
            h.contact_modulus_mpa, h.radius_mm, h.residual_n
        ));
    }
    if let Some(ratio) = r.over_two_plate_form {
        lines.push(format!("form       {ratio:.4} of the two-plate form at the end"));
    }
    if r.settings.placed_deg.iter().any(|angle| *angle != 0.0) {
        let [x, y, z] = r.settings.placed_deg;
        lines.push(format!("placed     --rotate-deg {x:.4} {y:.4} {z:.4}"));
    }
    let e = &r.energy;
    lines.push(format!(
        "energy     plates' work {:.4e} N·mm, internal {:.4e}, kinetic {:.2e}; {}",
        e.external,
        e.internal,
        e.kinetic,
        e.balance_error.map_or_else(
            || "before the contacts have formed".to_owned(),
            |b| format!("unaccounted {b:.1e} of the work")
        )
    ));
    if let Some(q) = &r.quasi_static {
        lines.push(format!(
            "motion     at most {} of the internal energy, at {:.2} µm, since contacts had formed at {:.2} µm",
            q.share(),
            1e3 * q.at_mm,
            1e3 * q.formed_mm
        ));
    }
    lines.push(format!(
        "contacts   {} in all, {} at the end; the grain turned by {:.3}°",
        r.contacts.len(),
        r.contacts.iter().filter(|c| c.died_mm.is_none()).count(),
        r.rotation_deg
    ));
    if let Some(e) = &r.experiment {
        lines.extend(experiment_lines(e));
        lines.extend(e.reading.notes.iter().map(|n| format!("note       experiment: {n}")));
    }
    lines.push(format!("folder     {}", folder.display()));
    lines.push(format!("files      {}", r.files.join(", ")));
    lines.join("\n") + "\n"
}
