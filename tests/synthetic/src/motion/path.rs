//! The path as a function of time.

use super::options::{MotionKind, MotionOptions};
use crate::random::{Random, mix};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use scene::Rigid3;
use std::f64::consts::TAU;

/// Slow waves of each coordinate.
const WAVES: usize = 4;
/// Time between pushes on average, seconds.
const PUSH_EVERY_S: f64 = 6.0;
/// Standard deviation of a push in time, seconds.
const PUSH_S: f64 = 0.35;
/// Step of the differences, seconds: exact to 1e-6 of what they measure, as nothing changes within less than [`PUSH_S`].
const STEP_S: f64 = 1e-3;

/// Displacement along x, y, z and turns about the axes of the rig.
type Unrest = [f64; 6];

/// A path of the rig.
#[derive(Clone, Debug)]
pub struct Motion {
    options: MotionOptions,
    centre: Vector3<f64>,
    /// Angular frequency, phase and strength of each wave of each coordinate.
    waves: [[[f64; 3]; WAVES]; 6],
    pushes: Vec<(f64, Unrest)>,
}

impl Motion {
    /// The path of some options around the middle of a scene.
    #[must_use]
    pub fn new(options: &MotionOptions, centre: Vector3<f64>) -> Self {
        let mut random = Random::new(mix(options.seed ^ 0x50A7));
        let waves = std::array::from_fn(|_| {
            std::array::from_fn(|_| [TAU / random.range(8.0, 40.0), random.range(0.0, TAU), random.range(0.3, 1.0) / WAVES as f64])
        });
        let (mut pushes, mut time) = (Vec::new(), 0.0);
        let end = options.frames as f64 / options.rate_hz + PUSH_EVERY_S;
        while time < end {
            time += random.range(0.3, 1.7) * PUSH_EVERY_S;
            let strength = |k: usize| if k < 3 { options.push_m } else { options.push_deg.to_radians() };
            pushes.push((time, std::array::from_fn(|k| random.range(-1.0, 1.0) * strength(k))));
        }
        Self { options: options.clone(), centre, waves, pushes }
    }

    /// Time of an exposure, seconds from the first.
    #[must_use]
    pub fn frame_time_s(&self, frame: usize) -> f64 {
        frame as f64 / self.options.rate_hz
    }

    /// Time of the last exposure, seconds.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.frame_time_s(self.options.frames.saturating_sub(1))
    }

    /// The pose of the rig (the frame of its first camera) at a time; smooth.
    #[must_use]
    pub fn rig_from_world(&self, time_s: f64) -> Rigid3 {
        let share = if self.duration_s() > 0.0 { time_s / self.duration_s() } else { 0.5 };
        let (place, target) = self.plan(share);
        let unrest = self.unrest(time_s);
        let away = Vector3::new(unrest[0], unrest[1], unrest[2]);
        // Looking down at what is near, the rig is carried along with what it looks at: it would turn about it.
        let target = if self.options.kind == MotionKind::Lanes { target + away } else { target };
        let place = place + away;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(unrest[3], unrest[4], unrest[5]));
        let z = (target - place).normalize();
        // Looking straight down, up in the image is north.
        let up = if z.xy().norm() > 0.05 { Vector3::z() } else { Vector3::y() };
        let x = z.cross(&up).normalize();
        let y = z.cross(&x);
        let level = Rigid3::from_matrix(&Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]), Vector3::zeros());
        let rotation = turn * level.rotation;
        Rigid3::new(rotation, -(rotation * place))
    }

    /// Velocity of the rig in the world, metres a second: central differences.
    #[must_use]
    pub fn velocity(&self, time_s: f64) -> Vector3<f64> {
        let at = |t| self.rig_from_world(t).centre();
        (at(time_s + STEP_S) - at(time_s - STEP_S)) / (2.0 * STEP_S)
    }

    /// Acceleration of the rig in the world, m/s2: central differences.
    #[must_use]
    pub fn acceleration(&self, time_s: f64) -> Vector3<f64> {
        let at = |t| self.rig_from_world(t).centre();
        (at(time_s + STEP_S) - 2.0 * at(time_s) + at(time_s - STEP_S)) / (STEP_S * STEP_S)
    }

    /// Angular velocity of the rig about its own axes, radians a second: central differences.
    #[must_use]
    pub fn angular_rate(&self, time_s: f64) -> Vector3<f64> {
        let [before, after] = [-STEP_S, STEP_S].map(|s| self.rig_from_world(time_s + s).rotation.inverse());
        (before.inverse() * after).scaled_axis() / (2.0 * STEP_S)
    }

    /// Where the rig should be, and what it should look at, at a share of the way.
    fn plan(&self, share: f64) -> (Vector3<f64>, Vector3<f64>) {
        let o = &self.options;
        let height = o.height_m[0] + (o.height_m[1] - o.height_m[0]) * share;
        match o.kind {
            MotionKind::Circle => {
                let angle = o.arc_deg.to_radians() * (share - 0.5);
                let place = Vector3::new(self.centre.x + o.radius_m * angle.sin(), self.centre.y - o.radius_m * angle.cos(), height);
                (place, self.centre)
            }
            MotionKind::Line => {
                let along = o.length_m * (share - 0.5);
                (Vector3::new(self.centre.x + along, self.centre.y - o.radius_m, height), self.centre + Vector3::x() * along)
            }
            MotionKind::Lanes => {
                // Lanes and half circles between them, at one speed.
                let turn = std::f64::consts::FRAC_PI_2 * o.spacing_m;
                let one = o.length_m + turn;
                let whole = one * f64::from(o.lanes) - turn;
                // Before the first exposure and after the last, the log goes on: straight along the first and the last lane.
                let last = f64::from(o.lanes - 1);
                let lane = (share * whole / one).floor().clamp(0.0, last);
                let along = share * whole - lane * one;
                let forth = if (lane as i64) % 2 == 1 { -1.0 } else { 1.0 };
                let (x, y) = if along <= o.length_m || lane == last {
                    (forth * (along - o.length_m / 2.0), lane * o.spacing_m)
                } else {
                    let a = (along - o.length_m) / turn * std::f64::consts::PI;
                    let radius = o.spacing_m / 2.0;
                    (forth * (o.length_m / 2.0 + radius * a.sin()), lane * o.spacing_m + radius * (1.0 - a.cos()))
                };
                let side = y - o.spacing_m * f64::from(o.lanes - 1) / 2.0;
                let place = Vector3::new(self.centre.x + x, self.centre.y + side, height);
                // A little ahead of straight down.
                (place, Vector3::new(place.x, place.y + 0.15 * height, 0.0))
            }
        }
    }

    fn unrest(&self, time_s: f64) -> Unrest {
        let mut sum: Unrest = std::array::from_fn(|k| {
            let strength = if k < 3 { self.options.current_m } else { self.options.current_deg.to_radians() };
            strength * self.waves[k].iter().map(|[rate, phase, share]| share * (rate * time_s + phase).sin()).sum::<f64>()
        });
        for (time, push) in &self.pushes {
            let weight = (-0.5 * ((time_s - time) / PUSH_S).powi(2)).exp();
            for k in 0..6 {
                sum[k] += weight * push[k];
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(options: MotionOptions) -> Motion {
        Motion::new(&options, Vector3::new(0.0, 0.0, 1.4))
    }

    #[test]
    fn the_target_is_on_the_axis_and_up_is_up() {
        let calm = MotionOptions { current_m: 0.0, current_deg: 0.0, push_m: 0.0, push_deg: 0.0, ..MotionOptions::default() };
        let path = motion(calm);
        for frame in [0, 20, 59] {
            let pose = path.rig_from_world(path.frame_time_s(frame));
            let seen = pose.apply(&Vector3::new(0.0, 0.0, 1.4));
            assert!(seen.x.abs() < 1e-12 && seen.y.abs() < 1e-12 && seen.z > 4.0);
            assert!(pose.apply(&Vector3::new(0.0, 0.0, 2.4)).y < 0.0, "what is higher lies further up in the image");
        }
        assert!((path.rig_from_world(0.0).centre().z - 1.0).abs() < 1e-12);
        assert!((path.rig_from_world(29.5).centre().z - 2.6).abs() < 1e-12);
    }

    #[test]
    fn the_vehicle_is_unquiet_within_its_bounds() {
        let (calm, path) =
            (motion(MotionOptions { current_m: 0.0, push_m: 0.0, ..MotionOptions::default() }), motion(MotionOptions::default()));
        let away = |t: f64| (path.rig_from_world(t).centre() - calm.rig_from_world(t).centre()).norm();
        let largest = (0..600).map(|i| away(0.05 * f64::from(i))).fold(0.0, f64::max);
        // Each coordinate by 0.12 + 0.02 m at most.
        assert!(largest > 0.03 && largest < 0.14 * 3f64.sqrt(), "{largest}");
    }

    /// Velocity and acceleration integrate to the path (trapezoidal rule over 10 ms; a push of 0.35 s bends it by 2e-5 m at most).
    #[test]
    fn derivatives_belong_to_the_path() {
        let path = motion(MotionOptions::default());
        let (mut place, mut velocity) = (path.rig_from_world(2.0).centre(), path.velocity(2.0));
        let h = 0.01;
        for i in 0..800 {
            let t = 2.0 + h * f64::from(i);
            let (a, b) = (path.acceleration(t), path.acceleration(t + h));
            place += velocity * h + (a * 2.0 + b) * (h * h / 6.0);
            velocity += (a + b) * (h / 2.0);
        }
        assert!((place - path.rig_from_world(10.0).centre()).norm() < 1e-4);
        assert!((velocity - path.velocity(10.0)).norm() < 1e-4);
        let turned = path.rig_from_world(3.0).rotation * path.rig_from_world(3.01).rotation.inverse();
        assert!((turned.scaled_axis() - path.angular_rate(3.005) * 0.01).norm() < 1e-6);
    }

    #[test]
    fn every_plan_goes_on_smoothly_before_its_beginning_and_after_its_end() {
        for kind in [MotionKind::Circle, MotionKind::Line, MotionKind::Lanes] {
            let path = motion(MotionOptions { kind, ..MotionOptions::default() });
            // Four lanes of 8 m in 30 s: 1.25 m/s on half circles of 0.5 m are 3.1 m/s2, pushes add 0.3 in each direction. A jump would be
            // a thousand times that.
            for i in 0..700 {
                let t = -2.0 + 0.05 * f64::from(i);
                assert!(path.acceleration(t).norm() < 4.0 && path.angular_rate(t).norm() < 1.2, "{kind:?} at {t}");
            }
        }
    }

    #[test]
    fn lanes_lead_over_the_whole_field() {
        let calm = MotionOptions { kind: MotionKind::Lanes, current_m: 0.0, push_m: 0.0, ..MotionOptions::default() };
        let path = motion(calm);
        let places: Vec<Vector3<f64>> = (0..600).map(|i| path.rig_from_world(path.duration_s() * f64::from(i) / 599.0).centre()).collect();
        let reach = |k: usize| places.iter().map(|p| p[k]).fold(0.0, f64::max);
        assert!((reach(0) - 4.5).abs() < 0.02 && (reach(1) - 1.5).abs() < 0.02, "{} {}", reach(0), reach(1));
        assert!(places.windows(2).all(|w| (w[1] - w[0]).norm() < 0.08), "no jumps");
    }
}
