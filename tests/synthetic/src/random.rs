//! Seeded random numbers that are the same everywhere.

/// SplitMix64 (Steele, Lea & Flood, OOPSLA 2014): small, quick, and good enough for scenes.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
}

impl Random {
    /// A stream of its own for each seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self { state: seed }
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        mix(self.state)
    }

    /// Uniform in 0..1.
    pub fn unit(&mut self) -> f64 {
        unit_from_bits(self.bits())
    }

    /// Uniform in `low..high`.
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `0..count`; 0 for a count of 0.
    pub fn index(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count.saturating_sub(1))
    }

    /// Normal with mean 0 and standard deviation 1 (Box & Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.unit()).cos()
    }
}

/// The finaliser of SplitMix64: a hash of 64 bits.
pub(crate) fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

pub(crate) fn unit_from_bits(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_right() {
        let mut random = Random::new(1);
        let n = 100_000;
        let (mut mean, mut square, mut normal, mut normal_square) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..n {
            let (u, g) = (random.unit(), random.normal());
            mean += u / f64::from(n);
            square += u * u / f64::from(n);
            normal += g / f64::from(n);
            normal_square += g * g / f64::from(n);
        }
        // Four standard errors of each mean: 1 / sqrt(n) = 0.0032 times the deviation.
        assert!((mean - 0.5).abs() < 0.0037 && (square - 1.0 / 3.0).abs() < 0.0038);
        assert!(normal.abs() < 0.0127 && (normal_square - 1.0).abs() < 0.018);
    }
}
