//! Contact with two rigid level plates: non-penetration as a constraint on nodes, Coulomb friction.
//!
//! ```text
//! normal:    v_n ← (z_plate − z)/Δt   where z + Δt v_n would pass the plate,   I_n = m Δv_n
//! friction:  v_t ← max(0, 1 − µ|I_n|/(m|v_t|)) v_t,                            |I_t| ≤ µ|I_n|
//! ```
//!
//! Contact is exact (a constraint on the velocities, no penalty): a node that would pass a plate is put on it, and the force
//! that this takes is the plate's. A plane against flat facets is touched at nodes only, so nothing passes, there is no
//! stiffness to choose and none in the time step. A node whose force pulls is free again at once. Friction is Coulomb's: what
//! it would take to stop a node's sliding in this step, at most μ times what presses.

use super::ContactError;
use super::lanes::Node;
use serde::{Deserialize, Serialize};

/// Where the plates are and how rough.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Plates {
    /// Height of the lower plate's face, mm.
    pub lower_mm: f64,
    /// Height of the upper plate's face, mm.
    pub upper_mm: f64,
    /// Coulomb's friction between plate and grain.
    pub friction: f64,
}

impl Plates {
    /// Whether these plates can hold a body that reaches from `bottom_mm` to `top_mm`.
    ///
    /// # Errors
    /// [`ContactError::Missed`] where a plate is beyond the body or cuts through it; [`ContactError::Setting`] for a friction
    /// that is negative or no number.
    pub fn check(&self, bottom_mm: f64, top_mm: f64) -> Result<(), ContactError> {
        if !(self.friction.is_finite() && self.friction >= 0.0) {
            return Err(ContactError::Setting {
                name: "friction",
                value: self.friction,
                unit: "",
                limit: "not negative, and finite",
                remedy: "quartz on steel has about 0.2, none is 0",
            });
        }
        // Rounding aside, the grain lies between; and a plate a whole grain away would never meet it.
        let slack = 1e-9 * (top_mm - bottom_mm);
        let meets = self.lower_mm <= bottom_mm + slack
            && self.upper_mm >= top_mm - slack
            && self.upper_mm - self.lower_mm <= 2.0 * (top_mm - bottom_mm);
        if meets {
            return Ok(());
        }
        Err(ContactError::Missed { lower_mm: self.lower_mm, upper_mm: self.upper_mm, bottom_mm, top_mm })
    }
}

/// What the plates did in one step, or in several.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Reaction {
    /// Impulse of the lower plate on the grain, N·s.
    pub lower_n_s: [f64; 3],
    /// Impulse of the upper plate on the grain, N·s.
    pub upper_n_s: [f64; 3],
    /// What friction took, N·mm.
    pub friction_n_mm: f64,
    /// What nodes lost when they met a plate, N·mm.
    pub impact_n_mm: f64,
    /// Nodes on the lower and the upper plate.
    pub nodes: [u32; 2],
}

impl Reaction {
    /// Adds what came after.
    pub(super) fn add(&mut self, other: &Self) {
        for k in 0..3 {
            self.lower_n_s[k] += other.lower_n_s[k];
            self.upper_n_s[k] += other.upper_n_s[k];
        }
        self.friction_n_mm += other.friction_n_mm;
        self.impact_n_mm += other.impact_n_mm;
        self.nodes[0] += other.nodes[0];
        self.nodes[1] += other.nodes[1];
    }
}

/// The plates at the end of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Closing {
    pub lower_mm: f64,
    pub upper_mm: f64,
    /// Speeds of both, up, mm/s.
    pub speed_mm_s: [f64; 2],
    pub friction: f64,
    pub step_s: f64,
}

impl Closing {
    /// Corrects a node's velocity, which would take it through a plate; `before` is its velocity before the step. What the
    /// plate gave, as an impulse, where it touched.
    #[inline]
    pub(super) fn hold(
        &self,
        position: &Node,
        before: &Node,
        mass: f64,
        v: &mut Node,
        reaction: &mut Reaction,
    ) {
        let ahead = position[2] + self.step_s * v[2];
        let (which, height) = if ahead < self.lower_mm {
            (0, self.lower_mm)
        } else if ahead > self.upper_mm {
            (1, self.upper_mm)
        } else {
            return;
        };
        let onto = (height - position[2]) / self.step_s;
        let normal = mass * (onto - v[2]);
        // Work on the node goes with the mean of its old and new velocity, work of the plate with its own.
        reaction.impact_n_mm += normal * (self.speed_mm_s[which] - 0.5 * (before[2] + onto));
        v[2] = onto;
        let slide = (v[0] * v[0] + v[1] * v[1]).sqrt();
        let most = self.friction * normal.abs() / mass;
        let keep = if slide <= most { 0.0 } else { 1.0 - most / slide };
        let mut impulse = [0.0, 0.0, normal];
        for k in 0..2 {
            let new = keep * v[k];
            impulse[k] = mass * (new - v[k]);
            reaction.friction_n_mm -= impulse[k] * 0.5 * (before[k] + new);
            v[k] = new;
        }
        let sum = if which == 0 { &mut reaction.lower_n_s } else { &mut reaction.upper_n_s };
        for k in 0..3 {
            sum[k] += impulse[k];
        }
        reaction.nodes[which] += 1;
    }
}
