//! From surveys to inputs, and what every test asks of a result.

use mapping::{
    BaselineInput, CameraInput, ImageInput, ImagePick, MapInput, OrientOptions, Orientation, PICK_SIGMA_PX, RigPoseInput, ScaleBarInput,
    orient,
};
use nalgebra::Vector3;
use scene::{Camera, CameraId, Reconstruction};
use synthetic::survey::{Survey, SurveyOptions, survey};
use synthetic::{Alignment, Deviation, Random, deviation};

/// Standard deviation of keypoints in all surveys, pixels.
pub const NOISE_PX: f64 = 0.5;

/// A result may be this many times as far from the truth as the adjusted truth: it may lose or split a few tracks.
pub const NEAR_OPTIMUM: f64 = 1.5;

/// What a result may be off where the optimum is on the truth, metres: the adjustment stops when a step changes the cost
/// by less than 1e-10 of it, and the cost is flat where lengths hardly weigh.
pub const SETTLED_M: f64 = 1e-4;

/// Observations that a frame must have, twice what its pose needs.
const MIN_FRAME_OBSERVATIONS: usize = 12;

/// A survey of 12 exposures by `cameras` cameras, with noise.
pub fn noisy(cameras: usize) -> SurveyOptions {
    SurveyOptions { cameras, noise_px: NOISE_PX, ..SurveyOptions::default() }
}

/// The survey as an input: interior orientation known and kept, nothing known of the rig.
pub fn input(survey: &Survey) -> MapInput {
    let truth = &survey.truth;
    let image = |image: &scene::Image| ImageInput {
        name: image.name.clone(),
        camera: image.camera,
        exposure: truth.frames[image.frame.index()].exposure,
    };
    MapInput {
        cameras: truth
            .cameras
            .iter()
            .map(|&camera| CameraInput {
                name: "camera".into(),
                camera,
                fixed: true,
                held: Vec::new(),
                sigmas: Vec::new(),
                alternatives: Vec::new(),
            })
            .collect(),
        images: truth.images.iter().map(image).collect(),
        keypoints: truth.keypoints.clone(),
        pairs: survey.pairs.clone(),
        ..MapInput::default()
    }
}

/// The survey of the options, and its input.
pub fn made(options: &SurveyOptions) -> (Survey, MapInput) {
    let made = survey(options);
    let input = input(&made);
    (made, input)
}

/// The true poses in the rig, for an input.
pub fn rig_poses(truth: &Reconstruction, sigma: Option<(f64, f64)>) -> Vec<Option<RigPoseInput>> {
    let pose = |s: &scene::RigSensor| Some(RigPoseInput { cam_from_rig: s.cam_from_rig, sigma });
    truth.rigs[0].sensors.iter().map(pose).collect()
}

/// True distance of two cameras in an exposure that both took.
pub fn true_baseline(truth: &Reconstruction, (a, b): (CameraId, CameraId), exposure: u32) -> Option<f64> {
    let centre = |camera| {
        let of = |i: &scene::ImageId| {
            let image = &truth.images[i.index()];
            image.camera == camera && truth.frames[image.frame.index()].exposure == exposure
        };
        Some(truth.cam_from_world(truth.oriented_images().find(of)?)?.centre())
    };
    Some((centre(a)? - centre(b)?).norm())
}

/// A known baseline of the first two cameras.
pub fn baseline(length_m: f64, sigma_m: f64) -> BaselineInput {
    BaselineInput { cameras: (CameraId(0), CameraId(1)), length_m, sigma_m }
}

/// A bar between two places, picked in every image that shows them, with the noise of keypoints.
pub fn scale_bar(truth: &Reconstruction, ends: [Vector3<f64>; 2], length_m: f64, sigma_m: f64, check: bool) -> ScaleBarInput {
    let mut random = Random::new(ends[0].x.to_bits());
    let mut picks = |xyz: &Vector3<f64>| {
        let mut out = Vec::new();
        for image in truth.oriented_images() {
            let camera = &truth.cameras[truth.images[image.index()].camera.index()];
            let pose = truth.cam_from_world(image).expect("oriented");
            let Some(pixel) = camera.project(&pose.apply(xyz)) else { continue };
            if pixel.x > 0.0 && pixel.y > 0.0 && pixel.x < f64::from(camera.width()) && pixel.y < f64::from(camera.height()) {
                let pixel = [pixel.x + NOISE_PX * random.normal(), pixel.y + NOISE_PX * random.normal()];
                out.push(ImagePick { image, pixel, sigma_px: PICK_SIGMA_PX });
            }
        }
        assert!(out.len() > 2, "an end that {} images show", out.len());
        out
    };
    ScaleBarInput { ends: [picks(&ends[0]), picks(&ends[1])], length_m, sigma_m, check }
}

/// Orients with the defaults; all images must end in one model, and nothing be noted.
#[track_caller]
pub fn oriented(input: &MapInput) -> Orientation {
    let out = complete(input);
    assert_eq!(out.summary.notes, Vec::<String>::new());
    out
}

/// Orients with the defaults; all images must end in one model.
#[track_caller]
pub fn complete(input: &MapInput) -> Orientation {
    let out = orient(input, &OrientOptions::default()).expect("a sound survey");
    assert_eq!(out.models.len(), 1);
    assert_eq!(out.summary.left_out, []);
    assert_eq!(out.models[0].oriented_images().count(), input.images.len());
    assert_consistent(&out, input);
    out
}

/// What holds of every result, however bad the input: each list fits the others, no value is NaN, a point is seen twice, a
/// pose rests on points, each image is in one model or has a reason.
#[track_caller]
pub fn assert_consistent(out: &Orientation, input: &MapInput) {
    let mut times = vec![0; input.images.len()];
    for model in &out.models {
        assert_eq!(model.images.len(), input.images.len());
        assert!(model.frames.iter().filter_map(|f| f.rig_from_world).all(|p| p.translation.iter().all(|v| v.is_finite())));
        assert!(model.cameras.iter().all(|c| c.params().iter().all(|v| v.is_finite())));
        for image in model.oriented_images() {
            times[image.index()] += 1;
        }
        assert!(model.oriented_images().count() > 1, "a model of nothing");
        let mut seen = vec![0; model.frames.len()];
        for o in model.points.iter().flat_map(|p| &p.track) {
            seen[model.images[o.image.index()].frame.index()] += 1;
        }
        let holds = |f: usize| model.frames[f].rig_from_world.is_none() || seen[f] >= MIN_FRAME_OBSERVATIONS;
        assert!((0..seen.len()).all(holds), "a pose without points");
        let mut used = std::collections::BTreeSet::new();
        for point in &model.points {
            assert!(point.xyz.iter().all(|v| v.is_finite()));
            assert!(point.track.len() >= 2 && point.track.is_sorted());
            assert!(point.track.windows(2).all(|o| o[0].image != o[1].image), "two observations in an image");
            assert!(point.error_px >= 0.0 && point.error_px <= OrientOptions::default().max_error_px);
            for &o in &point.track {
                assert!(model.cam_from_world(o.image).is_some(), "seen by an image without a pose");
                assert!(used.insert(o), "{o:?} shows two points");
            }
        }
    }
    assert!(times.iter().all(|&n| n <= 1), "models share images");
    let out_of_models: Vec<usize> = (0..times.len()).filter(|&i| times[i] == 0).collect();
    assert_eq!(out.summary.left_out.iter().map(|l| l.image.index()).collect::<Vec<_>>(), out_of_models);
    assert!(out.summary.left_out.iter().all(|l| !l.reason.is_empty()));
}

/// The largest distance from the truth, which must be at most [`NEAR_OPTIMUM`] times that of the adjusted truth. The
/// rotation follows: what turns a camera by an angle moves its image of the ground as much as a shift of 3 m times that.
#[track_caller]
pub fn assert_near_optimum(found: &Reconstruction, optimum: &Reconstruction, truth: &Reconstruction, alignment: Alignment) -> Deviation {
    let best = deviation(optimum, truth, alignment).expect("all oriented");
    let d = deviation(found, truth, alignment).expect("enough images");
    assert_eq!(d.missing, Vec::<String>::new());
    let (centre, angle) =
        (NEAR_OPTIMUM * best.max_centre.0 + SETTLED_M, NEAR_OPTIMUM * best.max_rotation_rad.0 + SETTLED_M / FLYING_HEIGHT_M);
    assert!(d.max_centre.0 <= centre && d.max_rotation_rad.0 <= angle, "{d:?}, the adjusted truth {best:?}");
    d
}

/// Height above the sea bed, metres.
pub const FLYING_HEIGHT_M: f64 = 3.0;

/// Focal length of the cameras, pixels.
pub fn focal(camera: &Camera) -> f64 {
    camera.mean_focal()
}
