//! Sums in a fixed order and percentiles.

use rayon::prelude::*;

/// Values a partial sum covers; partial sums are added in order, whatever thread computed them.
const CHUNK: usize = 4096;

/// Sum of `f` over the values.
pub(crate) fn sum(values: &[f64], f: impl Fn(f64) -> f64 + Sync) -> f64 {
    let parts: Vec<f64> = values.par_chunks(CHUNK).map(|chunk| chunk.iter().map(|&v| f(v)).sum()).collect();
    parts.iter().sum()
}

/// Percentile of ascending values, interpolated linearly between the two nearest ranks (method 7 of Hyndman & Fan, *Sample
/// quantiles in statistical packages*, The American Statistician, 1996); 0 for an empty list.
pub(crate) fn percentile(ascending: &[f64], percent: f64) -> f64 {
    let Some(last) = ascending.len().checked_sub(1) else { return 0.0 };
    let rank = percent / 100.0 * last as f64;
    let below = (rank.floor() as usize).min(last);
    let above = (below + 1).min(last);
    ascending[below] + (rank - below as f64) * (ascending[above] - ascending[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_interpolate() {
        let values = [1.0, 2.0, 4.0, 8.0];
        assert_eq!([0.0, 50.0, 100.0].map(|p| percentile(&values, p)), [1.0, 3.0, 8.0]);
        assert!((percentile(&values, 90.0) - (4.0 + 0.7 * 4.0)).abs() < 1e-12);
        assert_eq!((percentile(&[5.0], 95.0), percentile(&[], 50.0)), (5.0, 0.0));
    }

    #[test]
    fn sums_do_not_depend_on_threads() {
        let values: Vec<f64> = (0..50_000).map(|i| (f64::from(i) * 0.7).sin()).collect();
        let with = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a pool").install(|| sum(&values, |v| v));
        assert_eq!(with(1).to_bits(), with(2).to_bits());
    }
}
