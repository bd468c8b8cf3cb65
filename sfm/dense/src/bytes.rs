//! The stored form of a depth map.
//!
//! Little-endian. Header of 128 bytes: `SFMDEPTH`; version, image, width, height, number of neighbours, number of known pixels, number of ray
//! offsets (u32 each); the pinhole's fx, fy, cx, cy; the rotation cam_from_world as quaternion i, j, k, w; the translation (f64 each). Then the
//! neighbours (u32 each); the ray offsets behind a port, by rows (two f32 each); one
//! bit a pixel that says whether its depth is known, row after row, lowest bit first; and for the known pixels in that order all depths
//! (f32), all normals (two i16, octahedral), all confidences (u8, 255 = 1), all colours (3 u8).

use crate::{DenseError, DepthMap, RayOffsets};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use scene::{Camera, CameraModel, ImageId, Raster, Rigid3};

const MAGIC: &[u8; 8] = b"SFMDEPTH";
const VERSION: u32 = 2;
/// Bytes of one known pixel.
const PIXEL: usize = 4 + 4 + 1 + 3;

impl DepthMap {
    /// The map in its stored form; see the module `bytes` for the layout.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let known: Vec<usize> = (0..self.depth.data().len()).filter(|&i| self.depth.data()[i] > 0.0).collect();
        let nodes = self.offsets.as_ref().map_or(&[][..], RayOffsets::nodes);
        let mut out =
            Vec::with_capacity(128 + 4 * self.neighbours.len() + 8 * nodes.len() + self.depth.data().len() / 8 + 1 + known.len() * PIXEL);
        out.extend(MAGIC);
        let counts = [self.neighbours.len(), known.len(), nodes.len()].map(|n| n as u32);
        for value in [VERSION, self.image.0, self.camera.width(), self.camera.height()].into_iter().chain(counts) {
            out.extend(value.to_le_bytes());
        }
        let (q, t) = (self.cam_from_world.rotation.coords, self.cam_from_world.translation);
        for value in self.camera.params().iter().chain(q.iter()).chain(t.iter()) {
            out.extend(value.to_le_bytes());
        }
        out.extend(self.neighbours.iter().flat_map(|n| n.0.to_le_bytes()));
        out.extend(nodes.iter().flatten().flat_map(|v| v.to_le_bytes()));
        let first_bit = out.len();
        out.resize(first_bit + self.depth.data().len().div_ceil(8), 0);
        for &i in &known {
            out[first_bit + i / 8] |= 1 << (i % 8);
        }
        out.extend(known.iter().flat_map(|&i| self.depth.data()[i].to_le_bytes()));
        out.extend(known.iter().flat_map(|&i| encode_normal(self.normal.data()[i])).flat_map(i16::to_le_bytes));
        out.extend(known.iter().map(|&i| encode_confidence(self.confidence.data()[i])));
        out.extend(known.iter().flat_map(|&i| self.rgb.data()[i]));
        out
    }

    /// The map of a stored form.
    ///
    /// # Errors
    /// [`DenseError::BadBytes`] when the bytes are of another kind or version, cut short, too long, or hold impossible values.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, DenseError> {
        let mut rest = Reader(bytes);
        if rest.take(8)? != MAGIC {
            return Err(DenseError::BadBytes("it does not start like one"));
        }
        if rest.u32()? != VERSION {
            return Err(DenseError::BadBytes("it is of another version"));
        }
        let image = ImageId(rest.u32()?);
        let (width, height) = (rest.u32()?, rest.u32()?);
        let [neighbour_count, known, node_count] = [rest.u32()? as usize, rest.u32()? as usize, rest.u32()? as usize];
        let mut values = [0.0; 11];
        for value in &mut values {
            *value = f64::from_le_bytes(rest.array()?);
        }
        let camera =
            Camera::new(CameraModel::Pinhole, width, height, &values[..4]).map_err(|_| DenseError::BadBytes("impossible camera"))?;
        let rotation = Quaternion::new(values[7], values[4], values[5], values[6]);
        let translation = Vector3::new(values[8], values[9], values[10]);
        let unit = (rotation.norm() - 1.0).abs() < 1e-6 && translation.iter().all(|v| v.is_finite());
        if !unit {
            return Err(DenseError::BadBytes("impossible pose"));
        }
        let neighbours =
            rest.take(neighbour_count.saturating_mul(4))?.as_chunks::<4>().0.iter().map(|&b| ImageId(u32::from_le_bytes(b))).collect();
        let nodes = rest.take(node_count.saturating_mul(8))?.as_chunks::<8>().0.iter();
        let node = |&[a, b, c, d, e, f, g, h]: &[u8; 8]| [f32::from_le_bytes([a, b, c, d]), f32::from_le_bytes([e, f, g, h])];
        let nodes: Vec<[f32; 2]> = nodes.map(node).collect();
        let offsets = if nodes.is_empty() {
            None
        } else {
            Some(RayOffsets::from_nodes(&camera, nodes).ok_or(DenseError::BadBytes("impossible ray offsets"))?)
        };
        let pixels = (width as usize).checked_mul(height as usize).ok_or(DenseError::BadBytes("impossible size"))?;
        let bits = rest.take(pixels.div_ceil(8))?;
        let (depths, normals) = (rest.take(known.saturating_mul(4))?, rest.take(known.saturating_mul(4))?);
        let (confidences, colours) = (rest.take(known)?, rest.take(known.saturating_mul(3))?);
        if !rest.0.is_empty() {
            return Err(DenseError::BadBytes("it is too long"));
        }
        let (w, h) = (width as usize, height as usize);
        let mut map = Self {
            image,
            camera,
            // Unchecked keeps the bits of what was stored; the norm was checked above.
            cam_from_world: Rigid3::new(UnitQuaternion::new_unchecked(rotation), translation),
            offsets,
            neighbours,
            depth: Raster::filled(w, h, 0.0),
            normal: Raster::filled(w, h, [0.0; 3]),
            confidence: Raster::filled(w, h, 0.0),
            rgb: Raster::filled(w, h, [0; 3]),
        };
        let mut next = 0;
        for i in (0..pixels).filter(|i| bits[i / 8] >> (i % 8) & 1 == 1) {
            let (Some(&depth), Some(&[a, b, c, d])) = (depths.as_chunks::<4>().0.get(next), normals.as_chunks::<4>().0.get(next)) else {
                return Err(DenseError::BadBytes("it marks more pixels than it holds"));
            };
            let depth = f32::from_le_bytes(depth);
            if !(depth > 0.0 && depth.is_finite()) {
                return Err(DenseError::BadBytes("a depth is not positive"));
            }
            map.depth.data_mut()[i] = depth;
            map.normal.data_mut()[i] = decode_normal([i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d])]);
            map.confidence.data_mut()[i] = decode_confidence(confidences[next]);
            map.rgb.data_mut()[i] = colours.as_chunks::<3>().0[next];
            next += 1;
        }
        if next == known { Ok(map) } else { Err(DenseError::BadBytes("it holds more pixels than it marks")) }
    }
}

/// The value that the stored form keeps.
pub(crate) fn storable_normal(normal: [f32; 3]) -> [f32; 3] {
    decode_normal(encode_normal(normal))
}

/// The value that the stored form keeps.
pub(crate) fn storable_confidence(confidence: f32) -> f32 {
    decode_confidence(encode_confidence(confidence))
}

fn encode_confidence(confidence: f32) -> u8 {
    (confidence.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

fn decode_confidence(code: u8) -> f32 {
    f32::from(code) / 255.0
}

/// Octahedral coordinates of a unit vector (Meyer et al., *On floating-point normal vectors*, EGSR 2010), steps of 1/32767.
fn encode_normal(n: [f32; 3]) -> [i16; 2] {
    let [x, y, z] = n.map(f64::from);
    let sum = (x.abs() + y.abs() + z.abs()).max(1e-30);
    let (mut u, mut v) = (x / sum, y / sum);
    if z < 0.0 {
        (u, v) = fold(u, v);
    }
    [u, v].map(|c| (c * 32767.0).round() as i16)
}

fn decode_normal([u, v]: [i16; 2]) -> [f32; 3] {
    let (mut x, mut y) = (f64::from(u) / 32767.0, f64::from(v) / 32767.0);
    let z = 1.0 - x.abs() - y.abs();
    if z < 0.0 {
        (x, y) = fold(x, y);
    }
    let norm = (x * x + y * y + z * z).sqrt().max(1e-30);
    [(x / norm) as f32, (y / norm) as f32, (z / norm) as f32]
}

/// Exchanges the inner square, which holds z > 0, with the corners, which hold z < 0.
fn fold(u: f64, v: f64) -> (f64, f64) {
    ((1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v))
}

struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], DenseError> {
        let (taken, rest) = self.0.split_at_checked(count).ok_or(DenseError::BadBytes("it is cut short"))?;
        self.0 = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], DenseError> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(DenseError::BadBytes("it is cut short"))?;
        self.0 = rest;
        Ok(*taken)
    }

    fn u32(&mut self) -> Result<u32, DenseError> {
        Ok(u32::from_le_bytes(self.array()?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> DepthMap {
        let (w, h) = (13, 7);
        let camera = Camera::new(CameraModel::Pinhole, 13, 7, &[10.0, 11.0, 6.5, 3.5]).expect("valid");
        let mut map = DepthMap {
            image: ImageId(5),
            camera,
            cam_from_world: Rigid3::new(UnitQuaternion::from_euler_angles(0.1, -0.7, 0.3), Vector3::new(1.0, -2.0, 0.3)),
            // Nodes at the pixels 0, 8, 16 of two rows, 8 apart.
            offsets: RayOffsets::from_nodes(&camera, (0..6).map(|i| [0.01 * i as f32, -0.003]).collect()),
            neighbours: vec![ImageId(9), ImageId(2)],
            depth: Raster::filled(w, h, 0.0),
            normal: Raster::filled(w, h, [0.0; 3]),
            confidence: Raster::filled(w, h, 0.0),
            rgb: Raster::filled(w, h, [0; 3]),
        };
        for i in (0..w * h).filter(|i| i % 3 != 1) {
            map.depth.data_mut()[i] = 1.0 + i as f32;
            let n = Vector3::new((i as f32).sin(), (i as f32).cos(), -0.3 - (i % 5) as f32).normalize();
            map.normal.data_mut()[i] = storable_normal(n.into());
            map.confidence.data_mut()[i] = storable_confidence(i as f32 / 100.0);
            map.rgb.data_mut()[i] = [i as u8, 2, 255 - i as u8];
        }
        map
    }

    #[test]
    fn stored_and_read_is_the_same() {
        let map = map();
        assert!(map.offsets.is_some());
        assert_eq!(DepthMap::from_bytes(&map.to_bytes()).expect("whole"), map);
    }

    #[test]
    fn every_cut_and_every_flipped_byte_is_an_error_or_a_map() {
        let bytes = map().to_bytes();
        for n in 0..bytes.len() {
            assert!(DepthMap::from_bytes(&bytes[..n]).is_err(), "cut at {n}");
            let mut damaged = bytes.clone();
            damaged[n] ^= 0xff;
            // A changed colour cannot be noticed, but nothing may panic or allocate without bound.
            let _ = DepthMap::from_bytes(&damaged);
        }
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(DepthMap::from_bytes(&longer), Err(DenseError::BadBytes("it is too long")));
    }

    #[test]
    fn normals_keep_their_direction_and_settle_at_once() {
        let mut worst: f32 = 0.0;
        for i in 0..20_000u32 {
            let a = i as f32 * 2.399_963;
            let z = 1.0 - (i as f32 + 0.5) / 10_000.0;
            let r = (1.0 - z * z).max(0.0).sqrt();
            let n = [r * a.cos(), r * a.sin(), z];
            let stored = storable_normal(n);
            assert_eq!(storable_normal(stored), stored);
            worst = worst.max(n.iter().zip(stored).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max));
        }
        assert!(worst < 1e-4, "{worst}");
    }
}
