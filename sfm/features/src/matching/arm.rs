//! The instruction sets of 64-bit Arm.

use super::lanes::{Lanes, four_bytes};
use scene::Descriptor;
use std::arch::aarch64::*;
use std::arch::asm;

/// Vectors of 128 bits: everything but the product, which each user of the macro gives.
macro_rules! lanes_128 {
    ($name:ident, |$sum:ident, $row:ident, $columns:ident| $product:expr) => {
        impl Lanes for $name {
            const WIDTH: usize = 4;
            const WORDS: usize = 32;
            const ROW_OFFSET: u32 = 0;
            type Vector = uint32x4_t;

            fn row_word(descriptor: &Descriptor, k: usize) -> u32 {
                four_bytes(descriptor, k)
            }

            fn column_word(descriptor: &Descriptor, k: usize) -> u32 {
                four_bytes(descriptor, k)
            }

            // SAFETY, for all of them: the caller's.
            #[inline(always)]
            unsafe fn splat(value: u32) -> uint32x4_t {
                unsafe { vdupq_n_u32(value) }
            }

            #[inline(always)]
            unsafe fn load(from: *const u32) -> uint32x4_t {
                unsafe { vld1q_u32(from) }
            }

            #[inline(always)]
            unsafe fn store(to: *mut u32, v: uint32x4_t) {
                unsafe { vst1q_u32(to, v) }
            }

            #[inline(always)]
            unsafe fn multiply_add($sum: uint32x4_t, $row: uint32x4_t, $columns: uint32x4_t) -> uint32x4_t {
                unsafe { $product }
            }

            #[inline(always)]
            unsafe fn sub_512(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
                unsafe { vsubq_u32(a, vshlq_n_u32::<9>(b)) }
            }

            #[inline(always)]
            unsafe fn add(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
                unsafe { vaddq_u32(a, b) }
            }

            #[inline(always)]
            unsafe fn min(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
                unsafe { vminq_u32(a, b) }
            }

            #[inline(always)]
            unsafe fn max(a: uint32x4_t, b: uint32x4_t) -> uint32x4_t {
                unsafe { vmaxq_u32(a, b) }
            }
        }
    };
}

/// The base of the architecture.
pub(super) struct Neon;
lanes_128!(Neon, |sum, row, columns| {
    let (row, columns) = (vreinterpretq_u8_u32(row), vreinterpretq_u8_u32(columns));
    // Products of bytes as 16 bits; pairs of them need 17.
    let low = vpaddlq_u16(vmull_u8(vget_low_u8(row), vget_low_u8(columns)));
    let high = vpaddlq_u16(vmull_high_u8(row, columns));
    vaddq_u32(sum, vpaddq_u32(low, high))
});

/// The dot product of Armv8.2.
pub(super) struct NeonDot;
lanes_128!(NeonDot, |sum, row, columns| {
    let mut sum = sum;
    // The intrinsic is not stable yet.
    asm!(
        ".arch_extension dotprod",
        "udot {sum:v}.4s, {row:v}.16b, {columns:v}.16b",
        sum = inout(vreg) sum, row = in(vreg) row, columns = in(vreg) columns,
        options(pure, nomem, nostack, preserves_flags),
    );
    sum
});
