//! Bundler's `bundle.out`, version 0.3 (Snavely, Seitz & Szeliski, *Photo tourism*, SIGGRAPH 2006), and its list of images.

use super::error::FormatError;
use crate::{Camera, CameraModel, ImageId, Reconstruction};
use std::io::Write;

/// Farther from the middle of the image a principal point cannot be left out, pixels.
const MAX_OFF_CENTRE_PX: f64 = 0.5;

/// Writes the oriented images and the points that they see as `bundle.out`, and the names of the images in the same order as a list.
///
/// The format's camera looks along -z, y up; its pixels count from the middle of the image, y up. It has one focal length, two radial terms
/// and no principal point.
///
/// # Errors
/// [`FormatError::NotRepresentable`] for a camera that needs more; what the streams say.
pub fn write_bundler(reconstruction: &Reconstruction, bundle: &mut dyn Write, list: &mut dyn Write) -> Result<(), FormatError> {
    let images: Vec<ImageId> = reconstruction.oriented_images().collect();
    let mut number_of = vec![None; reconstruction.images.len()];
    images.iter().enumerate().for_each(|(number, image)| number_of[image.index()] = Some(number));
    let seen = |point: &&crate::Point| point.track.iter().any(|o| number_of[o.image.index()].is_some());
    writeln!(bundle, "# Bundle file v0.3\n{} {}", images.len(), reconstruction.points.iter().filter(seen).count())?;
    for &image in &images {
        let entry = &reconstruction.images[image.index()];
        let [f, k1, k2] = interior(&reconstruction.cameras[entry.camera.index()]).map_err(|what| FormatError::NotRepresentable {
            format: "a Bundler file",
            what: format!("the camera of {} {what}", entry.name),
        })?;
        writeln!(list, "{}", entry.name)?;
        writeln!(bundle, "{f} {k1} {k2}")?;
        let Some(pose) = reconstruction.cam_from_world(image) else { continue };
        let (r, t) = (pose.rotation_matrix(), pose.translation);
        for (k, sign) in [1.0, -1.0, -1.0].into_iter().enumerate() {
            writeln!(bundle, "{} {} {}", sign * r[(k, 0)], sign * r[(k, 1)], sign * r[(k, 2)])?;
        }
        writeln!(bundle, "{} {} {}", t.x, -t.y, -t.z)?;
    }
    for point in reconstruction.points.iter().filter(seen) {
        let (x, [red, green, blue]) = (&point.xyz, point.colour);
        writeln!(bundle, "{} {} {}\n{red} {green} {blue}", x.x, x.y, x.z)?;
        let views = point.track.iter().filter_map(|o| Some((o, number_of[o.image.index()]?)));
        write!(bundle, "{}", views.clone().count())?;
        for (o, number) in views {
            let camera = &reconstruction.cameras[reconstruction.images[o.image.index()].camera.index()];
            let pixel = reconstruction.pixel(*o);
            let (x, y) = (pixel.x - f64::from(camera.width()) / 2.0, f64::from(camera.height()) / 2.0 - pixel.y);
            write!(bundle, " {number} {} {x} {y}", o.keypoint.0)?;
        }
        writeln!(bundle)?;
    }
    Ok(())
}

/// Focal length and radial terms; else what is in the way.
fn interior(camera: &Camera) -> Result<[f64; 3], String> {
    let p = camera.params();
    if camera.port().is_some() {
        return Err("stands behind a port".to_owned());
    }
    let found = match camera.model() {
        CameraModel::Pinhole if p[0] == p[1] => [p[0], 0.0, 0.0],
        CameraModel::SimpleRadial => [p[0], p[3], 0.0],
        CameraModel::Radial => [p[0], p[3], p[4]],
        CameraModel::OpenCv if p[0] == p[1] && p[6..8] == [0.0; 2] => [p[0], p[4], p[5]],
        CameraModel::Brown if p[5..10] == [0.0; 5] => [p[0], p[3], p[4]],
        model => return Err(format!("needs more than a focal length and two radial terms (model {})", model.name())),
    };
    let middle = [f64::from(camera.width()) / 2.0, f64::from(camera.height()) / 2.0];
    let off = camera.principal_point().iter().zip(middle).map(|(p, m)| (p - m).abs()).fold(0.0, f64::max);
    if off > MAX_OFF_CENTRE_PX {
        return Err(format!("has its principal point {off:.1} px from the middle of the image"));
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::testing::one_image;
    use nalgebra::{Matrix3, Vector3};

    fn written(camera: Camera) -> Result<(String, String), FormatError> {
        let (mut bundle, mut list) = (Vec::new(), Vec::new());
        write_bundler(&one_image(camera), &mut bundle, &mut list)?;
        Ok((String::from_utf8(bundle).expect("text"), String::from_utf8(list).expect("text")))
    }

    #[test]
    fn what_is_written_projects_by_bundlers_formulas() {
        let camera = Camera::new(CameraModel::Radial, 640, 480, &[500.0, 320.0, 240.0, -0.1, 0.02]).expect("valid");
        let (bundle, list) = written(camera).expect("has a form");
        assert_eq!(list, "C1/1.jpg\n");
        let lines: Vec<Vec<f64>> = bundle.lines().skip(1).map(|l| l.split(' ').map(|n| n.parse().expect("a number")).collect()).collect();
        let points = lines[0][1] as usize;
        assert_eq!((lines[0][0], points, lines.len()), (1.0, one_image(camera).points.len(), 6 + 3 * points));
        let [f, k1, k2] = lines[1][..] else { panic!("{:?}", lines[1]) };
        let r = Matrix3::from_fn(|i, j| lines[2 + i][j]);
        for p in 0..points {
            let [xyz, colour, view] = [0, 1, 2].map(|k| &lines[6 + 3 * p + k]);
            let x = r * Vector3::from_row_slice(xyz) + Vector3::from_row_slice(&lines[5]);
            let (u, v) = (-x.x / x.z, -x.y / x.z);
            let r2 = u * u + v * v;
            let scale = f * (1.0 + k1 * r2 + k2 * r2 * r2);
            assert_eq!((colour.as_slice(), view[0], view[2]), ([9.0, 8.0, 7.0].as_slice(), 1.0, p as f64));
            // Keypoints are stored as f32.
            assert!((scale * u - view[3]).abs() < 1e-4 && (scale * v - view[4]).abs() < 1e-4, "{x:?} {view:?}");
        }
    }

    #[test]
    fn what_has_no_form_is_refused() {
        let refused =
            |model, params: &[f64]| written(Camera::new(model, 640, 480, params).expect("valid")).expect_err("no form").to_string();
        let fisheye = refused(CameraModel::Fisheye, &[400.0, 400.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(fisheye.contains("C1/1.jpg needs more than") && fisheye.contains("fisheye"), "{fisheye}");
        let off = refused(CameraModel::SimpleRadial, &[400.0, 330.0, 240.0, 0.0]);
        assert!(off.contains("10.0 px from the middle"), "{off}");
    }
}
