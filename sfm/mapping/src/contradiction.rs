//! Pairs that the model has to be wrong about, or that are wrong themselves.

use crate::model::Model;
use crate::options::OrientOptions;
use nalgebra::Matrix3;
use scene::{ImageId, Observation, VerifiedPair};
use solve::relative::{essential_from_pose, sampson_squared};

/// A verified pair of which a smaller share of the matches fits the model contradicts it. Nearly all matches of a right
/// pair fit; of a wrong one, those that lie near their epipolar line by chance, some hundredths.
const MIN_SHARE: f64 = 0.25;
/// Pairs named in a note.
const NAMED: usize = 5;

/// A note on the verified pairs between oriented images whose matches do not fit the poses, or `None` when there are none.
///
/// Two places that look alike give pairs that are as consistent in themselves as right ones, and the model may put both
/// into one place; the pairs that it then tears apart tell (Zach, Klopschitz & Pollefeys, *Disambiguating visual relations
/// using loop constraints*, CVPR 2010, decide by the same contradictions). Which side is wrong is not decided here.
pub(crate) fn note(model: &Model, options: &OrientOptions) -> Option<String> {
    let tested = |pair: &&VerifiedPair| {
        let (a, b) = pair.images;
        pair.matches.len() >= options.register_min_inliers && model.is_oriented(a) && model.is_oriented(b)
    };
    let tested: Vec<&VerifiedPair> = model.input.pairs.iter().filter(tested).collect();
    let mut against: Vec<&VerifiedPair> = tested.iter().copied().filter(|pair| contradicts(model, pair, options)).collect();
    if against.is_empty() {
        return None;
    }
    against.sort_by_key(|pair| (std::cmp::Reverse(pair.matches.len()), pair.images));
    let name = |image: ImageId| &model.images[image.index()].name;
    let named = |pair: &&VerifiedPair| format!("{} and {} ({} matches)", name(pair.images.0), name(pair.images.1), pair.matches.len());
    let mut list: Vec<String> = against.iter().take(NAMED).map(named).collect();
    if against.len() > NAMED {
        list.push("...".into());
    }
    let cause = match suspects(model, &tested, &against) {
        Some(cameras) => format!(
            "Most pairs within a camera fit, most between {cameras} do not: the interior orientation of one of them, or their place in the rig, is wrong"
        ),
        None => "Either these matches are wrong, or two places that look alike were taken for one".to_owned(),
    };
    Some(format!("{} of {} matched pairs of images contradict the model: {}. {cause}", against.len(), tested.len(), list.join(", ")))
}

/// The two cameras between which most pairs contradict the model, where few of those within each of them do.
fn suspects(model: &Model, tested: &[&VerifiedPair], against: &[&VerifiedPair]) -> Option<String> {
    let cameras = |pair: &VerifiedPair| {
        let [a, b] = [pair.images.0, pair.images.1].map(|i| model.images[i.index()].camera.index());
        (a.min(b), a.max(b))
    };
    let (p, q) = against.iter().map(|pair| cameras(pair)).find(|(p, q)| p != q)?;
    let share = |wanted: &[(usize, usize)]| {
        let count = |pairs: &[&VerifiedPair]| pairs.iter().filter(|pair| wanted.contains(&cameras(pair))).count() as f64;
        count(against) / count(tested).max(1.0)
    };
    let name = |c: usize| model.input.cameras[c].name.as_str();
    let (across, within) = (share(&[(p, q)]), share(&[(p, p), (q, q)]));
    (across > 0.5 && across > 3.0 * within).then(|| format!("{} and {}", name(p), name(q)))
}

fn contradicts(model: &Model, pair: &VerifiedPair, options: &OrientOptions) -> bool {
    let (a, b) = pair.images;
    let at = |image, keypoint| Observation { image, keypoint };
    let enough = MIN_SHARE * pair.matches.len() as f64;
    // Quickly: most pairs share points.
    let joined = pair.matches.iter().filter(|&&(ka, kb)| {
        let point = model.point_of(at(a, ka));
        point.is_some() && point == model.point_of(at(b, kb))
    });
    if joined.count() as f64 >= enough {
        return false;
    }
    let (Some(a_from_world), Some(b_from_world)) = (model.cam_from_world(a), model.cam_from_world(b)) else { return false };
    let (camera_a, camera_b) = (model.camera(a), model.camera(b));
    let essential: Matrix3<f64> = essential_from_pose(&(b_from_world * a_from_world.inverse()));
    let max_error = options.max_error_px / ((camera_a.mean_focal() + camera_b.mean_focal()) / 2.0);
    let fits = pair.matches.iter().filter(|&&(ka, kb)| {
        match (camera_a.unproject(&model.pixel(at(a, ka))), camera_b.unproject(&model.pixel(at(b, kb)))) {
            (Some(xa), Some(xb)) => {
                let squared = sampson_squared(&essential, &xa, &xb);
                // NaN for cameras in the same place: there is no epipolar line to be off.
                squared.is_nan() || squared <= max_error * max_error
            }
            _ => false,
        }
    });
    (fits.count() as f64) < enough
}
