//! How distances are distributed: quantiles, histogram, fitted laws.

use crate::statistics::sum;
use serde::Serialize;
use std::f64::consts::SQRT_2;

/// Most values that a fit of Weibull's law is made with; of more, evenly spaced ranks are taken.
const MAX_FIT: usize = 50_000;

/// Counts of values in intervals of one width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Lower end of the first interval, metres.
    pub from_m: f64,
    /// Width of an interval, metres.
    pub width_m: f64,
    /// Values below the first interval.
    pub below: u64,
    /// Values in each interval: its lower end belongs to it.
    pub counts: Vec<u64>,
    /// Values above the last interval.
    pub above: u64,
}

impl Histogram {
    /// Counts `values` in `bins` intervals of `width` from `from` on.
    #[must_use]
    pub fn new(values: &[f64], from: f64, width: f64, bins: usize) -> Self {
        let (mut below, mut above, mut counts) = (0, 0, vec![0; bins]);
        for value in values {
            let place = ((value - from) / width).floor();
            if place < 0.0 {
                below += 1;
            } else if let Some(count) = counts.get_mut(place as usize) {
                *count += 1;
            } else {
                above += 1;
            }
        }
        Self { from_m: from, width_m: width, below, counts, above }
    }
}

/// A normal law, by mean and standard deviation of the values (maximum likelihood, with n - 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NormalFit {
    /// Mean, metres.
    pub mean_m: f64,
    /// Standard deviation, metres.
    pub sigma_m: f64,
    /// Largest difference of the fitted and the found cumulative shares (Kolmogorov's statistic).
    pub ks: f64,
}

impl NormalFit {
    /// Fits ascending values; `None` for fewer than two different ones.
    #[must_use]
    pub fn new(ascending: &[f64]) -> Option<Self> {
        let n = ascending.len() as f64;
        let mean_m = sum(ascending, |v| v) / n;
        let sigma_m = (sum(ascending, |v| (v - mean_m) * (v - mean_m)) / (n - 1.0)).sqrt();
        if !(sigma_m > 0.0 && sigma_m.is_finite()) {
            return None;
        }
        let ks = kolmogorov(ascending, |v| 0.5 * (1.0 + erf((v - mean_m) / (sigma_m * SQRT_2))));
        Some(Self { mean_m, sigma_m, ks })
    }
}

/// Weibull's law of unsigned distances, F(d) = 1 - exp(-(d / scale)^shape) (W. Weibull, *A statistical distribution function
/// of wide applicability*, Journal of Applied Mechanics, 1951).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WeibullFit {
    /// Shape k: 1 for an exponential law, 2 for Rayleigh's.
    pub shape: f64,
    /// Scale, metres: 63.2 % of the distances are smaller.
    pub scale_m: f64,
    /// Largest difference of the fitted and the found cumulative shares (Kolmogorov's statistic).
    pub ks: f64,
}

impl WeibullFit {
    /// The law of maximum likelihood for ascending values: k solves sum(d^k ln d) / sum(d^k) - 1 / k = mean(ln d), and
    /// scale^k = mean(d^k). Zeros have no logarithm and are left out. `None` for fewer than two different values.
    #[must_use]
    pub fn new(ascending: &[f64]) -> Option<Self> {
        let positive = &ascending[ascending.partition_point(|&d| d <= 0.0)..];
        let (&smallest, &largest) = (positive.first()?, positive.last()?);
        if smallest == largest || !largest.is_finite() {
            return None;
        }
        // Relative to the largest value no power overflows.
        let logs: Vec<f64> = positive.iter().map(|d| (d / largest).ln()).collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        let moments = |k: f64| {
            logs.iter().fold([0.0; 3], |[a, b, c], l| {
                let power = (k * l).exp();
                [a + power, b + power * l, c + power * l * l]
            })
        };
        let mut shape = 1.0;
        for _ in 0..100 {
            let [a, b, c] = moments(shape);
            let value = b / a - 1.0 / shape - mean;
            // The derivative is positive everywhere: the variance of ln d under the weights d^k, and 1 / k^2.
            let step = value / (c / a - (b / a) * (b / a) + 1.0 / (shape * shape));
            let next = (shape - step).clamp(shape / 4.0, shape * 4.0);
            let done = (next - shape).abs() <= 1e-12 * shape;
            shape = next;
            if done {
                break;
            }
        }
        let scale_m = largest * (moments(shape)[0] / logs.len() as f64).powf(1.0 / shape);
        let ks = kolmogorov(positive, |d| 1.0 - (-(d / scale_m).powf(shape)).exp());
        Some(Self { shape, scale_m, ks })
    }
}

fn kolmogorov(ascending: &[f64], share: impl Fn(f64) -> f64) -> f64 {
    // Every value would cost two transcendental functions; 10,000 ranks tell the statistic to 1e-4.
    let (n, stride) = (ascending.len() as f64, ascending.len().div_ceil(10_000));
    let difference = |i: usize| {
        let fitted = share(ascending[i]);
        (fitted - i as f64 / n).abs().max((fitted - (i + 1) as f64 / n).abs())
    };
    (0..ascending.len()).step_by(stride).map(difference).fold(0.0, f64::max)
}

/// Error function, to 1.5e-7 (Abramowitz & Stegun, *Handbook of mathematical functions*, 1964, 7.1.26).
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series = ((((1.061_405_429 * t - 1.453_152_027) * t + 1.421_413_741) * t - 0.284_496_736) * t + 0.254_829_592) * t;
    (1.0 - series * (-x * x).exp()).copysign(x)
}

/// Percentiles of |v - centre| over ascending values v, without another list: the two runs on either side of the centre are
/// merged from it outwards. `percents` ascend.
pub(crate) fn percentiles_about(ascending: &[f64], centre: f64, percents: &[f64]) -> Vec<f64> {
    let last = ascending.len().saturating_sub(1);
    let ranks = percents.iter().map(|p| p / 100.0 * last as f64).flat_map(|r| [r.floor() as usize, (r.floor() as usize + 1).min(last)]);
    let values = ranked(ascending, centre, &ranks.collect::<Vec<_>>());
    let one = |(i, pair): (usize, &[f64])| {
        let rank = percents[i] / 100.0 * last as f64;
        pair[0] + (rank - rank.floor()) * (pair[1] - pair[0])
    };
    values.chunks_exact(2).enumerate().map(one).collect()
}

/// At most [`MAX_FIT`] ascending values of |v|, of evenly spaced ranks.
pub(crate) fn fit_sample(ascending: &[f64]) -> Vec<f64> {
    let n = ascending.len();
    let count = n.min(MAX_FIT);
    ranked(ascending, 0.0, &(0..count).map(|i| ((2 * i + 1) as u128 * n as u128 / (2 * count) as u128) as usize).collect::<Vec<_>>())
}

/// |v - centre| at the given ranks. Ranks do not descend by more than one.
fn ranked(ascending: &[f64], centre: f64, ranks: &[usize]) -> Vec<f64> {
    let mut above = ascending.partition_point(|&v| v < centre);
    let mut below = above;
    let (mut done, mut last) = (0usize, [0.0; 2]);
    let mut out = Vec::with_capacity(ranks.len());
    for &rank in ranks {
        while done <= rank {
            let (up, down) = (ascending.get(above).map(|v| v - centre), below.checked_sub(1).map(|i| centre - ascending[i]));
            let take_up = match (up, down) {
                (Some(up), Some(down)) => up <= down,
                (up, _) => up.is_some(),
            };
            last = [last[1], if take_up { up.unwrap_or_default() } else { down.unwrap_or_default() }];
            if take_up {
                above += 1
            } else {
                below = below.saturating_sub(1)
            }
            done += 1;
        }
        out.push(last[usize::from(rank + 1 == done)]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::percentile;

    #[test]
    fn histogram_counts_every_value_once() {
        let h = Histogram::new(&[-1.0, -0.1, 0.0, 0.05, 0.1, 0.35, 0.4, 7.0], 0.0, 0.1, 4);
        assert_eq!((h.below, h.counts.as_slice(), h.above), (2, [2, 1, 0, 1].as_slice(), 2));
    }

    #[test]
    fn laws_are_found_again_from_their_quantiles() {
        let n = 20_000;
        let share = |i: usize| (i as f64 + 0.5) / n as f64;
        for (shape, scale) in [(0.7, 0.02), (1.0, 3.0), (2.0, 0.5)] {
            let values: Vec<f64> = (0..n).map(|i| scale * (-(1.0 - share(i)).ln()).powf(1.0 / shape)).collect();
            let fit = WeibullFit::new(&values).expect("a law");
            // Mid-ranks cut the tails: 1e-3 for 20,000 of them.
            assert!((fit.shape / shape - 1.0).abs() < 2e-3 && (fit.scale_m / scale - 1.0).abs() < 2e-3 && fit.ks < 1e-3, "{fit:?}");
        }
        // Twelve uniform values add up to a normal law's look; here the law itself, by its series of quantiles through erf.
        let quantile = |p: f64| {
            let (mut low, mut high) = (-8.0, 8.0);
            for _ in 0..60 {
                let middle = (low + high) / 2.0;
                if 0.5 * (1.0 + erf(middle / SQRT_2)) < p { low = middle } else { high = middle }
            }
            low
        };
        let values: Vec<f64> = (0..n).map(|i| 0.3 + 0.02 * quantile(share(i))).collect();
        let fit = NormalFit::new(&values).expect("a law");
        assert!((fit.mean_m - 0.3).abs() < 1e-6 && (fit.sigma_m / 0.02 - 1.0).abs() < 1e-3 && fit.ks < 1e-3, "{fit:?}");
        assert_eq!(
            (WeibullFit::new(&[0.0, 0.0]), WeibullFit::new(&[1.0]), NormalFit::new(&[2.0, 2.0]), NormalFit::new(&[])),
            (None, None, None, None)
        );
    }

    #[test]
    fn quantiles_about_a_centre_are_those_of_the_list() {
        let mut values: Vec<f64> = (0..501).map(|i| (f64::from(i) * 1.7).sin() + 0.2).collect();
        values.sort_unstable_by(f64::total_cmp);
        for centre in [0.0, 0.31, -5.0, 5.0] {
            let mut list: Vec<f64> = values.iter().map(|v| (v - centre).abs()).collect();
            list.sort_unstable_by(f64::total_cmp);
            let percents = [0.0, 25.0, 50.0, 99.3, 100.0];
            let found = percentiles_about(&values, centre, &percents);
            for (f, p) in found.iter().zip(percents) {
                assert!((f - percentile(&list, p)).abs() < 1e-15, "{centre} {p}");
            }
        }
        let mut list: Vec<f64> = values.iter().map(|v| v.abs()).collect();
        list.sort_unstable_by(f64::total_cmp);
        assert_eq!(fit_sample(&values), list);
    }
}
