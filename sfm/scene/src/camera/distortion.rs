//! Distortion of normalised coordinates, with derivatives.

use super::model::{CameraModel, MAX_CAMERA_PARAMS};

/// Distorted normalised coordinates and their derivatives.
pub(super) struct Distorted {
    pub u: f64,
    pub v: f64,
    /// d(u', v') / d(u, v), row-major.
    pub d_uv: [[f64; 2]; 2],
    /// d(u', v') / d(parameters); zero for focal lengths and principal point.
    pub d_params: [[f64; MAX_CAMERA_PARAMS]; 2],
}

/// Distorts (u, v); `None` beyond the radius at which the radial polynomial stops growing, where the model folds back.
pub(super) fn distort(model: CameraModel, p: &[f64; MAX_CAMERA_PARAMS], u: f64, v: f64) -> Option<Distorted> {
    let zero = [[0.0; MAX_CAMERA_PARAMS]; 2];
    match model {
        CameraModel::Pinhole => Some(Distorted { u, v, d_uv: [[1.0, 0.0], [0.0, 1.0]], d_params: zero }),
        CameraModel::SimpleRadial => radial(u, v, [p[3], 0.0, 0.0], 3, 1),
        CameraModel::Radial => radial(u, v, [p[3], p[4], 0.0], 3, 2),
        CameraModel::OpenCv => {
            let mut out = radial(u, v, [p[4], p[5], 0.0], 4, 2)?;
            // OpenCV's p1 acts along y and p2 along x.
            tangential(&mut out, u, v, p[7], p[6], 7, 6);
            Some(out)
        }
        CameraModel::Brown => {
            let mut out = radial(u, v, [p[3], p[4], p[5]], 3, 3)?;
            tangential(&mut out, u, v, p[6], p[7], 6, 7);
            out.u += p[8] * u + p[9] * v;
            out.d_uv[0][0] += p[8];
            out.d_uv[0][1] += p[9];
            out.d_params[0][8] = u;
            out.d_params[0][9] = v;
            Some(out)
        }
        CameraModel::Fisheye => fisheye(u, v, [p[4], p[5], p[6], p[7]]),
    }
}

/// (u, v) (1 + k1 r2 + k2 r4 + k3 r6); the first `count` coefficients are parameters from index `first` on.
fn radial(u: f64, v: f64, k: [f64; 3], first: usize, count: usize) -> Option<Distorted> {
    let r2 = u * u + v * v;
    if 1.0 + r2 * (3.0 * k[0] + r2 * (5.0 * k[1] + r2 * 7.0 * k[2])) <= 0.0 {
        return None;
    }
    let factor = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]));
    // d factor / d r2, times d r2 / d u = 2u.
    let slope = 2.0 * (k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[2]));
    let mut d_params = [[0.0; MAX_CAMERA_PARAMS]; 2];
    let mut power = r2;
    for i in first..first + count {
        d_params[0][i] = u * power;
        d_params[1][i] = v * power;
        power *= r2;
    }
    let cross = slope * u * v;
    Some(Distorted { u: u * factor, v: v * factor, d_uv: [[factor + slope * u * u, cross], [cross, factor + slope * v * v]], d_params })
}

/// Adds b1 (r2 + 2 u2) + 2 b2 u v to u and b2 (r2 + 2 v2) + 2 b1 u v to v.
fn tangential(out: &mut Distorted, u: f64, v: f64, b1: f64, b2: f64, index_b1: usize, index_b2: usize) {
    let r2 = u * u + v * v;
    let (on_u, on_v, cross) = (r2 + 2.0 * u * u, r2 + 2.0 * v * v, 2.0 * u * v);
    out.u += b1 * on_u + b2 * cross;
    out.v += b2 * on_v + b1 * cross;
    out.d_uv[0][0] += 6.0 * b1 * u + 2.0 * b2 * v;
    out.d_uv[0][1] += 2.0 * b1 * v + 2.0 * b2 * u;
    out.d_uv[1][0] += 2.0 * b2 * u + 2.0 * b1 * v;
    out.d_uv[1][1] += 6.0 * b2 * v + 2.0 * b1 * u;
    out.d_params[0][index_b1] = on_u;
    out.d_params[1][index_b1] = cross;
    out.d_params[0][index_b2] = cross;
    out.d_params[1][index_b2] = on_v;
}

/// Radius r becomes theta (1 + k1 theta^2 + ... + k4 theta^8) with theta = atan r.
fn fisheye(u: f64, v: f64, k: [f64; 4]) -> Option<Distorted> {
    let r2 = u * u + v * v;
    let r = r2.sqrt();
    let theta = r.atan();
    let t2 = theta * theta;
    let poly = 1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3])));
    let growth = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
    if growth <= 0.0 {
        return None;
    }
    // theta / r and (d theta_d / d r - theta_d / r) / r2, by their series near the axis.
    let (ratio, bend) = if r > 1e-4 {
        let ratio = theta / r;
        (ratio, (growth / (1.0 + r2) - ratio * poly) / r2)
    } else {
        (1.0 - r2 / 3.0, 2.0 * (k[0] - 1.0 / 3.0))
    };
    let factor = ratio * poly;
    let mut d_params = [[0.0; MAX_CAMERA_PARAMS]; 2];
    let mut power = ratio * t2;
    for i in 4..8 {
        d_params[0][i] = u * power;
        d_params[1][i] = v * power;
        power *= t2;
    }
    let cross = bend * u * v;
    Some(Distorted { u: u * factor, v: v * factor, d_uv: [[factor + bend * u * u, cross], [cross, factor + bend * v * v]], d_params })
}
