//! Otsu's threshold.

/// Split of a histogram in two classes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Otsu {
    /// Values up to this one are dark, values above are bright.
    pub threshold: u8,
    /// Share of the variance that lies between the two classes, 0..=1: near 1 for two sharp modes, 0.75 for an even spread, 0 for one value.
    pub separability: f64,
    /// Mean of the dark class.
    pub dark_mean: f64,
    /// Mean of the bright class.
    pub bright_mean: f64,
}

/// The threshold that maximises the variance between two classes: sigma_B^2 = n0 n1 (m1 - m0)^2 / n^2.
///
/// Otsu, *A threshold selection method from gray-level histograms*, IEEE Trans. Systems, Man and Cybernetics, 1979. Where several neighbouring
/// thresholds are equal (no pixel lies between the modes), their middle. `None` for a histogram with fewer than two values in use.
#[must_use]
pub fn otsu(histogram: &[u64; 256]) -> Option<Otsu> {
    let total: u64 = histogram.iter().sum();
    let weighted = |values: &[u64]| values.iter().enumerate().map(|(v, &n)| v as u64 * n).sum::<u64>();
    let sum = weighted(histogram);
    let (mut n0, mut s0) = (0u64, 0u64);
    let mut best: Option<(f64, usize, usize)> = None;
    for (value, &n) in histogram.iter().enumerate() {
        n0 += n;
        s0 += value as u64 * n;
        if n0 == 0 || n0 == total {
            continue;
        }
        let n1 = total - n0;
        let difference = (sum - s0) as f64 / n1 as f64 - s0 as f64 / n0 as f64;
        let between = n0 as f64 * n1 as f64 * difference * difference;
        match &mut best {
            // Empty bins repeat the same counts, so that equality is exact.
            Some((most, _, last)) if between == *most && *last + 1 == value => *last = value,
            Some((most, ..)) if between <= *most => {}
            _ => best = Some((between, value, value)),
        }
    }
    let (between, first, last) = best?;
    let threshold = (first + last) / 2;
    let mean = sum as f64 / total as f64;
    let variance = histogram.iter().enumerate().map(|(v, &n)| n as f64 * (v as f64 - mean).powi(2)).sum::<f64>() / total as f64;
    let n0: u64 = histogram[..=threshold].iter().sum();
    let s0 = weighted(&histogram[..=threshold]);
    Some(Otsu {
        threshold: threshold as u8,
        separability: between / (total as f64 * total as f64) / variance,
        dark_mean: s0 as f64 / n0 as f64,
        bright_mean: (sum - s0) as f64 / (total - n0) as f64,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Within-class variance of every threshold from the definition, in integers scaled by the class sizes where possible.
    fn naive(histogram: &[u64; 256]) -> u8 {
        let within = |t: usize| {
            let class = |range: std::ops::Range<usize>| {
                let n: f64 = range.clone().map(|v| histogram[v] as f64).sum();
                let mean = range.clone().map(|v| v as f64 * histogram[v] as f64).sum::<f64>() / n;
                range.map(|v| histogram[v] as f64 * (v as f64 - mean).powi(2)).sum::<f64>()
            };
            class(0..t + 1) + class(t + 1..256)
        };
        let value = |t: &usize| if within(*t).is_nan() { f64::INFINITY } else { within(*t) };
        (0..255).min_by(|a, b| value(a).total_cmp(&value(b))).map_or(0, |t| t as u8)
    }

    #[test]
    fn agrees_with_the_least_variance_within() {
        for seed in 0..20u32 {
            let mut histogram = [0u64; 256];
            for (i, n) in histogram.iter_mut().enumerate() {
                // Two triangular modes over noise: no empty bins, one best threshold.
                let mode = |centre: i32, height: i32| (height - 3 * (i as i32 - centre).abs()).max(0) as u64;
                *n = 1
                    + u64::from((i as u32 + seed * 977).wrapping_mul(2_654_435_761) >> 29)
                    + mode(60 + seed as i32, 90)
                    + mode(190, 40 + 5 * seed as i32);
            }
            assert_eq!(otsu(&histogram).expect("many values").threshold, naive(&histogram), "seed {seed}");
        }
    }

    #[test]
    fn two_values_are_separated_in_the_middle() {
        let mut histogram = [0; 256];
        histogram[40] = 300;
        histogram[80] = 100;
        let found = otsu(&histogram).expect("two values");
        assert_eq!((found.threshold, found.dark_mean, found.bright_mean), (59, 40.0, 80.0));
        assert!((found.separability - 1.0).abs() < 1e-12);
    }

    #[test]
    fn an_even_spread_is_three_quarters_separable() {
        // Variance of a uniform distribution: w^2/12; between its halves: (w/2)^2/4.
        assert!((otsu(&[7; 256]).expect("many values").separability - 0.75).abs() < 1e-4);
    }

    #[test]
    fn one_value_or_none_has_no_threshold() {
        let mut histogram = [0; 256];
        assert_eq!(otsu(&histogram), None);
        histogram[255] = 9;
        assert_eq!(otsu(&histogram), None);
    }
}
