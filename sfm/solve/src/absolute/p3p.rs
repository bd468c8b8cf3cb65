//! Pose of a calibrated camera from three points.

use crate::numeric::polynomial::real_roots;
use nalgebra::{Matrix3, Vector3};

/// Gauss-Newton steps on the three distances: polishes what the cubic and the square roots lost.
const POLISH_STEPS: usize = 2;
/// Largest error of a squared distance between points, in units of the longest: more is no solution. Rounding reaches it where the camera is
/// more than 1e4 times the size of the triangle away.
const MAX_RESIDUAL: f64 = 1e-6;

/// Appends the poses `cam_from_world` = (R, t), up to four, for which `R x + t` lies along the unit vector `ray` for three points
/// in front along their rays.
///
/// The distances d_i along the rays obey the three laws of cosines `d_i^2 + d_j^2 - 2 d_i d_j (ray_i . ray_j) = |x_i - x_j|^2`. Two
/// combinations without the right sides are conics in the projective plane of (d_1 : d_2 : d_3); a degenerate member of their
/// pencil (a root of a cubic) splits into two lines, each of which meets the conics in up to two points. After Persson &
/// Nordberg, *Lambda twist*, ECCV 2018, with the lines taken from the adjugate as in Ding, Yang, Larsson, Olsson & Astrom, *Revisiting the
/// P3P problem*, CVPR 2023. Degenerate: points in line or equal (nothing is appended); points on the danger cylinder make a
/// double solution, of half the digits. Works with rays of any direction; does not know about images.
pub fn p3p(rays: &[Vector3<f64>; 3], x: &[Vector3<f64>; 3], out: &mut Vec<(Matrix3<f64>, Vector3<f64>)>) {
    let (edge12, edge13) = (x[1] - x[0], x[2] - x[0]);
    let normal = edge12.cross(&edge13);
    let a = [edge12.norm_squared(), edge13.norm_squared(), (x[2] - x[1]).norm_squared()];
    let size = a[0].max(a[1]).max(a[2]);
    // Sine of the flattest angle below about 1e-7; written so that NaN ends here as well.
    if !(normal.norm() > 1e-7 * size && size.is_finite()) {
        return;
    }
    let c = [rays[0].dot(&rays[1]), rays[0].dot(&rays[2]), rays[1].dot(&rays[2])];
    // Two equal rays hold two points at one distance only: the rest is rounding.
    if !c.iter().all(|cosine| *cosine < 1.0 - 1e-14) {
        return;
    }
    // In units of the longest side, so that no tolerance depends on the scale of the world.
    let a = a.map(|v| v / size);
    let law = |i: usize| law_of_cosines(i, c[i]);
    let first = law(0) * a[2] - law(2) * a[0];
    let second = law(1) * a[2] - law(2) * a[1];
    let Some(lines) = lines_of_pencil(&first, &second) else {
        return;
    };
    // World edges as columns, to be turned into camera edges.
    let Some(world) = Matrix3::from_columns(&[edge12, edge13, normal]).try_inverse() else {
        return;
    };
    // The better conditioned of both conics along a line is not known beforehand: the one with larger entries.
    let conic = if first.norm() > second.norm() { first } else { second };
    for line in lines {
        for direction in line_and_conic(&line, &conic).into_iter().flatten() {
            // Squared lengths fix the scale: the sum of all three laws has no cancellation.
            let sum = direction.dot(&((law(0) + law(1) + law(2)) * direction));
            let scale = ((a[0] + a[1] + a[2]) / sum).sqrt();
            let mut d = direction * if direction.sum() < 0.0 { -scale } else { scale };
            polish(&mut d, &c, &a);
            // A maximum over NaN may hide it; a sum of squares does not.
            let fits = residuals(&d, &c, &a).norm_squared() < MAX_RESIDUAL * MAX_RESIDUAL;
            if !(fits && d.iter().all(|v| *v > 0.0)) {
                continue;
            }
            let d = d * size.sqrt();
            let in_cam: [Vector3<f64>; 3] = std::array::from_fn(|i| rays[i] * d[i]);
            let (cam12, cam13) = (in_cam[1] - in_cam[0], in_cam[2] - in_cam[0]);
            let rotation = Matrix3::from_columns(&[cam12, cam13, cam12.cross(&cam13)]) * world;
            out.push((rotation, in_cam[0] - rotation * x[0]));
        }
    }
}

/// Quadratic form of the law for pair 0 = (1, 2), 1 = (1, 3), 2 = (2, 3).
fn law_of_cosines(pair: usize, cosine: f64) -> Matrix3<f64> {
    let (i, j) = [(0, 1), (0, 2), (1, 2)][pair];
    let mut m = Matrix3::zeros();
    m[(i, i)] = 1.0;
    m[(j, j)] = 1.0;
    m[(i, j)] = -cosine;
    m[(j, i)] = -cosine;
    m
}

/// The two lines of the best degenerate conic `first + g second`, or `None` when all have only one real point.
fn lines_of_pencil(first: &Matrix3<f64>, second: &Matrix3<f64>) -> Option<[Vector3<f64>; 2]> {
    let (adj_first, adj_second) = (adjugate(first), adjugate(second));
    let cubic = [first.determinant(), adj_first.dot(second), adj_second.dot(first), second.determinant()];
    let mut best: Option<(f64, Matrix3<f64>, Matrix3<f64>)> = None;
    real_roots(&cubic, |g| {
        let conic = (first + second * g) / (1.0 + g.abs());
        let adjugate = adjugate(&conic);
        // The adjugate of a pair of lines is -p p^T with their intersection p, real where the lines are.
        let size = -adjugate.trace();
        if size > best.as_ref().map_or(0.0, |b| b.0) {
            best = Some((size, conic, adjugate));
        }
    });
    let (_, conic, adjugate) = best?;
    let k = (0..3).fold(0, |k, i| if -adjugate[(i, i)] > -adjugate[(k, k)] { i } else { k });
    let square = -adjugate[(k, k)];
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let point = -adjugate.column(k) / square.sqrt();
    // conic + [p]x has rank one: its columns are one line, its rows the other.
    let split = conic + point.cross_matrix();
    let largest = split.iamax_full();
    Some([split.column(largest.1).into_owned(), split.row(largest.0).transpose()])
}

/// Of a symmetric matrix.
fn adjugate(m: &Matrix3<f64>) -> Matrix3<f64> {
    let [a, b, c, d, e, f] = [m[(0, 0)], m[(0, 1)], m[(0, 2)], m[(1, 1)], m[(1, 2)], m[(2, 2)]];
    let (aa, ab, ac) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let (bb, bc, cc) = (a * f - c * c, b * c - a * e, a * d - b * b);
    Matrix3::new(aa, ab, ac, ab, bb, bc, ac, bc, cc)
}

/// Where a line meets a conic.
fn line_and_conic(line: &Vector3<f64>, conic: &Matrix3<f64>) -> [Option<Vector3<f64>>; 2] {
    let pivot = line.iamax();
    let (i, j) = ((pivot + 1) % 3, (pivot + 2) % 3);
    // Points of the line: p + s q.
    let (mut p, mut q) = (Vector3::zeros(), Vector3::zeros());
    p[i] = 1.0;
    p[pivot] = -line[i] / line[pivot];
    q[j] = 1.0;
    q[pivot] = -line[j] / line[pivot];
    let (a, b, c) = (q.dot(&(conic * q)), q.dot(&(conic * p)), p.dot(&(conic * p)));
    let mut discriminant = b * b - a * c;
    // A touching line may come out a little beside the conic: a double solution.
    if discriminant < 0.0 && discriminant > -1e-12 * (b * b + (a * c).abs()) {
        discriminant = 0.0;
    }
    if discriminant.is_nan() || discriminant < 0.0 {
        return [None, None];
    }
    // Without cancellation: s = t / a and c / t; homogeneous, since a may vanish.
    let t = -(b + discriminant.sqrt().copysign(b));
    [Some(p * a + q * t), Some(p * t + q * c)]
}

/// Residuals of the three laws.
fn residuals(d: &Vector3<f64>, c: &[f64; 3], a: &[f64; 3]) -> Vector3<f64> {
    Vector3::new(
        d.x * d.x + d.y * d.y - 2.0 * d.x * d.y * c[0] - a[0],
        d.x * d.x + d.z * d.z - 2.0 * d.x * d.z * c[1] - a[1],
        d.y * d.y + d.z * d.z - 2.0 * d.y * d.z * c[2] - a[2],
    )
}

fn polish(d: &mut Vector3<f64>, c: &[f64; 3], a: &[f64; 3]) {
    let mut r = residuals(d, c, a);
    for _ in 0..POLISH_STEPS {
        // J = 2 [[p, q, 0], [u, 0, v], [0, w, z]].
        let (p, q) = (d.x - d.y * c[0], d.y - d.x * c[0]);
        let (u, v) = (d.x - d.z * c[1], d.z - d.x * c[1]);
        let (w, z) = (d.y - d.z * c[2], d.z - d.y * c[2]);
        let determinant = -(p * v * w + q * u * z);
        let scale = 0.5 / determinant;
        let step = Vector3::new(
            scale * (-v * w * r.x - q * z * r.y + q * v * r.z),
            scale * (-u * z * r.x + p * z * r.y - p * v * r.z),
            scale * (u * w * r.x - p * w * r.y - q * u * r.z),
        );
        let next = *d - step;
        let next_r = residuals(&next, c, a);
        // Near a double solution a step may lead away.
        if next_r.norm_squared().is_nan() || next_r.norm_squared() >= r.norm_squared() {
            return;
        }
        (*d, r) = (next, next_r);
    }
}
