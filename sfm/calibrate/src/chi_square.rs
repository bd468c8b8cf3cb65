//! The chi-square distribution.

/// Probability that a chi-square variable of `freedom` degrees of freedom is above `value`: the regularised upper incomplete gamma function,
/// by its series and, beyond the mean, its continued fraction (Abramowitz & Stegun 6.5.29, 6.5.31), to 1e-12.
#[must_use]
pub fn chi_square_above(value: f64, freedom: usize) -> f64 {
    if freedom == 0 || value <= 0.0 {
        return 1.0;
    }
    let (a, x) = (freedom as f64 / 2.0, value / 2.0);
    let front = (a * x.ln() - x - ln_gamma(freedom)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return (1.0 - front * sum).max(0.0);
    }
    // Lentz's evaluation.
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut fraction = d;
    for i in 1..10_000 {
        let i = f64::from(i);
        let numerator = i * (a - i);
        b += 2.0;
        d = 1.0 / (numerator * d + b);
        c = b + numerator / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-16 {
            break;
        }
    }
    front * fraction
}

/// Logarithm of the gamma function at half a whole number: products from 1 or the root of pi.
fn ln_gamma(twice: usize) -> f64 {
    let (mut at, mut sum) = if twice.is_multiple_of(2) { (1.0, 0.0) } else { (0.5, 0.5 * std::f64::consts::PI.ln()) };
    while 2.0 * at < twice as f64 {
        sum += f64::ln(at);
        at += 1.0;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_values() {
        // Two degrees of freedom have a closed form; the others stand in every table.
        for x in [0.1, 1.0, 5.0, 40.0] {
            assert!((chi_square_above(x, 2) - (-x / 2.0).exp()).abs() < 1e-12);
        }
        for (x, freedom, p) in
            [(3.841_458_82, 1, 0.05), (6.634_896_6, 1, 0.01), (18.307_038_05, 10, 0.05), (0.710_723, 4, 0.95), (124.342_113_4, 100, 0.05)]
        {
            assert!((chi_square_above(x, freedom) - p).abs() < 1e-7, "{x} {freedom}: {}", chi_square_above(x, freedom));
        }
        assert_eq!(chi_square_above(0.0, 3), 1.0);
        assert!(chi_square_above(5000.0, 10) < 1e-300);
    }
}
