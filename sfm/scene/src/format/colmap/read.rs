//! Reading the binary form.

use super::camera::{from_colmap, model_from_id};
use super::model::NO_POINT;
use super::write_binary::SENSOR_CAMERA;
use crate::format::FormatError;
use crate::format::bytes::Bytes;
use crate::{
    Camera, CameraId, Frame, FrameId, Image, ImageId, KeypointIndex, Observation, Point, Reconstruction, Rig, RigId, RigSensor, Rigid3,
    Scale,
};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::path::Path;

/// The bytes of a model's files.
#[derive(Clone, Copy, Debug)]
pub struct ColmapFiles<'a> {
    /// `cameras.bin`.
    pub cameras: &'a [u8],
    /// `rigs.bin` and `frames.bin`; models from before COLMAP 3.12 lack them, and every image is then a frame of its own.
    pub rigs_and_frames: Option<(&'a [u8], &'a [u8])>,
    /// `images.bin`.
    pub images: &'a [u8],
    /// `points3D.bin`.
    pub points: &'a [u8],
}

/// Reads `cameras.bin`, `rigs.bin`, `frames.bin`, `images.bin` and `points3D.bin` of `dir`; see [`read_colmap`].
///
/// # Errors
/// [`FormatError::File`] where a file cannot be read; else as [`read_colmap`].
pub fn read_colmap_binary(dir: &Path) -> Result<Reconstruction, FormatError> {
    let file = |name: &str| std::fs::read(dir.join(name)).map_err(FormatError::file(dir.join(name)));
    let (cameras, images, points) = (file("cameras.bin")?, file("images.bin")?, file("points3D.bin")?);
    let legacy = !dir.join("rigs.bin").exists() && !dir.join("frames.bin").exists();
    let rigs_and_frames = if legacy { None } else { Some((file("rigs.bin")?, file("frames.bin")?)) };
    let rigs_and_frames = rigs_and_frames.as_ref().map(|(r, f)| (r.as_slice(), f.as_slice()));
    read_colmap(&ColmapFiles { cameras: &cameras, rigs_and_frames, images: &images, points: &points })
}

/// Reads a model from the bytes of its files.
///
/// Ids become dense in the order of COLMAP's. Exposures are numbered by frame. The scale is [`Scale::Arbitrary`], for
/// the format does not tell. Keypoints are rounded to f32. A sensor without a pose is left out of its rig.
///
/// # Errors
/// [`FormatError::Bytes`] with file and offset where a file ends early, refers to nothing, repeats an id, holds a number
/// that is not possible, or uses what we cannot hold: camera models that [`crate::CameraModel`] lacks, sensors other than
/// cameras, rigs whose sensor with images has no pose.
pub fn read_colmap(files: &ColmapFiles) -> Result<Reconstruction, FormatError> {
    let (camera_ids, cameras) = read_cameras(&mut Bytes::new("cameras.bin", files.cameras))?;
    let mut out = Reconstruction {
        cameras,
        rigs: Vec::new(),
        frames: Vec::new(),
        images: Vec::new(),
        keypoints: Vec::new(),
        points: Vec::new(),
        scale: Scale::Arbitrary,
    };
    let mut frame_of_image = BTreeMap::new();
    if let Some((rigs, frames)) = files.rigs_and_frames {
        let rig_ids = read_rigs(&mut Bytes::new("rigs.bin", rigs), &camera_ids, &mut out)?;
        frame_of_image = read_frames(&mut Bytes::new("frames.bin", frames), &rig_ids, &mut out)?;
    } else {
        out.rigs = (0..out.cameras.len()).map(|i| Rig::single(CameraId::new(i))).collect();
    }
    let frames = files.rigs_and_frames.is_some().then_some(&frame_of_image);
    let (image_ids, point_ids_of_keypoints) = read_images(&mut Bytes::new("images.bin", files.images), &camera_ids, frames, &mut out)?;
    read_points(&mut Bytes::new("points3D.bin", files.points), &image_ids, &point_ids_of_keypoints, &mut out)?;
    Ok(out)
}

/// Sorts records by COLMAP's id; the position in the result is ours.
fn dense<K: Ord + Copy + std::fmt::Display, V>(
    bytes: &Bytes,
    mut records: Vec<(K, V)>,
) -> Result<(BTreeMap<K, usize>, Vec<V>), FormatError> {
    records.sort_by_key(|r| r.0);
    if let Some(twice) = records.windows(2).find(|w| w[0].0 == w[1].0) {
        return Err(bytes.error(format!("id {} occurs twice", twice[0].0)));
    }
    let ids = records.iter().enumerate().map(|(i, r)| (r.0, i)).collect();
    Ok((ids, records.into_iter().map(|r| r.1).collect()))
}

fn lookup(bytes: &Bytes, ids: &BTreeMap<u32, usize>, id: u32, what: &str) -> Result<usize, FormatError> {
    ids.get(&id).copied().ok_or_else(|| bytes.error(format!("{what} {id} does not exist")))
}

fn pose(bytes: &mut Bytes) -> Result<Rigid3, FormatError> {
    let [w, x, y, z, tx, ty, tz] = bytes.f64s()?;
    let rotation = Quaternion::new(w, x, y, z);
    let norm = rotation.norm();
    if !(norm > 1e-6 && norm.is_finite() && [tx, ty, tz].iter().all(|v| v.is_finite())) {
        return Err(bytes.error("the pose is not finite"));
    }
    // What is a unit quaternion up to rounding stays as it is, so that writing it again gives the same bytes.
    let rotation =
        if (norm - 1.0).abs() < 1e-12 { UnitQuaternion::new_unchecked(rotation) } else { UnitQuaternion::from_quaternion(rotation) };
    Ok(Rigid3::new(rotation, Vector3::new(tx, ty, tz)))
}

fn read_cameras(bytes: &mut Bytes) -> Result<(BTreeMap<u32, usize>, Vec<Camera>), FormatError> {
    let count = bytes.u64()?;
    let mut cameras = Vec::with_capacity(bytes.count(count, 48)?);
    for _ in 0..count {
        let (id, model) = (bytes.u32()?, bytes.i32()?);
        let model = model_from_id(model).ok_or_else(|| bytes.error(format!("camera {id} has model {model}, which is not supported")))?;
        let (width, height) = (bytes.u64()?, bytes.u64()?);
        let params = (0..model.param_count).map(|_| bytes.f64()).collect::<Result<Vec<_>, _>>()?;
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(bytes.error(format!("camera {id} has an image of {width} x {height}")));
        };
        cameras.push((id, from_colmap(model, width, height, &params).map_err(|what| bytes.error(format!("camera {id}: {what}")))?));
    }
    bytes.end()?;
    dense(bytes, cameras)
}

fn sensor(bytes: &mut Bytes, camera_ids: &BTreeMap<u32, usize>) -> Result<CameraId, FormatError> {
    let (kind, id) = (bytes.i32()?, bytes.u32()?);
    if kind != SENSOR_CAMERA {
        return Err(bytes.error(format!("sensors of type {kind} are not supported")));
    }
    lookup(bytes, camera_ids, id, "camera").map(CameraId::new)
}

fn read_rigs(bytes: &mut Bytes, camera_ids: &BTreeMap<u32, usize>, out: &mut Reconstruction) -> Result<BTreeMap<u32, usize>, FormatError> {
    let count = bytes.u64()?;
    let mut rigs = Vec::with_capacity(bytes.count(count, 8)?);
    for _ in 0..count {
        let id = bytes.u32()?;
        let sensor_count = bytes.u32()?;
        let mut sensors: Vec<RigSensor> = Vec::with_capacity(bytes.count(u64::from(sensor_count), 8)?);
        for j in 0..sensor_count {
            let camera = sensor(bytes, camera_ids)?;
            if sensors.iter().any(|s| s.camera == camera) {
                return Err(bytes.error(format!("rig {id} holds a camera twice")));
            }
            if j == 0 {
                sensors.push(RigSensor { camera, cam_from_rig: Rigid3::identity() });
            } else if bytes.u8()? != 0 {
                sensors.push(RigSensor { camera, cam_from_rig: pose(bytes)? });
            }
        }
        rigs.push((id, Rig { sensors }));
    }
    bytes.end()?;
    let (ids, rigs) = dense(bytes, rigs)?;
    out.rigs = rigs;
    Ok(ids)
}

fn read_frames(bytes: &mut Bytes, rig_ids: &BTreeMap<u32, usize>, out: &mut Reconstruction) -> Result<BTreeMap<u64, FrameId>, FormatError> {
    let count = bytes.u64()?;
    let mut frames = Vec::with_capacity(bytes.count(count, 68)?);
    for _ in 0..count {
        let id = bytes.u32()?;
        let rig = bytes.u32()?;
        let rig = RigId::new(lookup(bytes, rig_ids, rig, "rig")?);
        let rig_from_world = pose(bytes)?;
        let image_count = bytes.u32()?;
        let mut images = Vec::with_capacity(bytes.count(u64::from(image_count), 16)?);
        for _ in 0..image_count {
            // Which camera took the image is told again by images.bin.
            let _ = (bytes.i32()?, bytes.u32()?);
            images.push(bytes.u64()?);
        }
        frames.push((id, (Frame { rig, exposure: 0, rig_from_world: Some(rig_from_world) }, images)));
    }
    bytes.end()?;
    let (_, frames) = dense(bytes, frames)?;
    let mut frame_of_image = BTreeMap::new();
    for (i, (mut frame, images)) in frames.into_iter().enumerate() {
        frame.exposure = i as u32;
        out.frames.push(frame);
        for image in images {
            if frame_of_image.insert(image, FrameId::new(i)).is_some() {
                return Err(bytes.error(format!("image {image} belongs to two frames")));
            }
        }
    }
    Ok(frame_of_image)
}

struct RawImage {
    pose: Rigid3,
    camera: CameraId,
    name: String,
    keypoints: Vec<[f32; 2]>,
    points: Vec<u64>,
}

/// COLMAP's image ids as ours, and COLMAP's point id of each keypoint.
type ImageTables = (BTreeMap<u32, usize>, Vec<Vec<u64>>);

fn read_images(
    bytes: &mut Bytes,
    camera_ids: &BTreeMap<u32, usize>,
    frame_of_image: Option<&BTreeMap<u64, FrameId>>,
    out: &mut Reconstruction,
) -> Result<ImageTables, FormatError> {
    let count = bytes.u64()?;
    let mut raw = Vec::with_capacity(bytes.count(count, 73)?);
    for _ in 0..count {
        let id = bytes.u32()?;
        let pose = pose(bytes)?;
        let camera = bytes.u32()?;
        let camera = CameraId::new(lookup(bytes, camera_ids, camera, "camera")?);
        let name = bytes.string()?;
        let keypoint_count = bytes.u64()?;
        let keypoint_count = bytes.count(keypoint_count, 24)?;
        let (mut keypoints, mut points) = (Vec::with_capacity(keypoint_count), Vec::with_capacity(keypoint_count));
        for _ in 0..keypoint_count {
            let [x, y] = bytes.f64s()?;
            keypoints.push([x as f32, y as f32]);
            points.push(bytes.u64()?);
        }
        raw.push((id, RawImage { pose, camera, name, keypoints, points }));
    }
    bytes.end()?;
    let (ids, raw) = dense(bytes, raw)?;
    let mut points = Vec::with_capacity(raw.len());
    for ((&id, &index), image) in ids.iter().zip(raw) {
        let frame = match frame_of_image {
            Some(frames) => *frames.get(&u64::from(id)).ok_or_else(|| bytes.error(format!("image {id} belongs to no frame")))?,
            None => {
                let rig = RigId::new(image.camera.index());
                out.frames.push(Frame { rig, exposure: index as u32, rig_from_world: Some(image.pose) });
                FrameId::new(index)
            }
        };
        if out.rigs[out.frames[frame.index()].rig.index()].cam_from_rig(image.camera).is_none() {
            return Err(bytes.error(format!("the camera of image {id} has no pose in the rig of its frame")));
        }
        out.images.push(Image { name: image.name, camera: image.camera, frame });
        out.keypoints.push(image.keypoints);
        points.push(image.points);
    }
    Ok((ids, points))
}

fn read_points(
    bytes: &mut Bytes,
    image_ids: &BTreeMap<u32, usize>,
    point_ids_of_keypoints: &[Vec<u64>],
    out: &mut Reconstruction,
) -> Result<(), FormatError> {
    let count = bytes.u64()?;
    let mut points = Vec::with_capacity(bytes.count(count, 51)?);
    for _ in 0..count {
        let id = bytes.u64()?;
        let xyz = Vector3::from(bytes.f64s::<3>()?);
        let colour = [bytes.u8()?, bytes.u8()?, bytes.u8()?];
        let error_px = bytes.f64()?;
        if id == NO_POINT || !xyz.iter().all(|v| v.is_finite()) {
            return Err(bytes.error(format!("point {id} is not finite")));
        }
        let track_length = bytes.u64()?;
        let mut track = Vec::with_capacity(bytes.count(track_length, 8)?);
        for _ in 0..track_length {
            let (image, keypoint) = (bytes.u32()?, bytes.u32()?);
            let image = lookup(bytes, image_ids, image, "image")?;
            if point_ids_of_keypoints[image].get(keypoint as usize) != Some(&id) {
                return Err(bytes.error(format!("point {id} and keypoint {keypoint} of one of its images do not name each other")));
            }
            track.push(Observation { image: ImageId::new(image), keypoint: KeypointIndex(keypoint) });
        }
        track.sort_unstable();
        if let Some(twice) = track.windows(2).find(|w| w[0] == w[1]) {
            return Err(bytes.error(format!("point {id} names keypoint {} twice", twice[0].keypoint)));
        }
        points.push((id, Point { xyz, colour, error_px, track }));
    }
    bytes.end()?;
    out.points = dense(bytes, points)?.1;
    Ok(())
}
