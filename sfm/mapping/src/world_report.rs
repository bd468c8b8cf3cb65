//! What instruments and control points say of an adjusted model.

use crate::lengths::{picked_covariance, triangulated};
use crate::model::Model;
use crate::quality::CRITICAL;
use crate::ties::{Ties, frame_of_exposure};
use nalgebra::Vector3;
use scene::Rigid3;

/// What instruments and control points say of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct WorldReport {
    /// East and north of positions, metres.
    pub horizontal: Option<InstrumentReport>,
    /// Heights and depths, metres.
    pub height: Option<InstrumentReport>,
    /// Directions of the vertical, radians.
    pub tilt: Option<InstrumentReport>,
    /// Headings, radians.
    pub heading: Option<InstrumentReport>,
    /// Control and check points, in the order of the input.
    pub control_points: Vec<ControlPointReport>,
}

/// Residuals of an instrument.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InstrumentReport {
    /// Readings of oriented exposures.
    pub readings: usize,
    /// Readings with a component of more than 3.29 standard deviations; they hardly weigh.
    pub outliers: usize,
    /// Root mean square of the components of the others, in the unit of the instrument.
    pub rms: f64,
    /// The same over the given standard deviation: near 1 where that is right.
    pub sigma0: f64,
}

/// A control point and where it was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPointReport {
    /// Position in the input.
    pub index: usize,
    /// Found minus given, metres, along the axes that are known; `None` where it is picked in fewer than two oriented images.
    pub error_m: Option<Vector3<f64>>,
    /// The largest component over its standard deviation, which is that of the given coordinate and that of the picks together.
    pub normalised_residual: Option<f64>,
    /// Took no part in the adjustment.
    pub check: bool,
}

/// Sums of residuals.
#[derive(Default)]
struct Sums {
    readings: usize,
    outliers: usize,
    components: usize,
    squares: f64,
    normalised: f64,
}

impl Sums {
    /// Adds the components of a reading, each with its standard deviation.
    fn add(&mut self, components: &[(f64, f64)]) {
        self.readings += 1;
        if components.iter().any(|(v, sigma)| v.abs() > CRITICAL * sigma) {
            self.outliers += 1;
            return;
        }
        self.components += components.len();
        self.squares += components.iter().map(|(v, _)| v * v).sum::<f64>();
        self.normalised += components.iter().map(|(v, sigma)| (v / sigma).powi(2)).sum::<f64>();
    }

    fn report(&self) -> Option<InstrumentReport> {
        let n = self.components.max(1) as f64;
        let (rms, sigma0) = ((self.squares / n).sqrt(), (self.normalised / n).sqrt());
        (self.readings > 0).then_some(InstrumentReport { readings: self.readings, outliers: self.outliers, rms, sigma0 })
    }
}

pub(crate) fn report_world(model: &Model, ties: &Ties) -> Option<WorldReport> {
    if ties.is_empty() {
        return None;
    }
    let frames = frame_of_exposure(model);
    let pose = |exposure: u32| -> Option<Rigid3> { model.frames[frames.get(&exposure)?.index()].rig_from_world };
    let (mut horizontal, mut height, mut tilt, mut heading) = (Sums::default(), Sums::default(), Sums::default(), Sums::default());
    let world = &model.input.world;
    for o in world.positions.iter().filter(|_| ties.places) {
        let Some(pose) = pose(o.exposure) else { continue };
        let v = pose.inverse().apply(&o.in_rig) - o.xyz;
        let known = |axes: std::ops::Range<usize>| axes.map(|k| (v[k], o.sigma_m[k])).filter(|(_, s)| s.is_finite()).collect::<Vec<_>>();
        for (sums, components) in [(&mut horizontal, known(0..2)), (&mut height, known(2..3))] {
            if !components.is_empty() {
                sums.add(&components);
            }
        }
    }
    for o in world.ups.iter().filter(|_| ties.attitude) {
        let Some(pose) = pose(o.exposure) else { continue };
        let off = (pose.rotation * Vector3::z()).cross(&o.up_in_rig.normalize());
        // Two components that are alike share the angle.
        let each = off.norm().asin() / 2f64.sqrt();
        tilt.add(&[(each, o.sigma_rad), (each, o.sigma_rad)]);
    }
    for o in world.headings.iter().filter(|_| ties.attitude) {
        let Some(pose) = pose(o.exposure) else { continue };
        let axis = pose.rotation.inverse() * o.axis_in_rig;
        let off = axis.x.atan2(axis.y) - o.heading_rad;
        heading.add(&[(off.sin().atan2(off.cos()), o.sigma_rad)]);
    }
    let control_points = (0..world.control_points.len()).map(|i| control_point(model, i)).collect();
    let [horizontal, height, tilt, heading] = [horizontal, height, tilt, heading].map(|s| s.report());
    Some(WorldReport { horizontal, height, tilt, heading, control_points })
}

fn control_point(model: &Model, index: usize) -> ControlPointReport {
    let known = &model.input.world.control_points[index];
    let found = triangulated(model, &known.picks);
    let error = found.map(|xyz| xyz - known.xyz);
    let normalised = |(xyz, error): (Vector3<f64>, Vector3<f64>)| {
        let picked = picked_covariance(model, &known.picks, &xyz)?;
        let each =
            (0..3).filter(|&k| known.sigma_m[k].is_finite()).map(|k| error[k] / known.sigma_m[k].hypot(picked[(k, k)].max(0.0).sqrt()));
        each.max_by(|a, b| a.abs().total_cmp(&b.abs()))
    };
    ControlPointReport { index, error_m: error, normalised_residual: found.zip(error).and_then(normalised), check: known.check }
}
