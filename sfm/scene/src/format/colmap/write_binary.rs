//! The binary form, little-endian.

use super::model::ColmapModel;
use crate::Rigid3;
use std::io::{Result, Write};

/// COLMAP's number of the sensor type "camera".
pub(super) const SENSOR_CAMERA: i32 = 0;

fn put_u32(out: &mut dyn Write, value: u32) -> Result<()> {
    out.write_all(&value.to_le_bytes())
}

fn put_u64(out: &mut dyn Write, value: u64) -> Result<()> {
    out.write_all(&value.to_le_bytes())
}

fn put_f64(out: &mut dyn Write, value: f64) -> Result<()> {
    out.write_all(&value.to_le_bytes())
}

/// Sensor type and id (COLMAP's, from 1).
fn put_sensor(out: &mut dyn Write, camera: u32) -> Result<()> {
    out.write_all(&SENSOR_CAMERA.to_le_bytes())?;
    put_u32(out, camera + 1)
}

/// qw qx qy qz tx ty tz.
fn put_pose(out: &mut dyn Write, pose: &Rigid3) -> Result<()> {
    let (q, t) = (&pose.rotation, &pose.translation);
    [q.w, q.i, q.j, q.k, t.x, t.y, t.z].into_iter().try_for_each(|v| put_f64(out, v))
}

impl ColmapModel<'_> {
    /// `cameras.bin`: count u64; each: id u32, model i32, width u64, height u64, parameters f64.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_cameras_binary(&self, out: &mut dyn Write) -> Result<()> {
        put_u64(out, self.cameras.len() as u64)?;
        for (i, ((model, params), camera)) in self.cameras.iter().zip(&self.reconstruction.cameras).enumerate() {
            put_u32(out, i as u32 + 1)?;
            out.write_all(&model.id.to_le_bytes())?;
            put_u64(out, u64::from(camera.width()))?;
            put_u64(out, u64::from(camera.height()))?;
            params.iter().try_for_each(|&v| put_f64(out, v))?;
        }
        Ok(())
    }

    /// `rigs.bin`: count u64; each: id u32, number of sensors u32, the reference (type i32, id u32), each other sensor
    /// (type i32, id u32, has a pose u8, `sensor_from_rig`).
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_rigs_binary(&self, out: &mut dyn Write) -> Result<()> {
        put_u64(out, self.reconstruction.rigs.len() as u64)?;
        for (i, rig) in self.reconstruction.rigs.iter().enumerate() {
            put_u32(out, i as u32 + 1)?;
            put_u32(out, rig.sensors.len() as u32)?;
            for (j, sensor) in rig.sensors.iter().enumerate() {
                put_sensor(out, sensor.camera.0)?;
                if j > 0 {
                    out.write_all(&[1])?;
                    put_pose(out, &sensor.cam_from_rig)?;
                }
            }
        }
        Ok(())
    }

    /// `frames.bin`: count u64; each: id u32, rig u32, `rig_from_world`, number of images u32, each (sensor type i32,
    /// camera u32, image u64).
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_frames_binary(&self, out: &mut dyn Write) -> Result<()> {
        put_u64(out, self.frames.len() as u64)?;
        for (frame, pose, images) in &self.frames {
            put_u32(out, frame.0 + 1)?;
            put_u32(out, self.reconstruction.frames[frame.index()].rig.0 + 1)?;
            put_pose(out, pose)?;
            put_u32(out, images.len() as u32)?;
            for image in images {
                put_sensor(out, self.reconstruction.images[image.index()].camera.0)?;
                put_u64(out, u64::from(image.0) + 1)?;
            }
        }
        Ok(())
    }

    /// `images.bin`: count u64; each: id u32, `cam_from_world`, camera u32, name ending with 0, number of keypoints u64,
    /// each (x f64, y f64, point u64).
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_images_binary(&self, out: &mut dyn Write) -> Result<()> {
        put_u64(out, self.images.len() as u64)?;
        for (id, pose) in &self.images {
            let image = &self.reconstruction.images[id.index()];
            put_u32(out, id.0 + 1)?;
            put_pose(out, pose)?;
            put_u32(out, image.camera.0 + 1)?;
            out.write_all(image.name.as_bytes())?;
            out.write_all(&[0])?;
            let keypoints = &self.reconstruction.keypoints[id.index()];
            put_u64(out, keypoints.len() as u64)?;
            for (&[x, y], &point) in keypoints.iter().zip(&self.point_of_keypoint[id.index()]) {
                put_f64(out, f64::from(x))?;
                put_f64(out, f64::from(y))?;
                put_u64(out, point)?;
            }
        }
        Ok(())
    }

    /// `points3D.bin`: count u64; each: id u64, position f64 x 3, colour u8 x 3, error f64, number of observations u64,
    /// each (image u32, keypoint u32).
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_points_binary(&self, out: &mut dyn Write) -> Result<()> {
        put_u64(out, self.points().count() as u64)?;
        for (id, index, track) in self.points() {
            let point = &self.reconstruction.points[index];
            put_u64(out, id)?;
            point.xyz.iter().try_for_each(|&v| put_f64(out, v))?;
            out.write_all(&point.colour)?;
            put_f64(out, point.error_px)?;
            put_u64(out, track.len() as u64)?;
            for observation in &track {
                put_u32(out, observation.image.0 + 1)?;
                put_u32(out, observation.keypoint.0)?;
            }
        }
        Ok(())
    }
}
