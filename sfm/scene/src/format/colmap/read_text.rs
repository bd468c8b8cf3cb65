//! The text form, turned into the binary one, which is then read: all that can be wrong with a model is looked for in one place.

use super::super::error::FormatError;
use super::camera::model_from_name;
use super::model::NO_POINT;
use super::read::{ColmapFiles, read_colmap, read_colmap_binary};
use super::write_binary::SENSOR_CAMERA;
use crate::Reconstruction;
use std::path::Path;
use std::str::SplitAsciiWhitespace;

/// Reads a model: the binary form where `cameras.bin` is there, else the text.
///
/// # Errors
/// As [`read_colmap_binary`] or [`read_colmap_text`].
pub fn read_colmap_model(dir: &Path) -> Result<Reconstruction, FormatError> {
    let is_text = !dir.join("cameras.bin").exists() && dir.join("cameras.txt").exists();
    if is_text { read_colmap_text(dir) } else { read_colmap_binary(dir) }
}

/// Reads `cameras.txt`, `rigs.txt`, `frames.txt`, `images.txt` and `points3D.txt` of `dir`; models from before COLMAP 3.12 have neither rigs
/// nor frames. See [`read_colmap`] for what is made of them.
///
/// # Errors
/// [`FormatError::File`] where a file cannot be read, [`FormatError::Line`] where a line is not what the format says; else as
/// [`read_colmap`].
pub fn read_colmap_text(dir: &Path) -> Result<Reconstruction, FormatError> {
    let file = |name: &str| std::fs::read_to_string(dir.join(name)).map_err(FormatError::file(dir.join(name)));
    let cameras = Binary::of("cameras.txt", "cameras.bin", &file("cameras.txt")?, camera)?;
    let legacy = !dir.join("rigs.txt").exists() && !dir.join("frames.txt").exists();
    let rigs_and_frames = if legacy {
        None
    } else {
        let rigs = Binary::of("rigs.txt", "rigs.bin", &file("rigs.txt")?, rig)?;
        Some((rigs, Binary::of("frames.txt", "frames.bin", &file("frames.txt")?, frame)?))
    };
    let images = Binary::of("images.txt", "images.bin", &file("images.txt")?, image)?;
    let points = Binary::of("points3D.txt", "points3D.bin", &file("points3D.txt")?, point)?;
    let files = ColmapFiles {
        cameras: &cameras.bytes,
        rigs_and_frames: rigs_and_frames.as_ref().map(|(r, f)| (r.bytes.as_slice(), f.bytes.as_slice())),
        images: &images.bytes,
        points: &points.bytes,
    };
    let all =
        [Some(&cameras), rigs_and_frames.as_ref().map(|r| &r.0), rigs_and_frames.as_ref().map(|r| &r.1), Some(&images), Some(&points)];
    read_colmap(&files).map_err(|error| all.into_iter().flatten().fold(error, |error, binary| binary.by_line(error)))
}

/// The binary form of a text file.
struct Binary {
    text_name: &'static str,
    binary_name: &'static str,
    bytes: Vec<u8>,
    /// Where the record of each line begins, and the line.
    lines: Vec<(u64, u64)>,
}

impl Binary {
    /// Turns each record into bytes; the number of records stands before them.
    fn of(
        text_name: &'static str,
        binary_name: &'static str,
        text: &str,
        record: fn(&mut Line, &mut Vec<u8>) -> Result<(), FormatError>,
    ) -> Result<Self, FormatError> {
        let mut binary = Self { text_name, binary_name, bytes: vec![0; 8], lines: Vec::new() };
        let mut lines = text.lines().zip(1u64..);
        while let Some((line, number)) = lines.next() {
            if line.trim().is_empty() || line.trim_start().starts_with('#') {
                continue;
            }
            binary.lines.push((binary.bytes.len() as u64, number));
            // The keypoints of an image stand on the line after it, which is empty where there are none.
            let next = if text_name == "images.txt" { lines.next().map_or("", |(line, _)| line) } else { "" };
            let mut line = Line { file: text_name, number, fields: line.split_ascii_whitespace(), text: line, next };
            record(&mut line, &mut binary.bytes)?;
            if let Some(more) = line.fields.next() {
                return Err(line.error(format!("\"{more}\" is one field too many")));
            }
        }
        binary.bytes[..8].copy_from_slice(&(binary.lines.len() as u64).to_le_bytes());
        Ok(binary)
    }

    /// An error at a byte of this file, by its line.
    fn by_line(&self, error: FormatError) -> FormatError {
        match error {
            FormatError::Bytes { file, offset, what } if file == self.binary_name => {
                let before = self.lines.partition_point(|(begin, _)| *begin < offset);
                let line = before.checked_sub(1).map_or(1, |i| self.lines[i].1);
                FormatError::Line { file: self.text_name, line, what }
            }
            other => other,
        }
    }
}

/// A record of a text file.
struct Line<'t> {
    file: &'static str,
    number: u64,
    fields: SplitAsciiWhitespace<'t>,
    text: &'t str,
    next: &'t str,
}

impl<'t> Line<'t> {
    fn error(&self, what: impl Into<String>) -> FormatError {
        FormatError::Line { file: self.file, line: self.number, what: what.into() }
    }

    fn field(&mut self, name: &str) -> Result<&'t str, FormatError> {
        self.fields.next().ok_or_else(|| self.error(format!("ends before {name}")))
    }

    fn number<T: std::str::FromStr>(&mut self, name: &str) -> Result<T, FormatError> {
        let field = self.field(name)?;
        field.parse().map_err(|_| self.error(format!("{name} is \"{field}\", which it cannot be")))
    }

    fn u32(&mut self, name: &str, out: &mut Vec<u8>) -> Result<u32, FormatError> {
        let value: u32 = self.number(name)?;
        out.extend(value.to_le_bytes());
        Ok(value)
    }

    fn u64(&mut self, name: &str, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let value: u64 = self.number(name)?;
        out.extend(value.to_le_bytes());
        Ok(())
    }

    fn f64s(&mut self, names: &[&str], out: &mut Vec<u8>) -> Result<(), FormatError> {
        for name in names {
            let value: f64 = self.number(name)?;
            out.extend(value.to_le_bytes());
        }
        Ok(())
    }

    fn pose(&mut self, out: &mut Vec<u8>) -> Result<(), FormatError> {
        self.f64s(&["QW", "QX", "QY", "QZ", "TX", "TY", "TZ"], out)
    }

    fn sensor(&mut self, out: &mut Vec<u8>) -> Result<(), FormatError> {
        let kind = self.field("SENSOR_TYPE")?;
        if kind != "CAMERA" {
            return Err(self.error(format!("sensors of type {kind} are not supported")));
        }
        out.extend(SENSOR_CAMERA.to_le_bytes());
        self.u32("SENSOR_ID", out).map(|_| ())
    }
}

fn camera(line: &mut Line, out: &mut Vec<u8>) -> Result<(), FormatError> {
    line.u32("CAMERA_ID", out)?;
    let name = line.field("MODEL")?;
    let model = model_from_name(name).ok_or_else(|| line.error(format!("camera model {name} is not supported")))?;
    out.extend(model.id.to_le_bytes());
    line.u64("WIDTH", out)?;
    line.u64("HEIGHT", out)?;
    (0..model.param_count).try_for_each(|_| line.f64s(&["PARAMS"], out))
}

fn rig(line: &mut Line, out: &mut Vec<u8>) -> Result<(), FormatError> {
    line.u32("RIG_ID", out)?;
    let sensors = line.u32("NUM_SENSORS", out)?;
    for j in 0..sensors {
        line.sensor(out)?;
        if j > 0 {
            let has_pose: u8 = line.number("HAS_POSE")?;
            out.push(has_pose);
            if has_pose != 0 {
                line.pose(out)?;
            }
        }
    }
    Ok(())
}

fn frame(line: &mut Line, out: &mut Vec<u8>) -> Result<(), FormatError> {
    line.u32("FRAME_ID", out)?;
    line.u32("RIG_ID", out)?;
    line.pose(out)?;
    let images = line.u32("NUM_DATA_IDS", out)?;
    for _ in 0..images {
        line.sensor(out)?;
        line.u64("DATA_ID", out)?;
    }
    Ok(())
}

fn image(line: &mut Line, out: &mut Vec<u8>) -> Result<(), FormatError> {
    line.u32("IMAGE_ID", out)?;
    line.pose(out)?;
    line.u32("CAMERA_ID", out)?;
    // A name may hold blanks: all that is left.
    let first = line.field("NAME")?;
    let begin = first.as_ptr() as usize - line.text.as_ptr() as usize;
    out.extend(line.text[begin..].trim_end().as_bytes());
    out.push(0);
    line.fields = line.next.split_ascii_whitespace();
    line.number += 1;
    let count = line.fields.clone().count();
    if !count.is_multiple_of(3) {
        return Err(line.error(format!("{count} fields are not X, Y and POINT3D_ID of each keypoint")));
    }
    out.extend(((count / 3) as u64).to_le_bytes());
    for _ in 0..count / 3 {
        line.f64s(&["X", "Y"], out)?;
        let field = line.field("POINT3D_ID")?;
        let id = if field == "-1" { Some(NO_POINT) } else { field.parse().ok() };
        let id = id.ok_or_else(|| line.error(format!("POINT3D_ID is \"{field}\", which it cannot be")))?;
        out.extend(id.to_le_bytes());
    }
    Ok(())
}

fn point(line: &mut Line, out: &mut Vec<u8>) -> Result<(), FormatError> {
    line.u64("POINT3D_ID", out)?;
    line.f64s(&["X", "Y", "Z"], out)?;
    for name in ["R", "G", "B"] {
        out.push(line.number(name)?);
    }
    line.f64s(&["ERROR"], out)?;
    let count = line.fields.clone().count();
    if !count.is_multiple_of(2) {
        return Err(line.error("the last observation has no POINT2D_IDX"));
    }
    out.extend(((count / 2) as u64).to_le_bytes());
    for _ in 0..count / 2 {
        line.u32("IMAGE_ID", out)?;
        line.u32("POINT2D_IDX", out)?;
    }
    Ok(())
}
