//! Moving a cloud onto its reference.

use crate::EvalError;
use crate::distance::{Index, Reference, Triangle, centre, check_mesh, check_positions, triangles};
use crate::neighbours::normal;
use crate::statistics::percentile;
use nalgebra::{DMatrix, DVector, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use scene::Similarity3;
use serde::Serialize;

/// How an alignment ended.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct IcpSummary {
    /// Points used.
    pub points: usize,
    /// Steps.
    pub iterations: usize,
    /// Whether the last step was small enough; else the largest number of steps was reached.
    pub converged: bool,
    /// Root of the mean squared distance of the inliers along the normals before, metres.
    pub rms_before_m: f64,
    /// The same after, metres.
    pub rms_after_m: f64,
    /// Directions of the motion that the shape of the reference does not determine: left as they were.
    pub undetermined: usize,
}

const MAX_POINTS: usize = 20_000;
const MAX_ITERATIONS: usize = 100;

enum Target {
    Mesh(Index<Triangle>),
    Cloud(Index<Vector3<f64>>, Vec<Vector3<f64>>),
}

/// Motion, with scale where asked, that brings `cloud` onto `reference`: iterative closest points with distances along the
/// normals of the reference (Chen & Medioni, *Object modelling by registration of multiple range images*, Image and Vision
/// Computing, 1992). Distances beyond three normalised median deviations do not count. At most 20,000 points, evenly spaced.
///
/// Finds the nearest minimum: the clouds have to lie near each other, within about the size of their features.
///
/// # Errors
/// [`EvalError`]: an empty cloud or reference, positions that are not usable; [`EvalError::NoAlignment`] where no normal can
/// be found.
pub fn icp(cloud: &[Point3<f64>], reference: &Reference, with_scale: bool) -> Result<(Similarity3, IcpSummary), EvalError> {
    if cloud.is_empty() {
        return Err(EvalError::EmptyCloud);
    }
    let target = target(reference)?;
    let origin = match &target {
        Target::Mesh(index) => index.origin,
        Target::Cloud(index, _) => index.origin,
    };
    check_positions("point", cloud, &origin)?;
    let source: Vec<Vector3<f64>> = cloud.iter().step_by(cloud.len().div_ceil(MAX_POINTS)).map(|p| p - origin).collect();
    let extent = source.iter().map(|p| p.norm()).fold(0.0, f64::max);
    let mut moved = Similarity3::from_scale(1.0);
    let mut summary =
        IcpSummary { points: source.len(), iterations: 0, converged: false, rms_before_m: 0.0, rms_after_m: 0.0, undetermined: 0 };
    loop {
        let at: Vec<Vector3<f64>> = source.iter().map(|p| moved.apply(p)).collect();
        let rows = residuals(&target, &at);
        if rows.is_empty() {
            return Err(EvalError::NoAlignment);
        }
        let mut sizes: Vec<f64> = rows.iter().map(|(_, _, r)| r.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        let limit = 3.0 * 1.4826 * percentile(&sizes, 50.0) + 1e-12 * extent;
        let inliers: Vec<_> = rows.into_iter().filter(|(_, _, r)| r.abs() <= limit).collect();
        summary.rms_after_m = (inliers.iter().map(|(_, _, r)| r * r).sum::<f64>() / inliers.len() as f64).sqrt();
        if summary.iterations == 0 {
            summary.rms_before_m = summary.rms_after_m;
        }
        if summary.converged || summary.iterations == MAX_ITERATIONS {
            break;
        }
        let (step, undetermined, size) = step(&inliers, with_scale);
        moved = Similarity3 {
            scale: step.scale * moved.scale,
            rotation: step.rotation * moved.rotation,
            translation: step.apply(&moved.translation),
        };
        summary.iterations += 1;
        summary.undetermined = undetermined;
        summary.converged = size <= 1e-9 * extent.max(f64::MIN_POSITIVE);
    }
    // From coordinates relative to the origin to those of the world.
    let translation = moved.translation + origin.coords - moved.scale * (moved.rotation * origin.coords);
    Ok((Similarity3 { translation, ..moved }, summary))
}

fn target(reference: &Reference) -> Result<Target, EvalError> {
    match reference {
        Reference::Mesh(mesh) => {
            check_mesh(mesh)?;
            let origin = centre(&mesh.vertices);
            Ok(Target::Mesh(Index::new(origin, triangles(mesh, &origin))))
        }
        Reference::Cloud(cloud) => {
            if cloud.is_empty() {
                return Err(EvalError::EmptyReference("the cloud has no points"));
            }
            check_positions("reference point", &cloud.positions, &Point3::origin())?;
            let origin = centre(&cloud.positions);
            let index = Index::new(origin, cloud.positions.iter().map(|p| p - origin).collect());
            let normals = (0..cloud.len() as u32).into_par_iter().map(|slot| local_normal(&index, slot)).collect();
            Ok(Target::Cloud(index, normals))
        }
    }
}

/// Normal at a point of a cloud, from the smallest of a row of doubled radii that holds eight neighbours; zero for none.
fn local_normal(index: &Index<Vector3<f64>>, slot: u32) -> Vector3<f64> {
    let p = index.primitive(slot).0;
    // The nearest other of the next points on the curve gives a radius to start with.
    let next = (1..=8).map(|i| (slot as usize + i) % index.len()).map(|i| (index.primitive(i as u32).0 - p).norm());
    let mut radius = next.filter(|&d| d > 0.0).fold(f64::INFINITY, f64::min);
    if !radius.is_finite() {
        return Vector3::zeros();
    }
    for _ in 0..16 {
        let mut count = 0;
        index.within(p, radius, |_, _| count += 1);
        if count > 8 {
            break;
        }
        radius *= 2.0;
    }
    normal(index, p, radius).unwrap_or_default()
}

/// Point, normal and signed distance along it of every point whose nearest place has a normal.
fn residuals(target: &Target, at: &[Vector3<f64>]) -> Vec<(Vector3<f64>, Vector3<f64>, f64)> {
    let one = |p: &Vector3<f64>| {
        let (to_point, normal) = match target {
            Target::Mesh(index) => {
                let (triangle, _) = index.primitive(index.nearest(p, 0).slot);
                (triangle.nearest(p).0, triangle.normal()?)
            }
            Target::Cloud(index, normals) => {
                let slot = index.nearest(p, 0).slot;
                (p - index.primitive(slot).0, normals[slot as usize])
            }
        };
        (normal != Vector3::zeros()).then(|| (*p, normal, normal.dot(&to_point)))
    };
    at.par_iter().map(one).collect::<Vec<_>>().into_iter().flatten().collect()
}

/// The motion that makes the distances along the normals least in squares, linearised about the centre of the points; how
/// many directions it leaves out; how far it moves a point at most, roughly.
fn step(rows: &[(Vector3<f64>, Vector3<f64>, f64)], with_scale: bool) -> (Similarity3, usize, f64) {
    let unknowns = if with_scale { 7 } else { 6 };
    let centre = rows.iter().map(|(p, _, _)| p).sum::<Vector3<f64>>() / rows.len() as f64;
    let size = (rows.iter().map(|(p, _, _)| (p - centre).norm_squared()).sum::<f64>() / rows.len() as f64).sqrt().max(f64::MIN_POSITIVE);
    let (mut normal_matrix, mut right) = (DMatrix::zeros(unknowns, unknowns), DVector::zeros(unknowns));
    for (p, n, r) in rows {
        // Relative to the size, turns and shifts weigh alike.
        let x = (p - centre) / size;
        let turn = x.cross(n);
        let all = [turn.x, turn.y, turn.z, n.x, n.y, n.z, x.dot(n)];
        let row = DVector::from_column_slice(&all[..unknowns]);
        normal_matrix.ger(1.0, &row, &row, 1.0);
        right.axpy(-r / size, &row, 1.0);
    }
    let eigen = normal_matrix.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let (mut update, mut undetermined) = (DVector::zeros(unknowns), 0);
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value <= 1e-8 * largest {
            undetermined += 1;
        } else {
            update.axpy(vector.dot(&right) / value, &vector, 1.0);
        }
    }
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(update[0], update[1], update[2]));
    let scale = if with_scale { (1.0 + update[6]).clamp(0.5, 2.0) } else { 1.0 };
    let shift = Vector3::new(update[3], update[4], update[5]) * size;
    let translation = centre + shift - scale * (rotation * centre);
    (Similarity3 { scale, rotation, translation }, undetermined, update.norm() * size)
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::{Cloud, Mesh};

    /// A wavy sheet that determines every motion.
    fn height(x: f64, y: f64) -> f64 {
        0.3 * (2.0 * x).sin() + 0.25 * (2.5 * y + 0.4).cos() + 0.1 * (x * y)
    }

    fn sheet(n: usize, offset: f64) -> Vec<Point3<f64>> {
        let at = |k: usize| 4.0 * (k as f64 + offset) / n as f64;
        (0..n * n).map(|k| (at(k % n), at(k / n))).map(|(x, y)| Point3::new(x + 100.0, y - 50.0, height(x, y))).collect()
    }

    fn mesh(n: usize) -> Mesh {
        let quad = |i: usize| [i, i + 1, i + n, i + n + 1].map(|v| v as u32);
        let corners = (0..n * n).filter(|i| i % n + 1 < n && i / n + 1 < n).map(quad);
        Mesh { vertices: sheet(n, 0.0), faces: corners.flat_map(|[a, b, c, d]| [[a, b, c], [b, d, c]]).collect(), colours: vec![] }
    }

    #[test]
    fn a_known_motion_is_undone() {
        // Turned by up to 1.7 degrees about its middle and shifted by a few centimetres: 10 cm at the corners.
        let (rotation, middle) = (UnitQuaternion::from_euler_angles(0.02, -0.015, 0.03), Vector3::new(102.0, -48.0, 0.0));
        let translation = middle - rotation * middle + Vector3::new(0.05, -0.04, 0.06);
        let motion = Similarity3 { scale: 1.0, rotation, translation };
        let points: Vec<_> = mesh(81).vertices.iter().skip(41).step_by(3).map(|p| motion.apply_point(p)).collect();
        let reference = Reference::Mesh(mesh(81));
        let (found, summary) = icp(&points, &reference, false).expect("a sheet");
        assert!(summary.converged && summary.undetermined == 0 && summary.rms_after_m < 1e-8, "{summary:?}");
        for (p, q) in points.iter().zip(mesh(81).vertices.iter().skip(41).step_by(3)) {
            assert!((found.apply_point(p) - q).norm() < 1e-7, "{p} against {q}");
        }
    }

    #[test]
    fn scale_is_found_where_it_is_asked_for() {
        let centre = Vector3::new(102.0, -48.0, 0.0);
        let grown: Vec<_> = mesh(81).vertices.iter().map(|p| Point3::from(centre + (p.coords - centre) * 1.03)).collect();
        let (found, summary) = icp(&grown, &Reference::Mesh(mesh(81)), true).expect("a sheet");
        assert!(summary.converged && (found.scale * 1.03 - 1.0).abs() < 1e-8, "{summary:?} {}", found.scale);
        let (rigid, _) = icp(&grown, &Reference::Mesh(mesh(81)), false).expect("a sheet");
        assert_eq!(rigid.scale, 1.0);
    }

    #[test]
    fn a_cloud_is_aligned_to_a_cloud_and_a_plane_leaves_three_directions() {
        let shifted: Vec<_> = sheet(60, 0.3).iter().map(|p| p + Vector3::new(0.02, -0.03, 0.05)).collect();
        let reference = Reference::Cloud(Cloud { positions: sheet(80, 0.0), ..Cloud::default() });
        let (found, _) = icp(&shifted, &reference, false).expect("a sheet");
        let worst = shifted.iter().zip(sheet(60, 0.3)).map(|(p, q)| (found.apply_point(p) - q).norm()).fold(0.0, f64::max);
        // Planes through neighbours 5 cm apart on a curved sheet lie off it by about a millimetre.
        assert!(worst < 5e-3, "{worst}");
        let flat = |z: f64| (0..400).map(|k| Point3::new(f64::from(k % 20), f64::from(k / 20), z)).collect::<Vec<_>>();
        let plane = Mesh {
            vertices: [[-9.0, -9.0], [99.0, -9.0], [0.0, 99.0]].map(|[x, y]| Point3::new(x, y, 0.0)).to_vec(),
            faces: vec![[0, 1, 2]],
            colours: vec![],
        };
        let (found, summary) = icp(&flat(0.4), &Reference::Mesh(plane), false).expect("a plane");
        assert_eq!(summary.undetermined, 3);
        assert!((found.apply(&Vector3::new(3.0, 4.0, 0.4)) - Vector3::new(3.0, 4.0, 0.0)).norm() < 1e-9);
    }
}
