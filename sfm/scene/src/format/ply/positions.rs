//! Positions alone, piece by piece: what a cloud of any size is measured with.

use super::elements::{Skipped, Vertex};
use super::read::{Dropped, PlyReader};
use crate::format::FormatError;
use nalgebra::Point3;
use ply_rs_bw::ply::{ElementDef, Encoding, PropertyType, ScalarType};
use std::io::{BufRead, Read};

/// Points handed over at once.
const PIECE: usize = 1 << 20;

/// Reads the positions of a PLY cloud in pieces, as [`super::read_ply_cloud`] reads all of it. Positions that are not finite
/// are dropped and counted.
///
/// # Errors
/// As [`super::read_ply_cloud`], and what `each` returns.
pub fn read_ply_positions<E: From<FormatError>>(
    input: impl BufRead,
    mut each: impl FnMut(&[Point3<f64>]) -> Result<(), E>,
) -> Result<Dropped, E> {
    let mut file = PlyReader::open(input)?;
    for element in file.elements() {
        if element.name != "vertex" {
            file.read::<Skipped>(&element, |_, _| Ok(()))?;
            continue;
        }
        file.attributes(&element)?;
        let mut pieces = Pieces { piece: Vec::new(), dropped: Dropped::default(), failed: None, each: &mut each };
        let done = match layout(&element, file.header.encoding) {
            Some(layout) => fixed(&mut file, &element, &layout, &mut pieces),
            None => file.read::<Vertex>(&element, |_, vertex| pieces.push(vertex.position)),
        };
        if let Some(failed) = pieces.failed.take() {
            return Err(failed);
        }
        done?;
        return pieces.end();
    }
    Err(file.error("there is no element vertex".into()).into())
}

struct Pieces<'a, F, E> {
    piece: Vec<Point3<f64>>,
    dropped: Dropped,
    failed: Option<E>,
    each: &'a mut F,
}

impl<E, F: FnMut(&[Point3<f64>]) -> Result<(), E>> Pieces<'_, F, E> {
    /// An error only stops the reader: its reason is kept aside.
    fn push(&mut self, position: [f64; 3]) -> Result<(), String> {
        if !position.iter().all(|v| v.is_finite()) {
            self.dropped.points += 1;
            return Ok(());
        }
        self.piece.push(Point3::from(position));
        if self.piece.len() == PIECE {
            self.failed = (self.each)(&self.piece).err();
            self.piece.clear();
        }
        if self.failed.is_some() { Err(String::new()) } else { Ok(()) }
    }

    fn end(self) -> Result<Dropped, E> {
        if !self.piece.is_empty() {
            (self.each)(&self.piece)?;
        }
        Ok(self.dropped)
    }
}

/// Where x, y, z lie in a binary record of fixed size.
struct Layout {
    size: usize,
    places: [(usize, bool); 3],
    big: bool,
}

/// `None` for ascii, for records with lists and for whole coordinates, which the general reader takes.
fn layout(element: &ElementDef, encoding: Encoding) -> Option<Layout> {
    let big = match encoding {
        Encoding::Ascii => return None,
        Encoding::BinaryLittleEndian => false,
        Encoding::BinaryBigEndian => true,
    };
    let (mut size, mut places) = (0, [None; 3]);
    for (name, property) in &element.properties {
        let PropertyType::Scalar(kind) = &property.data_type else { return None };
        if let Some(axis) = ["x", "y", "z"].iter().position(|n| n == name) {
            places[axis] = match kind {
                ScalarType::Float => Some((size, false)),
                ScalarType::Double => Some((size, true)),
                _ => return None,
            };
        }
        size += match kind {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        };
    }
    Some(Layout { size, places: [places[0]?, places[1]?, places[2]?], big })
}

/// Records per read.
const BLOCK: usize = 1 << 14;

fn fixed<R: BufRead, E, F: FnMut(&[Point3<f64>]) -> Result<(), E>>(
    file: &mut PlyReader<R>,
    element: &ElementDef,
    layout: &Layout,
    pieces: &mut Pieces<'_, F, E>,
) -> Result<(), FormatError> {
    let mut bytes = Vec::new();
    let mut done = 0;
    while done < element.count {
        let wanted = BLOCK.min(element.count - done);
        bytes.clear();
        file.reader.get_mut().by_ref().take((wanted * layout.size) as u64).read_to_end(&mut bytes)?;
        for record in bytes.chunks_exact(layout.size) {
            pieces.push(layout.places.map(|place| coordinate(record, place, layout.big))).map_err(|what| file.error(what))?;
        }
        done += bytes.len() / layout.size;
        if bytes.len() < wanted * layout.size {
            return Err(file.error(format!("vertex {done} of {}: the file ends here", element.count)));
        }
    }
    Ok(())
}

fn coordinate(record: &[u8], (at, double): (usize, bool), big: bool) -> f64 {
    fn bytes<const N: usize>(record: &[u8], at: usize, big: bool) -> [u8; N] {
        let mut out = [0; N];
        out.copy_from_slice(&record[at..at + N]);
        if big {
            out.reverse();
        }
        out
    }
    if double { f64::from_le_bytes(bytes(record, at, big)) } else { f64::from(f32::from_le_bytes(bytes(record, at, big))) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::read_ply_cloud;
    use proptest::prelude::*;

    fn positions(bytes: &[u8]) -> Result<(Vec<Point3<f64>>, Dropped), FormatError> {
        let mut all = Vec::new();
        let dropped = read_ply_positions(bytes, |piece| {
            all.extend_from_slice(piece);
            Ok::<_, FormatError>(())
        })?;
        Ok((all, dropped))
    }

    fn file(encoding: &str, count: usize, body: &[u8]) -> Vec<u8> {
        let head = format!(
            "ply\nformat {encoding} 1.0\nelement vertex {count}\nproperty uchar red\nproperty float z\nproperty double x\nproperty float y\nend_header\n"
        );
        [head.as_bytes(), body].concat()
    }

    proptest! {
        #[test]
        fn any_bytes_read_as_the_general_reader_reads_them(body in prop::collection::vec(any::<u8>(), 0..200), count in 0..12usize, kind in 0..3usize) {
            let bytes = file(["binary_little_endian", "binary_big_endian", "ascii"][kind], count, &body);
            match (positions(&bytes), read_ply_cloud(bytes.as_slice())) {
                (Ok((points, dropped)), Ok((cloud, expected))) => {
                    prop_assert_eq!(points, cloud.positions);
                    prop_assert_eq!(dropped, expected);
                }
                (Err(_), Err(_)) => {}
                (a, b) => prop_assert!(false, "{a:?} against {b:?}"),
            }
        }

        #[test]
        fn damaged_files_of_every_format_are_refused_or_read_but_never_panic(kind in 0..5usize, cut in 0..400usize, changes in prop::collection::vec((0..400usize, any::<u8>()), 0..6)) {
            let mut bytes = match kind {
                0 => file("binary_little_endian", 4, &[7; 68]),
                1 => b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n".to_vec(),
                2 => b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n".to_vec(),
                3 => [[b' '; 80].as_slice(), &1u32.to_le_bytes(), &[63; 50]].concat(),
                _ => b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(),
            };
            for (at, value) in changes {
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            bytes.truncate(cut);
            let _ = positions(&bytes);
            let _ = crate::format::read_ply_mesh(bytes.as_slice());
            let _ = crate::format::read_obj_mesh(bytes.as_slice());
            let _ = crate::format::read_xyz(bytes.as_slice(), |_| Ok::<_, FormatError>(()));
            for mesh in [crate::format::read_off_mesh(bytes.as_slice()), crate::format::read_stl_mesh(&bytes)].into_iter().flatten() {
                prop_assert!(mesh.0.faces.iter().flatten().all(|&v| (v as usize) < mesh.0.vertices.len()));
            }
        }
    }

    #[test]
    fn a_count_beyond_the_file_takes_no_memory_and_an_error_of_the_caller_comes_back() {
        let bytes = file("binary_little_endian", 4_000_000_000_000_000_000, &[0; 34]);
        assert!(matches!(positions(&bytes), Err(FormatError::Bytes { what, .. }) if what.contains("vertex 2 of")));
        let stop = read_ply_positions(file("ascii", 1, b"1 2 3 4\n").as_slice(), |_| {
            Err(FormatError::Line { file: "stop", line: 7, what: String::new() })
        });
        assert!(matches!(stop, Err(FormatError::Line { file: "stop", .. })));
    }
}
