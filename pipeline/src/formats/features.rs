//! Keypoints, descriptors and colours of one image.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | `SFMFEAT1` |
//! | 4 | number of keypoints n, u32 |
//! | 16 n | x, y, scale, orientation of each, f32 |
//! | 128 n | descriptors |
//! | 3 n | sRGB colour of the pixel of each keypoint |

use super::bytes::{Cursor, FormatError};
use scene::{Features, Keypoint};

const MAGIC: &[u8; 8] = b"SFMFEAT1";

/// Features, and the colour of the image at each keypoint.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StoredFeatures {
    /// Keypoints and descriptors.
    pub features: Features,
    /// sRGB, one a keypoint.
    pub colours: Vec<[u8; 3]>,
}

/// The file of an image's features. The three lists must be of one length.
#[must_use]
pub fn write_features(stored: &StoredFeatures) -> Vec<u8> {
    let StoredFeatures { features, colours } = stored;
    let mut bytes = Vec::with_capacity(12 + features.len() * (16 + 128 + 3));
    bytes.extend_from_slice(MAGIC);
    bytes.extend_from_slice(&(features.len() as u32).to_le_bytes());
    for k in &features.keypoints {
        for value in [k.x, k.y, k.scale, k.orientation] {
            bytes.extend_from_slice(&value.to_le_bytes());
        }
    }
    features.descriptors.iter().for_each(|d| bytes.extend_from_slice(d));
    colours.iter().for_each(|c| bytes.extend_from_slice(c));
    bytes
}

/// Reads what [`write_features`] wrote.
///
/// # Errors
/// [`FormatError`] for bytes of another kind, version or length, and for numbers that are not finite.
pub fn read_features(bytes: &[u8]) -> Result<StoredFeatures, FormatError> {
    let mut cursor = Cursor::new("features", MAGIC, bytes)?;
    let count = cursor.count(16 + 128 + 3)?;
    let mut keypoints = Vec::with_capacity(count);
    for _ in 0..count {
        keypoints.push(Keypoint { x: cursor.f32()?, y: cursor.f32()?, scale: cursor.f32()?, orientation: cursor.f32()? });
    }
    let descriptors = cursor.take(128 * count)?.as_chunks::<128>().0.to_vec();
    let colours = cursor.take(3 * count)?.as_chunks::<3>().0.to_vec();
    cursor.end()?;
    Ok(StoredFeatures { features: Features { keypoints, descriptors }, colours })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> StoredFeatures {
        let keypoints = (0..3).map(|i| Keypoint { x: i as f32 + 0.25, y: 7.5, scale: 1.6, orientation: -3.0 }).collect();
        let descriptors = (0..3u8).map(|i| [i * 80; 128]).collect();
        StoredFeatures { features: Features { keypoints, descriptors }, colours: vec![[1, 2, 3], [4, 5, 6], [255, 0, 9]] }
    }

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(read_features(&write_features(&sample())), Ok(sample()));
        assert_eq!(read_features(&write_features(&StoredFeatures::default())), Ok(StoredFeatures::default()));
    }

    #[test]
    fn every_length_but_the_right_one_is_refused() {
        let bytes = write_features(&sample());
        for length in 0..bytes.len() {
            assert!(read_features(&bytes[..length]).is_err(), "{length} bytes");
        }
        assert!(read_features(&[bytes.as_slice(), &[0]].concat()).is_err());
        let mut huge = bytes.clone();
        huge[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        assert!(read_features(&huge).is_err());
        let mut nan = bytes;
        nan[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(read_features(&nan).is_err());
    }
}
