//! Instruction sets: a kernel is compiled once for each, and the processor decides which one runs.
//!
//! Figures are the same bits with every set: each adds and multiplies in the order that the source has and rounds after every
//! operation (none is fused with the next), and no function of the machine's library is called.

use std::fmt;

/// What is computed in one go, large enough that choosing its instructions costs nothing.
pub(super) trait Kernel {
    type Output;

    /// Computes it. Has to be `#[inline(always)]`, and all that it calls in its loops: what is not inlined stays compiled for the
    /// baseline.
    fn run(self) -> Self::Output;
}

/// A set of instructions that this processor has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Instructions(Set);

/// Private, so that there is no value of a set that the processor lacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Set {
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Instructions {
    /// What every processor has that the program was compiled for.
    pub const BASELINE: Self = Self(Set::Baseline);

    /// All sets that this processor has, the best last.
    pub fn available() -> Vec<Self> {
        let mut sets = vec![Self::BASELINE];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                sets.push(Self(Set::Avx2));
                if is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512bw")
                {
                    sets.push(Self(Set::Avx512));
                }
            }
        }
        sets
    }

    /// The best set that this processor has.
    pub fn best() -> Self {
        Self::available().pop().unwrap_or(Self::BASELINE)
    }

    /// Runs a kernel with these instructions.
    #[allow(unsafe_code)] // A function for other instructions than the program's: there is no other way to call one.
    pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        match self.0 {
            Set::Baseline => kernel.run(),
            // SAFETY: only `available` makes these values, where the processor has the instructions.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { avx2(kernel) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { avx512(kernel) },
        }
    }
}

impl fmt::Display for Instructions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self.0 {
            Set::Baseline => "baseline",
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => "AVX2",
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => "AVX-512",
        })
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{Body, Dynamics, LAWS, Material, Plates};
    use crate::geometry::{Ball, Point};
    use crate::mesh::{Controls, TetMesh, mesh};

    /// All that a ball's nodes did when it was pressed, damped, until some of it flowed; as bits.
    fn pressed(body: &Body, threads: usize) -> (Vec<u64>, f64) {
        let mut d = Dynamics::new(body);
        d.damping_per_s = 2e5;
        let dt = 0.8 * d.stable_step_s(body);
        let mut plates = Plates { lower_mm: 0.0, upper_mm: 1.0, friction: 0.2 };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let reactions: Vec<_> = pool.install(|| {
            (0..300).map(|_| d.step(body, &mut plates, [2000.0, -2000.0], dt).unwrap().lower_n_s).collect()
        });
        let (energy, fields) = (d.energy(body), d.fields(body));
        let figures = reactions.iter().chain(d.positions()).chain(d.velocities()).flatten();
        let figures = figures.chain(fields.stress_mpa.iter().flatten()).chain(&fields.plastic_strain);
        let bits = figures.chain([&dt, &energy.stored, &energy.viscous]).map(|x| x.to_bits()).collect();
        (bits, energy.plastic)
    }

    #[test]
    fn every_instruction_set_on_any_number_of_threads_gives_the_same_bits_under_every_law() {
        let ball = Ball { center: Point::new(0.0, 0.0, 0.5), radius_mm: 0.5 };
        let made: TetMesh = mesh(&ball, &Controls::for_size(3.0), &mut |_| ()).unwrap();
        let sets = Instructions::available();
        assert_eq!((sets[0], sets.last()), (Instructions::BASELINE, Some(&Instructions::best())));
        for law in LAWS {
            let mut body = Body::new(&made, &Material::default().by(law, 50.0)).unwrap();
            assert!(body.chunks.len() > 1, "{} elements", body.elements());
            let mut first = None;
            for &set in &sets {
                body.instructions = set;
                for threads in [1, 2] {
                    let (bits, plastic) = pressed(&body, threads);
                    assert_eq!(plastic > 0.0, law.yields, "{law:?}: {plastic} N mm");
                    let same = first.get_or_insert_with(|| bits.clone()) == &bits;
                    assert!(same, "{law:?} with {set} on {threads} thread(s)");
                }
            }
        }
    }
}
