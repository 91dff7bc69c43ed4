//! Checkpoints: a compression as bytes, to go on with it later: what comes out is what would have come out without a break, bit
//! for bit.
//!
//! ```text
//! "grainrig press 1\n"  length of the header (u64)  header (JSON)  positions  velocities  volume ratios  [history variables]
//! ```
//! Numbers are 64-bit, little endian. What follows from the mesh and the settings is not kept: the same mesh and settings make
//! the press, then its state is put in.

use super::lanes::{Node, W};
use super::laws::ChunkState;
use super::press::{AveragingWindow, Press, Sample};
use super::touch::Tracker;
use super::{Energy, Plates};
use serde::{Deserialize, Serialize};

const MAGIC: &[u8] = b"grainrig press 1\n";

#[derive(Serialize, Deserialize)]
struct Header {
    /// Of the mesh and the material.
    fingerprint: u64,
    steps: u64,
    time_s: f64,
    last_step_s: f64,
    step_s: f64,
    speed_mm_s: f64,
    spent: Energy,
    plates: Plates,
    #[serde(rename = "stretch")]
    window: AveragingWindow,
    tracker: Tracker,
    samples: Vec<Sample>,
}

/// Why bytes are no state of this compression.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StateError {
    /// Not such a file, or cut short.
    #[error("the checkpoint is damaged: {0}; begin the compression anew")]
    Damaged(String),
    /// Of another grain or another material.
    #[error("the checkpoint belongs to another mesh or material; begin the compression anew")]
    Other,
}

impl Press {
    /// The state as it is now, after one step at least.
    pub fn save(&self) -> Vec<u8> {
        let d = &self.dynamics;
        let header = Header {
            fingerprint: self.fingerprint(),
            steps: d.steps,
            time_s: d.time_s,
            last_step_s: d.last_step_s,
            step_s: self.step_s,
            speed_mm_s: self.speed_mm_s,
            spent: d.spent,
            plates: self.plates,
            window: self.window,
            tracker: self.tracker.clone(),
            samples: self.samples.clone(),
        };
        let header = serde_json::to_vec(&header).unwrap_or_default();
        let mut out = MAGIC.to_vec();
        out.extend((header.len() as u64).to_le_bytes());
        out.extend(header);
        let mut put = |x: f64| out.extend(x.to_le_bytes());
        d.positions.iter().chain(&d.velocities).flatten().for_each(|x| put(*x));
        for chunk in &d.chunks {
            chunk.volume_ratio.iter().flatten().for_each(|x| put(*x));
            chunk.history.iter().flatten().for_each(|x| put(*x));
        }
        out
    }

    /// Takes a saved state of the same compression.
    ///
    /// # Errors
    /// [`StateError`]; the press is then as it was.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), StateError> {
        let damaged = |what: &str| StateError::Damaged(what.to_owned());
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| damaged("it does not begin as one"))?;
        let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(|| damaged("it is cut short"))?;
        let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
        if rest.len() < length {
            return Err(damaged("it is cut short"));
        }
        let (header, rest) = rest.split_at(length);
        let header: Header =
            serde_json::from_slice(header).map_err(|e| StateError::Damaged(e.to_string()))?;
        if header.fingerprint != self.fingerprint() {
            return Err(StateError::Other);
        }
        let d = &self.dynamics;
        let batches: usize = d.chunks.iter().map(|c| c.volume_ratio.len()).sum();
        let histories: usize = d.chunks.iter().map(|c| c.history.len()).sum();
        let expected = 6 * d.positions.len() + W * (batches + histories);
        if rest.len() != 8 * expected {
            return Err(damaged("its length is not that of this mesh"));
        }
        let is_time = |s: f64| s.is_finite() && s > 0.0;
        if !is_time(header.step_s) || !header.time_s.is_finite() || !header.speed_mm_s.is_finite() {
            return Err(damaged("its time or its speed is no number above zero"));
        }
        let contacts = header.tracker.contacts.len();
        let knows = |sample: &Sample| sample.touches.iter().all(|t| t.id < contacts);
        if !header.tracker.fits(d.positions.len()) || !header.samples.iter().all(knows) {
            return Err(damaged("it names a contact or a node that there is not"));
        }
        let as_number = |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap_or_default());
        if !rest.chunks_exact(8).all(|b| as_number(b).is_finite()) {
            return Err(damaged("a number is not finite"));
        }
        let mut numbers = rest.chunks_exact(8).map(as_number);
        let mut next = || numbers.next().unwrap_or(f64::NAN);
        let mut node = |_| -> Node { [next(), next(), next()] };
        let d = &mut self.dynamics;
        d.positions = (0..d.positions.len()).map(&mut node).collect();
        d.velocities = (0..d.velocities.len()).map(&mut node).collect();
        for ChunkState { volume_ratio, history } in &mut d.chunks {
            volume_ratio.iter_mut().flatten().for_each(|x| *x = next());
            history.iter_mut().flatten().for_each(|x| *x = next());
        }
        d.steps = header.steps;
        d.time_s = header.time_s;
        d.last_step_s = header.last_step_s;
        d.spent = header.spent;
        self.step_s = header.step_s;
        self.speed_mm_s = header.speed_mm_s;
        self.plates = header.plates;
        self.window = header.window;
        self.tracker = header.tracker;
        self.samples = header.samples;
        Ok(())
    }

    /// A number that another mesh or material hardly has (FNV-1a).
    fn fingerprint(&self) -> u64 {
        let m = &self.body.material;
        let of_material =
            [m.young_mpa, m.poisson, m.density_t_mm3, m.yield_mpa.unwrap_or(0.0), m.hardening_mpa];
        let own = m.parameters.values();
        let numbers =
            self.body.reference.iter().flatten().chain(&of_material).chain(own).chain(&self.body.mass);
        numbers.fold(0xcbf2_9ce4_8422_2325, |hash, x| (hash ^ x.to_bits()).wrapping_mul(0x0100_0000_01b3))
    }
}
