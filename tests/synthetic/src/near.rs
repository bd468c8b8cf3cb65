//! A reconstruction against the truth.

use nalgebra::{Vector2, Vector3};
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
    /// Distance of where a direction is imaged, over the whole frame of each camera, pixels.
    pub interior_px: f64,
    /// Distance of points, in the unit of the truth; only for reconstructions of the same points in the same order.
    pub points: f64,
}

impl Default for Tolerances {
    /// No image may be missing; anything else passes.
    fn default() -> Self {
        Self { missing_images: 0, centre: f64::INFINITY, rotation_rad: f64::INFINITY, interior_px: f64::INFINITY, points: f64::INFINITY }
    }
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
    /// Largest distance of where a direction is imaged, pixels, and the camera's number; cameras are compared in their order.
    pub max_interior_px: (f64, usize),
    /// Root mean square distance of points after the alignment; `None` where the numbers of points differ.
    pub rms_points: Option<f64>,
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
    let mut out = Deviation {
        missing,
        max_centre: (0.0, String::new()),
        rms_centre: 0.0,
        max_rotation_rad: (0.0, String::new()),
        max_interior_px: interior(found, truth),
        rms_points: points(found, truth, &used),
        scale: free.scale,
    };
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

/// Places along each side of a frame at which cameras are compared.
const GRID: usize = 12;

fn interior(found: &Reconstruction, truth: &Reconstruction) -> (f64, usize) {
    if found.cameras.len() != truth.cameras.len() {
        return (f64::INFINITY, found.cameras.len().min(truth.cameras.len()));
    }
    let mut worst = (0.0, 0);
    for (c, (found, truth)) in found.cameras.iter().zip(&truth.cameras).enumerate() {
        for i in 0..GRID * GRID {
            let place = |k: usize, size: u32| (k as f64 + 0.5) / GRID as f64 * f64::from(size);
            let pixel = Vector2::new(place(i % GRID, truth.width()), place(i / GRID, truth.height()));
            let seen = truth.ray(&pixel).and_then(|ray| found.project(&ray));
            let miss = seen.map_or(f64::INFINITY, |p| (p - pixel).norm());
            if miss.is_nan() || miss > worst.0 {
                worst = (if miss.is_nan() { f64::INFINITY } else { miss }, c);
            }
        }
    }
    worst
}

fn points(found: &Reconstruction, truth: &Reconstruction, truth_from_found: &Similarity3) -> Option<f64> {
    if found.points.len() != truth.points.len() || truth.points.is_empty() {
        return None;
    }
    let squares = found.points.iter().zip(&truth.points).map(|(f, t)| (truth_from_found.apply(&f.xyz) - t.xyz).norm_squared());
    Some((squares.sum::<f64>() / truth.points.len() as f64).sqrt())
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
    assert!(
        d.max_interior_px.0 <= tolerances.interior_px,
        "camera {} images directions up to {} px away (at most {})",
        d.max_interior_px.1,
        d.max_interior_px.0,
        tolerances.interior_px
    );
    if tolerances.points.is_finite() {
        let points = d.rms_points.expect("points are compared only with as many of them");
        assert!(points <= tolerances.points, "points are off by {points} RMS (at most {})", tolerances.points);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::{SurveyOptions, survey};
    use nalgebra::UnitQuaternion;
    use scene::Rigid3;

    const TIGHT: Tolerances = Tolerances { missing_images: 0, centre: 1e-9, rotation_rad: 1e-7, interior_px: 1e-9, points: 1e-9 };

    fn truth() -> Reconstruction {
        survey(&SurveyOptions { exposures: 6, cameras: 2, points: 10, ..SurveyOptions::default() }).truth
    }

    /// The same scene in another world: frames, rig and points move.
    fn moved(truth: &Reconstruction, scale: f64) -> Reconstruction {
        let rotation = UnitQuaternion::from_euler_angles(0.4, -1.0, 2.5);
        let world = Similarity3 { scale, rotation, translation: Vector3::new(3.0, -5.0, 8.0) };
        let mut out = truth.clone();
        for frame in &mut out.frames {
            frame.rig_from_world = frame.rig_from_world.map(|pose| pose.in_new_world(&world));
        }
        for sensor in &mut out.rigs[0].sensors {
            sensor.cam_from_rig.translation *= scale;
        }
        out.points.iter_mut().for_each(|p| p.xyz = world.apply(&p.xyz));
        out
    }

    #[test]
    fn another_world_is_near_up_to_its_freedom() {
        let truth = truth();
        assert_near(&moved(&truth, 1.0), &truth, &TIGHT, Alignment::Se3);
        let scaled = moved(&truth, 0.25);
        assert_near(&scaled, &truth, &TIGHT, Alignment::Sim3);
        let rigid = deviation(&scaled, &truth, Alignment::Se3).expect("enough images");
        assert!((rigid.scale - 4.0).abs() < 1e-9 && rigid.max_centre.0 > 0.5, "{rigid:?}");
    }

    #[test]
    fn cameras_are_compared_by_what_they_image() {
        let truth = truth();
        let mut other = truth.clone();
        // 1 % of the principal distance: 5.6 px at the corner of 960 x 600, half a cell from it.
        other.cameras[1].params_mut()[0] *= 1.01;
        let d = deviation(&other, &truth, Alignment::Se3).expect("enough images");
        assert!((4.5..5.7).contains(&d.max_interior_px.0) && d.max_interior_px.1 == 1, "{d:?}");
    }

    #[test]
    fn each_fault_is_told_with_its_image() {
        let truth = truth();
        let mut turned = moved(&truth, 1.0);
        let pose = turned.frames[3].rig_from_world.expect("oriented");
        let turn = Rigid3::new(UnitQuaternion::from_scaled_axis(Vector3::x() * 0.02), Vector3::zeros());
        turned.frames[3].rig_from_world = Some(turn * pose);
        let d = deviation(&turned, &truth, Alignment::Se3).expect("enough images");
        // The alignment of the centres hardly follows one camera of twelve that swings by 1 cm.
        assert!((d.max_rotation_rad.0 - 0.02).abs() < 2e-3 && d.max_rotation_rad.1.ends_with("0003.png"), "{d:?}");
        let mut without = truth.clone();
        without.frames[2].rig_from_world = None;
        assert_eq!(deviation(&without, &truth, Alignment::Se3).expect("enough images").missing, ["C1/0002.png", "C2/0002.png"]);
        without.frames.iter_mut().skip(1).for_each(|f| f.rig_from_world = None);
        assert_eq!(deviation(&without, &truth, Alignment::Se3), None);
    }

    #[test]
    #[should_panic(expected = "missing")]
    fn a_missing_image_fails() {
        let truth = truth();
        let mut without = truth.clone();
        without.frames[2].rig_from_world = None;
        assert_near(&without, &truth, &TIGHT, Alignment::Se3);
    }
}
