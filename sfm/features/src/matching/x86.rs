//! The instruction sets of x86-64.

use super::lanes::{Lanes, four_bytes, two_halves};
use scene::Descriptor;
use std::arch::x86_64::*;

/// Vectors of 256 bits: everything but the product, which each user of the macro gives.
macro_rules! lanes_256 {
    ($name:ident, $words:literal, $offset:literal, $row_word:expr, $column_word:expr, |$sum:ident, $row:ident, $columns:ident| $product:expr) => {
        impl Lanes for $name {
            const WIDTH: usize = 8;
            const WORDS: usize = $words;
            const ROW_OFFSET: u32 = $offset;
            type Vector = __m256i;

            fn row_word(descriptor: &Descriptor, k: usize) -> u32 {
                $row_word(descriptor, k)
            }

            fn column_word(descriptor: &Descriptor, k: usize) -> u32 {
                $column_word(descriptor, k)
            }

            // SAFETY, for all of them: the caller's.
            #[inline(always)]
            unsafe fn splat(value: u32) -> __m256i {
                unsafe { _mm256_set1_epi32(value.cast_signed()) }
            }

            #[inline(always)]
            unsafe fn load(from: *const u32) -> __m256i {
                unsafe { _mm256_loadu_si256(from.cast()) }
            }

            #[inline(always)]
            unsafe fn store(to: *mut u32, v: __m256i) {
                unsafe { _mm256_storeu_si256(to.cast(), v) }
            }

            #[inline(always)]
            unsafe fn multiply_add($sum: __m256i, $row: __m256i, $columns: __m256i) -> __m256i {
                unsafe { $product }
            }

            #[inline(always)]
            unsafe fn sub_512(a: __m256i, b: __m256i) -> __m256i {
                unsafe { _mm256_sub_epi32(a, _mm256_slli_epi32::<9>(b)) }
            }

            #[inline(always)]
            unsafe fn add(a: __m256i, b: __m256i) -> __m256i {
                unsafe { _mm256_add_epi32(a, b) }
            }

            #[inline(always)]
            unsafe fn min(a: __m256i, b: __m256i) -> __m256i {
                unsafe { _mm256_min_epu32(a, b) }
            }

            #[inline(always)]
            unsafe fn max(a: __m256i, b: __m256i) -> __m256i {
                unsafe { _mm256_max_epu32(a, b) }
            }
        }
    };
}

/// As [`lanes_256`] with 512 bits.
macro_rules! lanes_512 {
    ($name:ident, $words:literal, $offset:literal, $row_word:expr, $column_word:expr, |$sum:ident, $row:ident, $columns:ident| $product:expr) => {
        impl Lanes for $name {
            const WIDTH: usize = 16;
            const WORDS: usize = $words;
            const ROW_OFFSET: u32 = $offset;
            type Vector = __m512i;

            fn row_word(descriptor: &Descriptor, k: usize) -> u32 {
                $row_word(descriptor, k)
            }

            fn column_word(descriptor: &Descriptor, k: usize) -> u32 {
                $column_word(descriptor, k)
            }

            // SAFETY, for all of them: the caller's.
            #[inline(always)]
            unsafe fn splat(value: u32) -> __m512i {
                unsafe { _mm512_set1_epi32(value.cast_signed()) }
            }

            #[inline(always)]
            unsafe fn load(from: *const u32) -> __m512i {
                unsafe { _mm512_loadu_si512(from.cast()) }
            }

            #[inline(always)]
            unsafe fn store(to: *mut u32, v: __m512i) {
                unsafe { _mm512_storeu_si512(to.cast(), v) }
            }

            #[inline(always)]
            unsafe fn multiply_add($sum: __m512i, $row: __m512i, $columns: __m512i) -> __m512i {
                unsafe { $product }
            }

            #[inline(always)]
            unsafe fn sub_512(a: __m512i, b: __m512i) -> __m512i {
                unsafe { _mm512_sub_epi32(a, _mm512_slli_epi32::<9>(b)) }
            }

            #[inline(always)]
            unsafe fn add(a: __m512i, b: __m512i) -> __m512i {
                unsafe { _mm512_add_epi32(a, b) }
            }

            #[inline(always)]
            unsafe fn min(a: __m512i, b: __m512i) -> __m512i {
                unsafe { _mm512_min_epu32(a, b) }
            }

            #[inline(always)]
            unsafe fn max(a: __m512i, b: __m512i) -> __m512i {
                unsafe { _mm512_max_epu32(a, b) }
            }
        }
    };
}

/// Bytes with 128 taken off, as signed: `x - 128` in two's complement is `x` with its highest bit turned.
fn four_signed_bytes(d: &Descriptor, k: usize) -> u32 {
    four_bytes(d, k) ^ 0x8080_8080
}

/// AVX2. Multiplies 16-bit numbers: its product of bytes saturates.
pub(super) struct Avx2;
lanes_256!(Avx2, 64, 0, two_halves, two_halves, |sum, row, columns| _mm256_add_epi32(sum, _mm256_madd_epi16(row, columns)));

/// AVX-VNNI: the products of bytes without AVX-512.
pub(super) struct AvxVnni;
lanes_256!(AvxVnni, 32, 128, four_signed_bytes, four_bytes, |sum, row, columns| _mm256_dpbusd_avx_epi32(sum, columns, row));

/// AVX-512 F and BW.
pub(super) struct Avx512Bw;
lanes_512!(Avx512Bw, 64, 0, two_halves, two_halves, |sum, row, columns| _mm512_add_epi32(sum, _mm512_madd_epi16(row, columns)));

/// AVX-512 F and VNNI.
pub(super) struct Avx512Vnni;
lanes_512!(Avx512Vnni, 32, 128, four_signed_bytes, four_bytes, |sum, row, columns| _mm512_dpbusd_epi32(sum, columns, row));
