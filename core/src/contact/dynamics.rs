//! Explicit dynamics: central differences for a body between plates.
//!
//! ```text
//!   x(n)  ──forces f(n)──▶  v(n+½) = v(n−½) + Δt (f(n)/m − α (v(n−½) − r)), plates hold  ──▶  x(n+1) = x(n) + Δt v(n+½)
//! ```
//!
//! r is the body's motion as a whole, nearly: damping takes its ringing, and hardly holds it back when it turns between plates.
//!
//! Forces of a chunk of elements go to slots of its own, and each node adds its chunks' slots in a fixed order; sums over
//! nodes are made over blocks of a fixed size. So the same bits come out on any number of threads.

use super::body::{BLOCK, BULK_VISCOSITY};
use super::instructions::Kernel;
use super::lanes::{Local, NodalVolumes, Node, W, ln};
use super::laws::{ChunkOutput, ChunkState, ChunkStep};
use super::plates::{Closing, Plates, Reaction};
use super::rigid::Rigid;
use super::{Body, ContactError, time_step};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Share of the damping that the body's motion as a whole gets. With all of it a grain that tips would be dragged along with
/// forces that no slow test has; without any it would rattle
/// between the plates, as there is no weight that keeps it down. With this share rattling ends in some hundred crossings of the
/// grain by shear waves, and the drag is some thousandths of the force.
const WHOLE: f64 = 0.05;

/// The energy balance, N·mm. What the plates put in is `external`; the rest is where it went:
///
/// ```text
/// W_ext = E_kin + E_stored + E_plastic + E_viscous + E_damping + E_friction + E_impact
/// ```
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Energy {
    /// Work of the plates.
    pub external: f64,
    /// Of motion.
    pub kinetic: f64,
    /// Stored elastically.
    pub stored: f64,
    /// Taken by plastic flow.
    pub plastic: f64,
    /// Taken by bulk viscosity.
    pub viscous: f64,
    /// Taken by damping.
    pub damping: f64,
    /// Taken by friction.
    pub friction: f64,
    /// Lost by nodes that met a plate.
    pub impact: f64,
}

impl Energy {
    /// What the grain's inside holds or took: stored and plastic.
    pub fn internal(&self) -> f64 {
        self.stored + self.plastic
    }

    /// What is left of the plates' work after all that took some: what is stored or has flowed, known without looking at the
    /// elements.
    pub(super) fn kept(&self) -> f64 {
        self.external - self.kinetic - self.viscous - self.damping - self.friction - self.impact
    }

    /// The error of the balance, left side less right side, over the largest of `|W_ext|`, `E_kin` and `E_stored + E_plastic`.
    pub fn balance_error(&self) -> f64 {
        let accounted =
            self.kinetic + self.internal() + self.viscous + self.damping + self.friction + self.impact;
        let size = self.external.abs().max(self.kinetic).max(self.internal());
        if size > 0.0 { (self.external - accounted) / size } else { 0.0 }
    }
}

/// How the grain moves as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Centre of mass, mm.
    pub center_mm: [f64; 3],
    /// Momentum, t·mm/s.
    pub momentum_n_s: [f64; 3],
    /// Moment of momentum about the origin, t·mm²/s.
    pub spin_n_mm_s: [f64; 3],
}

/// The output of a block of nodes for one step: the plates' impulses, kinetic energy and damping, N·mm.
#[derive(Debug, Clone, Copy, Default)]
struct BlockOutput {
    reaction: Reaction,
    kinetic: f64,
    damping: f64,
}

/// The state of a computation.
#[derive(Debug, Clone)]
pub struct Dynamics {
    /// Mass-proportional damping α, 1/s; a twentieth of it for the motion of the body as a whole.
    pub damping_per_s: f64,
    /// Steps done.
    pub steps: u64,
    /// The time, s.
    pub time_s: f64,
    pub(super) positions: Vec<Node>,
    pub(super) velocities: Vec<Node>,
    pub(super) chunks: Vec<ChunkState>,
    /// The step that led here, s; infinite before the first.
    pub(super) last_step_s: f64,
    /// Sums since the beginning; `kinetic` is of the last step, `stored` is not kept here.
    pub(super) spent: Energy,
    forces: Vec<Node>,
    slots: Vec<Node>,
    volumes: Vec<f64>,
    pub(super) pressures: Vec<f64>,
    chunk_outputs: Vec<ChunkOutput>,
    block_outputs: Vec<BlockOutput>,
}

/// The pressures of a block of nodes, MPa.
struct NodalPressures<'a> {
    body: &'a Body,
    bulk_mpa: f64,
    /// The block's first node.
    first: usize,
    /// Volumes in the slots of all chunks, mm³.
    volumes: &'a [f64],
    pressures: &'a mut [f64],
}

impl Kernel for NodalPressures<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { body, bulk_mpa, first, volumes, pressures } = self;
        for (i, pressure) in pressures.iter_mut().enumerate() {
            *pressure = body.gathered_volume(first + i, volumes) / body.volume[first + i];
        }
        for pressure in pressures {
            let ratio = *pressure;
            *pressure = bulk_mpa * ln(ratio) / ratio;
        }
    }
}

impl Dynamics {
    /// A body at rest, undeformed.
    pub fn new(body: &Body) -> Self {
        let (lanes, nodal) = (body.law.history_lanes(), body.law.nodal_bulk_mpa().is_some());
        let chunks = (body.chunks.iter())
            .map(|c| ChunkState {
                volume_ratio: vec![[1.0; W]; c.batches.len()],
                history: vec![[0.0; W]; lanes * c.batches.len()],
            })
            .collect();
        Self {
            damping_per_s: 0.0,
            steps: 0,
            time_s: 0.0,
            positions: body.reference.clone(),
            velocities: vec![[0.0; 3]; body.nodes()],
            chunks,
            last_step_s: f64::INFINITY,
            spent: Energy::default(),
            forces: vec![[0.0; 3]; body.nodes()],
            slots: body.all_slots([0.0; 3]),
            volumes: if nodal { body.all_slots(0.0) } else { Vec::new() },
            pressures: if nodal { vec![0.0; body.nodes()] } else { Vec::new() },
            chunk_outputs: vec![ChunkOutput::default(); body.chunks.len()],
            block_outputs: vec![BlockOutput::default(); body.nodes().div_ceil(BLOCK)],
        }
    }

    /// Current configuration: the nodes' positions in the order of computation, mm.
    pub fn positions(&self) -> &[[f64; 3]] {
        &self.positions
    }

    /// Nodes' velocities in the order of computation, mm/s.
    pub fn velocities(&self) -> &[[f64; 3]] {
        &self.velocities
    }

    /// Forces of the elements on the nodes at the beginning of the last step, N.
    pub(super) fn forces(&self) -> &[Node] {
        &self.forces
    }

    /// Puts the nodes somewhere, with velocities, as a test or an impact begins.
    pub fn set(&mut self, positions: Vec<[f64; 3]>, velocities: Vec<[f64; 3]>) {
        assert!(positions.len() == self.positions.len() && velocities.len() == positions.len());
        self.positions = positions;
        self.velocities = velocities;
    }

    /// The stable time increment of the body as it is deformed now, s: `Δt = (√(1 + b²) − b) 2/ω` for the highest mode ω, which
    /// bulk viscosity damps by the share b of its critical damping. Costs as much as about fifty steps.
    pub fn stable_step_s(&self, body: &Body) -> f64 {
        // Viscosity of the share b of critical damping in the highest mode asks for √(1+b²) − b of the step.
        let b = BULK_VISCOSITY;
        ((1.0 + b * b).sqrt() - b) * time_step::critical_time_step_s(body, &self.positions)
    }

    /// One step. The plates move with these speeds (lower, upper; up is positive, mm/s).
    ///
    /// # Errors
    /// [`ContactError::Broken`] where an element is inside out or no number; then the state is of no use.
    pub fn step(
        &mut self,
        body: &Body,
        plates: &mut Plates,
        speed_mm_s: [f64; 2],
        step_s: f64,
    ) -> Result<Reaction, ContactError> {
        self.element_forces(body);
        let mut viscous = 0.0;
        let mut plastic = 0.0;
        for output in &self.chunk_outputs {
            if let Some((element, what)) = output.broken {
                let element = body.mesh_element(element);
                return Err(ContactError::Broken { element, what, time_s: self.time_s, step: self.steps });
            }
            viscous += output.viscous;
            plastic += output.plastic;
        }
        plates.lower_mm += step_s * speed_mm_s[0];
        plates.upper_mm += step_s * speed_mm_s[1];
        let closing = Closing {
            lower_mm: plates.lower_mm,
            upper_mm: plates.upper_mm,
            speed_mm_s,
            friction: plates.friction,
            step_s,
        };
        self.advance(body, &closing);
        let mut reaction = Reaction::default();
        let (mut kinetic, mut damping) = (0.0, 0.0);
        for output in &self.block_outputs {
            reaction.add(&output.reaction);
            kinetic += output.kinetic;
            damping += output.damping;
        }
        let spent = &mut self.spent;
        spent.external += reaction.lower_n_s[2] * speed_mm_s[0] + reaction.upper_n_s[2] * speed_mm_s[1];
        spent.kinetic = kinetic;
        spent.plastic += plastic;
        spent.viscous += viscous;
        spent.damping += damping;
        spent.friction += reaction.friction_n_mm;
        spent.impact += reaction.impact_n_mm;
        self.last_step_s = step_s;
        self.time_s += step_s;
        self.steps += 1;
        Ok(reaction)
    }

    /// Forces of the elements where the nodes are now, by the material's law.
    fn element_forces(&mut self, body: &Body) {
        if let Some(bulk) = body.law.nodal_bulk_mpa() {
            self.nodal_pressures(body, bulk);
        }
        let (positions, velocities, step_s) = (&self.positions, &self.velocities, self.last_step_s);
        let (pressures, remembers) = (&self.pressures, body.law.history_lanes() > 0);
        // Before the first step nothing has moved yet.
        let back_s = if step_s.is_finite() { 0.5 * step_s } else { 0.0 };
        (body.chunks.par_iter())
            .zip(self.chunks.par_iter_mut())
            .zip(self.slots.par_chunks_mut(body.stride))
            .zip(self.chunk_outputs.par_iter_mut())
            .for_each_init(
                || (Local::default(), Local::default(), Vec::new(), Local::default()),
                |(local, half_positions, pressure, forces), (((chunk, state), slots), output)| {
                    chunk.fetch(positions, local);
                    if remembers {
                        half_positions.fill(chunk.nodes.iter().map(|&n| {
                            let (x, v) = (positions[n as usize], velocities[n as usize]);
                            [0, 1, 2].map(|k| x[k] - back_s * v[k])
                        }));
                    }
                    if !pressures.is_empty() {
                        pressure.clear();
                        pressure.extend(chunk.nodes.iter().map(|&n| pressures[n as usize]));
                    }
                    chunk.clear(forces);
                    let at = ChunkStep {
                        instructions: body.instructions,
                        chunk,
                        positions: local,
                        half_positions,
                        pressures: pressure,
                        step_s,
                    };
                    *output = body.law.step(&at, state, forces);
                    chunk.put(forces, slots);
                },
            );
    }

    /// The pressure κ ln J/J of each node, J being the volume around it over that in the mesh.
    fn nodal_pressures(&mut self, body: &Body, bulk_mpa: f64) {
        let positions = &self.positions;
        (body.chunks.par_iter()).zip(self.volumes.par_chunks_mut(body.stride)).for_each_init(
            Local::default,
            |local, (chunk, volumes)| {
                chunk.fetch(positions, local);
                volumes[..chunk.nodes.len()].fill(0.0);
                let batches = chunk.batches.as_slice();
                body.instructions.run(NodalVolumes { batches, positions: local, volumes });
            },
        );
        let volumes = &self.volumes;
        self.pressures.par_chunks_mut(BLOCK).enumerate().for_each(|(block, pressures)| {
            body.instructions.run(NodalPressures {
                body,
                bulk_mpa,
                first: block * BLOCK,
                volumes,
                pressures,
            });
        });
    }

    fn advance(&mut self, body: &Body, closing: &Closing) {
        let (slots, alpha, dt) = (&self.slots, self.damping_per_s, closing.step_s);
        let whole = (alpha > 0.0).then(|| Rigid::of(&body.mass, &self.positions, &self.velocities));
        (self.positions.par_chunks_mut(BLOCK))
            .zip(self.velocities.par_chunks_mut(BLOCK))
            .zip(self.forces.par_chunks_mut(BLOCK))
            .zip(self.block_outputs.par_iter_mut())
            .enumerate()
            .for_each(|(block, (((positions, velocities), forces), output))| {
                *output = BlockOutput::default();
                for i in 0..positions.len() {
                    let n = block * BLOCK + i;
                    let f = body.gathered(n, slots);
                    let mass = body.mass[n];
                    let before = velocities[i];
                    let damped = whole.map_or([0.0; 3], |w| {
                        let along = w.at(&positions[i]);
                        [0, 1, 2].map(|k| alpha * dt * (before[k] - (1.0 - WHOLE) * along[k]))
                    });
                    let mut v = [0, 1, 2].map(|k| before[k] - damped[k] + dt / mass * f[k]);
                    closing.hold(&positions[i], &before, mass, &mut v, &mut output.reaction);
                    for k in 0..3 {
                        positions[i][k] += dt * v[k];
                        output.kinetic += 0.5 * mass * v[k] * v[k];
                        output.damping += 0.5 * mass * damped[k] * (before[k] + v[k]);
                    }
                    velocities[i] = v;
                    forces[i] = f;
                }
            });
    }

    /// The energies now. Costs about as much as a step.
    pub fn energy(&self, body: &Body) -> Energy {
        let parts: Vec<f64> = (body.chunks.par_iter())
            .zip(&self.chunks)
            .map_init(Local::default, |local, (chunk, state)| {
                chunk.fetch(&self.positions, local);
                body.law.stored_n_mm(chunk, local, state)
            })
            .collect();
        let mut stored = parts.iter().sum::<f64>();
        if let Some(bulk) = body.law.nodal_bulk_mpa() {
            let spherical: f64 = (0..body.nodes())
                .map(|n| {
                    let volume = body.gathered_volume(n, &self.volumes);
                    let ratio = if self.steps == 0 { 1.0 } else { volume / body.volume[n] };
                    0.5 * bulk * body.volume[n] * ln(ratio).powi(2)
                })
                .sum();
            stored += spherical;
        }
        Energy { stored, ..self.spent }
    }

    /// Memory that the state takes, bytes.
    pub fn bytes(&self) -> usize {
        let of = |c: &ChunkState| size_of_val(c.volume_ratio.as_slice()) + size_of_val(c.history.as_slice());
        let chunks = self.chunks.iter().map(of).sum::<usize>();
        // Of a node: position, velocity, force, pressure.
        chunks + 24 * self.slots.len() + 8 * self.volumes.len() + 80 * self.positions.len()
    }

    /// How the grain moves as a whole now.
    pub fn motion(&self, body: &Body) -> Motion {
        let mut motion = Motion { center_mm: [0.0; 3], momentum_n_s: [0.0; 3], spin_n_mm_s: [0.0; 3] };
        let mut total = 0.0;
        for ((x, v), m) in self.positions.iter().zip(&self.velocities).zip(&body.mass) {
            total += m;
            for k in 0..3 {
                motion.center_mm[k] += m * x[k];
                motion.momentum_n_s[k] += m * v[k];
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                motion.spin_n_mm_s[k] += m * (x[i] * v[j] - x[j] * v[i]);
            }
        }
        motion.center_mm = motion.center_mm.map(|c| c / total);
        motion
    }
}
