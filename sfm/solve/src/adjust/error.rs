//! Why a problem cannot be adjusted, and the check of the input.

use super::problem::{PoseBlock, Problem};
use nalgebra::Vector3;
use scene::Rigid3;
use thiserror::Error;

/// Why a problem was refused; it is then unchanged.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AdjustError {
    /// An index points outside of its list.
    #[error("{item} {index} refers to {target} {found}, but there are only {count}")]
    BadIndex {
        /// What refers.
        item: &'static str,
        /// Which one of them.
        index: usize,
        /// What it refers to.
        target: &'static str,
        /// The index it gives.
        found: u32,
        /// The length of the list.
        count: usize,
    },
    /// A value is NaN or infinite.
    #[error("{item} {index}: {field} is not finite")]
    NotFinite {
        /// What has it.
        item: &'static str,
        /// Which one of them.
        index: usize,
        /// The field.
        field: &'static str,
    },
    /// A standard deviation or length is not positive.
    #[error("{item} {index}: {field} = {value} is not positive")]
    NotPositive {
        /// What has it.
        item: &'static str,
        /// Which one of them.
        index: usize,
        /// The field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// Both ends of a length are the same.
    #[error("{item} {index}: both ends are the same")]
    SameEnds {
        /// A baseline or a scale bar.
        item: &'static str,
        /// Which one of them.
        index: usize,
    },
    /// More blocks or observations than 32 bits can count.
    #[error("the problem is too large: {count} {what}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// How many.
        count: usize,
    },
    /// A setting is out of its range.
    #[error("option {name} = {value} is not possible")]
    BadOption {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The workspace of the linear solver could not be allocated.
    #[error("not enough memory for a reduced system of {unknowns} unknowns")]
    OutOfMemory {
        /// Its size.
        unknowns: usize,
    },
}

/// Checks every index, value and standard deviation.
pub(super) fn validate(problem: &Problem) -> Result<(), AdjustError> {
    for (what, count) in [("observations", problem.observations.len()), ("points", problem.points.len())] {
        // A margin for what is derived from them: an observation meets three blocks.
        if count > (u32::MAX / 8) as usize {
            return Err(AdjustError::TooLarge { what, count });
        }
    }
    poses("sensor", &problem.sensors)?;
    poses("frame", &problem.frames)?;
    for (index, block) in problem.cameras.iter().enumerate() {
        finite("camera", index, "parameter", block.camera.params().iter().all(|p| p.is_finite()))?;
        for (prior, _) in block.priors.iter().zip(block.camera.params()) {
            if let Some(prior) = prior {
                finite("camera", index, "prior", prior.value.is_finite())?;
                positive("camera", index, "sigma of a prior", prior.sigma)?;
            }
        }
    }
    for (index, block) in problem.points.iter().enumerate() {
        finite("point", index, "position", block.xyz.iter().all(|x| x.is_finite()))?;
    }
    let (frames, sensors) = (problem.frames.len(), problem.sensors.len());
    let (cameras, points) = (problem.cameras.len(), problem.points.len());
    for (index, o) in problem.observations.iter().enumerate() {
        in_range("observation", index, "frame", o.frame, frames)?;
        in_range("observation", index, "sensor", o.sensor, sensors)?;
        in_range("observation", index, "camera", o.camera, cameras)?;
        in_range("observation", index, "point", o.point, points)?;
        finite("observation", index, "pixel", o.pixel.x.is_finite() && o.pixel.y.is_finite())?;
        positive("observation", index, "sigma_px", o.sigma_px)?;
    }
    for (index, b) in problem.baselines.iter().enumerate() {
        for (frame, sensor) in [b.a, b.b] {
            in_range("baseline", index, "frame", frame, frames)?;
            in_range("baseline", index, "sensor", sensor, sensors)?;
        }
        length("baseline", index, b.length, b.sigma, b.a == b.b)?;
    }
    for (index, b) in problem.scale_bars.iter().enumerate() {
        in_range("scale bar", index, "point", b.a, points)?;
        in_range("scale bar", index, "point", b.b, points)?;
        length("scale bar", index, b.length, b.sigma, b.a == b.b)?;
    }
    instruments(problem)
}

fn instruments(problem: &Problem) -> Result<(), AdjustError> {
    let (frames, all) = (problem.frames.len(), |v: &Vector3<f64>| v.iter().all(|x| x.is_finite()));
    for (index, o) in problem.positions.iter().enumerate() {
        in_range("position", index, "frame", o.frame, frames)?;
        finite("position", index, "xyz or in_rig", all(&o.xyz) && all(&o.in_rig))?;
        axes("position", index, &o.sigma)?;
    }
    for (index, o) in problem.directions.iter().enumerate() {
        in_range("direction", index, "frame", o.frame, frames)?;
        finite("direction", index, "in_rig or in_world", all(&o.in_rig) && all(&o.in_world))?;
        positive("direction", index, "length", o.in_rig.norm().min(o.in_world.norm()))?;
        positive("direction", index, "sigma_rad", o.sigma_rad)?;
    }
    for (index, o) in problem.headings.iter().enumerate() {
        in_range("heading", index, "frame", o.frame, frames)?;
        finite("heading", index, "heading_rad or axis_in_rig", o.heading_rad.is_finite() && all(&o.axis_in_rig))?;
        positive("heading", index, "sigma_rad", o.sigma_rad)?;
    }
    for (index, o) in problem.control_points.iter().enumerate() {
        in_range("control point", index, "point", o.point, problem.points.len())?;
        finite("control point", index, "xyz", all(&o.xyz))?;
        axes("control point", index, &o.sigma)?;
    }
    Ok(())
}

/// Each positive or infinite.
fn axes(item: &'static str, index: usize, sigma: &Vector3<f64>) -> Result<(), AdjustError> {
    sigma.iter().try_for_each(|&s| if s == f64::INFINITY { Ok(()) } else { positive(item, index, "sigma", s) })
}

fn poses(item: &'static str, blocks: &[PoseBlock]) -> Result<(), AdjustError> {
    for (index, block) in blocks.iter().enumerate() {
        finite(item, index, "pose", is_finite(&block.pose))?;
        if let Some(prior) = &block.prior {
            finite(item, index, "prior", is_finite(&prior.pose))?;
            positive(item, index, "sigma_rotation_rad", prior.sigma_rotation_rad)?;
            positive(item, index, "sigma_translation", prior.sigma_translation)?;
        }
    }
    Ok(())
}

fn length(item: &'static str, index: usize, length: f64, sigma: f64, same: bool) -> Result<(), AdjustError> {
    positive(item, index, "length", length)?;
    positive(item, index, "sigma", sigma)?;
    if same { Err(AdjustError::SameEnds { item, index }) } else { Ok(()) }
}

fn is_finite(pose: &Rigid3) -> bool {
    pose.rotation.coords.iter().chain(pose.translation.iter()).all(|x| x.is_finite())
}

fn finite(item: &'static str, index: usize, field: &'static str, ok: bool) -> Result<(), AdjustError> {
    if ok { Ok(()) } else { Err(AdjustError::NotFinite { item, index, field }) }
}

fn positive(item: &'static str, index: usize, field: &'static str, value: f64) -> Result<(), AdjustError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(AdjustError::NotPositive { item, index, field, value }) }
}

fn in_range(item: &'static str, index: usize, target: &'static str, found: u32, count: usize) -> Result<(), AdjustError> {
    if (found as usize) < count { Ok(()) } else { Err(AdjustError::BadIndex { item, index, target, found, count }) }
}
