//! Points without company.

use nalgebra::Point3;

/// For every point, whether at least `min_neighbours` others lie within its radius.
///
/// Radii above the 95 % quantile count as that, which bounds the work.
pub(crate) fn has_company(points: &[Point3<f64>], radii: &[f64], min_neighbours: usize) -> Vec<bool> {
    if points.is_empty() || min_neighbours == 0 {
        return vec![true; points.len()];
    }
    let mut sorted_radii = radii.to_vec();
    sorted_radii.sort_unstable_by(f64::total_cmp);
    let cell = sorted_radii[(sorted_radii.len() - 1) * 95 / 100].max(f64::MIN_POSITIVE);
    let key = |p: &Point3<f64>| [p.x, p.y, p.z].map(|v| (v / cell).floor().clamp(-9e15, 9e15) as i64);
    let mut order: Vec<([i64; 3], usize)> = points.iter().enumerate().map(|(i, p)| (key(p), i)).collect();
    order.sort_unstable();
    // Points of three cells in a row along z are contiguous.
    let run = |[x, y, z]: [i64; 3]| {
        let start = order.partition_point(|(k, _)| *k < [x, y, z - 1]);
        order[start..].iter().take_while(move |(k, _)| *k <= [x, y, z + 1])
    };
    let accompanied = |i: usize| {
        let (p, k, r2) = (&points[i], key(&points[i]), radii[i].min(cell).powi(2));
        // The point itself is always among them.
        let mut missing = min_neighbours + 1;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for &(_, j) in run([k[0] + dx, k[1] + dy, k[2]]) {
                    missing -= usize::from((points[j] - p).norm_squared() <= r2);
                    if missing == 0 {
                        return true;
                    }
                }
            }
        }
        false
    };
    use rayon::prelude::*;
    (0..points.len()).into_par_iter().map(accompanied).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_brute_force_count() {
        let mut state = 1u64;
        let mut unit = || {
            // Knuth's linear congruential generator: its upper bits are good enough to scatter points.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / 16_777_216.0 - 0.5
        };
        let points: Vec<_> = (0..500).map(|_| Point3::new(unit(), unit(), unit())).collect();
        let radii: Vec<_> = (0..500).map(|i| if i % 2 == 0 { 0.1 } else { 0.15 }).collect();
        let brute: Vec<_> =
            points.iter().zip(&radii).map(|(p, r)| points.iter().filter(|q| (*q - p).norm_squared() <= r * r).count() > 3).collect();
        let found = has_company(&points, &radii, 3);
        assert_eq!(found, brute);
        assert!(found.iter().any(|&f| f) && found.iter().any(|&f| !f));
        assert!(has_company(&[], &[], 3).is_empty());
    }
}
