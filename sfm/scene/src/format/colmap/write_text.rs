//! The text form: one record a line (images two), fields separated by one space.

use super::model::{ColmapModel, NO_POINT};
use crate::Rigid3;
use std::io::{Result, Write};

/// ` qw qx qy qz tx ty tz`.
fn put_pose(out: &mut dyn Write, pose: &Rigid3) -> Result<()> {
    let (q, t) = (&pose.rotation, &pose.translation);
    write!(out, " {} {} {} {} {} {} {}", q.w, q.i, q.j, q.k, t.x, t.y, t.z)
}

impl ColmapModel<'_> {
    /// `cameras.txt`.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_cameras_text(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]\n# Number of cameras: {}", self.cameras.len())?;
        for (i, ((model, params), camera)) in self.cameras.iter().zip(&self.reconstruction.cameras).enumerate() {
            write!(out, "{} {} {} {}", i + 1, model.name, camera.width(), camera.height())?;
            params.iter().try_for_each(|v| write!(out, " {v}"))?;
            writeln!(out)?;
        }
        Ok(())
    }

    /// `rigs.txt`.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_rigs_text(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID SENSORS[] as (TYPE ID HAS_POSE [QW QX QY QZ TX TY TZ])")?;
        writeln!(out, "# Number of rigs: {}", self.reconstruction.rigs.len())?;
        for (i, rig) in self.reconstruction.rigs.iter().enumerate() {
            write!(out, "{} {}", i + 1, rig.sensors.len())?;
            for (j, sensor) in rig.sensors.iter().enumerate() {
                write!(out, " CAMERA {}", sensor.camera.0 + 1)?;
                if j > 0 {
                    write!(out, " 1")?;
                    put_pose(out, &sensor.cam_from_rig)?;
                }
            }
            writeln!(out)?;
        }
        Ok(())
    }

    /// `frames.txt`.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_frames_text(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# FRAME_ID RIG_ID QW QX QY QZ TX TY TZ NUM_DATA_IDS DATA_IDS[] as (SENSOR_TYPE SENSOR_ID DATA_ID)")?;
        writeln!(out, "# Number of frames: {}", self.frames.len())?;
        for (frame, pose, images) in &self.frames {
            write!(out, "{} {}", frame.0 + 1, self.reconstruction.frames[frame.index()].rig.0 + 1)?;
            put_pose(out, pose)?;
            write!(out, " {}", images.len())?;
            for image in images {
                write!(out, " CAMERA {} {}", self.reconstruction.images[image.index()].camera.0 + 1, image.0 + 1)?;
            }
            writeln!(out)?;
        }
        Ok(())
    }

    /// `images.txt`.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_images_text(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME\n# POINTS2D[] as (X Y POINT3D_ID)")?;
        writeln!(out, "# Number of images: {}", self.images.len())?;
        for (id, pose) in &self.images {
            let image = &self.reconstruction.images[id.index()];
            write!(out, "{}", id.0 + 1)?;
            put_pose(out, pose)?;
            writeln!(out, " {} {}", image.camera.0 + 1, image.name)?;
            let keypoints = self.reconstruction.keypoints[id.index()].iter().zip(&self.point_of_keypoint[id.index()]);
            for (i, (&[x, y], &point)) in keypoints.enumerate() {
                let gap = if i > 0 { " " } else { "" };
                // Through f64, as the binary form: the shortest digits of the f32 would be another number.
                write!(out, "{gap}{} {} ", f64::from(x), f64::from(y))?;
                if point == NO_POINT { write!(out, "-1")? } else { write!(out, "{point}")? }
            }
            writeln!(out)?;
        }
        Ok(())
    }

    /// `points3D.txt`.
    ///
    /// # Errors
    /// What the stream says.
    pub fn write_points_text(&self, out: &mut dyn Write) -> Result<()> {
        writeln!(out, "# POINT3D_ID X Y Z R G B ERROR TRACK[] as (IMAGE_ID POINT2D_IDX)\n# Number of points: {}", self.points().count())?;
        for (id, index, track) in self.points() {
            let point = &self.reconstruction.points[index];
            let ([r, g, b], x) = (point.colour, &point.xyz);
            write!(out, "{id} {} {} {} {r} {g} {b} {}", x.x, x.y, x.z, point.error_px)?;
            for observation in &track {
                write!(out, " {} {}", observation.image.0 + 1, observation.keypoint.0)?;
            }
            writeln!(out)?;
        }
        Ok(())
    }
}
