//! Random numbers that depend on what they are for, not on who asks first.

/// A stream of numbers, a function of the seed, the pixel and the pass alone.
pub(crate) struct Draw(u64);

impl Draw {
    pub fn new(seed: u64, pass: u32, x: usize, y: usize) -> Self {
        let mut state = Self(seed ^ (u64::from(pass) << 48) ^ ((y as u64) << 24) ^ x as u64);
        // Neighbouring keys differ in one bit: two rounds decorrelate them.
        state.0 = state.bits();
        state
    }

    /// SplitMix64: Steele, Lea & Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014.
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in 0..1.
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    /// Uniform in -1..1.
    pub fn signed(&mut self) -> f32 {
        2.0 * self.unit() - 1.0
    }
}
