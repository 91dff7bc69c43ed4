//! Random numbers by counter: each is a function of a key and a place, so that pictures do not depend on the
//! order in which threads draw them.

/// What a random number is for: no two purposes share their numbers.
#[derive(Debug, Clone, Copy)]
pub enum Purpose {
    /// The built-in grain's shape.
    Shape = 1,
    /// The mottling of the grain's surface.
    Texture = 2,
    /// The motor's step errors.
    Steps = 3,
    /// Each view's sideways shift.
    Wobble = 4,
    /// The pixels' noise.
    Noise = 5,
}

/// The finaliser of `SplitMix64` (Steele, Lea, Flood 2014, figure 15): every input bit flips about half of
/// the output bits.
#[inline]
pub fn mix(z: u64) -> u64 {
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// 64 random bits for the `index`-th draw under `key`.
#[inline]
pub fn bits(key: u64, index: u64) -> u64 {
    mix(key.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15)))
}

/// The key of one purpose under a seed.
pub fn key(seed: u64, purpose: Purpose) -> u64 {
    bits(mix(seed ^ 0x6772_6169_6e72_6967), purpose as u64)
}

/// Uniform in [0, 1).
pub fn uniform(key: u64, index: u64) -> f64 {
    (bits(key, index) >> 11) as f64 / (1u64 << 53) as f64
}

/// Value noise: random values (−1 to 1) at whole places, blended between them.
pub fn lattice(key: u64, p: &grainrig_core::geometry::Vector) -> f64 {
    let cell = p.map(f64::floor);
    let f = (p - cell).map(|x| x * x * (3.0 - 2.0 * x));
    (0..8)
        .map(|corner| {
            let (mut weight, mut place) = (1.0, 0u64);
            for k in 0..3 {
                let up = corner >> k & 1;
                weight *= if up == 1 { f[k] } else { 1.0 - f[k] };
                place = (place << 21) | ((cell[k] as i64 + i64::from(up)) as u64 & 0x1f_ffff);
            }
            weight * (2.0 * uniform(key, place) - 1.0)
        })
        .sum()
}

/// The standard normal distribution as a table of equally likely values (the middles of 4096 quantiles,
/// so none beyond ±3.7): one look-up a draw, the same on every machine.
#[derive(Debug)]
pub struct Normal {
    values: Vec<f32>,
}

impl Normal {
    const COUNT: usize = 4096;
    /// Bits of randomness that one draw takes.
    pub const BITS: u32 = 12;

    /// Tabulates the quantiles by integrating the density from the middle outwards.
    pub fn new() -> Self {
        let density = |x: f64| (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let mut values = vec![0.0; Self::COUNT];
        let (mut x, mut below, dx) = (0.0, 0.5, 1e-4);
        for i in Self::COUNT / 2..Self::COUNT {
            let want = (i as f64 + 0.5) / Self::COUNT as f64;
            while below < want {
                below += dx * density(x + 0.5 * dx);
                x += dx;
            }
            values[i] = x as f32;
            values[Self::COUNT - 1 - i] = -x as f32;
        }
        Self { values }
    }

    /// The value for the lowest [`Self::BITS`] bits of `bits`.
    #[inline]
    pub fn pick(&self, bits: u64) -> f32 {
        self.values[bits as usize % Self::COUNT]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_standard_normal() {
        let n = Normal::new();
        let mean: f64 = n.values.iter().map(|x| f64::from(*x)).sum::<f64>() / 4096.0;
        let var: f64 = n.values.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>() / 4096.0;
        assert!(mean.abs() < 1e-6 && (var - 1.0).abs() < 2e-3, "{mean} {var}");
        // The 97.5 % quantile of the normal distribution.
        assert!((n.values[3993] - 1.96).abs() < 0.01, "{}", n.values[3993]);
    }

    #[test]
    fn draws_are_uniform_and_depend_on_key_and_index() {
        let k = key(7, Purpose::Noise);
        let mean = (0..10_000).map(|i| uniform(k, i)).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
        assert_ne!(bits(k, 0), bits(k, 1));
        assert_ne!(k, key(7, Purpose::Wobble));
        assert_ne!(k, key(8, Purpose::Noise));
    }
}
