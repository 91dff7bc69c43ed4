//! From what is given to a meshed grain at rest between the plates.

use super::JobError;
use crate::session::sha256_hex;
use grainrig_core::contact::{ContactError, Contacts, Foot, Rests, Rocking, rocking};
use grainrig_core::geometry::{Aabb, Ball, ConvexHull, ImplicitBody, Point, TriangleMesh, Vector};
use grainrig_core::mesh::{Controls, Solid, TetMesh, mesh};
use grainrig_core::plausible::{self, Doubt, share_of};
use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Elements where nobody says, over the diameter of a ball of the grain's volume.
const SIZE: f64 = 1.0 / 14.0;
/// Elements at the contacts, over the same: from the first, finer by a third each time, to the last, while there are not more
/// tetrahedra than this. A grain on a flat side has much surface near the plate, a ball little.
const AT_CONTACT: [f64; 2] = [1.0 / 28.0, 1.0 / 85.0];
const TETRAHEDRA: usize = 120_000;
const RESTING: &str = "laying the grain on the lower plate";

/// The body to compress.
#[derive(Debug, Clone)]
pub enum CompressInput {
    /// A sphere of this diameter, mm.
    Sphere(f64),
    /// A closed surface in mm.
    Surface {
        /// The surface.
        surface: TriangleMesh,
        /// Its name.
        name: String,
        /// The height up to which no view shows it, mm; none where all of it is known.
        hidden_mm: Option<f64>,
    },
    /// Tetrahedra in mm, with their name.
    Mesh(TetMesh, String),
}

impl CompressInput {
    pub(in crate::jobs) fn name(&self) -> String {
        match self {
            Self::Sphere(d) => format!("sphere of {d} mm"),
            Self::Surface { name, .. } | Self::Mesh(_, name) => name.clone(),
        }
    }

    /// SHA-256 of the body itself, hexadecimal.
    pub(super) fn sha256(&self) -> String {
        match self {
            Self::Sphere(d) => sha256_hex(&d.to_le_bytes()),
            Self::Surface { surface, .. } => {
                let mut bytes = place_bytes(&surface.vertices);
                bytes.extend(surface.triangles.iter().flatten().flat_map(|n| n.to_le_bytes()));
                sha256_hex(&bytes)
            }
            Self::Mesh(mesh, _) => sha256_hex(&mesh_bytes(mesh)),
        }
    }
}

/// How the body is meshed and laid on the lower plate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placing {
    /// Largest circumradius of a surface facet, mm.
    pub size_mm: Option<f64>,
    /// The same where the plates will touch, mm.
    pub size_at_contact_mm: Option<f64>,
    /// Turn about x, then y, then z, degrees, instead of coming to rest.
    pub rotate_deg: Option<[f64; 3]>,
    /// The rest that it lies in, 1 for the most likely one; none for the one that it comes to from how it lies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<usize>,
    /// How it is followed while the plates turn it.
    #[serde(default)]
    pub rocking: RockingBy,
    /// What becomes of the part that the pedestal hid.
    #[serde(default)]
    pub foot: FootBy,
}

/// What becomes of the part of a grain that its pedestal hid.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum FootBy {
    /// It is closed as the surface around it goes on.
    #[default]
    Closed,
    /// It stays the flat that it was cut to.
    Flat,
}

/// The part of a grain that its pedestal hid, and what of it touches a plate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FootResult {
    /// The height up to which no view shows the surface, mm.
    pub height_mm: f64,
    /// The area of the surface up to there, as it was carved, mm².
    pub area_mm2: f64,
    /// How far below the lowest place of the carved surface the closed one is, mm; none where it was left flat.
    pub depth_mm: Option<f64>,
    /// The share of the lower plate's contacts that are on it where the plates hold the grain, 0 to 1.
    pub lower_share: f64,
    /// The same of the upper plate's.
    pub upper_share: f64,
}

impl FootResult {
    /// What a person should know where a plate touches what no view showed.
    pub fn warning(&self) -> Option<String> {
        let plate = match (self.lower_share > 0.0, self.upper_share > 0.0) {
            (false, false) => return None,
            (true, false) => "the lower plate touches",
            (false, true) => "the upper plate touches",
            (true, true) => "both plates touch",
        };
        let is = match self.depth_mm {
            Some(depth) => format!(
                "closed as the surface around goes on, {:.1} µm deep, which is known to about a factor of two",
                1e3 * depth
            ),
            None => "a flat that the grain need not have".to_owned(),
        };
        Some(format!(
            "{plate} the grain where it stood on its pedestal, which no view shows: there it is {is}; a second session of the grain, \
             laid otherwise, shows it (`grainrig merge`)"
        ))
    }
}

/// A surface as it is pressed: with its foot closed, where it has one and that was asked for; and the foot.
fn footed(surface: &TriangleMesh, hidden_mm: Option<f64>, by: FootBy) -> (TriangleMesh, Option<Foot>) {
    let foot = hidden_mm.and_then(|mm| Foot::of(surface, mm));
    let share = if by == FootBy::Closed { 1.0 } else { 0.0 };
    (foot.as_ref().map_or_else(|| surface.clone(), |f| f.closed(surface, share)), foot)
}

/// The shares of the lower and of the upper contacts that are in a foot, for a grain that lies with its centre at the origin.
pub(in crate::jobs) fn on_foot(
    foot: &Foot,
    contacts: &Contacts,
    pose: &Rotation3<f64>,
    center: &Point,
) -> [f64; 2] {
    [&contacts.lower, &contacts.upper].map(|places| {
        let count = places.iter().filter(|p| foot.holds(&(pose.inverse() * **p + center.coords))).count();
        count as f64 / places.len().max(1) as f64
    })
}

/// How a grain is followed while the plates turn it, before they hold it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum RockingBy {
    /// As a rigid body between slow plates; the finite elements begin where the plates hold it.
    #[default]
    Rigid,
    /// By the finite elements, from the first touch on: the plates' speed counts.
    Elements,
}

/// What the rigid stage of a compression came to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RockingResult {
    /// How far the plates came while the grain turned between them, mm.
    pub approach_mm: f64,
    /// How far it turned, degrees.
    pub turned_deg: f64,
    /// The slope of the line from the lower to the upper contacts against the plates' normal at the first touch, degrees.
    pub from_gap_deg: f64,
    /// The same where the plates hold the grain, degrees.
    pub to_gap_deg: f64,
    /// Whether friction holds it; if not, the upper contacts stand above the lower ones.
    pub held_by_friction: bool,
}

impl From<&Rocking> for RockingResult {
    fn from(r: &Rocking) -> Self {
        let [from_gap_deg, to_gap_deg] = r.slopes.map(|s| s.atan().to_degrees());
        let (approach_mm, turned_deg) = (r.approach_mm(), r.angle().to_degrees());
        Self { approach_mm, turned_deg, from_gap_deg, to_gap_deg, held_by_friction: r.held_by_friction }
    }
}

/// A meshed body between plates.
pub(super) struct Placed {
    pub mesh: TetMesh,
    pub middle_mm: f64,
    pub gap_mm: f64,
    pub sphere_radius_mm: Option<f64>,
    /// How it was laid down: about x, then y, then z, degrees, as [`Placing::rotate_deg`].
    pub turned_deg: [f64; 3],
    /// How the plates turned it from there; none of a body that was not followed so.
    pub rocking: Option<RockingResult>,
    /// What the pedestal hid of it.
    pub foot: Option<FootResult>,
}

/// What of a body's length, and of figures that have to do with it, no laboratory has.
pub(in crate::jobs) fn doubts(
    input: &CompressInput,
    placing: &Placing,
    to_approach_mm: Option<f64>,
) -> Vec<Doubt> {
    let longest = |points: &[Point]| Aabb::of(points.iter().copied()).map_or(0.0, |b| b.size().max());
    let (body, long_mm) = match input {
        CompressInput::Sphere(d) => (plausible::SPHERE, *d),
        CompressInput::Surface { surface, .. } => (plausible::GRAIN, longest(&surface.vertices)),
        CompressInput::Mesh(mesh, _) => (plausible::GRAIN, longest(&mesh.nodes)),
    };
    let shares = [
        ("size_mm", placing.size_mm, [1.0 / 3000.0, 1.0]),
        ("size_at_contact_mm", placing.size_at_contact_mm, [1e-5, 1.0]),
        ("to_approach_mm", to_approach_mm, [1e-7, 0.5]),
    ];
    let of_body = || format!("the body is {} mm long", plausible::figure(long_mm));
    let of_shares = shares.into_iter().filter_map(|(name, value, share)| {
        share_of(name, long_mm, share).doubt(value?).map(|d| d.so_that(of_body()))
    });
    body.doubt(long_mm).into_iter().chain(of_shares).collect()
}

/// `told` hears what is being done, and how much of that is done, 0 to 1.
pub(super) fn placed(
    input: &CompressInput,
    placing: &Placing,
    friction: f64,
    told: &mut dyn FnMut(&str, f64),
) -> Result<Placed, JobError> {
    match input {
        CompressInput::Sphere(diameter) => {
            let radius = 0.5 * diameter;
            let ball = Ball { center: Point::origin(), radius_mm: radius };
            let mesh = meshed(&ball, *diameter, placing, told)?;
            // The plates begin where the sphere is, not its facets: what is between is no approach of theirs.
            Ok(Placed {
                mesh,
                middle_mm: 0.0,
                gap_mm: *diameter,
                sphere_radius_mm: Some(radius),
                turned_deg: [0.0; 3],
                rocking: None,
                foot: None,
            })
        }
        CompressInput::Surface { surface, hidden_mm, .. } => {
            told(RESTING, 0.0);
            let (surface, foot) = footed(surface, *hidden_mm, placing.foot);
            let laid = Laid::new(&surface.vertices, &surface_center(&surface), placing, friction)?;
            let foot = foot.map(|foot| laid.foot(&foot, placing.foot));
            let vertices = surface.vertices.iter().map(|p| laid.held(p)).collect();
            let turned = TriangleMesh { vertices, triangles: surface.triangles };
            let diameter_mm = (6.0 * turned.volume_mm3().abs() / std::f64::consts::PI).cbrt();
            // The plates begin where the surface is. A mesh has no node on its summits and ends lower: by a few tenths of a
            // micrometre, other ones at each size of the elements, and a stiff grain has its first newtons in such a way.
            let ends = reach(&turned.vertices);
            let solid = Solid::new(turned).map_err(JobError::Mesh)?;
            Ok(Placed { foot, ..laid.between(meshed(&solid, diameter_mm, placing, told)?, ends) })
        }
        CompressInput::Mesh(given, _) => {
            told(RESTING, 0.0);
            given.check().map_err(ContactError::Mesh)?;
            let surface = given.surface();
            let center = surface_center(&surface.triangles);
            let laid = Laid::new(&surface.triangles.vertices, &center, placing, friction)?;
            let nodes = given.nodes.iter().map(|p| laid.held(p)).collect();
            let mesh = TetMesh::new(nodes, given.tets.clone());
            let ends = reach(&mesh.nodes);
            Ok(laid.between(mesh, ends))
        }
    }
}

/// Fills a body that is about as large as a ball of this diameter.
fn meshed(
    body: &dyn ImplicitBody,
    diameter_mm: f64,
    placing: &Placing,
    told: &mut dyn FnMut(&str, f64),
) -> Result<TetMesh, JobError> {
    let size = placing.size_mm.unwrap_or(SIZE * diameter_mm);
    let with = |at_contact: f64, told: &mut dyn FnMut(&str, f64)| {
        let phase = format!("meshing, {:.0} µm at the contacts", 1e3 * at_contact.min(size));
        told(&phase, 0.0);
        let controls = Controls {
            surface_size_mm: size,
            tet_volume_mm3: 0.5 * size.powi(3),
            size_at_contact_mm: Some(at_contact),
            ..Controls::for_size(diameter_mm)
        };
        mesh(body, &controls, &mut |done| told(&phase, done)).map_err(JobError::Mesh)
    };
    if let Some(asked) = placing.size_at_contact_mm {
        return with(asked, told);
    }
    let mut at_contact = (AT_CONTACT[0] * diameter_mm).min(size);
    let mut made = with(at_contact, told)?;
    while at_contact > AT_CONTACT[1] * diameter_mm {
        // Elements on the surface grow with the square of its fineness: what would be far too many is not tried.
        if made.tets.len() * 3 / 2 > TETRAHEDRA {
            break;
        }
        at_contact = (at_contact / 1.5).max(0.999 * AT_CONTACT[1] * diameter_mm);
        let finer = with(at_contact, told)?;
        if finer.tets.len() > TETRAHEDRA {
            break;
        }
        made = finer;
    }
    Ok(made)
}

/// A body as it is laid on the lower plate, and as the plates hold it.
struct Laid {
    center: Point,
    pose: Rotation3<f64>,
    rocking: Option<Rocking>,
    /// Where the plates touch it then.
    held: Contacts,
}

impl Laid {
    /// Lays a body with these corners and this centre of mass on the lower plate, and lets the plates turn it.
    ///
    /// # Errors
    /// [`ContactError::Flat`] for a body without a volume, [`ContactError::NoRest`] for a rest that it has not.
    fn new(points: &[Point], center: &Point, placing: &Placing, friction: f64) -> Result<Self, JobError> {
        let hull = hull_of(points)?;
        let laid = if let Some(deg) = placing.rotate_deg {
            let [x, y, z] = deg.map(f64::to_radians);
            Rotation3::from_euler_angles(x, y, z)
        } else {
            let rests = Rests::new(hull.clone(), center, None);
            let asked = placing.rest.unwrap_or_else(|| rests.reached_from(&-Vector::z()) + 1);
            let count = rests.rests.len();
            let rest = asked.checked_sub(1).and_then(|k| rests.rests.get(k));
            rest.ok_or(ContactError::NoRest { asked, count })?.turn
        };
        let hull = hull.about(center);
        let mut turned = rocking(&hull, &laid, friction);
        let by_elements = placing.rocking == RockingBy::Elements;
        let held = std::mem::take(if by_elements { &mut turned.first } else { &mut turned.held });
        Ok(Self { center: *center, pose: laid, rocking: (!by_elements).then_some(turned), held })
    }

    /// Where a point of the body is when the plates hold it.
    fn held(&self, p: &Point) -> Point {
        let laid = self.pose * (p - self.center);
        Point::from(self.rocking.as_ref().map_or(laid, |r| r.turned * laid))
    }

    /// What of a foot the plates touch.
    fn foot(&self, foot: &Foot, by: FootBy) -> FootResult {
        let pose = self.rocking.as_ref().map_or(self.pose, |r| r.turned * self.pose);
        let [lower_share, upper_share] = on_foot(foot, &self.held, &pose, &self.center);
        FootResult {
            height_mm: foot.height_mm,
            area_mm2: foot.area_mm2,
            depth_mm: foot.depth_mm.filter(|_| by == FootBy::Closed),
            lower_share,
            upper_share,
        }
    }

    /// A mesh of the body as it is held, between plates at the lowest and the highest place of the body.
    fn between(&self, mesh: TetMesh, (low, high): (f64, f64)) -> Placed {
        let (x, y, z) = self.pose.euler_angles();
        Placed {
            mesh,
            middle_mm: 0.5 * (low + high),
            gap_mm: high - low,
            sphere_radius_mm: None,
            turned_deg: [x, y, z].map(f64::to_degrees),
            rocking: self.rocking.as_ref().map(RockingResult::from),
            foot: None,
        }
    }
}

/// The convex hull of a body's corners.
///
/// # Errors
/// [`ContactError::Flat`].
pub(in crate::jobs) fn hull_of(points: &[Point]) -> Result<ConvexHull, JobError> {
    Ok(ConvexHull::new(points).ok_or(ContactError::Flat)?)
}

fn reach(points: &[Point]) -> (f64, f64) {
    points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.z), h.max(p.z)))
}

/// The centre of the volume that a closed surface bounds.
pub(in crate::jobs) fn surface_center(surface: &TriangleMesh) -> Point {
    let from = surface.bounds().map_or_else(Point::origin, |b| b.center());
    let (mut sum, mut volume) = (Vector::zeros(), 0.0);
    for t in 0..surface.triangles.len() {
        let [a, b, c] = surface.corners(t).map(|p| p - from);
        let six = a.dot(&b.cross(&c));
        volume += six;
        sum += (a + b + c) * (six / 4.0);
    }
    if volume > 0.0 { from + sum / volume } else { from }
}

fn place_bytes(places: &[Point]) -> Vec<u8> {
    places.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(f64::to_le_bytes).collect()
}

/// The mesh, bit for bit: counts, places, node numbers.
pub(super) fn mesh_bytes(mesh: &TetMesh) -> Vec<u8> {
    let mut out = Vec::new();
    out.extend((mesh.nodes.len() as u64).to_le_bytes());
    out.extend((mesh.tets.len() as u64).to_le_bytes());
    out.extend(place_bytes(&mesh.nodes));
    out.extend(mesh.tets.iter().flatten().flat_map(|n| n.to_le_bytes()));
    out
}

/// The mesh of such bytes.
pub(super) fn mesh_from(bytes: &[u8]) -> Option<TetMesh> {
    let (nodes, rest) = bytes.split_first_chunk::<8>()?;
    let (tets, rest) = rest.split_first_chunk::<8>()?;
    let (nodes, tets) = (u64::from_le_bytes(*nodes) as usize, u64::from_le_bytes(*tets) as usize);
    if rest.len() != nodes.checked_mul(24)?.checked_add(tets.checked_mul(16)?)? {
        return None;
    }
    let (places, numbers) = rest.split_at(24 * nodes);
    let number = |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap_or_default());
    let nodes = places
        .chunks_exact(24)
        .map(|p| Point::new(number(&p[..8]), number(&p[8..16]), number(&p[16..])))
        .collect();
    let tets = numbers
        .chunks_exact(16)
        .map(|t| [0, 1, 2, 3].map(|k| u32::from_le_bytes(t[4 * k..4 * k + 4].try_into().unwrap_or_default())))
        .collect();
    Some(TetMesh::new(nodes, tets))
}
