//! `[rig]` and `[[scale_bar]]`.

use super::error::{Source, did_you_mean};
use super::keys::check_names;
use super::model::{BaselineConfig, CameraConfig, PickConfig, PoseConfig, RigConfig, RigMode, ScaleBarConfig, TargetConfig};
use super::raw::{Place, RawBaseline, RawPick, RawPose, RawRig, RawScaleBar};
use super::resolve::raw_table;
use super::values::Values;
use nalgebra::{Matrix3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use scene::Rigid3;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;

/// Standard deviation of a length of which none is given, metres.
const DEFAULT_SIGMA_M: f64 = 0.001;
/// How far from a pick the centre of a target may be, pixels, where it is not said.
const DEFAULT_SEARCH_RADIUS_PX: f64 = 10.0;
const MODES: [(&str, RigMode); 3] = [("rigid", RigMode::Rigid), ("baselines", RigMode::Baselines), ("none", RigMode::None)];
/// Largest deviation of a given rotation matrix from orthonormality, and of a quaternion from length 1.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// The rig of a dive.toml; `folder` is where relative file names start.
pub(super) fn resolve(source: &mut Source<'_>, raw: &RawRig, cameras: &[CameraConfig], folder: &Path) -> RigConfig {
    let Some(file) = &raw.file else { return of_keys(source, raw, cameras) };
    let key = "rig.file";
    if !raw.pose.is_empty() || !raw.baseline.is_empty() {
        let hint = "give either `file`, or poses and baselines".to_owned();
        source.problem(Some(file.span()), key, "stands beside poses or baselines", Some(hint));
    }
    let path = folder.join(file.get_ref().as_str());
    let read = std::fs::read_to_string(&path).map(|text| {
        let mut inner = Source::new(&path, &text);
        let rig = raw_table::<RawRig>(&mut inner, |inner, table| check_names(inner, table, "rig")).map(|below| {
            if let Some(again) = &below.file {
                inner.problem(Some(again.span()), key, "leads to yet another file", None);
            }
            of_keys(&mut inner, &below, cameras)
        });
        inner.finish(rig)
    });
    match read {
        Err(e) => source.problem(Some(file.span()), key, format!("cannot read {}: {e}", path.display()), None),
        Ok(Err(error)) => source.add(error),
        // What stands in dive.toml goes before what stands in the file.
        Ok(Ok(rig)) => {
            let mode = (Values { source }).choice("rig.mode", &raw.mode, &MODES).unwrap_or(rig.mode);
            return RigConfig { mode, ..rig };
        }
    }
    RigConfig { mode: RigMode::None, poses: Vec::new(), baselines: Vec::new() }
}

fn of_keys(source: &mut Source<'_>, raw: &RawRig, cameras: &[CameraConfig]) -> RigConfig {
    let mut values = Values { source };
    let baselines = baselines(&mut values, &raw.baseline, cameras);
    let poses = poses(&mut values, &raw.pose, cameras);
    let all_posed = cameras.len() > 1 && poses.iter().skip(1).all(Option::is_some) && poses.len() == cameras.len();
    let mode = values.choice("rig.mode", &raw.mode, &MODES).unwrap_or(match () {
        () if all_posed => RigMode::Rigid,
        () if !baselines.is_empty() => RigMode::Baselines,
        () => RigMode::None,
    });
    if let (RigMode::Baselines, true, Some(mode)) = (mode, baselines.is_empty(), &raw.mode) {
        values.problem_with_hint(
            mode.span(),
            "rig.mode",
            "there is no baseline",
            "add [[rig.baseline]] with between, length_m and sigma_m",
        );
    }
    if let (RigMode::Rigid, 1, Some(mode)) = (mode, cameras.len(), &raw.mode) {
        values.problem(mode.span(), "rig.mode", "a rigid rig needs two cameras, there is one");
    }
    RigConfig { mode, poses, baselines }
}

fn camera_index(values: &mut Values<'_, '_>, key: &str, name: &str, at: Range<usize>, cameras: &[CameraConfig]) -> Option<usize> {
    let found = cameras.iter().position(|c| c.name == name);
    if found.is_none() {
        let names: Vec<&str> = cameras.iter().map(|c| c.name.as_str()).collect();
        let hint = match did_you_mean(name, names.iter().copied()) {
            Some(meant) => format!("did you mean \"{meant}\"?"),
            None => format!("the cameras are \"{}\"", names.join("\", \"")),
        };
        values.problem_with_hint(at, key, format!("there is no camera \"{name}\""), hint);
    }
    found
}

fn baselines(values: &mut Values<'_, '_>, raw: &[Spanned<RawBaseline>], cameras: &[CameraConfig]) -> Vec<BaselineConfig> {
    let mut found: Vec<BaselineConfig> = Vec::new();
    for entry in raw {
        let baseline = entry.get_ref();
        let key = "rig.baseline.between";
        let Some(between) = &baseline.between else {
            values.problem_with_hint(entry.span(), key, "is missing", "name the two cameras: between = [\"C1\", \"C2\"]");
            continue;
        };
        let [first, second] = between.get_ref().as_slice() else {
            values.problem(between.span(), key, format!("needs two cameras, has {}", between.get_ref().len()));
            continue;
        };
        let [first, second] = [first, second].map(|name| camera_index(values, key, name.get_ref(), name.span(), cameras));
        let length_m = required(values, "rig.baseline.length_m", &baseline.length_m, &entry.span());
        let sigma_m = values.positive("rig.baseline.sigma_m", &baseline.sigma_m).unwrap_or(DEFAULT_SIGMA_M);
        let (Some(first), Some(second), Some(length_m)) = (first, second, length_m) else { continue };
        if first == second {
            values.problem(between.span(), key, "names the same camera twice");
            continue;
        }
        let pair = (first.min(second), first.max(second));
        if found.iter().any(|b| b.cameras == pair) {
            values.problem(between.span(), key, "this pair of cameras already has a baseline");
            continue;
        }
        found.push(BaselineConfig { cameras: pair, length_m, sigma_m });
    }
    found
}

fn required(values: &mut Values<'_, '_>, key: &str, value: &Option<Spanned<f64>>, entry: &Range<usize>) -> Option<f64> {
    if value.is_none() {
        values.problem(entry.clone(), key, "is missing");
    }
    values.positive(key, value)
}

/// One entry a camera, or none at all; rebased so that the first camera is the reference.
fn poses(
    values: &mut Values<'_, '_>,
    raw: &BTreeMap<Spanned<String>, Spanned<RawPose>>,
    cameras: &[CameraConfig],
) -> Vec<Option<PoseConfig>> {
    let mut poses = vec![None; cameras.len()];
    for (name, pose) in raw {
        let key = format!("rig.pose.{}", name.get_ref());
        let index = camera_index(values, &key, name.get_ref(), name.span(), cameras);
        let pose = one_pose(values, &key, pose);
        if let (Some(index), Some(pose)) = (index, pose) {
            poses[index] = Some(pose);
        }
    }
    if poses.iter().all(Option::is_none) {
        return Vec::new();
    }
    let reference: Rigid3 = poses[0].map_or_else(Rigid3::identity, |p: PoseConfig| p.cam_from_rig);
    let rig_from_reference = reference.inverse();
    for pose in poses.iter_mut().flatten() {
        pose.cam_from_rig = pose.cam_from_rig * rig_from_reference;
    }
    poses[0] = Some(PoseConfig { cam_from_rig: Rigid3::identity(), sigma: None });
    poses
}

fn one_pose(values: &mut Values<'_, '_>, key: &str, entry: &Spanned<RawPose>) -> Option<PoseConfig> {
    let pose = entry.get_ref();
    let translation = values.numbers::<3>(&format!("{key}.translation_m"), &pose.translation_m);
    if pose.translation_m.is_none() {
        values.problem(entry.span(), &format!("{key}.translation_m"), "is missing");
    }
    let rotation = rotation(values, key, entry)?;
    let sigma_deg = values.positive(&format!("{key}.sigma_deg"), &pose.sigma_deg);
    let sigma_m = values.positive(&format!("{key}.sigma_m"), &pose.sigma_m);
    let sigma = match (sigma_deg, sigma_m) {
        (Some(deg), Some(m)) => Some((deg.to_radians(), m)),
        (None, None) => None,
        (deg, _) => {
            let (given, other) = if deg.is_some() { ("sigma_deg", "sigma_m") } else { ("sigma_m", "sigma_deg") };
            // A wrong value has been reported; only a missing one is news.
            if pose.sigma_deg.is_none() || pose.sigma_m.is_none() {
                values.problem(entry.span(), &format!("{key}.{given}"), format!("`{other}` is missing beside it"));
            }
            None
        }
    };
    Some(PoseConfig { cam_from_rig: Rigid3::new(rotation, Vector3::from(translation?)), sigma })
}

pub(super) fn rotation(values: &mut Values<'_, '_>, key: &str, entry: &Spanned<RawPose>) -> Option<UnitQuaternion<f64>> {
    let pose = entry.get_ref();
    let given = [pose.quaternion_wxyz.is_some(), pose.axis_angle_deg.is_some(), pose.matrix.is_some()];
    if given.iter().filter(|g| **g).count() > 1 {
        let hint = "give one of quaternion_wxyz, axis_angle_deg, matrix";
        values.problem_with_hint(entry.span(), key, "the rotation is given more than once", hint);
        return None;
    }
    if let Some(place) = &pose.quaternion_wxyz {
        let [w, x, y, z] = values.numbers::<4>(&format!("{key}.quaternion_wxyz"), &pose.quaternion_wxyz)?;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > ROTATION_TOLERANCE {
            let message = format!("its length is {:.4}, it must be 1", quaternion.norm());
            values.problem(place.span(), &format!("{key}.quaternion_wxyz"), message);
            return None;
        }
        return Some(UnitQuaternion::from_quaternion(quaternion));
    }
    if pose.axis_angle_deg.is_some() {
        let degrees = values.numbers::<3>(&format!("{key}.axis_angle_deg"), &pose.axis_angle_deg)?;
        return Some(UnitQuaternion::from_scaled_axis(Vector3::from(degrees.map(f64::to_radians))));
    }
    let Some(place) = &pose.matrix else { return Some(UnitQuaternion::identity()) };
    let rows = place.get_ref();
    if rows.len() != 3 || rows.iter().any(|row| row.len() != 3 || row.iter().any(|v| !v.is_finite())) {
        values.problem(place.span(), &format!("{key}.matrix"), "needs three rows of three finite numbers");
        return None;
    }
    let matrix = Matrix3::from_fn(|row, column| rows[row][column]);
    if (matrix * matrix.transpose() - Matrix3::identity()).norm() > ROTATION_TOLERANCE || matrix.determinant() < 0.0 {
        values.problem(
            place.span(),
            &format!("{key}.matrix"),
            "is not a rotation: its rows must be orthogonal, of length 1, and right-handed",
        );
        return None;
    }
    Some(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix)))
}

/// The target at the picks of a table.
pub(super) fn target(values: &mut Values<'_, '_>, table: &str, kind: &Place<String>, radius: &Place<f64>) -> Option<TargetConfig> {
    let key = format!("{table}.search_radius_px");
    let search_radius_px = values.within(&key, radius, 1.0, 100.0, DEFAULT_SEARCH_RADIUS_PX);
    if let (None, Some(radius)) = (kind, radius) {
        values.problem_with_hint(
            radius.span(),
            &key,
            "nothing is searched for",
            "target = \"circle\" measures circular targets at the picks",
        );
    }
    values.choice(&format!("{table}.target"), kind, &[("circle", TargetConfig { search_radius_px })])
}

/// A point picked in an image.
pub(super) fn pick(values: &mut Values<'_, '_>, key: &str, entry: &Spanned<RawPick>, cameras: &[CameraConfig]) -> Option<PickConfig> {
    let place = entry.get_ref();
    let [x, y] = [("x", &place.x), ("y", &place.y)].map(|(axis, value)| values.finite(&format!("{key}.{axis}"), value));
    let (Some(image), Some(x), Some(y)) = (&place.image, x, y) else {
        if place.image.is_none() || place.x.is_none() || place.y.is_none() {
            values.problem(entry.span(), key, "a pick needs image, x and y");
        }
        return None;
    };
    let camera = image.get_ref().split_once('/').map_or("", |(camera, _)| camera);
    if cameras.iter().any(|c| c.name == camera) {
        return Some(PickConfig { image: image.get_ref().clone(), x, y });
    }
    let hint = "images are named by camera and file, \"C1/0001.jpg\"";
    values.problem_with_hint(image.span(), &format!("{key}.image"), format!("there is no image \"{}\"", image.get_ref()), hint);
    None
}

pub(super) fn scale_bars(source: &mut Source<'_>, raw: &[Spanned<RawScaleBar>], cameras: &[CameraConfig]) -> Vec<ScaleBarConfig> {
    let mut values = Values { source };
    raw.iter().enumerate().filter_map(|(i, entry)| scale_bar(&mut values, i, entry, cameras)).collect()
}

fn scale_bar(values: &mut Values<'_, '_>, index: usize, entry: &Spanned<RawScaleBar>, cameras: &[CameraConfig]) -> Option<ScaleBarConfig> {
    let bar = entry.get_ref();
    let key = "scale_bar.endpoints";
    let length_m = required(values, "scale_bar.length_m", &bar.length_m, &entry.span());
    let sigma_m = values.positive("scale_bar.sigma_m", &bar.sigma_m).unwrap_or(DEFAULT_SIGMA_M);
    let Some(endpoints) = &bar.endpoints else {
        let hint = "endpoints = [[{ image = \"C1/a.jpg\", x = 1.0, y = 2.0 }, ...], [...]]";
        values.problem_with_hint(entry.span(), key, "is missing", hint);
        return None;
    };
    let [first, second] = endpoints.get_ref().as_slice() else {
        values.problem(endpoints.span(), key, format!("needs two ends, has {}", endpoints.get_ref().len()));
        return None;
    };
    let mut ends = [Vec::new(), Vec::new()];
    for (end, raw) in ends.iter_mut().zip([first, second]) {
        if raw.len() < 2 {
            let message = format!("each end needs picks in two images or more, one has {}", raw.len());
            values.problem(endpoints.span(), key, message);
        }
        end.extend(raw.iter().filter_map(|p| pick(values, key, p, cameras)));
    }
    let name = bar.name.as_ref().map_or_else(|| format!("bar {}", index + 1), |n| n.get_ref().clone());
    let check = bar.check.as_ref().is_some_and(|c| *c.get_ref());
    let target = target(values, "scale_bar", &bar.target, &bar.search_radius_px);
    Some(ScaleBarConfig { name, length_m: length_m?, sigma_m, check, target, ends })
}
