//! Signatures and their distances.

use scene::Descriptor;

/// Signs with which entries are added before the transform: a fixed throw of coins, so that no structure of descriptors agrees with it.
const COINS: [u64; 2] = [0x6A09_E667_F3BC_C908, 0xBB67_AE85_84CA_A73B];

/// On which side of its word a descriptor lies, along 64 orthogonal directions.
///
/// Directions are rows of a Hadamard matrix of order 128 with the columns' signs thrown at random: as good as a random rotation (Ailon &
/// Chazelle, STOC 2006), in a few hundred additions of integers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Signature(pub u64);

impl Signature {
    pub(super) fn new(descriptor: &Descriptor, word: &Descriptor) -> Self {
        // The first 64 rows are a matrix of order 64 on the sums of both halves. At most 128 x 255 = 32640 in magnitude.
        let signed = |i: usize| {
            let difference = i16::from(descriptor[i]) - i16::from(word[i]);
            if (COINS[i / 64] >> (i % 64)) & 1 == 1 { -difference } else { difference }
        };
        let mut values: [i16; 64] = std::array::from_fn(|i| signed(i) + signed(i + 64));
        let mut half = 1;
        while half < 64 {
            for pair in values.chunks_exact_mut(2 * half) {
                let (low, high) = pair.split_at_mut(half);
                for (a, b) in low.iter_mut().zip(high) {
                    (*a, *b) = (*a + *b, *a - *b);
                }
            }
            half *= 2;
        }
        Self(values.iter().enumerate().fold(0, |bits, (i, &value)| bits | u64::from(value > 0) << i))
    }
}

/// An instruction set that the distances are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Popcount {
    /// What the target guarantees; NEON counts bits.
    Portable,
    /// A word at a time.
    #[cfg(target_arch = "x86_64")]
    Popcnt,
    /// Eight words at a time.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Popcount {
    /// Those that this machine has, the quickest last.
    pub(super) fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "only x86-64 has more than one")]
        let mut sets = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("popcnt") {
            sets.push(Self::Popcnt);
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512vpopcntdq") {
                sets.push(Self::Avx512);
            }
        }
        sets
    }

    /// The quickest that this machine has.
    pub(super) fn best() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }

    /// Hamming distances of one signature from some, as many as the shorter list has.
    pub(super) fn distances(self, from: Signature, to: &[Signature], out: &mut [u8]) {
        match self {
            Self::Portable => distances(from, to, out),
            // SAFETY: these variants are only made by `available` where the machine has the instructions.
            #[cfg(target_arch = "x86_64")]
            Self::Popcnt => unsafe { popcnt(from, to, out) },
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => unsafe { avx512(from, to, out) },
        }
    }
}

#[inline(always)]
fn distances(from: Signature, to: &[Signature], out: &mut [u8]) {
    for (out, to) in out.iter_mut().zip(to) {
        *out = (from.0 ^ to.0).count_ones() as u8;
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "popcnt")]
fn popcnt(from: Signature, to: &[Signature], out: &mut [u8]) {
    distances(from, to, out);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "popcnt,avx2,avx512f,avx512bw,avx512vpopcntdq")]
fn avx512(from: Signature, to: &[Signature], out: &mut [u8]) {
    distances(from, to, out);
}
