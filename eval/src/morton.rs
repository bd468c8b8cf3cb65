//! Z-order: neighbours in space become neighbours in a list (G. M. Morton, IBM, 1966).

use nalgebra::Point3;
use rayon::prelude::*;

/// Indices of the points in the order of a Morton curve through their bounding box, 21 bits an axis; equal codes keep the
/// order of the list.
pub(crate) fn order(points: &[Point3<f64>]) -> Vec<u32> {
    let (min, max) = bounds(points);
    let scale = (max - min).map(|extent| if extent > 0.0 { f64::from((1u32 << 21) - 1) / extent } else { 0.0 });
    let mut keys: Vec<(u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(i, p)| {
            let cell = (p - min).component_mul(&scale);
            (spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2, i as u32)
        })
        .collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|k| k.1).collect()
}

/// Smallest and largest coordinates; the origin for an empty list.
pub(crate) fn bounds(points: &[Point3<f64>]) -> (Point3<f64>, Point3<f64>) {
    let first = points.first().copied().unwrap_or_else(Point3::origin);
    points.iter().fold((first, first), |(min, max), p| (min.inf(p), max.sup(p)))
}

/// Two zero bits after each of the lower 21 bits.
fn spread(value: u64) -> u64 {
    let mut v = value & 0x1f_ffff;
    v = (v | v << 32) & 0x001f_0000_0000_ffff;
    v = (v | v << 16) & 0x001f_0000_ff00_00ff;
    v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
    v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
    (v | v << 2) & 0x1249_2492_4924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_bits_stay_apart() {
        for bit in 0..21 {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(0x1f_ffff), (0..21).map(|b| 1u64 << (3 * b)).sum::<u64>());
    }

    #[test]
    fn corners_of_a_cube_come_in_z_order() {
        let corners: Vec<_> = (0..8).map(|i| Point3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).rev().collect();
        assert_eq!(order(&corners), [7, 6, 5, 4, 3, 2, 1, 0]);
        assert_eq!(order(&[Point3::origin(); 3]), [0, 1, 2]);
    }
}
