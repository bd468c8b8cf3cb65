//! Morton codes: one number for three coordinates, so that a prefix names an enclosing cube.

/// Coordinates of a cell, a node or a brick.
pub(crate) type Coordinates = [u32; 3];

/// Interleaves the lower 21 bits of each coordinate.
pub(crate) fn encode(c: Coordinates) -> u64 {
    spread(c[0]) | spread(c[1]) << 1 | spread(c[2]) << 2
}

/// The inverse of [`encode`].
pub(crate) fn decode(code: u64) -> Coordinates {
    [compact(code), compact(code >> 1), compact(code >> 2)]
}

fn spread(v: u32) -> u64 {
    let mut x = u64::from(v) & 0x1f_ffff;
    x = (x | x << 32) & 0x001f_0000_0000_ffff;
    x = (x | x << 16) & 0x001f_0000_ff00_00ff;
    x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

fn compact(code: u64) -> u32 {
    let mut x = code & 0x1249_2492_4924_9249;
    x = (x | x >> 2) & 0x10c3_0c30_c30c_30c3;
    x = (x | x >> 4) & 0x100f_00f0_0f00_f00f;
    x = (x | x >> 8) & 0x001f_0000_ff00_00ff;
    x = (x | x >> 16) & 0x001f_0000_0000_ffff;
    ((x | x >> 32) & 0x1f_ffff) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_decoded_and_prefixes_are_parents() {
        for c in [[0, 0, 0], [1, 2, 3], [0x1f_ffff, 0, 0x15_5555], [12345, 654_321, 99]] {
            assert_eq!(decode(encode(c)), c);
            assert_eq!(encode(c) >> 3, encode(c.map(|v| v >> 1)));
        }
    }
}
