//! Plain loops, for machines without one of the instruction sets.

use super::lanes::{Lanes, two_halves};
use scene::Descriptor;

/// Eight lanes of plain code, which the compiler turns into what the target guarantees.
pub(super) struct Portable;

const WIDTH: usize = 8;

#[inline(always)]
fn zip(a: [u32; WIDTH], b: [u32; WIDTH], f: impl Fn(u32, u32) -> u32) -> [u32; WIDTH] {
    let mut out = [0; WIDTH];
    for i in 0..WIDTH {
        out[i] = f(a[i], b[i]);
    }
    out
}

/// The product of two words of two 16-bit halves, signed, as the vector instructions of the base of x86-64 have it; entries are at most 255.
#[inline(always)]
fn product(a: u32, b: u32) -> u32 {
    let low = i32::from(a as i16) * i32::from(b as i16);
    let high = i32::from((a >> 16) as i16) * i32::from((b >> 16) as i16);
    (low + high) as u32
}

impl Lanes for Portable {
    const WIDTH: usize = WIDTH;
    const WORDS: usize = 64;
    const ROW_OFFSET: u32 = 0;
    type Vector = [u32; WIDTH];

    fn row_word(descriptor: &Descriptor, k: usize) -> u32 {
        two_halves(descriptor, k)
    }

    fn column_word(descriptor: &Descriptor, k: usize) -> u32 {
        two_halves(descriptor, k)
    }

    #[inline(always)]
    unsafe fn splat(value: u32) -> [u32; WIDTH] {
        [value; WIDTH]
    }

    #[inline(always)]
    unsafe fn load(from: *const u32) -> [u32; WIDTH] {
        // SAFETY: the caller's.
        unsafe { from.cast::<[u32; WIDTH]>().read_unaligned() }
    }

    #[inline(always)]
    unsafe fn store(to: *mut u32, v: [u32; WIDTH]) {
        // SAFETY: the caller's.
        unsafe { to.cast::<[u32; WIDTH]>().write_unaligned(v) }
    }

    #[inline(always)]
    unsafe fn multiply_add(sum: [u32; WIDTH], row: [u32; WIDTH], columns: [u32; WIDTH]) -> [u32; WIDTH] {
        zip(sum, zip(row, columns, product), u32::wrapping_add)
    }

    #[inline(always)]
    unsafe fn sub_512(a: [u32; WIDTH], b: [u32; WIDTH]) -> [u32; WIDTH] {
        zip(a, b, |a, b| a.wrapping_sub(b << 9))
    }

    #[inline(always)]
    unsafe fn add(a: [u32; WIDTH], b: [u32; WIDTH]) -> [u32; WIDTH] {
        zip(a, b, u32::wrapping_add)
    }

    #[inline(always)]
    unsafe fn min(a: [u32; WIDTH], b: [u32; WIDTH]) -> [u32; WIDTH] {
        zip(a, b, u32::min)
    }

    #[inline(always)]
    unsafe fn max(a: [u32; WIDTH], b: [u32; WIDTH]) -> [u32; WIDTH] {
        zip(a, b, u32::max)
    }
}
