//! A reconstruction against the truth.

use nalgebra::Vector3;
use scene::{ImageId, Reconstruction, Similarity3};
use std::collections::BTreeMap;

/// What may be taken away before comparing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alignment {
    /// A rigid motion: the scale must be right.
    Se3,
    /// A similarity.
    Sim3,
}

/// The largest deviations that pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Images of the truth that may be missing.
    pub missing_images: usize,
    /// Distance of projection centres, in the unit of the truth.
    pub centre: f64,
    /// Angle between rotations, radians.
    pub rotation_rad: f64,
}

/// How far a reconstruction is from the truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// Images of the truth without a pose in the reconstruction.
    pub missing: Vec<String>,
    /// Largest distance of projection centres after the alignment, and the image.
    pub max_centre: (f64, String),
    /// Root mean square of these distances.
    pub rms_centre: f64,
    /// Largest angle between rotations, radians, and the image.
    pub max_rotation_rad: (f64, String),
    /// Units of the truth in one unit of the reconstruction, by the best similarity.
    pub scale: f64,
}

/// Compares poses of images of the same name; `None` when fewer than three are common, or all stand on one line.
#[must_use]
pub fn deviation(found: &Reconstruction, truth: &Reconstruction, alignment: Alignment) -> Option<Deviation> {
    let by_name: BTreeMap<&str, ImageId> = found.oriented_images().map(|i| (found.images[i.index()].name.as_str(), i)).collect();
    let mut common = Vec::new();
    let mut missing = Vec::new();
    for image in truth.oriented_images() {
        let name = &truth.images[image.index()].name;
        match by_name.get(name.as_str()).and_then(|&i| found.cam_from_world(i)) {
            Some(pose) => common.push((name, pose, truth.cam_from_world(image)?)),
            None => missing.push(name.clone()),
        }
    }
    let from: Vec<Vector3<f64>> = common.iter().map(|(_, found, _)| found.centre()).collect();
    let to: Vec<Vector3<f64>> = common.iter().map(|(_, _, truth)| truth.centre()).collect();
    let free = Similarity3::align(&from, &to, true)?;
    let used = Similarity3::align(&from, &to, alignment == Alignment::Sim3)?;
    let mut out =
        Deviation { missing, max_centre: (0.0, String::new()), rms_centre: 0.0, max_rotation_rad: (0.0, String::new()), scale: free.scale };
    for (name, found, truth) in &common {
        let aligned = found.in_new_world(&used);
        let distance = (aligned.centre() - truth.centre()).norm();
        let angle = aligned.rotation.angle_to(&truth.rotation);
        out.rms_centre += distance * distance / common.len() as f64;
        if distance >= out.max_centre.0 {
            out.max_centre = (distance, (*name).clone());
        }
        if angle >= out.max_rotation_rad.0 {
            out.max_rotation_rad = (angle, (*name).clone());
        }
    }
    out.rms_centre = out.rms_centre.sqrt();
    Some(out)
}

/// Panics with the figures when a reconstruction is further from the truth than the tolerances.
///
/// # Panics
/// That is what it is for.
#[track_caller]
pub fn assert_near(found: &Reconstruction, truth: &Reconstruction, tolerances: &Tolerances, alignment: Alignment) {
    let Some(d) = deviation(found, truth, alignment) else {
        panic!("too few images are oriented to compare: {}", found.oriented_images().count())
    };
    assert!(d.missing.len() <= tolerances.missing_images, "missing: {:?}", d.missing);
    assert!(
        d.max_centre.0 <= tolerances.centre,
        "centre of {} is off by {} (at most {})",
        d.max_centre.1,
        d.max_centre.0,
        tolerances.centre
    );
    assert!(
        d.max_rotation_rad.0 <= tolerances.rotation_rad,
        "rotation of {} is off by {} rad (at most {})",
        d.max_rotation_rad.1,
        d.max_rotation_rad.0,
        tolerances.rotation_rad
    );
}
