//! A cloud with its distances, in colours that colour-blind readers can tell apart.

use anyhow::{Context, Result, bail};
use eval::Points;
use nalgebra::Point3;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

/// Signed: blue, white, orange (after Brewer's PuOr and RdBu: blue and orange stay apart for every kind of colour blindness).
const DIVERGING: [[f64; 3]; 5] =
    [[5.0, 48.0, 97.0], [103.0, 169.0, 207.0], [247.0, 247.0, 247.0], [241.0, 163.0, 64.0], [127.0, 59.0, 8.0]];
/// Unsigned: dark blue through grey to yellow (after cividis; Nunez, Anderton & Renslow, PLoS ONE, 2018).
const SEQUENTIAL: [[f64; 3]; 5] =
    [[0.0, 34.0, 78.0], [65.0, 77.0, 107.0], [124.0, 123.0, 120.0], [188.0, 175.0, 111.0], [254.0, 232.0, 56.0]];

/// A file that takes points and distances piece by piece.
pub(super) struct Coloured {
    path: PathBuf,
    out: BufWriter<File>,
    csv: bool,
    signed: bool,
    /// Distance of the last colour, metres.
    end_m: f64,
}

impl Coloured {
    /// Starts the file; colours end at twice the threshold.
    pub fn new(path: &Path, cloud: &dyn Points, signed: bool, threshold_m: Option<f64>) -> Result<Self> {
        let csv = match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
            Some("ply") => false,
            Some("csv") => true,
            _ => bail!("{}: clouds are written as .ply or .csv", path.display()),
        };
        let mut count = 0usize;
        cloud.visit(&mut |piece| {
            count += piece.len();
            Ok(())
        })?;
        let name = || path.display().to_string();
        let mut out = BufWriter::with_capacity(1 << 18, File::create(path).with_context(name)?);
        let head = if csv {
            "x,y,z,distance_m\n".to_owned()
        } else {
            format!(
                "ply\nformat binary_little_endian 1.0\nelement vertex {count}\nproperty double x\nproperty double y\nproperty double z\n\
                 property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float distance\nend_header\n"
            )
        };
        out.write_all(head.as_bytes()).with_context(name)?;
        Ok(Self { path: path.to_owned(), out, csv, signed, end_m: 2.0 * threshold_m.unwrap_or(1.0) })
    }

    /// Appends points.
    pub fn write(&mut self, points: &[Point3<f64>], distances: &[f64]) -> Result<()> {
        for (p, d) in points.iter().zip(distances) {
            let done = if self.csv {
                writeln!(self.out, "{},{},{},{d}", p.x, p.y, p.z)
            } else {
                let share = (d / self.end_m).clamp(-1.0, 1.0);
                let colour = if self.signed { blend(&DIVERGING, (share + 1.0) / 2.0) } else { blend(&SEQUENTIAL, share) };
                let mut record = [0; 31];
                for axis in 0..3 {
                    record[8 * axis..8 * axis + 8].copy_from_slice(&p[axis].to_le_bytes());
                }
                record[24..27].copy_from_slice(&colour);
                record[27..].copy_from_slice(&(*d as f32).to_le_bytes());
                self.out.write_all(&record)
            };
            done.with_context(|| self.path.display().to_string())?;
        }
        Ok(())
    }

    /// Ends the file.
    pub fn finish(mut self) -> Result<()> {
        self.out.flush().with_context(|| self.path.display().to_string())
    }
}

/// Colour at a place from 0 to 1 on a row of colours.
fn blend(colours: &[[f64; 3]; 5], place: f64) -> [u8; 3] {
    let at = place.clamp(0.0, 1.0) * 4.0;
    let below = (at as usize).min(3);
    [0, 1, 2].map(|i| (colours[below][i] + (at - below as f64) * (colours[below + 1][i] - colours[below][i])).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_middle_have_their_colours() {
        assert_eq!([0.0, 0.5, 1.0].map(|p| blend(&DIVERGING, p)), [[5, 48, 97], [247, 247, 247], [127, 59, 8]]);
        assert_eq!([-1.0, 2.0].map(|p| blend(&SEQUENTIAL, p)), [[0, 34, 78], [254, 232, 56]]);
    }
}
