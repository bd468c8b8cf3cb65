//! Whether as many matches could agree by chance.

/// Decimal logarithm of the number of epipolar geometries that `inliers` out of `tentative` random matches are expected to agree with as
/// well, beyond the `sample` that defines it: the number of false alarms of Moisan & Stival, *A probabilistic criterion to detect rigid point
/// matches between two images*, IJCV 2004. `chance` is the probability for a random match to agree. Below 0 the agreement means something.
pub(super) fn log10_false_alarms(tentative: usize, inliers: usize, sample: usize, models: usize, chance: f64) -> f64 {
    if inliers <= sample {
        return f64::INFINITY;
    }
    let trials = (models * (tentative - sample)) as f64;
    trials.log10()
        + log10_binomial(tentative, inliers)
        + log10_binomial(inliers, sample)
        + (inliers - sample) as f64 * chance.clamp(f64::MIN_POSITIVE, 1.0).log10()
}

fn log10_binomial(n: usize, k: usize) -> f64 {
    let k = k.min(n - k);
    (0..k).map(|i| ((n - i) as f64 / (i + 1) as f64).log10()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn binomials() {
        for (n, k, value) in [(5, 2, 10.0f64), (10, 0, 1.0), (10, 10, 1.0), (40, 20, 137_846_528_820.0)] {
            assert!((log10_binomial(n, k) - value.log10()).abs() < 1e-12);
        }
    }

    #[test]
    fn a_few_of_many_mean_nothing_most_of_a_few_do() {
        let alarms = |tentative, inliers| log10_false_alarms(tentative, inliers, 7, 3, 0.01);
        assert!(alarms(300, 20) > 0.0 && alarms(1000, 40) > 0.0);
        assert!(alarms(30, 20) < 0.0 && alarms(300, 60) < 0.0 && alarms(1000, 100) < 0.0);
        assert!(alarms(7, 7) > 0.0 && alarms(20, 5) > 0.0);
    }
}
