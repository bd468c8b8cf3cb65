//! What the scan needs from an instruction set.

use scene::Descriptor;

/// Vectors of unsigned 32-bit lanes, and sums of products of bytes into them.
///
/// A descriptor is packed as `WORDS` words of 32 bits, each with a few of its entries; a product of words is the dot product of
/// these entries. All arithmetic wraps.
///
/// # Safety
/// The methods may only be called where the machine has the instructions of the implementor, and, for vectors to stay in registers,
/// within a function that enables them.
pub(super) trait Lanes {
    /// Number of lanes.
    const WIDTH: usize;
    /// Number of words of a packed descriptor.
    const WORDS: usize;
    /// Subtracted from the entries of a row before they are packed, where the instructions multiply signed by unsigned bytes.
    const ROW_OFFSET: u32;
    /// A vector.
    type Vector: Copy;

    /// Word `k` of a row.
    fn row_word(descriptor: &Descriptor, k: usize) -> u32;
    /// Word `k` of a column.
    fn column_word(descriptor: &Descriptor, k: usize) -> u32;

    /// All lanes the same.
    unsafe fn splat(value: u32) -> Self::Vector;
    /// From memory of any alignment.
    unsafe fn load(from: *const u32) -> Self::Vector;
    /// To memory of any alignment.
    unsafe fn store(to: *mut u32, v: Self::Vector);
    /// `sum` + products of the words of a row and of columns.
    unsafe fn multiply_add(sum: Self::Vector, row: Self::Vector, columns: Self::Vector) -> Self::Vector;
    /// `a - 512 b`.
    unsafe fn sub_512(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// `a + b`.
    unsafe fn add(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The smaller of each lane, unsigned.
    unsafe fn min(a: Self::Vector, b: Self::Vector) -> Self::Vector;
    /// The larger of each lane, unsigned.
    unsafe fn max(a: Self::Vector, b: Self::Vector) -> Self::Vector;
}

/// Four bytes as they are.
pub(super) fn four_bytes(d: &Descriptor, k: usize) -> u32 {
    u32::from_le_bytes([d[4 * k], d[4 * k + 1], d[4 * k + 2], d[4 * k + 3]])
}

/// Two entries, each widened to 16 bits.
pub(super) fn two_halves(d: &Descriptor, k: usize) -> u32 {
    u32::from(d[2 * k]) | u32::from(d[2 * k + 1]) << 16
}
