//! Robust absolute pose of a rig.

use super::p3p::p3p;
use super::refinement::{Movable, refine_with_loss};
use crate::numeric::minimise::{COARSE, Normal, levenberg_marquardt};
use crate::ransac::{Estimator, GroupedSampler, Msac, Ransac, RansacOptions, run};
use nalgebra::{Matrix2x3, Matrix3, Vector2, Vector3};
use scene::{Camera, Rigid3};

/// Trials of one refinement inside the search.
const MAX_STEPS: usize = 6;

/// A camera of the rig that is to be oriented; a single camera has the identity as its pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensor {
    /// Interior orientation.
    pub camera: Camera,
    /// Pose in the rig.
    pub cam_from_rig: Rigid3,
}

/// A pixel and the scene point that it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correspondence {
    /// Index of the sensor that saw it.
    pub sensor: usize,
    /// Where.
    pub pixel: Vector2<f64>,
    /// The point.
    pub x_in_world: Vector3<f64>,
}

/// Pose `rig_from_world` of a rig, or of a camera, robustly; `o.max_error` in pixels.
///
/// LO-RANSAC over [`p3p`] on three correspondences of one sensor (sensors chosen in proportion to their correspondences), scored on
/// all of them. Inside the search a pixel error is the error in normalised coordinates times the derivative of the
/// distortion at the observed pixel: exact to the first order, so that inliers differ from true ones only near the limit. In
/// the end the pose is refined on true pixel errors (truncated at the limit) and the inliers are those of
/// [`Camera::project`]. Correspondences with a bad sensor index, values that are not finite, or a pixel without a ray count as
/// outliers. `None` when no sensor has three usable ones or nothing has three inliers. Three inliers prove nothing: the caller sets the bar.
/// Sensors with fewer than three correspondences only take part in the scoring; a rig whose sensors all see one or two
/// points needs the generalised P3P, which is not here.
#[must_use]
pub fn estimate_absolute_pose(sensors: &[Sensor], correspondences: &[Correspondence], o: &RansacOptions) -> Option<Ransac<Rigid3>> {
    let estimator = PoseEstimator::new(sensors, correspondences);
    let sampler = GroupedSampler { groups: estimator.groups.iter().map(|g| g.range.clone()).collect() };
    let scoring = Msac { max_squared_error: o.max_error * o.max_error };
    let found = run(&estimator, &sampler, &scoring, o)?;
    let mut inliers: Vec<usize> = found.inliers.iter().map(|&i| estimator.source[i]).collect();
    inliers.sort_unstable();
    let start = found.model.rigid();
    let limit = scoring.max_squared_error;
    let truncated = |squared: f64| if squared < limit { (squared, 1.0) } else { (limit, 0.0) };
    let model = refine_with_loss(sensors, correspondences, &inliers, &start, truncated);
    let inliers = true_inliers(sensors, correspondences, &model, o.max_error);
    (inliers.len() >= 3).then_some(Ransac { model, inliers, iterations: found.iterations })
}

/// Correspondences with a true reprojection error below the limit.
pub(super) fn true_inliers(sensors: &[Sensor], correspondences: &[Correspondence], rig_from_world: &Rigid3, max_error: f64) -> Vec<usize> {
    let poses: Vec<Rigid3> = sensors.iter().map(|s| s.cam_from_rig * *rig_from_world).collect();
    let within = |c: &Correspondence| {
        let sensor = sensors.get(c.sensor)?;
        let pixel = sensor.camera.project(&poses[c.sensor].apply(&c.x_in_world))?;
        Some((pixel - c.pixel).norm() < max_error)
    };
    (0..correspondences.len()).filter(|&i| within(&correspondences[i]) == Some(true)).collect()
}

/// Correspondences of one sensor, which stand together.
struct Group {
    range: std::ops::Range<usize>,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    rig_from_cam: Rigid3,
}

struct PoseEstimator {
    groups: Vec<Group>,
    /// Index in the caller's list.
    source: Vec<usize>,
    rays: Vec<Vector3<f64>>,
    points: Vec<Vector3<f64>>,
    /// Normalised coordinates.
    u: Vec<f64>,
    v: Vec<f64>,
    /// Derivative of the pixel by the normalised coordinates, row by row, at the observed pixel.
    d: [Vec<f64>; 4],
    x: [Vec<f64>; 3],
}

impl PoseEstimator {
    fn new(sensors: &[Sensor], correspondences: &[Correspondence]) -> Self {
        let mut out = Self {
            groups: Vec::new(),
            source: Vec::new(),
            rays: Vec::new(),
            points: Vec::new(),
            u: Vec::new(),
            v: Vec::new(),
            d: Default::default(),
            x: Default::default(),
        };
        for (index, sensor) in sensors.iter().enumerate() {
            let start = out.source.len();
            for (i, c) in correspondences.iter().enumerate().filter(|(_, c)| c.sensor == index) {
                out.push(i, c, &sensor.camera);
            }
            if out.source.len() > start {
                out.groups.push(Group {
                    range: start..out.source.len(),
                    rotation: sensor.cam_from_rig.rotation_matrix(),
                    translation: sensor.cam_from_rig.translation,
                    rig_from_cam: sensor.cam_from_rig.inverse(),
                });
            }
        }
        out
    }

    fn push(&mut self, index: usize, c: &Correspondence, camera: &Camera) {
        if !c.pixel.iter().chain(c.x_in_world.iter()).all(|v| v.is_finite()) {
            return;
        }
        let Some(uv) = camera.unproject(&c.pixel) else {
            return;
        };
        let direction = uv.push(1.0);
        // Behind a port rays do not meet: what is linearised is the point at its object distance.
        let depth = camera.port().map_or(1.0, |port| port.object_distance_m / direction.norm());
        let Some(at) = camera.project_with_jacobians(&(direction * depth)) else {
            return;
        };
        self.source.push(index);
        self.rays.push(direction.normalize());
        self.points.push(c.x_in_world);
        self.u.push(uv.x);
        self.v.push(uv.y);
        // The derivative by X and Y times Z is the one by the normalised coordinates.
        for (k, (i, j)) in [(0, 0), (0, 1), (1, 0), (1, 1)].into_iter().enumerate() {
            self.d[k].push(depth * at.d_point[(i, j)]);
        }
        for k in 0..3 {
            self.x[k].push(c.x_in_world[k]);
        }
    }

    /// Errors of `range`, seen by one sensor with the pose (r, t).
    fn errors_of_sensor(&self, r: &Matrix3<f64>, t: &Vector3<f64>, range: std::ops::Range<usize>, out: &mut [f64]) {
        let n = out.len();
        let [x, y, z] = self.x.each_ref().map(|v| &v[range.clone()][..n]);
        let [d00, d01, d10, d11] = self.d.each_ref().map(|v| &v[range.clone()][..n]);
        let (u, v) = (&self.u[range.clone()][..n], &self.v[range][..n]);
        for i in 0..n {
            let a = r[(0, 0)] * x[i] + r[(0, 1)] * y[i] + r[(0, 2)] * z[i] + t.x;
            let b = r[(1, 0)] * x[i] + r[(1, 1)] * y[i] + r[(1, 2)] * z[i] + t.y;
            let c = r[(2, 0)] * x[i] + r[(2, 1)] * y[i] + r[(2, 2)] * z[i] + t.z;
            let inverse = 1.0 / c;
            let (du, dv) = (a * inverse - u[i], b * inverse - v[i]);
            let (ex, ey) = (d00[i] * du + d01[i] * dv, d10[i] * du + d11[i] * dv);
            let error = ex * ex + ey * ey;
            out[i] = if c > 0.0 { error } else { f64::INFINITY };
        }
    }
}

/// A pose with a rotation matrix, for speed.
#[derive(Clone)]
struct Pose {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl Pose {
    fn rigid(&self) -> Rigid3 {
        Rigid3::from_matrix(&self.rotation, self.translation)
    }

    fn of(rigid: &Rigid3) -> Self {
        Self { rotation: rigid.rotation_matrix(), translation: rigid.translation }
    }
}

impl Estimator for PoseEstimator {
    type Model = Pose;

    fn sample_size(&self) -> usize {
        3
    }

    fn len(&self) -> usize {
        self.source.len()
    }

    fn solve(&self, sample: &[usize], models: &mut Vec<Pose>) {
        let Some(group) = self.groups.iter().find(|g| g.range.contains(&sample[0])) else {
            return;
        };
        let mut poses = Vec::with_capacity(4);
        p3p(&std::array::from_fn(|k| self.rays[sample[k]]), &std::array::from_fn(|k| self.points[sample[k]]), &mut poses);
        let rig_from_cam = Pose::of(&group.rig_from_cam);
        models.extend(
            poses.into_iter().map(|(r, t)| Pose {
                rotation: rig_from_cam.rotation * r,
                translation: rig_from_cam.rotation * t + rig_from_cam.translation,
            }),
        );
    }

    fn squared_errors(&self, model: &Pose, start: usize, out: &mut [f64]) {
        let end = start + out.len();
        for group in &self.groups {
            let (first, last) = (group.range.start.max(start), group.range.end.min(end));
            if first < last {
                let rotation = group.rotation * model.rotation;
                let translation = group.rotation * model.translation + group.translation;
                self.errors_of_sensor(&rotation, &translation, first..last, &mut out[first - start..last - start]);
            }
        }
    }

    fn refine(&self, model: &Pose, inliers: &[usize], max_error: f64) -> Option<Pose> {
        if inliers.len() < 3 {
            return None;
        }
        let limit = max_error * max_error;
        let linearise = |rig_from_world: &Rigid3| {
            let pose = Pose::of(rig_from_world);
            let mut normal = Normal::<6>::zero();
            let mut inliers = inliers.iter().copied().peekable();
            for group in &self.groups {
                while let Some(i) = inliers.next_if(|i| *i < group.range.end) {
                    let x_in_rig = pose.rotation * self.points[i] + pose.translation;
                    let x = group.rotation * x_in_rig + group.translation;
                    let (u, v, inverse) = (x.x / x.z, x.y / x.z, 1.0 / x.z);
                    let (du, dv) = (u - self.u[i], v - self.v[i]);
                    let d = self.d.each_ref().map(|values| values[i]);
                    let (ex, ey) = (d[0] * du + d[1] * dv, d[2] * du + d[3] * dv);
                    let error = ex * ex + ey * ey;
                    if !(x.z > 0.0 && error < limit) {
                        normal.cost += limit;
                        continue;
                    }
                    let d_point = Matrix2x3::new(d[0], d[1], -d[0] * u - d[1] * v, d[2], d[3], -d[2] * u - d[3] * v) * inverse;
                    let [row_x, row_y] = rig_from_world.pose_rows(&(d_point * group.rotation), &x_in_rig);
                    normal.add(ex, &row_x, 1.0);
                    normal.add(ey, &row_y, 1.0);
                    normal.cost += error;
                }
            }
            Some(normal)
        };
        let refined = levenberg_marquardt(&model.rigid(), MAX_STEPS, COARSE, linearise, Movable::moved);
        Some(Pose::of(&refined))
    }
}
