//! Stereolithography meshes: triangles with corners of their own.

use super::FormatError;
use super::ply::{Dropped, drop_not_finite};
use crate::Mesh;
use nalgebra::Point3;

/// Reads an STL mesh, binary or ascii. Corners with the same bits become one vertex; normals are skipped; triangles with a
/// corner that is not finite are dropped.
///
/// # Errors
/// [`FormatError::Bytes`] where a binary file does not hold the triangles it announces, [`FormatError::Line`] where an ascii
/// one is something else.
pub fn read_stl_mesh(bytes: &[u8]) -> Result<(Mesh, Dropped), FormatError> {
    // Binary files may start with "solid" as well: only their length tells.
    let announced = bytes.get(80..84).map(|b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    let is_binary = announced.is_some_and(|n| 84 + 50 * n == bytes.len() as u64);
    let corners = match announced {
        _ if !is_binary && bytes.trim_ascii_start().starts_with(b"solid") => ascii(bytes)?,
        Some(count) if 84 + 50 * count <= bytes.len() as u64 => bytes[84..]
            .chunks_exact(50)
            .take(count as usize)
            .flat_map(|record| [12, 24, 36].map(|at| corner(&record[at..at + 12])))
            .collect(),
        _ => {
            let what = format!("{} triangles are announced, the file ends before", announced.unwrap_or(0));
            return Err(FormatError::Bytes { file: "STL", offset: bytes.len() as u64, what });
        }
    };
    let (mut mesh, mut dropped) = (weld(&corners), Dropped::default());
    drop_not_finite(&mut mesh, &mut dropped);
    Ok((mesh, dropped))
}

fn corner(bytes: &[u8]) -> Point3<f64> {
    let one = |i: usize| f64::from(f32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]));
    Point3::new(one(0), one(4), one(8))
}

fn ascii(bytes: &[u8]) -> Result<Vec<Point3<f64>>, FormatError> {
    let mut corners = Vec::new();
    let mut line = 0;
    let error = |line: u64, what: &str| FormatError::Line { file: "STL", line, what: what.to_owned() };
    for text in bytes.split(|&b| b == b'\n') {
        line += 1;
        let text = std::str::from_utf8(text).map_err(|_| error(line, "is not text"))?;
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("vertex") => {
                let numbers: Vec<f64> = words.filter_map(|w| w.parse().ok()).collect();
                let &[x, y, z] = numbers.as_slice() else { return Err(error(line, "a vertex has three coordinates")) };
                corners.push(Point3::new(x, y, z));
            }
            Some("endloop") if corners.len() % 3 != 0 => return Err(error(line, "a loop has three vertices")),
            None | Some("solid" | "facet" | "outer" | "endloop" | "endfacet" | "endsolid") => {}
            Some(_) => return Err(error(line, "is not a line of an STL file")),
        }
    }
    if corners.len() % 3 == 0 { Ok(corners) } else { Err(error(line, "the last loop is not complete")) }
}

/// Triangles over corners, equal ones being one vertex, in the order of their first appearance.
fn weld(corners: &[Point3<f64>]) -> Mesh {
    let key = |i: u32| <[u64; 3]>::from(corners[i as usize].coords.map(|c| (c + 0.0).to_bits()));
    let mut order: Vec<u32> = (0..corners.len() as u32).collect();
    order.sort_unstable_by_key(|&i| (key(i), i));
    let mut first = vec![0; corners.len()];
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&i| first[i as usize] = same[0]);
    }
    let (mut mesh, mut number) = (Mesh::default(), vec![0; corners.len()]);
    for i in 0..corners.len() {
        if first[i] as usize == i {
            number[i] = mesh.vertices.len() as u32;
            mesh.vertices.push(corners[i]);
        }
        number[i] = number[first[i] as usize];
    }
    mesh.faces = number.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(triangles: &[[[f32; 3]; 3]], announced: u32) -> Vec<u8> {
        let mut out = b"solid but binary".to_vec();
        out.resize(80, 0);
        out.extend(announced.to_le_bytes());
        for triangle in triangles {
            out.extend([0; 12]);
            triangle.iter().flatten().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend([0; 2]);
        }
        out
    }

    const SQUARE: [[[f32; 3]; 3]; 2] =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];

    #[test]
    fn both_forms_give_the_same_welded_mesh() {
        let (mesh, dropped) = read_stl_mesh(&binary(&SQUARE, 2)).expect("valid");
        assert_eq!((mesh.vertices.len(), mesh.faces.as_slice(), dropped), (4, [[0, 1, 2], [0, 2, 3]].as_slice(), Dropped::default()));
        let mut text = "solid square\n".to_owned();
        for triangle in SQUARE {
            text += "facet normal 0 0 1\n outer loop\n";
            triangle.iter().for_each(|v| text += &format!("  vertex {} {} {}\n", v[0], v[1], v[2]));
            text += " endloop\nendfacet\n";
        }
        assert_eq!(read_stl_mesh((text + "endsolid\n").as_bytes()).expect("valid").0, mesh);
    }

    #[test]
    fn short_files_and_wrong_counts_are_errors() {
        assert!(read_stl_mesh(&binary(&SQUARE, 4_000_000_000)).is_err());
        assert!(
            read_stl_mesh(b"").is_err()
                && read_stl_mesh(b"solid x\nvertex 1 2\n").is_err()
                && read_stl_mesh(b"solid x\nvertex 1 2 3\n").is_err()
        );
        assert_eq!(read_stl_mesh(&binary(&[[[f32::NAN; 3]; 3], SQUARE[0]], 2)).expect("one is left").0.faces, [[0, 1, 2]]);
    }
}
