//! Dot products of descriptors in blocks, by the vector instructions of the machine.
//!
//! Products and sums are whole numbers, so every variant gives exactly the same result.

use scene::Descriptor;

/// Rows of the left list and columns of the right list in one block.
pub(super) const ROWS: usize = 4;
/// Columns of a block: as many as a 512-bit vector has 32-bit lanes.
pub(super) const COLUMNS: usize = 16;
const WORDS: usize = 32;

/// Sixteen descriptors with their bytes interleaved: the first four bytes of each, then the next four of each, ...
#[repr(C, align(64))]
#[derive(Clone)]
pub(super) struct Packed {
    words: [[u8; 4 * COLUMNS]; WORDS],
    /// 128 times the sum of each descriptor: see [`vnni`].
    offset: [i32; COLUMNS],
}

/// The descriptors in groups of sixteen; the last group is filled up with zeros.
pub(super) fn pack(descriptors: &[Descriptor]) -> Vec<Packed> {
    descriptors
        .chunks(COLUMNS)
        .map(|group| {
            let mut packed = Packed { words: [[0; 4 * COLUMNS]; WORDS], offset: [0; COLUMNS] };
            for (column, descriptor) in group.iter().enumerate() {
                for (word, bytes) in descriptor.chunks_exact(4).enumerate() {
                    packed.words[word][4 * column..4 * column + 4].copy_from_slice(bytes);
                }
                packed.offset[column] = 128 * descriptor.iter().map(|&v| i32::from(v)).sum::<i32>();
            }
            packed
        })
        .collect()
}

/// Which instructions multiply bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kernel {
    Portable,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Vnni,
}

impl Kernel {
    /// What this machine can run, the fastest last.
    pub(super) fn available() -> Vec<Self> {
        #[allow(unused_mut, reason = "other architectures add nothing")]
        let mut all = vec![Self::Portable];
        #[cfg(target_arch = "x86_64")]
        {
            if is_x86_feature_detected!("avx2") {
                all.push(Self::Avx2);
            }
            if is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vnni") {
                all.push(Self::Vnni);
            }
        }
        all
    }

    pub(super) fn best() -> Self {
        Self::available().pop().unwrap_or(Self::Portable)
    }

    /// Dot products of four descriptors with the sixteen of a group.
    #[inline]
    pub(super) fn dots(self, rows: [&Descriptor; ROWS], group: &Packed, out: &mut [[i32; COLUMNS]; ROWS]) {
        match self {
            Self::Portable => portable(rows, group, out),
            // SAFETY: `available` offers a variant only where the machine has its instructions.
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => unsafe { avx2(rows, group, out) },
            // SAFETY: as above.
            #[cfg(target_arch = "x86_64")]
            Self::Vnni => unsafe { vnni(rows, group, out) },
        }
    }
}

fn portable(rows: [&Descriptor; ROWS], group: &Packed, out: &mut [[i32; COLUMNS]; ROWS]) {
    for (row, out) in rows.iter().zip(out) {
        let mut sum = [0i32; COLUMNS];
        for (bytes, words) in row.chunks_exact(4).zip(&group.words) {
            for (sum, quad) in sum.iter_mut().zip(words.chunks_exact(4)) {
                for (a, b) in bytes.iter().zip(quad) {
                    *sum += i32::from(*a) * i32::from(*b);
                }
            }
        }
        *out = sum;
    }
}

/// Bytes widened to 16 bits, multiplied and added in pairs.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(rows: [&Descriptor; ROWS], group: &Packed, out: &mut [[i32; COLUMNS]; ROWS]) {
    use std::arch::x86_64::{
        __m256i, _mm_loadu_si128, _mm256_add_epi32, _mm256_cvtepu8_epi16, _mm256_hadd_epi32, _mm256_madd_epi16, _mm256_permute4x64_epi64,
        _mm256_set1_epi64x, _mm256_setzero_si256, _mm256_storeu_si256,
    };
    // Four columns a vector: each has two sums of pairs, which are added at the end.
    let mut sum: [[__m256i; 4]; ROWS] = [[_mm256_setzero_si256(); 4]; ROWS];
    for word in 0..WORDS {
        let wide: [__m256i; 4] = std::array::from_fn(|i| {
            // SAFETY: 16 bytes at 16 i of the 64 of a word.
            _mm256_cvtepu8_epi16(unsafe { _mm_loadu_si128(group.words[word].as_ptr().add(16 * i).cast()) })
        });
        for (row, sum) in rows.iter().zip(&mut sum) {
            let quad: [u8; 4] = std::array::from_fn(|i| row[4 * word + i]);
            let spread = quad.iter().rev().fold(0u64, |all, &b| all << 16 | u64::from(b));
            let bytes = _mm256_set1_epi64x(spread.cast_signed());
            for i in 0..4 {
                sum[i] = _mm256_add_epi32(sum[i], _mm256_madd_epi16(bytes, wide[i]));
            }
        }
    }
    for (sum, out) in sum.iter().zip(out) {
        for half in 0..2 {
            let joined = _mm256_permute4x64_epi64::<0b1101_1000>(_mm256_hadd_epi32(sum[2 * half], sum[2 * half + 1]));
            // SAFETY: eight of the sixteen values.
            unsafe { _mm256_storeu_si256(out.as_mut_ptr().add(8 * half).cast(), joined) };
        }
    }
}

/// Four multiplications of an unsigned with a signed byte, and their sum, in one instruction. The rows are made signed
/// by taking 128 from every byte: what the products lack is 128 times the sum of the column.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vnni")]
fn vnni(rows: [&Descriptor; ROWS], group: &Packed, out: &mut [[i32; COLUMNS]; ROWS]) {
    use std::arch::x86_64::{__m512i, _mm512_dpbusd_epi32, _mm512_loadu_si512, _mm512_set1_epi32, _mm512_storeu_si512};
    // SAFETY: sixteen values of 32 bits.
    let offset = unsafe { _mm512_loadu_si512(group.offset.as_ptr().cast()) };
    let mut sum: [__m512i; ROWS] = [offset; ROWS];
    for word in 0..WORDS {
        // SAFETY: a word of the group has 64 bytes.
        let columns = unsafe { _mm512_loadu_si512(group.words[word].as_ptr().cast()) };
        for (row, sum) in rows.iter().zip(&mut sum) {
            let quad: [u8; 4] = std::array::from_fn(|i| row[4 * word + i] ^ 0x80);
            *sum = _mm512_dpbusd_epi32(*sum, columns, _mm512_set1_epi32(i32::from_le_bytes(quad)));
        }
    }
    for (sum, out) in sum.iter().zip(out) {
        // SAFETY: sixteen values of 32 bits.
        unsafe { _mm512_storeu_si512(out.as_mut_ptr().cast(), *sum) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_variant_gives_the_plain_sum(bytes in prop::collection::vec(any::<u8>(), 128 * (ROWS + COLUMNS))) {
            let all: Vec<Descriptor> = bytes.chunks_exact(128).map(|c| c.try_into().expect("128 bytes")).collect();
            let (rows, columns) = all.split_at(ROWS);
            let group = &pack(columns)[0];
            for kernel in Kernel::available() {
                let mut out = [[0; COLUMNS]; ROWS];
                kernel.dots([&rows[0], &rows[1], &rows[2], &rows[3]], group, &mut out);
                for (i, row) in rows.iter().enumerate() {
                    for (j, column) in columns.iter().enumerate() {
                        let sum: i32 = row.iter().zip(column).map(|(a, b)| i32::from(*a) * i32::from(*b)).sum();
                        prop_assert_eq!(out[i][j], sum, "{:?}", kernel);
                    }
                }
            }
        }
    }
}
