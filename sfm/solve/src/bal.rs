//! The text format of *Bundle Adjustment in the Large* (Agarwal, Snavely, Seitz & Szeliski, ECCV 2010).

use crate::adjust::{CameraBlock, ImageObservation, PointBlock, PoseBlock, Problem};
use nalgebra::{Quaternion, UnitQuaternion, Vector2, Vector3};
use scene::camera::MAX_CAMERA_PARAMS;
use scene::{Camera, CameraModel, Rigid3};
use thiserror::Error;

/// Why a text is no problem.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum BalError {
    /// A word is not a number, or not the one that is expected.
    #[error("line {line}: \"{word}\" is not {expected}")]
    Word {
        /// From 1.
        line: usize,
        /// The word.
        word: String,
        /// What should stand there.
        expected: &'static str,
    },
    /// The text ends early.
    #[error("the file ends where {expected} should follow: it was cut short, or its first line promises too much")]
    Short {
        /// What should follow.
        expected: &'static str,
    },
    /// A camera is none.
    #[error("camera {index}: {what}")]
    Camera {
        /// Which one, from 0.
        index: usize,
        /// What is wrong.
        what: String,
    },
}

/// Words of a text with their lines.
struct Words<'a>(Box<dyn Iterator<Item = (usize, &'a str)> + 'a>);

impl Words<'_> {
    fn number(&mut self, expected: &'static str) -> Result<f64, BalError> {
        let (line, word) = self.0.next().ok_or(BalError::Short { expected })?;
        let parsed = word.parse().ok().filter(|v: &f64| v.is_finite());
        parsed.ok_or_else(|| BalError::Word { line, word: word.to_owned(), expected })
    }

    fn index(&mut self, below: usize, expected: &'static str) -> Result<u32, BalError> {
        let (line, word) = self.0.next().ok_or(BalError::Short { expected })?;
        let parsed = word.parse().ok().filter(|v: &u32| (*v as usize) < below);
        parsed.ok_or_else(|| BalError::Word { line, word: word.to_owned(), expected })
    }

    fn vector(&mut self, expected: &'static str) -> Result<Vector3<f64>, BalError> {
        Ok(Vector3::new(self.number(expected)?, self.number(expected)?, self.number(expected)?))
    }
}

/// The problem of a text: one frame and one camera (focal length and two radial terms, all free) an image.
///
/// BAL's cameras look along -z with y up, and p = -P / P.z. Turned by pi about x they look along z with y down; u stays
/// and v changes sign. Its radial polynomial is ours.
///
/// # Errors
/// [`BalError`] with the line.
pub fn parse_bal(text: &str) -> Result<Problem, BalError> {
    let words = text.lines().enumerate().flat_map(|(i, line)| line.split_ascii_whitespace().map(move |word| (i + 1, word)));
    let mut words = Words(Box::new(words));
    let most = u32::MAX as usize;
    let cameras = words.index(most, "the number of cameras")? as usize;
    let points = words.index(most, "the number of points")? as usize;
    let observations = words.index(most, "the number of observations")?;
    let mut problem = Problem { sensors: vec![PoseBlock::fixed(Rigid3::identity())], ..Problem::default() };
    for _ in 0..observations {
        let image = words.index(cameras, "a camera of an observation")?;
        let point = words.index(points, "a point of an observation")?;
        let pixel = Vector2::new(words.number("an image coordinate")?, -words.number("an image coordinate")?);
        problem.observations.push(ImageObservation { frame: image, sensor: 0, camera: image, point, pixel, sigma_px: 1.0 });
    }
    let turn = UnitQuaternion::new_normalize(Quaternion::new(0.0, 1.0, 0.0, 0.0));
    for index in 0..cameras {
        let (w, t) = (words.vector("a rotation of a camera")?, words.vector("a translation of a camera")?);
        let params = words.vector("focal length and distortion of a camera")?;
        problem.frames.push(PoseBlock::free(Rigid3::new(turn * UnitQuaternion::from_scaled_axis(w), turn * t)));
        let camera = Camera::new(CameraModel::Radial, 1, 1, &[params.x, 0.0, 0.0, params.y, params.z]);
        let camera = camera.map_err(|e| BalError::Camera { index, what: e.to_string() })?;
        let mut free = [false; MAX_CAMERA_PARAMS];
        (free[0], free[3], free[4]) = (true, true, true);
        problem.cameras.push(CameraBlock { free, ..CameraBlock::fixed(camera) });
    }
    for _ in 0..points {
        problem.points.push(PointBlock { xyz: words.vector("a point")?, free: true });
    }
    Ok(problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "1 2 2\n0 0 -3.5e1 2.0e1\n0 1 4.0 -1.0\n0.1\n0\n0\n1\n2\n-9\n500\n0.01\n0\n1\n2\n3\n-1\n0\n-4\n";

    #[test]
    fn a_point_projects_as_the_format_says() {
        let problem = parse_bal(SMALL).expect("sound");
        assert_eq!((problem.frames.len(), problem.points.len(), problem.observations.len()), (1, 2, 2));
        assert_eq!(problem.observations[0].pixel, Vector2::new(-35.0, -20.0));
        // P = R X + t; p = -P / P.z; p' = f r(p) p, y up.
        let x = problem.points[1].xyz;
        let p = UnitQuaternion::from_scaled_axis(Vector3::new(0.1, 0.0, 0.0)) * x + Vector3::new(1.0, 2.0, -9.0);
        let (u, v) = (-p.x / p.z, -p.y / p.z);
        let scale = 500.0 * (1.0 + 0.01 * (u * u + v * v));
        let found = problem.cameras[0].camera.project(&problem.frames[0].pose.apply(&x)).expect("in front");
        assert!((found - Vector2::new(scale * u, -scale * v)).norm() < 1e-9, "{found}");
    }

    #[test]
    fn broken_texts_are_refused_with_the_line() {
        for cut in 0..SMALL.split_ascii_whitespace().count() {
            let words: Vec<&str> = SMALL.split_ascii_whitespace().take(cut).collect();
            assert!(matches!(parse_bal(&words.join("\n")), Err(BalError::Short { .. })), "{cut}");
        }
        let wrong = |from: &str, to: &str| parse_bal(&SMALL.replacen(from, to, 1));
        assert!(matches!(wrong("0 1 4.0", "0 2 4.0"), Err(BalError::Word { line: 3, .. })));
        assert!(matches!(wrong("4.0", "four"), Err(BalError::Word { line: 3, .. })));
        assert!(matches!(wrong("500", "-500"), Err(BalError::Camera { index: 0, .. })));
        assert!(matches!(wrong("500", "nan"), Err(BalError::Word { line: 10, .. })));
        assert!(matches!(parse_bal("4000000000 1 1\n"), Err(BalError::Short { .. })));
    }
}
