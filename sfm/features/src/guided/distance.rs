//! Distances of one descriptor from a run of others.

use scene::Descriptor;

/// A descriptor in the form in which it is compared with many.
pub(super) type Widened = [i16; 128];

/// Writes the squared distance of each of `run` to `out`, which is as long. Exact, hence the same for every instruction set.
pub(super) type Distances = fn(&Widened, &[Descriptor], &mut [u32]);

/// The quickest that this machine has.
pub(super) fn best() -> Distances {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has the instructions.
        return |row, run, out| unsafe { avx2(row, run, out) };
    }
    portable
}

pub(super) fn portable(row: &Widened, run: &[Descriptor], out: &mut [u32]) {
    for (to, other) in out.iter_mut().zip(run) {
        // In 16 bits until the squares are added, and without checks of what cannot overflow: compilers turn it into multiply-and-add of pairs.
        let square = |(&x, &y): (&i16, &u8)| {
            let d = i32::from(x.wrapping_sub(i16::from(y)));
            d.wrapping_mul(d)
        };
        *to = row.iter().zip(other).map(square).fold(0, i32::wrapping_add) as u32;
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(row: &Widened, run: &[Descriptor], out: &mut [u32]) {
    use std::arch::x86_64::*;
    // SAFETY: 16 numbers of 16 bits from a multiple of 16 on, of 128.
    let row: [__m256i; 8] = std::array::from_fn(|k| unsafe { _mm256_loadu_si256(row.as_ptr().add(16 * k).cast()) });
    for (to, other) in out.iter_mut().zip(run) {
        let mut sums = [_mm256_setzero_si256(); 2];
        for k in 0..8 {
            // SAFETY: 16 bytes from a multiple of 16 on, of 128.
            let bytes = unsafe { _mm_loadu_si128(other.as_ptr().add(16 * k).cast()) };
            let d = _mm256_sub_epi16(row[k], _mm256_cvtepu8_epi16(bytes));
            sums[k % 2] = _mm256_add_epi32(sums[k % 2], _mm256_madd_epi16(d, d));
        }
        let sum = _mm256_add_epi32(sums[0], sums[1]);
        let sum = _mm_add_epi32(_mm256_castsi256_si128(sum), _mm256_extracti128_si256::<1>(sum));
        let sum = _mm_add_epi32(sum, _mm_shuffle_epi32::<0b00_00_11_10>(sum));
        let sum = _mm_add_epi32(sum, _mm_shuffle_epi32::<0b00_00_00_01>(sum));
        *to = _mm_cvtsi128_si32(sum).cast_unsigned();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn every_set_gives_the_sum_of_squares() {
        let mut random = SplitMix64(1);
        let mut descriptors: Vec<Descriptor> = (0..37).map(|_| std::array::from_fn(|_| random.next() as u8)).collect();
        descriptors.extend([[0; 128], [255; 128]]);
        for row in [descriptors[3], [0; 128], [255; 128]] {
            let expected: Vec<u32> =
                descriptors.iter().map(|d| d.iter().zip(&row).map(|(&x, &y)| u32::from(x.abs_diff(y)).pow(2)).sum()).collect();
            for distances in [portable, best()] {
                let mut out = vec![0; descriptors.len()];
                distances(&row.map(i16::from), &descriptors, &mut out);
                assert_eq!(out, expected);
            }
        }
    }
}
