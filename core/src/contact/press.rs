//! A uniaxial compression: loading, sampling and stopping, from the first touch to a force or an approach of the plates.
//!
//! Both plates move, each by half the approach, which halves the speed and quarters the energy of motion; only the approach
//! counts. How fast follows from what the grain has stored of their work so far (see [`Loading`]).

use super::lanes::Node;
use super::touch::{BoundaryFacets, Contact, Plate, Touch, Tracker};
use super::{Body, ContactError, Dynamics, Energy, Material, Plates, Reaction};
use crate::geometry::{Point, Vector};
use crate::mesh::TetMesh;
use nalgebra::{Matrix3, Rotation3};
use serde::{Deserialize, Serialize};

/// Steps between two looks at the stable step.
const REVIEW: u64 = 2000;
/// Share of the stable step that is taken: the body can shrink by so much before the next look.
const OF_STABLE: f64 = 0.9;
/// How far nodes may lie beyond plates as they are asked for, over half the plates' distance.
const OUTSIDE: f64 = 0.02;
/// A ramp to another speed takes so many crossings of the grain by a shear wave.
const RAMP: f64 = 2.0;

/// How the plates move and where they stop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Loading {
    /// Stop at this force, N.
    pub to_force_n: Option<f64>,
    /// Stop at this approach of the plates, mm.
    pub to_approach_mm: Option<f64>,
    /// The slowest approach of the plates over √(E/ρ): how fast they come before the grain resists.
    pub slowest: f64,
    /// The fastest approach over √(E/ρ).
    pub fastest: f64,
    /// Between them the plates go as fast as a grain moving at their speed would have this share of what is stored so far. What
    /// moves in the grain is slower, most of it much, so that the true share is a small part of this one. While a grain tips, it
    /// stores nothing, and the plates stay slow.
    pub motion_share: f64,
    /// Mass-proportional damping α over `c_s/H`, the shear wave's crossings of the grain's height in a second; a twentieth of it
    /// for the grain's motion as a whole.
    pub damping: f64,
    /// Mass that may be added to the smallest elements, over the grain's.
    pub mass_scaling: f64,
    /// A time step to be taken, s; none takes nine tenths of the stable one.
    pub step_s: Option<f64>,
}

impl Default for Loading {
    fn default() -> Self {
        Self {
            to_force_n: Some(10.0),
            to_approach_mm: None,
            slowest: 4e-6,
            fastest: 1e-3,
            motion_share: 0.03,
            damping: 0.2,
            mass_scaling: 0.01,
            step_s: None,
        }
    }
}

impl Loading {
    /// How much of the way to the end is done at a sample, 0 to 1.
    pub fn done_at(&self, sample: &Sample) -> f64 {
        let by_force = self.to_force_n.map_or(0.0, |f| (sample.force_n.max(0.0) / f).powf(2.0 / 3.0));
        let by_approach = self.to_approach_mm.map_or(0.0, |d| sample.approach_mm / d);
        by_force.max(by_approach).clamp(0.0, 1.0)
    }

    /// Whether the plates can move so.
    ///
    /// # Errors
    /// [`ContactError::Setting`] for a limit that is not positive, or none at all, and for speeds that make no sense.
    pub fn check(&self) -> Result<(), ContactError> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        let bad = |name, value, unit, limit, remedy| {
            Err(ContactError::Setting { name, value, unit, limit, remedy })
        };
        if let Some(f) = self.to_force_n
            && !positive(f)
        {
            return bad("to_force_n", f, "N", "positive and finite", "10 N is usual");
        }
        if let Some(d) = self.to_approach_mm
            && !positive(d)
        {
            return bad("to_approach_mm", d, "mm", "positive and finite", "a hundredth of the grain is much");
        }
        if self.to_force_n.is_none() && self.to_approach_mm.is_none() {
            return bad("to_force_n", f64::NAN, "N", "given where no approach is", "say where to stop");
        }
        if !positive(self.slowest) || self.slowest > 0.01 {
            return bad("slowest", self.slowest, "√(E/ρ)", "above 0 and at most 0.01", "4e-6 is usual");
        }
        if !(self.fastest >= self.slowest && self.fastest <= 0.01) {
            return bad("fastest", self.fastest, "√(E/ρ)", "from the slowest to 0.01", "1e-3 is usual");
        }
        if !positive(self.motion_share) || self.motion_share > 1.0 {
            return bad("motion_share", self.motion_share, "", "above 0 and at most 1", "0.03 is usual");
        }
        if !(0.0..=10.0).contains(&self.damping) {
            return bad("damping", self.damping, "c_s/H", "from 0 to 10", "0.2 is usual");
        }
        if !(0.0..=1.0).contains(&self.mass_scaling) {
            return bad("mass_scaling", self.mass_scaling, "of the mass", "from 0 to 1", "0.01 is usual");
        }
        if let Some(s) = self.step_s
            && !positive(s)
        {
            return bad("step_s", s, "s", "positive and finite", "leave it out");
        }
        Ok(())
    }
}

/// A sample: forces averaged over a window, energies and contacts at its end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The time at the end of the window, s.
    pub time_s: f64,
    /// Steps done by then.
    pub steps: u64,
    /// The approach of the plates in the middle of the window, mm.
    pub approach_mm: f64,
    /// The mean of both plates' forces over the window, N.
    pub force_n: f64,
    /// Of the lower plate on the grain, over the window, N.
    pub lower_n: [f64; 3],
    /// Of the upper plate on the grain, over the window, N.
    pub upper_n: [f64; 3],
    /// The energies at the end of the window.
    pub energy: Energy,
    /// How far the grain has turned, as a rotation vector, rad.
    pub rotation_rad: [f64; 3],
    /// The contacts at the end of the window.
    pub touches: Vec<Touch>,
    /// The time step, s.
    pub step_s: f64,
    /// How fast the plates approach, mm/s.
    pub speed_mm_s: f64,
}

/// The averaging window in progress: sums since it began.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct AveragingWindow {
    pub(super) reaction: Reaction,
    pub(super) from_s: f64,
    pub(super) from_mm: f64,
}

/// A compression in progress.
#[derive(Debug, Clone)]
pub struct Press {
    pub(super) body: Body,
    pub(super) dynamics: Dynamics,
    pub(super) plates: Plates,
    pub(super) loading: Loading,
    pub(super) samples: Vec<Sample>,
    pub(super) tracker: Tracker,
    pub(super) window: AveragingWindow,
    pub(super) speed_mm_s: f64,
    pub(super) step_s: f64,
    boundary: BoundaryFacets,
    /// The plates' distance at the beginning, mm.
    gap_mm: f64,
    /// The approach that went into turning the grain before, mm.
    rocked_mm: f64,
    /// The approach at which the plates begin to move, mm.
    begins_mm: f64,
    height_mm: f64,
    mass_t: f64,
}

impl Press {
    /// A mesh between plates `gap_mm` apart whose middle is the height `middle_mm`; the approach counts from there.
    ///
    /// # Errors
    /// [`ContactError`]: a material, a mesh, plates or a loading that cannot be computed.
    pub fn new(
        mesh: &TetMesh,
        material: &Material,
        middle_mm: f64,
        gap_mm: f64,
        friction: f64,
        loading: &Loading,
    ) -> Result<Self, ContactError> {
        loading.check()?;
        let mut body = Body::new(mesh, material)?;
        let (bottom, top) = reach(&body.reference);
        let asked =
            Plates { lower_mm: middle_mm - 0.5 * gap_mm, upper_mm: middle_mm + 0.5 * gap_mm, friction };
        // A mesh's nodes may lie a little outside the body that it stands for: then the plates begin at the nodes, and the
        // approach below zero.
        let half = (0.5 * gap_mm).max(middle_mm - bottom).max(top - middle_mm);
        let plates = if half <= (1.0 + OUTSIDE) * 0.5 * gap_mm {
            Plates { lower_mm: middle_mm - half, upper_mm: middle_mm + half, friction }
        } else {
            asked
        };
        plates.check(bottom, top)?;
        if loading.mass_scaling > 0.0 {
            body.scale_mass(loading.mass_scaling);
        }
        let mut dynamics = Dynamics::new(&body);
        let height_mm = top - bottom;
        dynamics.damping_per_s = loading.damping * material.shear_wave_mm_s() / height_mm;
        let boundary = BoundaryFacets::new(mesh, &body);
        let mass_t = body.mass_t();
        let mut press = Self {
            body,
            dynamics,
            plates,
            loading: *loading,
            samples: Vec::new(),
            tracker: Tracker::default(),
            window: AveragingWindow::default(),
            speed_mm_s: 0.0,
            step_s: 0.0,
            boundary,
            gap_mm,
            rocked_mm: 0.0,
            begins_mm: 0.0,
            height_mm,
            mass_t,
        };
        press.begins_mm = press.approach_mm();
        press.window.from_mm = press.begins_mm;
        press.review()?;
        Ok(press)
    }

    /// The same with an approach that counts from where plates first touched a grain that they had to turn by so much of
    /// approach, mm, before they held it as the mesh lies.
    #[must_use]
    pub fn rocked(mut self, approach_mm: f64) -> Self {
        self.rocked_mm = approach_mm;
        self.begins_mm = self.approach_mm();
        self.window.from_mm = self.begins_mm;
        self
    }

    /// The approach at which the plates begin to move, mm: that of turning the grain, less by what a mesh's nodes lie outside the body.
    pub fn begins_mm(&self) -> f64 {
        self.begins_mm
    }

    /// How far the farthest node is beyond a plate, mm: rounding.
    pub fn overclosure_mm(&self) -> f64 {
        let beyond = |p: &Node| (self.plates.lower_mm - p[2]).max(p[2] - self.plates.upper_mm);
        self.dynamics.positions.iter().map(beyond).fold(0.0, f64::max)
    }

    /// The body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// The state.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// The plates where they are.
    pub fn plates(&self) -> &Plates {
        &self.plates
    }

    /// What was kept so far.
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// All contacts that there were.
    pub fn contacts(&self) -> &[Contact] {
        &self.tracker.contacts
    }

    /// The time step, s.
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// How near the plates have come, mm.
    pub fn approach_mm(&self) -> f64 {
        self.rocked_mm + self.gap_mm - (self.plates.upper_mm - self.plates.lower_mm)
    }

    /// How much of the way to the end is done, 0 to 1: a guess by the approach, or by the force as a contact's grows.
    pub fn done(&self) -> f64 {
        self.samples.last().map_or(0.0, |s| self.loading.done_at(s))
    }

    /// The positions of the mesh's nodes now, mm, with the lower plate at the height zero, and that of the upper plate.
    pub fn positions_mm(&self) -> (Vec<Point>, f64) {
        let mut out = vec![Point::origin(); self.body.nodes()];
        for (n, x) in self.dynamics.positions.iter().enumerate() {
            out[self.body.mesh_node(n)] = Point::new(x[0], x[1], x[2] - self.plates.lower_mm);
        }
        (out, self.plates.upper_mm - self.plates.lower_mm)
    }

    /// The grain's height as it was put between the plates, mm.
    pub fn height_mm(&self) -> f64 {
        self.height_mm
    }

    /// Whether the force or the approach is reached.
    pub fn finished(&self) -> bool {
        let last = self.samples.last();
        self.loading.to_force_n.is_some_and(|f| last.is_some_and(|s| s.force_n >= f))
            || self.loading.to_approach_mm.is_some_and(|d| last.is_some_and(|s| s.approach_mm >= d))
    }

    /// Computes until the next sample is there.
    ///
    /// # Errors
    /// [`ContactError::Broken`] where an element fails: the samples stay; [`ContactError::Unstable`] where the step that was
    /// asked for has become too large.
    pub fn next_sample(&mut self) -> Result<&Sample, ContactError> {
        while !self.advance(REVIEW)? {}
        Ok(&self.samples[self.samples.len() - 1])
    }

    /// Computes until the next sample is there, but no more than so many steps; whether it is. The bits do not depend on how
    /// a compression is cut up, and it may be saved after each piece.
    ///
    /// # Errors
    /// As [`Self::next_sample`].
    pub fn advance(&mut self, most_steps: u64) -> Result<bool, ContactError> {
        // Ringing of the grain as a whole is averaged out over a crossing by shear waves, there and back.
        let long_s = 2.0 * self.height_mm / self.body.material.shear_wave_mm_s();
        for _ in 0..most_steps {
            if self.dynamics.steps > 0 && self.dynamics.steps.is_multiple_of(REVIEW) {
                self.review()?;
            }
            self.accelerate();
            let half = 0.5 * self.speed_mm_s;
            let did = self.dynamics.step(&self.body, &mut self.plates, [half, -half], self.step_s)?;
            self.window.reaction.add(&did);
            if self.dynamics.time_s - self.window.from_s >= long_s {
                self.sample();
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Takes the time step that the body bears as it is now.
    fn review(&mut self) -> Result<(), ContactError> {
        let stable_s = self.dynamics.stable_step_s(&self.body);
        if !stable_s.is_finite() {
            let (time_s, step) = (self.dynamics.time_s, self.dynamics.steps);
            return Err(ContactError::Broken { element: 0, what: "has no stable step", time_s, step });
        }
        self.step_s = match self.loading.step_s {
            Some(asked_s) if asked_s > stable_s => return Err(ContactError::Unstable { asked_s, stable_s }),
            Some(asked_s) => asked_s,
            None => OF_STABLE * stable_s,
        };
        Ok(())
    }

    /// Lets the speed follow what the grain has stored, smoothly: `v = √(2 φ E/m)` for the share φ = `motion_share` of the energy E
    /// that is not motion and the grain's mass m, within [`Loading::slowest`] and [`Loading::fastest`].
    fn accelerate(&mut self) {
        let material = &self.body.material;
        let bar_mm_s = (material.young_mpa / material.density_t_mm3).sqrt();
        let stored = self.dynamics.spent.kept().max(0.0);
        let mass = self.mass_t;
        let wanted = (2.0 * self.loading.motion_share * stored / mass).sqrt();
        let wanted = wanted.clamp(self.loading.slowest * bar_mm_s, self.loading.fastest * bar_mm_s);
        let most = self.loading.slowest * bar_mm_s * self.step_s * material.shear_wave_mm_s()
            / (RAMP * self.height_mm);
        self.speed_mm_s += (wanted - self.speed_mm_s).clamp(-most, most);
    }

    fn sample(&mut self) {
        let approach = self.approach_mm();
        let window = std::mem::take(&mut self.window);
        let seconds = self.dynamics.time_s - window.from_s;
        let lower_n = window.reaction.lower_n_s.map(|i| i / seconds);
        let upper_n = window.reaction.upper_n_s.map(|i| i / seconds);
        let touching = self.touching();
        let touches = self.tracker.look(&self.boundary, &self.dynamics.positions, &touching, approach);
        self.samples.push(Sample {
            time_s: self.dynamics.time_s,
            steps: self.dynamics.steps,
            approach_mm: 0.5 * (window.from_mm + approach),
            force_n: 0.5 * (lower_n[2] - upper_n[2]),
            lower_n,
            upper_n,
            energy: self.dynamics.energy(&self.body),
            rotation_rad: self.rotation().scaled_axis().into(),
            touches,
            step_s: self.step_s,
            speed_mm_s: self.speed_mm_s,
        });
        self.window.from_s = self.dynamics.time_s;
        self.window.from_mm = approach;
    }

    /// Nodes that touch a plate now, by rising number, with what presses on each, N.
    fn touching(&self) -> Vec<(u32, Plate, f64)> {
        // A node that a plate holds is on it but for rounding.
        let near = 1e-12 * self.height_mm.max(self.plates.upper_mm.abs());
        let at = |n: u32| self.dynamics.positions[n as usize][2];
        let force = |n: u32| self.dynamics.forces()[n as usize][2];
        (self.boundary.nodes().iter())
            .filter_map(|&n| {
                if (at(n) - self.plates.lower_mm).abs() <= near {
                    Some((n, Plate::Lower, -force(n)))
                } else if (at(n) - self.plates.upper_mm).abs() <= near {
                    Some((n, Plate::Upper, force(n)))
                } else {
                    None
                }
            })
            .collect()
    }

    /// How far the grain has turned: the rotation that carries its nodes best to where they are, by mass.
    pub fn rotation(&self) -> Rotation3<f64> {
        let mass = &self.body.mass;
        let center = |positions: &[Node]| -> Vector {
            let (sum, total) = positions
                .iter()
                .zip(mass)
                .fold((Vector::zeros(), 0.0), |(s, t), (p, m)| (s + Vector::from(*p) * *m, t + m));
            sum / total
        };
        let (from, to) = (center(&self.body.reference), center(&self.dynamics.positions));
        let mut a = Matrix3::zeros();
        for ((x, y), m) in self.body.reference.iter().zip(&self.dynamics.positions).zip(mass) {
            a += (Vector::from(*y) - to) * (Vector::from(*x) - from).transpose() * *m;
        }
        Rotation3::from_matrix_eps(&a, 1e-15, 100, Rotation3::identity())
    }

    /// Displacements of the mesh's nodes, with the lower plate at rest, mm.
    pub fn displacements_mm(&self) -> Vec<Point> {
        let moved = self.plates.lower_mm - (self.plates.lower_mm + self.plates.upper_mm - self.gap_mm) / 2.0;
        let mut out = vec![Point::origin(); self.body.nodes()];
        for (n, (x, y)) in self.body.reference.iter().zip(&self.dynamics.positions).enumerate() {
            out[self.body.mesh_node(n)] = Point::new(y[0] - x[0], y[1] - x[1], y[2] - x[2] - moved);
        }
        out
    }
}

/// The least and the largest height.
fn reach(positions: &[Node]) -> (f64, f64) {
    positions.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[2]), h.max(p[2])))
}
