//! The verified pairs of one image with later ones.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SFMPAIR1` |
//! | 4 | number of pairs, u32 |
//! | | then for each pair: |
//! | 8 | the two images, u32 each, the smaller first |
//! | 1 | 0 essential matrix, 1 fundamental matrix, 2 homography |
//! | 72 | the matrix, row after row, f64 |
//! | 4 | inliers of a homography, u32 |
//! | 4 | number of matches n, u32 |
//! | 8 n | keypoint in the first and in the second image, u32 each |

use super::bytes::{Cursor, FormatError};
use nalgebra::Matrix3;
use scene::{ImageId, KeypointIndex, PairConfiguration, VerifiedPair};

const MAGIC: &[u8; 8] = b"SFMPAIR1";

/// The file of some pairs.
#[must_use]
pub fn write_matches(pairs: &[VerifiedPair]) -> Vec<u8> {
    let mut bytes = Vec::new();
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&(pairs.len() as u32).to_le_bytes());
    for pair in pairs {
        bytes.extend_from_slice(&pair.images.0.0.to_le_bytes());
        bytes.extend_from_slice(&pair.images.1.0.to_le_bytes());
        let (kind, matrix) = match &pair.configuration {
            PairConfiguration::Calibrated { essential } => (0, essential),
            PairConfiguration::Uncalibrated { fundamental } => (1, fundamental),
            PairConfiguration::PlanarOrPanoramic { homography } => (2, homography),
        };
        bytes.push(kind);
        matrix.transpose().iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
        bytes.extend_from_slice(&(pair.homography_inliers as u32).to_le_bytes());
        bytes.extend_from_slice(&(pair.matches.len() as u32).to_le_bytes());
        for (first, second) in &pair.matches {
            bytes.extend_from_slice(&first.0.to_le_bytes());
            bytes.extend_from_slice(&second.0.to_le_bytes());
        }
    }
    bytes
}

/// Reads what [`write_matches`] wrote.
///
/// # Errors
/// [`FormatError`] for bytes of another kind, version or length, and for numbers that are not finite.
pub fn read_matches(bytes: &[u8]) -> Result<Vec<VerifiedPair>, FormatError> {
    let mut cursor = Cursor::new("matches", MAGIC, bytes)?;
    let count = cursor.count(8 + 1 + 72 + 8)?;
    let mut pairs = Vec::with_capacity(count);
    for _ in 0..count {
        let images = (ImageId(cursor.u32()?), ImageId(cursor.u32()?));
        let kind = cursor.u8()?;
        let mut values = [0.0; 9];
        for value in &mut values {
            *value = cursor.f64()?;
        }
        let matrix = Matrix3::from_row_slice(&values);
        let configuration = match kind {
            0 => PairConfiguration::Calibrated { essential: matrix },
            1 => PairConfiguration::Uncalibrated { fundamental: matrix },
            2 => PairConfiguration::PlanarOrPanoramic { homography: matrix },
            other => return Err(cursor.error(format!("there is no configuration {other}"))),
        };
        let homography_inliers = cursor.u32()? as usize;
        let count = cursor.count(8)?;
        let mut matches = Vec::with_capacity(count);
        for _ in 0..count {
            matches.push((KeypointIndex(cursor.u32()?), KeypointIndex(cursor.u32()?)));
        }
        pairs.push(VerifiedPair { images, matches, configuration, homography_inliers });
    }
    cursor.end()?;
    Ok(pairs)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Vec<VerifiedPair> {
        let matrix = Matrix3::from_fn(|r, c| (3 * r + c) as f64 / 7.0);
        let pair = |second, configuration, n: u32| VerifiedPair {
            images: (ImageId(3), ImageId(second)),
            matches: (0..n).map(|i| (KeypointIndex(i), KeypointIndex(2 * i))).collect(),
            configuration,
            homography_inliers: 5,
        };
        vec![
            pair(4, PairConfiguration::Calibrated { essential: matrix }, 3),
            pair(5, PairConfiguration::Uncalibrated { fundamental: matrix }, 0),
            pair(9, PairConfiguration::PlanarOrPanoramic { homography: matrix }, 1),
        ]
    }

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(read_matches(&write_matches(&sample())), Ok(sample()));
        assert_eq!(read_matches(&write_matches(&[])), Ok(Vec::new()));
    }

    #[test]
    fn every_length_but_the_right_one_is_refused() {
        let bytes = write_matches(&sample());
        for length in 0..bytes.len() {
            assert!(read_matches(&bytes[..length]).is_err(), "{length} bytes");
        }
        assert!(read_matches(&[bytes.as_slice(), &[0]].concat()).is_err());
        let mut kind = bytes;
        kind[20] = 9;
        assert!(read_matches(&kind).is_err());
    }
}
