//! What is asked of a compression, and the folder that is claimed for it.

use super::body;
use super::laws::{self, Parameters};
use super::{
    CompressInput, CompressSettings, Compression, FootBy, JobError, MESH, Placing, RESULT, RUN, RockingBy,
    TEXT_LIMIT,
};
use crate::session::{Held, LOCK, hold, read_inside, write_whole};
use grainrig_core::contact::{ContactError, LAWS, Law, Loading, Material, Plates, SETTLED};
use grainrig_core::plausible::{self, Doubt};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use utoipa::openapi::{ObjectBuilder, RefOr, Schema, schema::Type};

const ASKED: &str = "asked.json";

/// How a grain answers: a law by its name.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CompressMaterial(pub &'static Law);

impl Default for CompressMaterial {
    fn default() -> Self {
        Self(LAWS[0])
    }
}

impl utoipa::PartialSchema for CompressMaterial {
    fn schema() -> RefOr<Schema> {
        let laws = LAWS.map(|law| format!("{}: {}.", law.name, law.what)).join(" ");
        ObjectBuilder::new()
            .schema_type(Type::String)
            .enum_values(Some(LAWS.map(|law| law.name)))
            .description(Some(format!("How a grain answers. {laws}")))
            .into()
    }
}

impl utoipa::ToSchema for CompressMaterial {}

/// A compression as it is asked for; what is left out has its usual value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields, default)]
#[schema(example = json!({ "material": "elastic", "to_force_n": 2.0 }))]
pub struct CompressRequest {
    /// How the grain answers; plastic yields at `yield_mpa`.
    #[arg(
        long,
        value_parser = laws::parser(),
        default_value = CompressMaterial::default().0.name,
        help = "How the grain answers; plastic yields at --yield-mpa"
    )]
    pub material: CompressMaterial,
    /// Young's modulus, MPa.
    #[arg(long, value_name = "MPA", default_value_t = Self::default().young_mpa, allow_negative_numbers = true)]
    pub young_mpa: f64,
    /// Poisson's ratio.
    #[arg(long, value_name = "NU", default_value_t = Self::default().poisson, allow_negative_numbers = true)]
    pub poisson: f64,
    /// Density, t/mm³.
    #[arg(long, value_name = "RHO", default_value_t = Self::default().density_t_mm3, allow_negative_numbers = true)]
    pub density_t_mm3: f64,
    /// Yield stress of a plastic grain, MPa.
    #[arg(long, value_name = "MPA", default_value_t = Self::default().yield_mpa, allow_negative_numbers = true)]
    pub yield_mpa: f64,
    /// Slope of the yield stress against the plastic strain, MPa.
    #[arg(long, value_name = "MPA", default_value_t = Self::default().hardening_mpa, allow_negative_numbers = true)]
    pub hardening_mpa: f64,
    /// Parameters of the material's own, by name; what is left out has its usual value.
    #[command(flatten)]
    pub parameters: Parameters,
    /// Coulomb's friction between plates and grain.
    #[arg(long, value_name = "MU", default_value_t = Self::default().friction, allow_negative_numbers = true)]
    pub friction: f64,
    /// Stop at this force, N; by default, where no approach is given, at 10 N or four times the transition's force,
    /// whichever is more. From four times on it counts as known that the force does not fall below it again, so a force
    /// between the two goes on to there; an approach stops wherever it is.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub to_force_n: Option<f64>,
    /// Stop at this approach of the plates, mm.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub to_approach_mm: Option<f64>,
    /// Largest circumradius of a surface facet, mm; by default a fourteenth of the diameter of a ball of
    /// the grain's volume.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub size_mm: Option<f64>,
    /// The same where the plates touch, mm; by default as fine as 120 000 tetrahedra allow, at most an 85th.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub size_at_contact_mm: Option<f64>,
    /// Turn the grain about x, then y, then z (degrees) instead of letting it come to rest on the lower plate.
    #[arg(long, value_name = "DEG", num_args = 3, allow_negative_numbers = true)]
    #[schema(min_items = 3, max_items = 3)]
    pub rotate_deg: Option<Vec<f64>>,
    /// Lay the grain in this one of its rests, 1 for the most likely (`grainrig rests` shows them), instead of the one
    /// that it comes to from how it was photographed.
    #[arg(long, value_name = "N", conflicts_with = "rotate_deg")]
    pub rest: Option<usize>,
    /// How the grain is followed while the plates turn it, before they hold it: as a rigid body between slow plates, or by the finite
    /// elements, where the plates' speed counts.
    #[arg(long, value_enum, value_name = "BY", default_value_t)]
    pub rocking: RockingBy,
    /// What becomes of the part of a session's grain that the pedestal hid: it is closed as the surface around it goes on, or stays
    /// the flat that it was cut to.
    #[arg(long, value_enum, value_name = "BY", default_value_t)]
    pub foot: FootBy,
    /// Multiple of the usual speed of the plates.
    #[arg(long, value_name = "FACTOR", default_value_t = Self::default().speed, allow_negative_numbers = true)]
    pub speed: f64,
    /// Mass that may be added to the smallest elements, over the grain's.
    #[arg(long, value_name = "SHARE", default_value_t = Self::default().mass_scaling, allow_negative_numbers = true)]
    pub mass_scaling: f64,
    /// A time step instead of nine tenths of the stable one, s.
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub time_step_s: Option<f64>,
    /// The force at which the transition to a Hertzian response is read, N.
    #[arg(long, value_name = "N", default_value_t = Self::default().transition_n, allow_negative_numbers = true)]
    pub transition_n: f64,
    /// The laboratory's own test: a Bluehill export, drawn and compared.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub experiment: Option<PathBuf>,
    /// Compliance of the testing machine, µm/N, taken off the measured displacement.
    #[arg(long, value_name = "UM_PER_N", conflicts_with = "plate_on_plate", allow_negative_numbers = true)]
    pub compliance_um_per_n: Option<f64>,
    /// A Bluehill export of plate on plate, which tells the machine's compliance.
    #[arg(long, value_name = "FILE")]
    #[schema(value_type = Option<String>)]
    pub plate_on_plate: Option<PathBuf>,
    /// Other compressions whose curves are drawn beside: their folders, the names of others of the same session, or SESSION/NAME.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    #[schema(value_type = Vec<String>)]
    pub beside: Vec<PathBuf>,
    /// Take figures as they are that look like slips of unit; the result says so.
    #[arg(skip)]
    pub as_given: bool,
}

impl Default for CompressRequest {
    /// Nadimi and Fonseca's (2017) grain, elastic, to 10 N; a plastic one yields at 100 MPa.
    fn default() -> Self {
        let (material, loading) = (Material::default(), Loading::default());
        Self {
            material: CompressMaterial::default(),
            young_mpa: material.young_mpa,
            poisson: material.poisson,
            density_t_mm3: material.density_t_mm3,
            yield_mpa: 100.0,
            hardening_mpa: material.hardening_mpa,
            parameters: Parameters::default(),
            friction: 0.2,
            to_force_n: None,
            to_approach_mm: None,
            size_mm: None,
            size_at_contact_mm: None,
            rotate_deg: None,
            rest: None,
            rocking: RockingBy::default(),
            foot: FootBy::default(),
            speed: 1.0,
            mass_scaling: loading.mass_scaling,
            time_step_s: None,
            transition_n: 2.0,
            experiment: None,
            compliance_um_per_n: None,
            plate_on_plate: None,
            beside: Vec::new(),
            as_given: false,
        }
    }
}

impl CompressRequest {
    /// The material, whether it can be computed or not.
    fn material(&self) -> Material {
        let all = Material {
            young_mpa: self.young_mpa,
            poisson: self.poisson,
            density_t_mm3: self.density_t_mm3,
            hardening_mpa: self.hardening_mpa,
            parameters: self.parameters.0.clone(),
            ..Material::default()
        };
        all.by(self.material.0, self.yield_mpa)
    }

    /// What of the figures no laboratory has, but for those that depend on the body.
    fn doubts(&self, material: &Material) -> Vec<Doubt> {
        let others = [
            plausible::FRICTION.doubt(self.friction),
            plausible::SPEED.doubt(self.speed),
            plausible::TRANSITION.doubt(self.transition_n),
            self.to_force_n.and_then(|f| plausible::FORCE.doubt(f)),
            self.to_approach_mm.and_then(|d| plausible::APPROACH.doubt(d)),
            self.time_step_s.and_then(|s| plausible::TIME_STEP.doubt(s)),
        ];
        material.doubts().into_iter().chain(others.into_iter().flatten()).collect()
    }

    /// What is computed, but for what the body says.
    ///
    /// # Errors
    /// [`ContactError::Setting`] for the first figure that makes no sense.
    pub fn settings(&self) -> Result<CompressSettings, ContactError> {
        let positive = |name, value: f64, unit, remedy| {
            let limit = "positive and finite";
            let fits = value.is_finite() && value > 0.0;
            if fits { Ok(()) } else { Err(ContactError::Setting { name, value, unit, limit, remedy }) }
        };
        let material = self.material();
        let doubts = self.doubts(&material);
        plausible::slips(&doubts, self.as_given)?;
        positive("speed", self.speed, "", "1 is usual")?;
        positive("transition_n", self.transition_n, "N", "2 N is usual")?;
        for (name, size) in [("size_mm", self.size_mm), ("size_at_contact_mm", self.size_at_contact_mm)] {
            size.map_or(Ok(()), |size| positive(name, size, "mm", "leave it out"))?;
        }
        if let Some(angles) = self.rotate_deg.as_ref().filter(|angles| angles.len() != 3) {
            let (name, value, unit, limit) =
                ("rotate_deg", angles.len() as f64, "angles", "3: about x, y and z");
            return Err(ContactError::Setting { name, value, unit, limit, remedy: "leave it out" });
        }
        if let Some(&value) = self.rotate_deg.iter().flatten().find(|x| !x.is_finite()) {
            let (name, unit, limit, remedy) = ("rotate_deg", "°", "finite", "leave it out");
            return Err(ContactError::Setting { name, value, unit, limit, remedy });
        }
        if self.rest.is_some() && self.rotate_deg.is_some() {
            let (name, value, unit) = ("rest", self.rest.map_or(f64::NAN, |r| r as f64), "");
            let (limit, remedy) = ("left out beside rotate_deg", "give one of both");
            return Err(ContactError::Setting { name, value, unit, limit, remedy });
        }
        let usual = Loading::default();
        // Past the transition's force, until it is known that the force does not fall below it again.
        let settled_n = SETTLED * self.transition_n;
        let past = |force_n: f64| (self.transition_n..settled_n).contains(&force_n);
        let to_force_n = match self.to_force_n {
            Some(asked_n) if past(asked_n) => Some(settled_n),
            Some(asked_n) => Some(asked_n),
            None if self.to_approach_mm.is_some() => None,
            None => usual.to_force_n.map(|usual_n| usual_n.max(settled_n)),
        };
        let loading = Loading {
            to_force_n,
            to_approach_mm: self.to_approach_mm,
            slowest: self.speed * usual.slowest,
            fastest: self.speed * usual.fastest,
            motion_share: (self.speed * self.speed * usual.motion_share).min(1.0),
            mass_scaling: self.mass_scaling,
            step_s: self.time_step_s,
            ..usual
        };
        loading.check()?;
        material.check()?;
        // Any body will do to look at the friction.
        Plates { lower_mm: 0.0, upper_mm: 1.0, friction: self.friction }.check(0.0, 1.0)?;
        let taken_as_given = plausible::settle(doubts, self.as_given)?;
        Ok(CompressSettings {
            source: String::new(),
            material,
            friction: self.friction,
            loading,
            middle_mm: 0.0,
            gap_mm: 0.0,
            sphere_radius_mm: None,
            placed_deg: [0.0; 3],
            rocking: None,
            foot: None,
            transition_n: self.transition_n,
            goes_on_from_n: self.to_force_n.filter(|&asked_n| past(asked_n)),
            as_given: self.as_given,
            taken_as_given,
        })
    }

    /// How the body is meshed and laid down.
    pub fn placing(&self) -> Placing {
        Placing {
            size_mm: self.size_mm,
            size_at_contact_mm: self.size_at_contact_mm,
            rotate_deg: self.rotate_deg.as_deref().and_then(|angles| angles.try_into().ok()),
            rest: self.rest,
            rocking: self.rocking,
            foot: self.foot,
        }
    }
}

/// What was asked, as `asked.json` keeps it: the same again goes on, something else begins elsewhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Asked {
    /// The body's name.
    pub input: String,
    /// Of the body, whatever its file was called.
    pub sha256: String,
    pub placing: Placing,
    pub settings: CompressSettings,
}

impl Asked {
    /// What is asked of a body; the figures that look like slips of unit are named in it.
    pub(super) fn new(
        input: &CompressInput,
        placing: &Placing,
        settings: &CompressSettings,
    ) -> Result<Self, JobError> {
        let mut settings = settings.clone();
        let doubts = body::doubts(input, placing, settings.loading.to_approach_mm);
        settings.taken_as_given.extend(plausible::settle(doubts, settings.as_given)?);
        Ok(Self { input: input.name(), sha256: input.sha256(), placing: *placing, settings })
    }
}

/// What was asked in a folder; `None` where nothing was, or nobody can read it.
pub(super) fn asked(folder: &Path) -> Option<Asked> {
    serde_json::from_slice(&read_inside(folder, ASKED, TEXT_LIMIT).ok()?).ok()
}

/// Whether the compression in a folder has come to its end.
pub(super) fn is_finished(folder: &Path) -> bool {
    #[derive(Deserialize)]
    struct Ended {
        finished: bool,
    }
    let text = read_inside(folder, RESULT, TEXT_LIMIT).ok();
    let ended: Option<Ended> = text.and_then(|text| serde_json::from_slice(&text).ok());
    ended.is_some_and(|ended| ended.finished)
}

/// A folder that is ours for one compression: what was asked is in it, durable, and nobody else computes there.
#[derive(Debug)]
pub struct Claim {
    pub(super) folder: PathBuf,
    pub(super) held: Held,
    pub(super) input: CompressInput,
    pub(super) placing: Placing,
    pub(super) settings: CompressSettings,
}

impl Claim {
    /// Claims a folder that is empty or does not exist, or in which the same was asked and has not come to its end.
    ///
    /// # Errors
    /// [`JobError::Doubt`] for a body or sizes that look like slips of unit, [`JobError::NotFree`] for a folder with something else in it, [`JobError::Session`] where another process computes
    /// there or the disk fails.
    pub fn new(
        folder: &Path,
        input: CompressInput,
        placing: &Placing,
        settings: &CompressSettings,
    ) -> Result<Self, JobError> {
        let wanted = Asked::new(&input, placing, settings)?;
        let goes_on = match asked(folder) {
            Some(before) => (before == wanted && !is_finished(folder)) || !folder.join(MESH).exists(),
            None => is_free(folder),
        };
        if !goes_on {
            let path = folder.to_owned();
            let unreadable = read_inside(folder, ASKED, TEXT_LIMIT)
                .ok()
                .and_then(|text| serde_json::from_slice::<Asked>(&text).err());
            return Err(match unreadable {
                Some(e) => JobError::Resume { path, reason: format!("{ASKED}: {e}") },
                None => JobError::NotFree { path },
            });
        }
        std::fs::create_dir_all(folder).map_err(|source| JobError::Write { path: folder.into(), source })?;
        let held = hold(folder)?;
        let text = serde_json::to_vec_pretty(&wanted).map_err(|e| JobError::Encode(e.to_string()))?;
        write_whole(folder, ASKED, &text)?;
        Ok(Self { folder: folder.into(), held, input, placing: *placing, settings: wanted.settings })
    }

    /// Meshes the body and lays it between the plates; where that was done before an interruption, takes up from the checkpoint.
    /// `told` hears what is being done, at once, and how much of that is done, 0 to 1.
    ///
    /// # Errors
    /// [`JobError`]: a body or plates that cannot be computed, a damaged checkpoint, a disk that fails.
    pub fn build(self, told: &mut dyn FnMut(&str, f64)) -> Result<Compression, JobError> {
        if self.folder.join(RUN).exists() {
            return Compression::open(&self.folder, self.held);
        }
        Compression::meshed(self, told)
    }
}

/// Whether nothing is in a folder but what a claim that was broken off leaves.
fn is_free(folder: &Path) -> bool {
    match std::fs::read_dir(folder) {
        Ok(mut entries) => entries.all(|e| {
            e.is_ok_and(|e| {
                let name = e.file_name();
                name == LOCK || name.to_string_lossy().starts_with(&format!(".{ASKED}."))
            })
        }),
        Err(e) => e.kind() == std::io::ErrorKind::NotFound,
    }
}
