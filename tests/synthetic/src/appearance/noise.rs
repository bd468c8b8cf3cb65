//! Noise in space that looks alike nowhere.

use nalgebra::Vector3;

/// Wavelength of the coarsest octave, metres.
const COARSEST_M: f32 = 0.5;
/// Octaves down to 1 mm.
const OCTAVES: u32 = 9;

/// A hash of a lattice point: two rounds of multiply and shift (the finaliser of MurmurHash3, Appleby 2011).
#[inline(always)]
fn hash(mut h: u32) -> u32 {
    h = (h ^ (h >> 16)).wrapping_mul(0x85EB_CA6B);
    h = (h ^ (h >> 13)).wrapping_mul(0xC2B2_AE35);
    h ^ (h >> 16)
}

/// Gradient noise in about -1..1 with a wavelength of 1 (Perlin, *Improving noise*, SIGGRAPH 2002); the gradients are drawn from a
/// cube.
#[inline(always)]
pub(crate) fn gradient(p: &Vector3<f32>, seed: u32) -> f32 {
    let floor = [floor(p.x), floor(p.y), floor(p.z)];
    let f: [f32; 3] = std::array::from_fn(|k| p[k] - floor[k] as f32);
    let ease = f.map(|t| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let lattice = |k: usize, prime: u32| {
        let first = (floor[k] as u32).wrapping_mul(prime);
        [first, first.wrapping_add(prime)]
    };
    let (hx, hy, hz) = (lattice(0, 0x9E37_79B1), lattice(1, 0x85EB_CA77), lattice(2, 0xC2B2_AE3D));
    let mut values = [0.0f32; 8];
    for (c, value) in values.iter_mut().enumerate() {
        let (i, j, k) = (c & 1, c >> 1 & 1, c >> 2);
        let h = hash(hx[i].wrapping_add(hy[j]).wrapping_add(hz[k]) ^ seed);
        // Ten bits of each component.
        let component = |shift: u32| ((h >> shift & 0x3FF) as i32 - 512) as f32;
        *value = component(0) * (f[0] - i as f32) + component(10) * (f[1] - j as f32) + component(20) * (f[2] - k as f32);
    }
    let between = |a: f32, b: f32, t: f32| a + t * (b - a);
    let along_x = |c: usize| between(values[c], values[c + 1], ease[0]);
    between(between(along_x(0), along_x(2), ease[1]), between(along_x(4), along_x(6), ease[1]), ease[2]) * (1.6 / 512.0)
}

/// The whole number below: quicker than the call that `f32::floor` is without newer instructions.
#[inline(always)]
fn floor(v: f32) -> i32 {
    let whole = v as i32;
    whole - i32::from((whole as f32) > v)
}

/// Octaves of noise in about -1..1, each of half the wavelength and a share `roughness` of the strength of the last; octaves finer
/// than two footprints fade out, as a lens would blur them.
#[inline(always)]
pub(super) fn fractal(p: &Vector3<f32>, footprint_m: f32, roughness: f32, seed: u32) -> f32 {
    let (mut sum, mut strength, mut wavelength) = (0.0, 1.0, COARSEST_M);
    for octave in 0..OCTAVES {
        let share = (wavelength / footprint_m - 1.4) * (1.0 / 1.2);
        if share <= 0.0 {
            break;
        }
        // Shifted octave by octave, so that lattice planes do not fall together.
        let shifted = p / wavelength + Vector3::new(0.37, 0.61, 0.13) * octave as f32;
        sum += share.min(1.0) * strength * gradient(&shifted, seed.wrapping_add(octave));
        wavelength *= 0.5;
        strength *= roughness;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_balanced_continuous_and_bounded() {
        let (mut sum, mut square, n) = (0.0f64, 0.0f64, 20_000);
        for i in 0..n {
            let p = Vector3::new(0.173 * i as f32, 0.311 * (i % 97) as f32, -0.237 * (i % 31) as f32);
            let v = gradient(&p, 5);
            assert!(v.abs() <= 2.0, "{v}");
            assert!((gradient(&(p + Vector3::new(1e-3, 0.0, 0.0)), 5) - v).abs() < 0.02);
            sum += f64::from(v);
            square += f64::from(v * v);
        }
        let (mean, deviation) = (sum / f64::from(n), (square / f64::from(n)).sqrt());
        // Neighbouring samples are correlated over about ten: four standard errors of 2,000 free ones.
        assert!(mean.abs() < 0.03 && (0.25..0.55).contains(&deviation), "{mean} {deviation}");
    }

    #[test]
    fn what_is_finer_than_a_pixel_fades_out() {
        let fine = |footprint: f32| -> f32 {
            let step = |p: Vector3<f32>| fractal(&(p + Vector3::new(0.004, 0.0, 0.0)), footprint, 0.8, 3) - fractal(&p, footprint, 0.8, 3);
            (0..200).map(|i| step(Vector3::new(0.41 * i as f32, 0.2, 0.013 * i as f32)).powi(2)).sum()
        };
        // 4 mm are a hundredth of the wavelength that is left, and a whole one of some that are not.
        assert!(fine(0.2) < 0.01 * fine(0.001), "{} {}", fine(0.2), fine(0.001));
        assert_eq!(fractal(&Vector3::new(0.4, 0.2, 0.1), 1.0, 0.8, 3).to_bits(), 0);
    }
}
