//! Reproducible random numbers: each a function of a key and a place.

/// The finaliser of `SplitMix64` (Steele, Lea, Flood 2014).
fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A stream of random numbers; streams of other seeds or purposes share none.
#[derive(Debug, Clone)]
pub struct Chance(u64);

impl Chance {
    /// The stream of a seed for a purpose.
    pub fn new(seed: u64, purpose: &str) -> Self {
        let key = purpose.bytes().fold(mix(seed ^ 0x7069_6374), |key, b| mix(key ^ u64::from(b)));
        Self(key)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix(self.0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform between two limits.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Standard normal (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// Smooth noise in space.
#[derive(Debug, Clone, Copy)]
pub struct Mottle(u64);

impl Mottle {
    /// The noise of a seed.
    pub fn new(seed: u64) -> Self {
        Self(mix(seed ^ 0x6d6f_7474))
    }

    /// Its value at a place, about −1 to 1: random values at whole places, blended between them, and half as much of
    /// half the size.
    pub fn at(self, p: &nalgebra::Vector3<f64>) -> f64 {
        self.octave(p) + 0.5 * self.octave(&(p * 2.0).add_scalar(17.3))
    }

    fn octave(self, p: &nalgebra::Vector3<f64>) -> f64 {
        let cell = p.map(f64::floor);
        let f = (p - cell).map(|x| x * x * (3.0 - 2.0 * x));
        (0..8)
            .map(|corner| {
                let (mut weight, mut key) = (1.0, self.0);
                for k in 0..3 {
                    let up = corner >> k & 1;
                    weight *= if up == 1 { f[k] } else { 1.0 - f[k] };
                    key = (key ^ (cell[k] as i64 + i64::from(up)) as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                }
                weight * ((mix(key) >> 11) as f64 / (1u64 << 52) as f64 - 1.0)
            })
            .sum()
    }
}
