//! Parameter values, and how a step changes them.

use super::layout::{Layout, Owner, View};
use super::problem::Problem;
use crate::lie::so3_exp;
use nalgebra::{Matrix3, Vector3};
use scene::camera::ParamKind;
use scene::{Camera, Rigid3};

/// Poses of a view as matrices.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewPose {
    pub r_cam_from_rig: Matrix3<f64>,
    pub t_cam_from_rig: Vector3<f64>,
    pub r_rig_from_world: Matrix3<f64>,
    pub t_rig_from_world: Vector3<f64>,
    pub plain_sensor: bool,
}

impl ViewPose {
    pub fn x_in_cam(&self, x_in_world: &Vector3<f64>) -> Vector3<f64> {
        let x_in_rig = self.r_rig_from_world * x_in_world + self.t_rig_from_world;
        if self.plain_sensor { x_in_rig } else { self.r_cam_from_rig * x_in_rig + self.t_cam_from_rig }
    }
}

/// The value of every parameter.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub frames: Vec<Rigid3>,
    pub sensors: Vec<Rigid3>,
    pub cameras: Vec<Camera>,
    /// By slot.
    pub points: Vec<[f64; 3]>,
    /// By position in [`Layout::kept_points`].
    pub kept_points: Vec<Vector3<f64>>,
    /// Derived from frames and sensors.
    pub views: Vec<ViewPose>,
}

impl State {
    /// The start values, without points and views.
    pub fn new(problem: &Problem) -> Self {
        Self {
            frames: problem.frames.iter().map(|b| b.pose).collect(),
            sensors: problem.sensors.iter().map(|b| b.pose).collect(),
            cameras: problem.cameras.iter().map(|b| b.camera).collect(),
            points: Vec::new(),
            kept_points: Vec::new(),
            views: Vec::new(),
        }
    }

    pub fn load_points(&mut self, problem: &Problem, layout: &Layout) {
        let xyz = |p: u32| problem.points[p as usize].xyz;
        self.points = layout.slots[..layout.slot_count()].iter().map(|s| xyz(s.point).into()).collect();
        self.kept_points = layout.kept_points.iter().map(|&p| xyz(p)).collect();
    }

    pub fn update_views(&mut self, views: &[View]) {
        self.views.clear();
        for view in views {
            let (frame, sensor) = (&self.frames[view.frame as usize], &self.sensors[view.sensor as usize]);
            self.views.push(ViewPose {
                r_cam_from_rig: sensor.rotation_matrix(),
                t_cam_from_rig: sensor.translation,
                r_rig_from_world: frame.rotation_matrix(),
                t_rig_from_world: frame.translation,
                plain_sensor: view.plain_sensor,
            });
        }
    }

    /// Sets the kept blocks to those of `from` moved by `step`, and the views with them. False when a camera became
    /// impossible: a focal length that is not positive, or a value that is not finite.
    pub fn set_moved(&mut self, from: &Self, step: &[f64], layout: &Layout) -> bool {
        let mut possible = true;
        for (b, &owner) in layout.owners.iter().enumerate() {
            let d = &step[layout.offsets[b]..layout.offsets[b + 1]];
            match owner {
                Owner::Frame(i) => self.frames[i as usize] = moved(&from.frames[i as usize], d),
                Owner::Sensor(i) => self.sensors[i as usize] = moved(&from.sensors[i as usize], d),
                Owner::Camera(i) => {
                    let mut camera = from.cameras[i as usize];
                    let kinds = camera.model().param_kinds();
                    let params = camera.params_mut();
                    for (k, d) in layout.camera_free[i as usize].indices().zip(d) {
                        params[k] += d;
                        possible &= params[k].is_finite() && (kinds[k] != ParamKind::Focal || params[k] > 0.0);
                    }
                    self.cameras[i as usize] = camera;
                }
                Owner::Point(i) => self.kept_points[i as usize] = from.kept_points[i as usize] + Vector3::new(d[0], d[1], d[2]),
            }
        }
        self.update_views(&layout.views);
        possible && step.iter().all(|d| d.is_finite())
    }

    pub fn store(&self, problem: &mut Problem, layout: &Layout) {
        for &owner in &layout.owners {
            match owner {
                Owner::Frame(i) => problem.frames[i as usize].pose = self.frames[i as usize],
                Owner::Sensor(i) => problem.sensors[i as usize].pose = self.sensors[i as usize],
                Owner::Camera(i) => problem.cameras[i as usize].camera = self.cameras[i as usize],
                Owner::Point(i) => problem.points[layout.kept_points[i as usize] as usize].xyz = self.kept_points[i as usize],
            }
        }
        for (slot, xyz) in layout.slots.iter().zip(&self.points).filter(|(s, _)| s.free) {
            problem.points[slot.point as usize].xyz = Vector3::from(*xyz);
        }
    }

    /// The largest relative change of a kept parameter by `step`: see [`super::AdjustOptions::parameter_tolerance`].
    pub fn largest_step(&self, step: &[f64], world: f64, layout: &Layout) -> f64 {
        let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let share = |d: &[f64], value: f64| norm(d) / value.max(world).max(f64::MIN_POSITIVE);
        let pose = |d: &[f64], pose: &Rigid3| norm(&d[..3]).max(share(&d[3..], pose.translation.norm()));
        let of = |(b, &owner): (usize, &Owner)| {
            let d = &step[layout.offsets[b]..layout.offsets[b + 1]];
            match owner {
                Owner::Frame(i) => pose(d, &self.frames[i as usize]),
                Owner::Sensor(i) => pose(d, &self.sensors[i as usize]),
                Owner::Camera(i) => {
                    let params = self.cameras[i as usize].params();
                    let free = layout.camera_free[i as usize].indices();
                    free.zip(d).map(|(k, d)| d.abs() / params[k].abs().max(1.0)).fold(0.0, f64::max)
                }
                Owner::Point(i) => share(d, self.kept_points[i as usize].norm()),
            }
        };
        layout.owners.iter().enumerate().map(of).fold(0.0, f64::max)
    }
}

/// (exp(w) R, t + d) for the step (w, d).
fn moved(pose: &Rigid3, step: &[f64]) -> Rigid3 {
    let mut rotation = so3_exp(&Vector3::new(step[0], step[1], step[2])) * pose.rotation;
    rotation.renormalize();
    Rigid3::new(rotation, pose.translation + Vector3::new(step[3], step[4], step[5]))
}
