//! Bundler's `bundle.out`, version 0.3 (Snavely, Seitz & Szeliski, *Photo tourism*, SIGGRAPH 2006), and its list of images.

use super::error::FormatError;
use crate::{
    Camera, CameraId, CameraModel, Frame, FrameId, Image, ImageId, KeypointIndex, Observation, Point, Reconstruction, Rig, RigId, Rigid3,
    Scale,
};
use nalgebra::{Matrix3, Vector3};
use std::io::Write;

const FILE: &str = "bundle.out";
const HEAD: &str = "# Bundle file v0.3";
/// Largest deviation of a rotation matrix from orthonormality: files have seven digits and more.
const ROTATION_TOLERANCE: f64 = 1e-3;
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
    writeln!(bundle, "{HEAD}\n{} {}", images.len(), reconstruction.points.iter().filter(seen).count())?;
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

/// Reads `bundle.out` and the list of its images; `size_of` gives the width and height of an image by its name there, which the format lacks.
///
/// An image whose camera has no focal length was not oriented. Images with the same interior orientation share a camera. Every observation
/// becomes a keypoint; the numbers of the keypoints in the file belong to files that are not read. The unit is open.
///
/// # Errors
/// [`FormatError::Line`] where a line is not what the format says, or an image has no size.
pub fn read_bundler(bundle: &str, list: &str, size_of: &dyn Fn(&str) -> Option<(u32, u32)>) -> Result<Reconstruction, FormatError> {
    let names: Vec<&str> = list.lines().map(name_of).filter(|n| !n.is_empty()).collect();
    let mut numbers = Numbers::of(bundle)?;
    let [images, points] = [numbers.count("the number of images")?, numbers.count("the number of points")?];
    if images != names.len() {
        return Err(numbers.wrong(format!("{images} images, but the list names {}", names.len())));
    }
    let mut model = Reconstruction {
        cameras: Vec::new(),
        rigs: Vec::new(),
        frames: Vec::new(),
        images: Vec::new(),
        keypoints: Vec::new(),
        points: Vec::new(),
        scale: Scale::Arbitrary,
    };
    for (i, name) in names.into_iter().enumerate() {
        let (width, height) = size_of(name).ok_or_else(|| numbers.wrong(format!("the size of image {name} is not known")))?;
        let [f, k1, k2] = numbers.next_n("a focal length and two radial terms")?;
        let r: [f64; 9] = numbers.next_n("a rotation matrix")?;
        let t: [f64; 3] = numbers.next_n("a translation")?;
        let (w, h) = (f64::from(width), f64::from(height));
        let focal = if f > 0.0 { f } else { w.max(h) };
        let camera = Camera::new(CameraModel::Radial, width, height, &[focal, w / 2.0, h / 2.0, k1, k2]);
        let camera = camera.map_err(|e| numbers.wrong(format!("image {name}: {e}")))?;
        let number = model.cameras.iter().position(|c| *c == camera).unwrap_or_else(|| {
            model.rigs.push(Rig::single(CameraId::new(model.cameras.len())));
            model.cameras.push(camera);
            model.cameras.len() - 1
        });
        let pose = if f > 0.0 {
            let rotation = Matrix3::from_fn(|row, column| if row == 0 { r[column] } else { -r[3 * row + column] });
            if (rotation * rotation.transpose() - Matrix3::identity()).norm() > ROTATION_TOLERANCE || rotation.determinant() < 0.0 {
                return Err(numbers.wrong(format!("the matrix of image {name} is no rotation")));
            }
            Some(Rigid3::from_matrix(&rotation, Vector3::new(t[0], -t[1], -t[2])))
        } else {
            None
        };
        model.frames.push(Frame { rig: RigId::new(number), exposure: i as u32, rig_from_world: pose });
        model.images.push(Image { name: name.to_owned(), camera: CameraId::new(number), frame: FrameId::new(i) });
        model.keypoints.push(Vec::new());
    }
    for _ in 0..points {
        let xyz: [f64; 3] = numbers.next_n("a point")?;
        let colour: [f64; 3] = numbers.next_n("a colour")?;
        let mut point = Point { xyz: xyz.into(), colour: colour.map(|c| c.clamp(0.0, 255.0) as u8), error_px: 0.0, track: Vec::new() };
        for _ in 0..numbers.count("the number of views")? {
            let number = numbers.count("the number of an image")?;
            let [_key, x, y] = numbers.next_n("a key and its place")?;
            let Some(image) = model.images.get(number) else {
                return Err(numbers.wrong(format!("a point is seen in image {number} of {images}")));
            };
            let camera = &model.cameras[image.camera.index()];
            let pixel = [x + f64::from(camera.width()) / 2.0, f64::from(camera.height()) / 2.0 - y];
            let keypoints = &mut model.keypoints[number];
            point.track.push(Observation { image: ImageId::new(number), keypoint: KeypointIndex::new(keypoints.len()) });
            keypoints.push(pixel.map(|v| v as f32));
        }
        // A point has one place in an image; the first counts.
        point.track.sort_by_key(|o| o.image);
        point.track.dedup_by_key(|o| o.image);
        model.points.push(point);
    }
    numbers.end()?;
    Ok(model)
}

/// The name of a line of the list; behind it may stand `0` and a focal length.
fn name_of(line: &str) -> &str {
    let words: Vec<&str> = line.split_whitespace().collect();
    match words[..] {
        [.., zero, focal] if words.len() > 2 && zero == "0" && focal.parse::<f64>().is_ok() => {
            line.trim_end().strip_suffix(focal).map_or(line, |rest| rest.trim_end().strip_suffix('0').unwrap_or(rest)).trim()
        }
        _ => line.trim(),
    }
}

/// The numbers of a file, with the lines that they stand in.
struct Numbers<'a> {
    words: Vec<(u64, &'a str)>,
    next: usize,
}

impl<'a> Numbers<'a> {
    fn of(text: &'a str) -> Result<Self, FormatError> {
        let head = text.lines().next().unwrap_or_default();
        if head.trim() != HEAD {
            let what = format!("a file of version 0.3 begins with \"{HEAD}\"");
            return Err(FormatError::Line { file: FILE, line: 1, what });
        }
        let lines = text.lines().enumerate().skip(1).map(|(i, line)| (i as u64 + 1, line));
        Ok(Self { words: lines.flat_map(|(i, line)| line.split_whitespace().map(move |word| (i, word))).collect(), next: 0 })
    }

    /// An error at the word that was read last.
    fn wrong(&self, what: String) -> FormatError {
        let line = self.words.get(self.next.saturating_sub(1)).map_or(1, |w| w.0);
        FormatError::Line { file: FILE, line, what }
    }

    fn word(&mut self, what: &str) -> Result<&'a str, FormatError> {
        let word = self.words.get(self.next).map(|w| w.1);
        self.next += usize::from(word.is_some());
        word.ok_or_else(|| self.wrong(format!("the file ends before {what}")))
    }

    fn count(&mut self, what: &str) -> Result<usize, FormatError> {
        let word = self.word(what)?;
        let count = word.parse().map_err(|_| self.wrong(format!("\"{word}\" is not {what}")))?;
        // Each of what is counted takes a word at least.
        if count > self.words.len() { Err(self.wrong(format!("{count} is more than the file holds: {what}"))) } else { Ok(count) }
    }

    fn next_n<const N: usize>(&mut self, what: &str) -> Result<[f64; N], FormatError> {
        let mut values = [0.0; N];
        for value in &mut values {
            let word = self.word(what)?;
            *value = word
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| self.wrong(format!("\"{word}\" is no number of {what}")))?;
        }
        Ok(values)
    }

    fn end(&mut self) -> Result<(), FormatError> {
        let Some(&(_, word)) = self.words.get(self.next) else { return Ok(()) };
        self.next += 1;
        Err(self.wrong(format!("\"{word}\" stands after the last point")))
    }
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

    #[test]
    fn what_is_written_comes_back() {
        let camera = Camera::new(CameraModel::Radial, 640, 480, &[500.0, 320.0, 240.0, -0.1, 0.02]).expect("valid");
        let (bundle, list) = written(camera).expect("has a form");
        let (given, found) = (one_image(camera), read_bundler(&bundle, &list, &|_| Some((640, 480))).expect("valid"));
        assert_eq!((found.cameras.as_slice(), found.images.len(), found.scale), ([camera].as_slice(), 1, Scale::Arbitrary));
        let [a, b] = [&given, &found].map(|m| m.cam_from_world(ImageId(0)).expect("oriented"));
        assert!((a.rotation_matrix() - b.rotation_matrix()).norm() < 1e-14 && (a.translation - b.translation).norm() < 1e-14);
        assert_eq!(given.points.len(), found.points.len());
        for (p, q) in given.points.iter().zip(&found.points) {
            assert_eq!((p.xyz, p.colour, p.track.len()), (q.xyz, q.colour, q.track.len()));
            // Keypoints are single precision.
            assert!((given.pixel(p.track[0]) - found.pixel(q.track[0])).norm() < 1e-4);
        }
    }

    /// By Bundler's own formulas, from a file written by hand: an image that was not oriented, a name with a focal length behind it.
    #[test]
    fn a_foreign_file_projects_onto_its_observations() {
        // Looks along -z from (0, 0, 5): P = X + t with t = (0, 0, -5), p = -P / P.z, and 400 (1 + 0.1 |p|^2) p from the middle.
        let bundle = "# Bundle file v0.3\n2 1\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n400 0.1 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -5\n\
                      1 0.5 0\n10 20 30\n1 1 77 80.416 40.208\n";
        let model = read_bundler(bundle, "a b.jpg\nC1/2.jpg 0 410.5\n", &|_| Some((300, 200))).expect("valid");
        assert_eq!(model.images.iter().map(|i| i.name.as_str()).collect::<Vec<_>>(), ["a b.jpg", "C1/2.jpg"]);
        assert_eq!(model.oriented_images().collect::<Vec<_>>(), [ImageId(1)]);
        let point = &model.points[0];
        let camera = &model.cameras[model.images[1].camera.index()];
        let pose = model.cam_from_world(ImageId(1)).expect("oriented");
        let found = camera.project(&pose.apply(&point.xyz)).expect("in front");
        // |p|^2 = 0.05; 400 * 1.005 * (0.2, 0.1) = (80.4, 40.2): the file is 0.016 and 0.008 px off.
        assert!((found.x - 230.4).abs() < 1e-9 && (found.y - 59.8).abs() < 1e-9, "{found:?}");
        assert!((model.pixel(point.track[0]) - found).norm() < 0.02);
    }

    #[test]
    fn broken_files_are_named_by_their_lines() {
        let camera = Camera::new(CameraModel::Radial, 640, 480, &[500.0, 320.0, 240.0, -0.1, 0.02]).expect("valid");
        let (bundle, list) = written(camera).expect("has a form");
        let refused = |bundle: &str, list: &str| read_bundler(bundle, list, &|_| Some((640, 480))).expect_err("broken").to_string();
        let head = refused(&bundle.replace("v0.3", "v0.1"), &list);
        assert!(head.starts_with("bundle.out, line 1: a file of version 0.3"), "{head}");
        let count = refused(&bundle.replace("1 4\n", "1 40000000000\n"), &list);
        assert!(count.contains("line 2: 40000000000 is more than the file holds"), "{count}");
        assert!(refused(&bundle, "a.jpg\nb.jpg\n").contains("1 images, but the list names 2"));
        let number = refused(&bundle.replace("500 -0.1", "5x0 -0.1"), &list);
        assert!(number.contains("line 3: \"5x0\" is no number of a focal length"), "{number}");
        let cut = refused(bundle.trim_end().rsplit_once(' ').expect("words").0, &list);
        assert!(cut.contains("the file ends before a key and its place"), "{cut}");
        let image = refused(&bundle.replace("1 0 0 ", "1 7 0 "), &list);
        assert!(image.contains("a point is seen in image 7 of 1"), "{image}");
        assert!(refused(&format!("{bundle}9\n"), &list).contains("\"9\" stands after the last point"));
        let no_size = read_bundler(&bundle, &list, &|_| None).expect_err("no size").to_string();
        assert!(no_size.contains("the size of image C1/1.jpg is not known"), "{no_size}");
    }
}
