//! Order along a Hilbert curve: neighbours in the list are neighbours in space, without the jumps of a Z-order.

use nalgebra::Point3;
use rayon::prelude::*;

/// Bits of an axis. 1024 cells an axis tell neighbours apart well enough, and a code shares a word with an index.
const BITS: u32 = 10;

/// Indices of the points in the order of a Hilbert curve through their bounding box; equal codes keep the order of the
/// list. At most 2^32 points.
pub(crate) fn order(points: &[Point3<f64>]) -> Vec<u32> {
    let (min, max) = bounds(points);
    let cells = f64::from((1u32 << BITS) - 1);
    let scale = (max - min).map(|extent| if extent > 0.0 { cells / extent } else { 0.0 });
    let keys = points
        .par_iter()
        .enumerate()
        .map(|(i, p)| {
            let cell = (p - min).component_mul(&scale);
            u64::from(code([cell.x as u32, cell.y as u32, cell.z as u32])) << 32 | i as u64
        })
        .collect();
    sorted(keys).into_iter().map(|key| key as u32).collect()
}

/// Ascending by the upper half, equal ones in the order of the list: three rounds of a radix sort.
fn sorted(mut keys: Vec<u64>) -> Vec<u64> {
    let mut other = vec![0; keys.len()];
    for shift in [32, 42, 52] {
        let digit = |key: u64| (key >> shift) as usize & 0x3ff;
        let mut next = [0u32; 1 << BITS];
        for &key in &keys {
            next[digit(key)] += 1;
        }
        let mut before = 0;
        for count in &mut next {
            before += std::mem::replace(count, before);
        }
        for &key in &keys {
            let place = &mut next[digit(key)];
            other[*place as usize] = key;
            *place += 1;
        }
        std::mem::swap(&mut keys, &mut other);
    }
    keys
}

/// Smallest and largest coordinates; the origin for an empty list.
pub(crate) fn bounds(points: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    let first = points.first().copied().unwrap_or_else(Point3::origin);
    points.iter().fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)))
}

/// Place of a cell on the curve (J. Skilling, *Programming the Hilbert curve*, AIP Conference Proceedings 707, 2004).
fn code(cell: [u32; 3]) -> u32 {
    let mut x = cell;
    let mut bit = 1 << (BITS - 1);
    while bit > 1 {
        let below = bit - 1;
        for i in 0..3 {
            // Without branches: where the bit is set the lower bits of the first axis are inverted, else exchanged.
            let set = 0u32.wrapping_sub(u32::from(x[i] & bit != 0));
            let exchange = (x[0] ^ x[i]) & below & !set;
            x[0] ^= (below & set) | exchange;
            x[i] ^= exchange;
        }
        bit >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut turn = 0;
    for i in 1..BITS {
        turn ^= 0u32.wrapping_sub(x[2] >> i & 1) & ((1 << i) - 1);
    }
    let x = x.map(|v| spread(v ^ turn));
    x[0] << 2 | x[1] << 1 | x[2]
}

/// Two zero bits after each of the lower ten bits.
fn spread(value: u32) -> u32 {
    let v = value & 0x3ff;
    let v = (v | v << 16) & 0x0300_00ff;
    let v = (v | v << 8) & 0x0300_f00f;
    let v = (v | v << 4) & 0x030c_30c3;
    (v | v << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_on_the_curve_are_neighbours_in_space() {
        // The first 32^3 codes fill a cube, each one step from the last.
        let mut cells: Vec<(u32, [u32; 3])> = Vec::new();
        for x in 0..32 {
            for y in 0..32 {
                cells.extend((0..32).map(|z| (code([x, y, z]), [x, y, z])));
            }
        }
        cells.sort_unstable();
        for (i, pair) in cells.windows(2).enumerate() {
            assert_eq!(pair[0].0 as usize, i);
            let step: u32 = (0..3).map(|k| pair[0].1[k].abs_diff(pair[1].1[k])).sum();
            assert_eq!(step, 1, "{pair:?}");
        }
    }

    #[test]
    fn every_point_comes_once_and_equal_ones_in_order() {
        let points: Vec<_> = (0..1000).map(|i| Point3::new(f64::from(i * 37 % 100), f64::from(i % 7), 0.0)).collect();
        let mut order = order(&points);
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(i, &o)| i == o as usize));
        assert_eq!(super::order(&[Point3::origin(); 3]), [0, 1, 2]);
        assert!(super::order(&[]).is_empty());
    }
}
