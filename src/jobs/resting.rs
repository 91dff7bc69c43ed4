//! How a grain can come to lie, and how closing plates turn it.

use super::compressing::{
    CompressInput, CompressOptions, CompressRequest, FootBy, Placing, doubts, hull_of, on_foot,
    surface_center,
};
use super::ensemble::{Interval, Variants, draws, placing_rad, unknown};
use super::mesh_files::Unit;
use super::{Context, JobError};
use crate::session::write_whole;
use grainrig_core::contact::{
    ContactError, Foot, Lying, Plates, Rest, Rests, Rocking, Spread, ensemble, rocking,
};
use grainrig_core::geometry::{Point, TriangleMesh, Vector};
use grainrig_core::plausible::{self, FRICTION};
use grainrig_core::report::{Pose, Poses};
use serde::{Deserialize, Serialize};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Rests beyond which it is likely that a surface rests on its facets.
const FACETS: usize = 40;
/// Rests that are drawn.
const DRAWN: usize = 24;

/// The rests of a grain.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, utoipa::ToSchema, clap::Args)]
#[serde(deny_unknown_fields)]
pub struct RestsOptions {
    /// A session, a mesh of tetrahedra or a closed surface.
    #[schema(value_type = String)]
    pub input: PathBuf,
    /// Unit of the file's numbers.
    #[arg(long, value_enum, default_value_t = Unit::Mm)]
    #[serde(default)]
    pub unit: Unit,
    /// Coulomb's friction between plates and grain; 0.2 unless given.
    #[arg(long, value_name = "MU", allow_negative_numbers = true)]
    pub friction: Option<f64>,
    /// The least lift of the grain's centre that makes a rest one of its own, mm; a hundred thousandth of the grain's radius unless
    /// given. Rests less than 3° apart that take ten times that at most are one in any case: a round surface's facets.
    #[arg(long, value_name = "MM", allow_negative_numbers = true)]
    pub least_lift_mm: Option<f64>,
    /// What becomes of the part of a session's grain that the pedestal hid: it is closed as the surface around it goes on, or stays
    /// the flat that it was cut to.
    #[arg(long, value_enum, value_name = "BY", default_value_t)]
    #[serde(default)]
    pub foot: FootBy,
    /// Follow how the plates turn the grain from this many poses about each rest too: tilted at random (`placing_deg`), at any friction up
    /// to the one given, on surfaces that the outlines and the hidden foot leave open.
    #[arg(
        long,
        value_name = "N",
        help = "Follow how the plates turn the grain from N poses about each rest too: tilted at random (--placing-deg), at any friction \
                up to the one given, on surfaces that the outlines and the hidden foot leave open"
    )]
    pub ensemble: Option<usize>,
    /// Standard deviation of the tilt about either level axis with which a grain is laid between the plates, degrees; 2 unless given.
    #[arg(long, value_name = "DEG", requires = "ensemble", allow_negative_numbers = true)]
    pub placing_deg: Option<f64>,
    /// Folder for rests.csv and rests.png; NAME-rests unless given.
    #[arg(long, value_name = "DIR")]
    #[schema(value_type = Option<String>)]
    pub out: Option<PathBuf>,
    /// Take figures as they are that look like slips of unit.
    #[arg(skip)]
    #[serde(default)]
    pub as_given: bool,
}

/// What there is to know of the rests of a grain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RestsResult {
    /// The body.
    pub source: String,
    /// Coulomb's friction between plates and grain.
    pub friction: f64,
    /// The least lift of the centre that made a rest one of its own, mm.
    pub least_lift_mm: f64,
    /// The rest that the grain comes to from how it lies in its file, or was photographed; 1 is the most likely.
    pub as_photographed: usize,
    /// All rests, the most likely first.
    pub rests: Vec<RestLine>,
    /// How far the plates turn the grain where it is laid askew, over all rests by their chances; none unless asked for.
    pub ensemble: Option<AskewResult>,
    /// How deep the part that the pedestal hid was closed, mm; none where nothing was hidden, or it was left flat.
    pub foot_depth_mm: Option<f64>,
    /// What was written, as it was named.
    pub files: Vec<String>,
    /// What a person should know.
    pub warnings: Vec<String>,
}

/// What is drawn where a grain is laid askew, and what comes of it over all rests.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AskewResult {
    /// Poses about each rest.
    pub draws: usize,
    /// Standard deviation of the tilt about either level axis, degrees.
    pub placing_deg: f64,
    /// The least and the greatest friction.
    pub friction: [f64; 2],
    /// The depths to which the part that the pedestal hid was closed, mm, one as likely as the other; empty where it was not closed.
    pub foot_depths_mm: Vec<f64>,
    /// How far the plates come while they turn the grain, each rest by its chance.
    #[serde(flatten)]
    pub askew: Askew,
}

/// How far plates come while they turn a grain that is laid askew.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Askew {
    /// How far they come.
    pub rocking_mm: Interval,
    /// The part of the draws in which they turn it at all, 0 to 1.
    pub rocks_share: f64,
}

impl Askew {
    /// Of approaches (mm) with their weights.
    fn of(all: Vec<(f64, f64)>) -> Self {
        let whole: f64 = all.iter().map(|(_, weight)| weight).sum();
        let rocking: f64 = all.iter().filter(|(mm, _)| *mm > 0.0).map(|(_, weight)| weight).sum();
        let rocks_share = if whole > 0.0 { rocking / whole } else { 0.0 };
        Self { rocking_mm: Interval::of(all), rocks_share }
    }
}

/// A rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RestLine {
    /// Its number, as `compress --rest` takes it.
    pub rest: usize,
    /// The chance that the grain comes to lie so when it is let down at random, 0 to 1.
    pub chance: f64,
    /// The grain's height as it lies, mm: the plates' distance where both first touch it.
    pub height_mm: f64,
    /// The height of its centre of mass over the plate, mm.
    pub center_mm: f64,
    /// The lift of the centre that it takes to leave the rest for a lower one, mm; none for the lowest.
    pub lift_mm: Option<f64>,
    /// What it stands on: corners of its convex hull as it lies, x, y and z from the centre of mass, mm.
    pub feet_mm: Vec<[f64; 3]>,
    /// The angle between the plates' normal and the shortest line from the feet to the upper contacts, degrees.
    pub gap_deg: f64,
    /// Whether closing plates turn it.
    pub rocks: bool,
    /// How far they come meanwhile, mm.
    pub rocking_mm: f64,
    /// How far they turn it, degrees.
    pub rocking_deg: f64,
    /// Whether friction holds it in the end; if not, its upper contacts stand above the lower ones.
    pub held_by_friction: bool,
    /// Where the plates touch the grain where the pedestal hid it, as it lies or as they hold it: there its surface is not known.
    pub on_foot: bool,
    /// How far the plates come where the grain is laid askew; none unless asked for.
    pub askew: Option<Askew>,
    /// What `compress --rotate-deg` takes to lay it so, degrees.
    pub rotate_deg: [f64; 3],
}

impl RestLine {
    fn new(number: usize, rest: &Rest, rocked: &Rocking, on_foot: bool) -> Self {
        let (x, y, z) = rest.turn.euler_angles();
        let [gap, _] = rocked.slopes;
        Self {
            rest: number,
            chance: rest.chance,
            height_mm: rocked.from_mm,
            center_mm: rest.center_mm,
            lift_mm: Some(rest.lift_mm).filter(|mm| mm.is_finite()),
            feet_mm: rocked.first.lower.iter().map(|p| p.coords.into()).collect(),
            gap_deg: gap.atan().to_degrees(),
            rocks: rocked.approach_mm() > 0.0,
            rocking_mm: rocked.approach_mm(),
            rocking_deg: rocked.angle().to_degrees(),
            held_by_friction: rocked.held_by_friction,
            on_foot,
            askew: None,
            rotate_deg: [x, y, z].map(f64::to_degrees),
        }
    }
}

impl RestsOptions {
    /// Whether it makes sense, as far as that can be told before the body is read.
    ///
    /// # Errors
    /// [`JobError`].
    pub fn check(&self, context: &Context) -> Result<(), JobError> {
        let friction = self.friction()?;
        self.check_lift()?;
        self.spread(friction)?;
        plausible::settle(FRICTION.doubt(friction).into_iter().collect(), self.as_given || context.as_given)?;
        self.read().check(context)?;
        context.names.output(&self.folder()).map(drop)
    }

    /// Finds the rests, and writes the table and the picture.
    ///
    /// # Errors
    /// [`JobError`]: no such body, one without a volume, a friction that makes no sense, a disk that fails.
    pub fn run(&self, context: &Context) -> Result<RestsResult, JobError> {
        let friction = self.friction()?;
        self.check_lift()?;
        let spread = self.spread(friction)?;
        let options = self.read();
        let mut warnings = Vec::new();
        let input = options.input_body(context, &mut |what, _| {
            warnings.extend(what.contains(':').then(|| what.to_owned()));
        })?;
        let found = doubts(&input, &Placing::default(), None).into_iter().chain(FRICTION.doubt(friction));
        warnings.extend(plausible::settle(found.collect(), self.as_given || context.as_given)?);
        let source = input.name();
        let (carved, foot) = surface(input)?;
        let surface = self.closed(&carved, foot.as_ref());
        let center = surface_center(&surface);
        let rests = Rests::new(hull_of(&surface.vertices)?, &center, self.least_lift_mm);
        let foot_depth_mm = foot.as_ref().and_then(|f| f.depth_mm).filter(|_| self.foot == FootBy::Closed);
        let may_be = match &spread {
            Some(_) => {
                let foot = foot.as_ref().filter(|_| self.foot == FootBy::Closed);
                let unknown = unknown(options.recording(context)?.as_ref());
                Some(Variants::new(&carved, foot, &unknown, self.least_lift_mm)?)
            }
            None => None,
        };
        let mut all_askew = Vec::new();
        let mut draws_csv = String::from("rest,draw,surface,tilt_deg,friction,turned_deg,rocking_mm\n");
        let mut lines = Vec::new();
        let mut poses = Vec::new();
        let as_photographed = rests.reached_from(&-Vector::z()) + 1;
        for (k, rest) in rests.rests.iter().enumerate() {
            context.working("rests", k as f64 / rests.rests.len() as f64);
            let rocked = rocking(rests.hull(), &rest.turn, friction);
            let touches_foot = foot.as_ref().is_some_and(|foot| {
                let touched = [(&rocked.first, rest.turn), (&rocked.held, rocked.turned * rest.turn)];
                touched
                    .iter()
                    .any(|(at, pose)| on_foot(foot, at, pose, &center).iter().any(|share| *share > 0.0))
            });
            let mut line = RestLine::new(k + 1, rest, &rocked, touches_foot);
            if let (Some((spread, draws)), Some(may_be)) = (&spread, &may_be) {
                let turns = may_be.rests.iter().map(|r| r.rests[r.reached_from(&rest.down)].turn);
                let lying = Lying { chance: 1.0, turns: turns.collect() };
                let hulls: Vec<_> = may_be.rests.iter().map(Rests::hull).collect();
                let drawn = ensemble(&hulls, &[lying], spread, *draws);
                for (draw, d) in drawn.iter().enumerate() {
                    let [tilt, turned] = [d.tilt, d.turned].map(f64::to_degrees);
                    let _ = writeln!(
                        draws_csv,
                        "{},{},{},{tilt:.4},{:.4},{turned:.4},{:.6}",
                        k + 1,
                        draw + 1,
                        d.surface + 1,
                        d.friction,
                        d.approach_mm
                    );
                }
                let askew: Vec<(f64, f64)> =
                    drawn.iter().map(|d| (d.approach_mm, rest.chance / *draws as f64)).collect();
                all_askew.extend_from_slice(&askew);
                line.askew = Some(Askew::of(askew));
            }
            if poses.len() < DRAWN {
                poses.push(pose(&surface, &center, rest, &rocked, captions(&line, as_photographed)));
            }
            lines.push(line);
        }
        if self.least_lift_mm.is_some() {
            warnings.push(
                "with a least lift of your own the rests' numbers are not those of `compress --rest`: give it rotate_deg".into(),
            );
        }
        warnings.extend(foot.as_ref().and_then(|f| foot_warning(f, foot_depth_mm, &lines)));
        if lines.len() > FACETS {
            warnings.push(format!(
                "{} rests are many: where the surface's facets are coarse the grain rests on each of them; a finer surface, or \
                 --least-lift-mm above the {:.2e} mm used, counts those together",
                lines.len(),
                rests.least_lift_mm
            ));
        }
        if lines.len() > DRAWN {
            warnings.push(format!("rests.png shows the {DRAWN} most likely of {} rests", lines.len()));
        }
        let folder = self.folder();
        let place = context.names.output(&folder)?;
        std::fs::create_dir_all(&place).map_err(|source| JobError::Write { path: place.clone(), source })?;
        let title = format!("Rests of {source}, between plates of friction {friction}");
        let png = Poses { title, poses }.png().map_err(|e| JobError::Encode(e.to_string()))?;
        let mut files = Vec::new();
        let mut written = vec![("rests.csv", table(&lines).into_bytes()), ("rests.png", png)];
        if spread.is_some() {
            written.push(("draws.csv", draws_csv.into_bytes()));
        }
        for (name, bytes) in written {
            write_whole(&place, name, &bytes)?;
            files.push(folder.join(name).display().to_string());
        }
        let least_lift_mm = rests.least_lift_mm;
        let ensemble = spread.map(|(spread, draws)| AskewResult {
            draws,
            placing_deg: spread.placing.to_degrees(),
            friction: spread.friction,
            foot_depths_mm: may_be.map_or_else(Vec::new, |v| v.foot_depths_mm),
            askew: Askew::of(all_askew),
        });
        Ok(RestsResult {
            source,
            friction,
            least_lift_mm,
            as_photographed,
            rests: lines,
            ensemble,
            foot_depth_mm,
            files,
            warnings,
        })
    }

    /// A surface with its foot closed, or left flat where that was asked for.
    fn closed(&self, carved: &TriangleMesh, foot: Option<&Foot>) -> TriangleMesh {
        let foot = foot.filter(|_| self.foot == FootBy::Closed);
        foot.map_or_else(|| carved.clone(), |foot| foot.closed(carved, 1.0))
    }

    /// What an ensemble draws from, and how often; none where no one was asked for.
    fn spread(&self, friction: f64) -> Result<Option<(Spread, usize)>, ContactError> {
        let Some(asked) = self.ensemble else { return Ok(None) };
        // The rigid stage alone: what the grain is made of does not count.
        let spread = Spread {
            placing: placing_rad(self.placing_deg)?,
            friction: [0.0, friction],
            young_mpa: [1.0, 1.0],
        };
        Ok(Some((spread, draws(asked)?)))
    }

    fn friction(&self) -> Result<f64, ContactError> {
        let friction = self.friction.unwrap_or(CompressRequest::default().friction);
        // Any body will do to look at it.
        Plates { lower_mm: 0.0, upper_mm: 1.0, friction }.check(0.0, 1.0)?;
        Ok(friction)
    }

    fn check_lift(&self) -> Result<(), ContactError> {
        let Some(value) = self.least_lift_mm.filter(|mm| !(mm.is_finite() && *mm >= 0.0)) else {
            return Ok(());
        };
        let (name, unit, limit, remedy) = ("least_lift_mm", "mm", "not negative, and finite", "leave it out");
        Err(ContactError::Setting { name, value, unit, limit, remedy })
    }

    /// The body as a compression reads it.
    fn read(&self) -> CompressOptions {
        CompressOptions { input: Some(self.input.clone()), unit: self.unit, ..CompressOptions::default() }
    }

    fn folder(&self) -> PathBuf {
        self.out.clone().unwrap_or_else(|| {
            let stem = if self.read().is_file() { self.input.file_stem() } else { self.input.file_name() };
            format!("{}-rests", stem.unwrap_or_default().to_string_lossy()).into()
        })
    }
}

/// The surface of what is pressed, as it was carved, and what of it was hidden.
fn surface(input: CompressInput) -> Result<(TriangleMesh, Option<Foot>), JobError> {
    match input {
        CompressInput::Surface { surface, hidden_mm, .. } => {
            let foot = hidden_mm.and_then(|mm| Foot::of(&surface, mm));
            Ok((surface, foot))
        }
        CompressInput::Mesh(mesh, _) => {
            mesh.check().map_err(ContactError::Mesh)?;
            Ok((mesh.surface().triangles, None))
        }
        CompressInput::Sphere(_) => {
            Err(JobError::Usage("a sphere lies anyhow; give a session or a file".into()))
        }
    }
}

/// What a person should know of rests on a foot.
fn foot_warning(foot: &Foot, depth_mm: Option<f64>, lines: &[RestLine]) -> Option<String> {
    let share: f64 = lines.iter().filter(|l| l.on_foot).map(|l| l.chance).sum();
    let count = lines.iter().filter(|l| l.on_foot).count();
    let is = match depth_mm {
        Some(mm) => {
            format!(
                "closed as the surface around goes on, {:.1} µm deep, known to about a factor of two",
                1e3 * mm
            )
        }
        None => "left the flat that it was cut to".to_owned(),
    };
    (count > 0).then(|| {
        format!(
            "{count} rests (* in the table, {:.0} % of the chances) touch a plate with the {:.4} mm² that the pedestal hid, which are {is}",
            100.0 * share,
            foot.area_mm2
        )
    })
}

fn pose(
    surface: &TriangleMesh,
    center: &Point,
    rest: &Rest,
    rocked: &Rocking,
    captions: Vec<String>,
) -> Pose {
    let corners = |t: usize| surface.corners(t).map(|p| Point::from(rest.turn * (p - center)));
    Pose {
        captions,
        surface: (0..surface.triangles.len()).map(corners).collect(),
        lower: rocked.first.lower.clone(),
        upper: rocked.first.upper.clone(),
    }
}

fn captions(line: &RestLine, as_photographed: usize) -> Vec<String> {
    let photographed = if line.rest == as_photographed { ", as photographed" } else { "" };
    let foot = if line.on_foot { ", on the foot" } else { "" };
    let rocks = if line.rocks {
        format!("rocks {:.1} µm, {:.1}°", 1e3 * line.rocking_mm, line.rocking_deg)
    } else {
        "held as it lies".to_owned()
    };
    vec![
        format!("{}: {:.1} %{photographed}{foot}", line.rest, 100.0 * line.chance),
        format!("gap {:.1}°, {rocks}", line.gap_deg),
    ]
}

/// The rests as CSV (RFC 4180), with a line of names.
fn table(lines: &[RestLine]) -> String {
    let mut out = String::from(
        "rest,chance,height_mm,center_mm,lift_mm,feet,gap_deg,rocks,rocking_mm,rocking_deg,held_by_friction,\
         on_foot,askew_p05_mm,askew_median_mm,askew_p95_mm,askew_rocks_share,rotate_x_deg,rotate_y_deg,rotate_z_deg\n",
    );
    for l in lines {
        let lift = l.lift_mm.map_or_else(String::new, |mm| format!("{mm:.6}"));
        let askew = l.askew.map_or_else(
            || ",,,".to_owned(),
            |a| {
                format!(
                    "{:.6},{:.6},{:.6},{:.4}",
                    a.rocking_mm.p05_mm, a.rocking_mm.median_mm, a.rocking_mm.p95_mm, a.rocks_share
                )
            },
        );
        let [x, y, z] = l.rotate_deg;
        let _ = writeln!(
            out,
            "{},{:.5},{:.6},{:.6},{lift},{},{:.4},{},{:.6},{:.4},{},{},{askew},{x:.4},{y:.4},{z:.4}",
            l.rest,
            l.chance,
            l.height_mm,
            l.center_mm,
            l.feet_mm.len(),
            l.gap_deg,
            l.rocks,
            l.rocking_mm,
            l.rocking_deg,
            l.held_by_friction,
            l.on_foot
        );
    }
    out
}
