//! A grain pressed in many ways: `δ_i` as an interval, and what it comes from.
//!
//! ```text
//!  surfaces × ways to lie × tilts × frictions × moduli ─▶ rigid stage, guess of what sinks in ─▶ for all
//!  a few of them, spread over the guesses              ─▶ finite elements, a core each        ─▶ ratio, errors when left out
//!  all                                                 ─▶ rocking + guess × ratio × an error  ─▶ median, twentieths, band
//! ```
//!
//! The folder holds `asked.json`, and a `case-….json` for each case that has been computed: the same command again goes on with those
//! that are missing.

mod cases;
mod figures;
mod interval;
mod variants;

pub use figures::{EnsembleFigures, EnsembleResult, lines as ensemble_lines};
pub use interval::Interval;
pub(super) use variants::{Unknown, Variants};

use super::compressing::{
    CompressInput, CompressOptions, CompressRequest, CompressSettings, Placing, doubts, others,
};
use super::{Context, FootBy, JobError, RockingBy};
use crate::session::{LOCK, Recording, hold, read_inside, sha256_hex, to_json, write_whole};
use cases::{Case, Common};
use figures::{Drawing, Figures};
use grainrig_core::contact::{
    ContactError, Drawn, Foot, Lying, Material, Rests, SETTLED, Spread, Surrogate, ensemble, indentation_mm,
};
use grainrig_core::geometry::{ConvexHull, TriangleMesh, Vector};
use grainrig_core::plausible;
use nalgebra::Rotation3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

const ASKED: &str = "asked.json";
/// Longest `asked.json` that is read back, bytes.
const LIMIT: u64 = 1 << 20;
/// Draws that make sense: fewer have no fifth per cent, more take hours.
const DRAWS: RangeInclusive<usize> = 20..=100_000;
/// Draws where nobody says.
const USUAL_DRAWS: usize = 1000;
/// Cases that make sense: fewer tell nothing of their errors.
const CASES: RangeInclusive<usize> = 6..=1000;
/// Cases where nobody says.
const USUAL_CASES: usize = 24;
/// Draws with one thing alone uncertain.
const ALONE: usize = 400;
/// Standard deviation of the tilt of a grain that is laid by hand, degrees.
const PLACING_DEG: f64 = 2.0;
/// That of an outline's place, pixels: chosen, not measured.
const OUTLINE_PX: f64 = 0.2;
/// The share of a hull that is hollow where its volume is not estimated: chosen, not measured.
const HOLLOWS: f64 = 0.05;
/// Forces of the band of curves, over the transition's.
const FORCES: [f64; 12] = [0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];
/// The transition's own among them.
const AT: usize = 7;

/// What is not known of how a grain is pressed, and how often it is drawn.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields, default)]
pub struct EnsembleSpread {
    /// Press the grain in so many ways, for an interval instead of one number; 1000 are usual.
    #[arg(
        long = "ensemble",
        value_name = "N",
        help = "Press the grain in N ways, for an interval instead of one number: the rigid stage in all, finite elements in --cases of \
                them; in all rests by their chances unless --rest or --rotate-deg says which, laid askew by --placing-deg, at any \
                friction up to --friction, on surfaces that the outlines and the hidden foot leave open"
    )]
    pub draws: Option<usize>,
    /// How many of them are computed by finite elements; 24 unless given.
    #[arg(long, value_name = "N", requires = "draws")]
    pub cases: Option<usize>,
    /// Standard deviation of the tilt about either level axis with which the grain is laid between the plates, degrees; 2 unless given.
    #[arg(long, value_name = "DEG", requires = "draws", allow_negative_numbers = true)]
    pub placing_deg: Option<f64>,
    /// The least and the greatest Young's modulus that the grain may have, MPa; the one given unless these are.
    #[arg(long, value_name = "MPA", num_args = 2, requires = "draws", allow_negative_numbers = true)]
    #[schema(min_items = 2, max_items = 2)]
    pub young_span_mpa: Option<Vec<f64>>,
    /// Standard deviation of the surface, µm; a fifth of a pixel of a session, none of a file, unless given.
    #[arg(long, value_name = "UM", requires = "draws", allow_negative_numbers = true)]
    pub outline_um: Option<f64>,
}

impl EnsembleSpread {
    /// As the core draws.
    fn spread(&self, settings: &CompressSettings) -> Result<Spread, ContactError> {
        let friction = settings.friction;
        let given = settings.material.young_mpa;
        let young_mpa = match self.young_span_mpa.as_deref() {
            Some([low, high]) if *low > 0.0 && low <= high && high.is_finite() => [*low, *high],
            Some(span) => {
                let (name, unit, limit) = ("young_span_mpa", "MPa", "two positive moduli, the lesser first");
                let value = span.first().copied().unwrap_or(f64::NAN);
                let remedy = "90000 110000 are usual about 100000";
                return Err(ContactError::Setting { name, value, unit, limit, remedy });
            }
            None => [given, given],
        };
        Ok(Spread { placing: placing_rad(self.placing_deg)?, friction: [0.0, friction], young_mpa })
    }

    /// What looks like slips of unit in the figures that were taken as given, the moduli's ends included.
    fn taken_as_given(&self, settings: &CompressSettings, as_given: bool) -> Result<Vec<String>, JobError> {
        let mut taken = settings.taken_as_given.clone();
        if self.young_span_mpa.is_some() {
            for young_mpa in self.spread(settings)?.young_mpa {
                let material = Material { young_mpa, ..settings.material.clone() };
                material.check()?;
                taken.extend(plausible::settle(material.doubts(), as_given)?);
            }
        }
        self.spread(settings)?;
        Ok(taken)
    }

    fn draws(&self) -> Result<usize, ContactError> {
        draws(self.draws.unwrap_or(USUAL_DRAWS))
    }

    fn cases(&self) -> Result<usize, ContactError> {
        let cases = self.cases.unwrap_or(USUAL_CASES);
        if CASES.contains(&cases) {
            return Ok(cases);
        }
        let (name, value, unit, limit) = ("cases", cases as f64, "cases", "from 6 to 1000");
        Err(ContactError::Setting { name, value, unit, limit, remedy: "24 are usual" })
    }

    fn unknown(&self, recording: Option<&Recording>) -> Result<Unknown, ContactError> {
        let usual = unknown(recording);
        let value = self.outline_um.unwrap_or(1e3 * usual.outline_mm);
        if (0.0..=100.0).contains(&value) {
            return Ok(Unknown { outline_mm: 1e-3 * value, ..usual });
        }
        let (name, unit, limit, remedy) =
            ("outline_um", "µm", "from 0 to 100", "a fifth of a pixel is usual");
        Err(ContactError::Setting { name, value, unit, limit, remedy })
    }
}

/// What is not known of a session's hull; nothing of a file.
pub(super) fn unknown(recording: Option<&Recording>) -> Unknown {
    let Some(result) = recording.and_then(Recording::result) else { return Unknown::default() };
    let figure = |pointer: &str| result.pointer(pointer).and_then(Value::as_f64);
    let outline_mm = figure("/scale_mm_per_px").map_or(0.0, |mm| OUTLINE_PX * mm);
    let volumes = figure("/hull/volume_estimate_mm3").zip(figure("/hull/volume_mm3"));
    let hollows = volumes.map_or(HOLLOWS, |(grain, hull)| (1.0 - grain / hull).clamp(0.0, 1.0));
    Unknown { outline_mm, hollows }
}

/// So many draws, where that makes sense.
pub(super) fn draws(value: usize) -> Result<usize, ContactError> {
    if DRAWS.contains(&value) {
        return Ok(value);
    }
    let (name, value, unit, limit) = ("ensemble", value as f64, "draws", "from 20 to 100000");
    Err(ContactError::Setting { name, value, unit, limit, remedy: "1000 are usual" })
}

/// The standard deviation of the tilt, rad.
pub(super) fn placing_rad(deg: Option<f64>) -> Result<f64, ContactError> {
    let value = deg.unwrap_or(PLACING_DEG);
    if (0.0..=45.0).contains(&value) {
        return Ok(value.to_radians());
    }
    let (name, unit, limit, remedy) = ("placing_deg", "°", "from 0 to 45", "2 are usual");
    Err(ContactError::Setting { name, value, unit, limit, remedy })
}

/// A grain to be pressed in many ways.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EnsembleOptions {
    /// The grain, and how it is pressed; its friction is the greatest.
    pub grain: CompressOptions,
    /// What is not known.
    #[serde(default)]
    pub spread: EnsembleSpread,
}

/// What was asked, as `asked.json` keeps it.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
struct Asked {
    /// Of the surface.
    sha256: String,
    placing: Placing,
    settings: CompressSettings,
    spread: EnsembleSpread,
}

impl EnsembleOptions {
    /// Whether it makes sense, as far as that can be told before the body is read.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        let no = |why: &str| Err(JobError::Usage(why.to_owned()));
        let g = &self.grain;
        if g.resume.is_some() {
            return no("an ensemble goes on with the same command again, without --resume");
        }
        if g.sphere_diameter_mm.is_some() {
            return no("a sphere lies anyhow; an ensemble is of a session or of a surface");
        }
        if g.request.to_approach_mm.is_some() {
            return no(
                "an ensemble ends at a force (--to-force-n): at one approach each case is somewhere else",
            );
        }
        if g.request.rocking == RockingBy::Elements {
            return no(
                "an ensemble follows the plates' turning of the grain as a rigid body: leave --rocking out",
            );
        }
        g.check(context)?;
        let request = self.request(context);
        let settings = request.settings()?;
        self.spread.taken_as_given(&settings, request.as_given)?;
        self.spread.draws()?;
        self.spread.cases()?;
        self.spread.unknown(None)?;
        context.names.output(&self.folder()).map(drop)
    }

    /// Draws, computes and writes.
    ///
    /// # Errors
    /// [`JobError`]: a body without rests, figures that make no sense, a folder with something else in it, fewer than three cases that
    /// could be computed, a disk that fails.
    pub fn run(&self, context: &Context) -> Result<EnsembleResult, JobError> {
        self.check(context)?;
        let request = self.request(context);
        let mut settings = request.settings()?;
        let placing = request.placing();
        context.working("reading the body", 0.0);
        let recording = self.grain.recording(context)?;
        let beside = others(&request, &context.names, recording.as_ref())?;
        let mut warnings = Vec::new();
        let input = self.grain.input_body(context, &mut |what, _| {
            warnings.extend((what != "reading the body").then(|| what.to_owned()));
        })?;
        warnings.extend(plausible::settle(doubts(&input, &placing, None), request.as_given)?);
        let CompressInput::Surface { surface, name, hidden_mm } = input else {
            let why = "an ensemble is of a session or of a closed surface: a mesh of tetrahedra is one surface alone";
            return Err(JobError::Usage(why.into()));
        };
        settings.source.clone_from(&name);
        let unknown = self.spread.unknown(recording.as_ref())?;
        let spread = self.spread.spread(&settings)?;
        warnings.extend(self.spread.taken_as_given(&settings, request.as_given)?);
        context.working("rests", 0.0);
        let foot = hidden_mm.and_then(|mm| Foot::of(&surface, mm)).filter(|_| placing.foot == FootBy::Closed);
        let grain = Variants::new(&surface, foot.as_ref(), &unknown, None)?;
        let (lyings, nominal) = lyings(&grain, &placing)?;
        let given = self.folder();
        let folder = context.names.output(&given)?;
        std::fs::create_dir_all(&folder)
            .map_err(|source| JobError::Write { path: folder.clone(), source })?;
        let _held = hold(&folder)?;
        let asked = Asked {
            sha256: sha256_hex(&to_json(&(&surface.vertices, &surface.triangles))?),
            placing,
            settings: settings.clone(),
            spread: self.spread.clone(),
        };
        claim(&folder, &asked)?;
        let model = Model {
            grain: &grain,
            settings: &settings,
            hulls: grain.rests.iter().map(Rests::hull).collect(),
        };
        context.working("rigid stages", 0.0);
        let all = model.drawn(grain.surfaces.len(), &lyings, &spread, self.spread.draws()?);
        let sure = Spread {
            placing: 0.0,
            friction: [settings.friction; 2],
            young_mpa: [settings.material.young_mpa; 2],
        };
        let as_placed = model.drawn(1, std::slice::from_ref(&nominal), &sure, 1);
        let chosen = chosen(&all, self.spread.cases()? - 1);
        let asked_cases: Vec<Case> = (as_placed.iter())
            .chain(chosen.iter().map(|&k| &all[k]))
            .map(|g| Case::new(&g.drawn, g.sunk_mm[AT]))
            .collect();
        let common =
            Common { surfaces: &grain.surfaces, placing: &placing, settings: &settings, folder: &folder };
        let drawing = Drawing {
            source: name,
            draws: all.len(),
            cases: asked_cases.len(),
            placing_deg: spread.placing.to_degrees(),
            friction: spread.friction,
            young_mpa: spread.young_mpa,
            outline_um: 1e3 * unknown.outline_mm,
            hollow_share: unknown.hollows,
            foot_depths_mm: grain.foot_depths_mm.clone(),
            ways_to_lie: lyings.len(),
            transition_n: settings.transition_n,
        };
        let Some(cases) = common.computed(asked_cases, context)? else {
            return Ok(EnsembleResult {
                finished: false,
                drawing,
                figures: None,
                files: Vec::new(),
                warnings,
            });
        };
        context.working("intervals", 0.0);
        let (transition, surrogates) = surrogates(&cases, &as_placed, &chosen, &all, settings.transition_n)?;
        let one =
            |surfaces: usize, lyings: &[Lying], spread: &Spread| model.drawn(surfaces, lyings, spread, ALONE);
        let mut alone = Vec::new();
        let just = std::slice::from_ref(&nominal);
        if lyings.len() > 1 {
            alone.push(("rest", one(1, &lyings, &sure)));
        }
        if spread.placing > 0.0 {
            alone.push(("placing", one(1, just, &Spread { placing: spread.placing, ..sure })));
        }
        if settings.friction > 0.0 {
            alone.push(("friction", one(1, just, &Spread { friction: spread.friction, ..sure })));
        }
        if grain.surfaces.len() > 1 {
            alone.push(("surface", one(grain.surfaces.len(), just, &sure)));
        }
        if spread.young_mpa[0] < spread.young_mpa[1] {
            alone.push(("young", one(1, just, &Spread { young_mpa: spread.young_mpa, ..sure })));
        }
        let figures = Figures {
            drawing,
            all,
            chosen,
            as_placed: &as_placed[0],
            cases,
            transition,
            surrogates,
            alone,
            beside,
            warnings,
        };
        figures.written(&folder, &given)
    }

    fn request(&self, context: &Context) -> CompressRequest {
        let mut request = self.grain.request(context);
        // Whether the force falls again is known from here on; what comes later is not looked at.
        request.to_force_n = request.to_force_n.or(Some(SETTLED * request.transition_n));
        request
    }

    fn folder(&self) -> PathBuf {
        self.grain.out.clone().unwrap_or_else(|| {
            let subject = self.grain.subject();
            let stem = if self.grain.is_file() { subject.file_stem() } else { subject.file_name() };
            format!("{}-ensemble", stem.unwrap_or_default().to_string_lossy()).into()
        })
    }
}

/// A case with what its shape says.
pub(super) struct Guessed {
    pub drawn: Drawn,
    /// How far the plates sink in at each of the [`FORCES`], mm.
    pub sunk_mm: Vec<f64>,
}

struct Model<'a> {
    grain: &'a Variants,
    settings: &'a CompressSettings,
    hulls: Vec<&'a ConvexHull>,
}

impl Model<'_> {
    /// So many draws, of the first so many surfaces.
    fn drawn(&self, surfaces: usize, lyings: &[Lying], spread: &Spread, count: usize) -> Vec<Guessed> {
        let forces_n = FORCES.map(|share| share * self.settings.transition_n);
        let guess = |drawn: Drawn| {
            let mut material = self.settings.material.clone();
            material.young_mpa = drawn.young_mpa;
            let surface: &TriangleMesh = &self.grain.surfaces[drawn.surface];
            let sunk_mm = indentation_mm(surface, &drawn.held, material.contact_modulus_mpa(), &forces_n);
            Guessed { drawn, sunk_mm }
        };
        ensemble(&self.hulls[..surfaces], lyings, spread, count).into_par_iter().map(guess).collect()
    }
}

/// The ways in which the grain may lie, and the one in which a compression alone would lay it.
fn lyings(grain: &Variants, placing: &Placing) -> Result<(Vec<Lying>, Lying), JobError> {
    if let Some([x, y, z]) = placing.rotate_deg.map(|deg| deg.map(f64::to_radians)) {
        let turns = vec![Rotation3::from_euler_angles(x, y, z); grain.surfaces.len()];
        let given = Lying { chance: 1.0, turns };
        return Ok((vec![given.clone()], given));
    }
    let rests = &grain.rests[0];
    let lying = |k: usize| {
        let rest = &rests.rests[k];
        // Each surface comes to a rest of its own.
        let turns = grain.rests.iter().map(|r| r.rests[r.reached_from(&rest.down)].turn);
        Lying { chance: rest.chance, turns: turns.collect() }
    };
    let count = rests.rests.len();
    match placing.rest {
        Some(asked) => {
            let k = asked.checked_sub(1).filter(|k| *k < count);
            let given = lying(k.ok_or(ContactError::NoRest { asked, count })?);
            Ok((vec![given.clone()], given))
        }
        None => Ok(((0..count).map(lying).collect(), lying(rests.reached_from(&-Vector::z())))),
    }
}

/// So many of the draws, evenly over what their shapes say: the middle one of each of as many parts.
fn chosen(all: &[Guessed], count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by(|a, b| all[*a].sunk_mm[AT].total_cmp(&all[*b].sunk_mm[AT]));
    let count = count.min(order.len());
    (0..count).map(|k| order[(2 * k + 1) * order.len() / (2 * count)]).collect()
}

/// What the computed cases say of the guesses at the transition's force, and at each of the [`FORCES`]; none at one that too few of them
/// tell of.
///
/// # Errors
/// [`JobError::Content`] where too few tell of the transition's.
fn surrogates(
    cases: &[Case],
    as_placed: &[Guessed],
    chosen: &[usize],
    all: &[Guessed],
    transition_n: f64,
) -> Result<(Surrogate, Vec<Option<Surrogate>>), JobError> {
    let guessed: Vec<&Guessed> = as_placed.iter().chain(chosen.iter().map(|&k| &all[k])).collect();
    let at = |k: usize| {
        let force_n = FORCES[k] * transition_n;
        let pairs = cases.iter().zip(&guessed).filter(|(case, _)| case.failed.is_none());
        let pairs = pairs.filter_map(|(case, guess)| Some([guess.sunk_mm[k], case.sunk_mm(force_n)?]));
        Surrogate::of(&pairs.collect::<Vec<_>>())
    };
    let failed: Vec<&str> = cases.iter().filter_map(|c| c.failed.as_deref()).collect();
    let transition = at(AT).ok_or_else(|| {
        JobError::Content(format!(
            "{} of {} cases could not be computed, too many for the others to stand for them; the first: {}",
            failed.len(),
            cases.len(),
            failed.first().copied().unwrap_or("it does not sink in")
        ))
    })?;
    Ok((transition, (0..FORCES.len()).map(at).collect()))
}

/// Makes sure that a folder is free, or holds what the same command left.
fn claim(folder: &Path, asked: &Asked) -> Result<(), JobError> {
    let not_free = || JobError::NotFree { path: folder.to_owned() };
    match read_inside(folder, ASKED, LIMIT) {
        Ok(text) => {
            let before: Option<Asked> = serde_json::from_slice(&text).ok();
            if before.is_some_and(|before| before == *asked) {
                return Ok(());
            }
            if !holds_only(folder, &[ASKED, LOCK]) {
                return Err(not_free());
            }
        }
        Err(_) if holds_only(folder, &[LOCK]) => {}
        Err(_) => return Err(not_free()),
    }
    write_whole(folder, ASKED, &to_json(asked)?)?;
    Ok(())
}

/// Whether nothing is in a folder but files of these names.
fn holds_only(folder: &Path, names: &[&str]) -> bool {
    let is_one = |entry: std::io::Result<std::fs::DirEntry>| {
        entry.is_ok_and(|e| names.iter().any(|name| e.file_name() == *name))
    };
    std::fs::read_dir(folder).is_ok_and(|mut all| all.all(is_one))
}
