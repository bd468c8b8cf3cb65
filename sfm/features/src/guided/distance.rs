//! Distances of one descriptor from some of a list.

use scene::Descriptor;

/// A descriptor in 16 bits, as products of pairs of numbers take it.
pub(super) type Widened = [i16; 128];

/// Writes the scalar product with each of the descriptors at the given positions to the last list, which is as long as that of the positions.
/// Exact, hence the same for every instruction set.
pub(super) type Products = fn(&Widened, &[Descriptor], &[u32], &mut [i32]);

/// The quickest that this machine has.
pub(super) fn best() -> Products {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has the instructions.
        return |row, descriptors, positions, out| unsafe { avx2(row, descriptors, positions, out) };
    }
    portable
}

/// The square of a descriptor's length.
pub(super) fn squared_norm(d: &Descriptor) -> i32 {
    d.iter().map(|&v| i32::from(v) * i32::from(v)).sum()
}

pub(super) fn portable(row: &Widened, descriptors: &[Descriptor], positions: &[u32], out: &mut [i32]) {
    for (to, &position) in out.iter_mut().zip(positions) {
        // Without checks of what cannot overflow: compilers turn it into multiply-and-add of pairs.
        let other = &descriptors[position as usize];
        *to = row.iter().zip(other).map(|(&x, &y)| i32::from(x).wrapping_mul(i32::from(y))).fold(0, i32::wrapping_add);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2(row: &Widened, descriptors: &[Descriptor], positions: &[u32], out: &mut [i32]) {
    use std::arch::x86_64::*;
    // SAFETY: 16 numbers of 16 bits from a multiple of 16 on, of 128.
    let mut wide = [_mm256_setzero_si256(); 8];
    for (k, to) in wide.iter_mut().enumerate() {
        *to = unsafe { _mm256_loadu_si256(row.as_ptr().add(16 * k).cast()) };
    }
    /// Eight parts of the product; a function would pass the row through memory.
    macro_rules! lanes {
        ($position:expr) => {{
            let other: &Descriptor = &descriptors[$position as usize];
            let mut sums = [_mm256_setzero_si256(); 2];
            for k in 0..8 {
                // SAFETY: 16 bytes from a multiple of 16 on, of 128.
                let bytes = unsafe { _mm_loadu_si128(other.as_ptr().add(16 * k).cast()) };
                sums[k % 2] = _mm256_add_epi32(sums[k % 2], _mm256_madd_epi16(wide[k], _mm256_cvtepu8_epi16(bytes)));
            }
            _mm256_add_epi32(sums[0], sums[1])
        }};
    }

    // Four at a time: their lanes are added in one tree.
    let (fours, rest) = positions.as_chunks::<4>();
    let (out_fours, out_rest) = out[..positions.len()].as_chunks_mut::<4>();
    for (to, four) in out_fours.iter_mut().zip(fours) {
        let (a, b, c, d) = (lanes!(four[0]), lanes!(four[1]), lanes!(four[2]), lanes!(four[3]));
        let pairs = _mm256_hadd_epi32(_mm256_hadd_epi32(a, b), _mm256_hadd_epi32(c, d));
        let sums = _mm_add_epi32(_mm256_castsi256_si128(pairs), _mm256_extracti128_si256::<1>(pairs));
        // SAFETY: four numbers of 32 bits.
        unsafe { _mm_storeu_si128(to.as_mut_ptr().cast(), sums) };
    }
    for (to, &position) in out_rest.iter_mut().zip(rest) {
        let sum = lanes!(position);
        let sum = _mm_add_epi32(_mm256_castsi256_si128(sum), _mm256_extracti128_si256::<1>(sum));
        let sum = _mm_hadd_epi32(sum, sum);
        *to = _mm_cvtsi128_si32(_mm_hadd_epi32(sum, sum));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn every_set_gives_the_scalar_product() {
        let mut random = SplitMix64(1);
        let mut descriptors: Vec<Descriptor> = (0..37).map(|_| std::array::from_fn(|_| random.next() as u8)).collect();
        descriptors.extend([[0; 128], [255; 128]]);
        let positions: Vec<u32> = (0..descriptors.len() as u32).map(|k| k * 7 % 39).collect();
        for row in [3, 37, 38] {
            let product =
                |&p: &u32| descriptors[p as usize].iter().zip(&descriptors[row]).map(|(&x, &y)| i32::from(x) * i32::from(y)).sum();
            let expected: Vec<i32> = positions.iter().map(product).collect();
            for products in [portable, best()] {
                // Every length of the last group.
                for len in 0..positions.len() {
                    let mut out = vec![-1; len];
                    products(&descriptors[row].map(i16::from), &descriptors, &positions[..len], &mut out);
                    assert_eq!(out, expected[..len]);
                }
            }
            assert_eq!(Some(squared_norm(&descriptors[row])), positions.iter().position(|&p| p as usize == row).map(|at| expected[at]));
        }
    }
}
