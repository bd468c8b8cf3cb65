//! Wavefront OBJ: geometry, and colours of the vertices.

use super::FormatError;
use super::ply::{Dropped, drop_not_finite};
use crate::Mesh;
use nalgebra::Point3;
use std::io::{BufRead, Write};

/// Reads the vertices (`v x y z`, with `r g b` from 0 to 1 where every vertex has them) and faces (`f`, corners as `v`,
/// `v/vt`, `v//vn` or `v/vt/vn`, counted from 1 or, negative, from the last vertex back) of an OBJ file; all other lines
/// are skipped. Polygons become fans of triangles; vertices that are not finite are dropped with their faces.
///
/// # Errors
/// [`FormatError::Line`] where a coordinate is not a number or a face names a vertex that does not exist;
/// [`FormatError::Stream`] where reading fails.
pub fn read_obj_mesh(mut input: impl BufRead) -> Result<(Mesh, Dropped), FormatError> {
    let (mut mesh, mut dropped) = (Mesh::default(), Dropped::default());
    let (mut text, mut corners) = (String::new(), Vec::new());
    let mut line = 0;
    loop {
        text.clear();
        line += 1;
        if input.read_line(&mut text)? == 0 {
            break;
        }
        let error = |what: String| FormatError::Line { file: "OBJ", line, what };
        let mut words = text.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut values = [0.0; 7];
                let mut count = 0;
                for word in words.take(7) {
                    values[count] = word.parse().map_err(|_| error(format!("{word:?} is not a number")))?;
                    count += 1;
                }
                if count < 3 {
                    return Err(error(format!("a vertex has three coordinates, this one {count}")));
                }
                mesh.vertices.push(Point3::new(values[0], values[1], values[2]));
                if count == 6 {
                    mesh.colours.push([3, 4, 5].map(|i| (values[i] * 255.0).round() as u8));
                }
            }
            Some("f") => {
                corners.clear();
                for word in words {
                    corners.push(corner(word, mesh.vertices.len()).map_err(error)?);
                }
                if !fan(&corners, &mut mesh.faces) {
                    dropped.faces += 1;
                }
            }
            _ => {}
        }
    }
    if mesh.colours.len() != mesh.vertices.len() {
        mesh.colours.clear();
    }
    let count = mesh.vertices.len();
    if mesh.faces.iter().flatten().any(|&v| v as usize >= count) {
        return Err(FormatError::Line { file: "OBJ", line, what: format!("a face names a vertex beyond the last, {count}") });
    }
    drop_not_finite(&mut mesh, &mut dropped);
    Ok((mesh, dropped))
}

/// Writes a mesh as OBJ: `v x y z`, with `r g b` from 0 to 1 where it has colours, and `f` counted from 1. Numbers have as many digits as
/// bring back the same value.
///
/// # Errors
/// [`FormatError::NotRepresentable`] where there is not one colour a vertex; [`FormatError::Stream`] where writing fails.
pub fn write_obj_mesh(mesh: &Mesh, mut out: impl Write) -> Result<(), FormatError> {
    if !mesh.colours.is_empty() && mesh.colours.len() != mesh.vertices.len() {
        let what = format!("{} colours for {} vertices", mesh.colours.len(), mesh.vertices.len());
        return Err(FormatError::NotRepresentable { format: "OBJ", what });
    }
    for (i, v) in mesh.vertices.iter().enumerate() {
        write!(out, "v {} {} {}", v.x, v.y, v.z)?;
        if let Some(colour) = mesh.colours.get(i) {
            let [r, g, b] = colour.map(|c| f64::from(c) / 255.0);
            write!(out, " {r:.4} {g:.4} {b:.4}")?;
        }
        writeln!(out)?;
    }
    for [a, b, c] in &mesh.faces {
        writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1)?;
    }
    Ok(out.flush()?)
}

/// Index from 0 of a face's corner. Vertices may follow the faces that use them.
fn corner(word: &str, vertices: usize) -> Result<i64, String> {
    let number = word.split('/').next().unwrap_or_default();
    let index: i64 = number.parse().map_err(|_| format!("{word:?} is not a corner of a face"))?;
    let from_zero = if index < 0 { vertices as i64 + index } else { index - 1 };
    if index == 0 || from_zero < 0 || from_zero >= i64::from(u32::MAX) {
        return Err(format!("corner {word:?} names no vertex"));
    }
    Ok(from_zero)
}

/// Appends a convex polygon as triangles around its first corner; false, and nothing, for fewer than three corners.
pub(super) fn fan(corners: &[i64], faces: &mut Vec<[u32; 3]>) -> bool {
    let &[first, ref rest @ ..] = corners else { return false };
    for pair in rest.windows(2) {
        faces.push([first as u32, pair[0] as u32, pair[1] as u32]);
    }
    rest.len() >= 2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_fanned_and_all_corner_forms_are_read() {
        let text =
            "# a square and a triangle\no thing\nv 0 0 0\nv 1 0 0\r\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nf 1 2/7 3//1 4/1/1\nf -4 -3 -1\nf 1 2\n";
        let (mesh, dropped) = read_obj_mesh(text.as_bytes()).expect("valid");
        assert_eq!(mesh.faces, [[0, 1, 2], [0, 2, 3], [0, 1, 3]]);
        assert_eq!(mesh.vertices[2], Point3::new(1.0, 1.0, 0.0));
        assert_eq!(dropped, Dropped { points: 0, faces: 1 });
    }

    #[test]
    fn what_is_written_is_read_back() {
        let vertices = vec![Point3::new(1e6 / 3.0, -0.1, 1e-9), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.0)];
        let mesh = Mesh { vertices, faces: vec![[0, 1, 2]], colours: vec![[0, 127, 255], [3, 2, 1], [254, 253, 252]] };
        let mut bytes = Vec::new();
        write_obj_mesh(&mesh, &mut bytes).expect("written");
        assert_eq!(read_obj_mesh(bytes.as_slice()).expect("valid").0, mesh);
    }

    #[test]
    fn errors_name_the_line() {
        for (text, line) in
            [("v 0 0 0\nv 1 x 0\n", 2), ("v 0 0\n", 1), ("v 0 0 0\n\nf 0 1 1\n", 3), ("f a b c\n", 1), ("v 0 0 0\nf -2 1 1\n", 2)]
        {
            match read_obj_mesh(text.as_bytes()) {
                Err(FormatError::Line { line: found, .. }) => assert_eq!(found, line, "{text:?}"),
                other => panic!("{text:?}: {other:?}"),
            }
        }
        assert!(read_obj_mesh("v 0 0 0\nf 1 2 3\n".as_bytes()).is_err(), "vertices 2 and 3 do not exist");
    }

    #[test]
    fn vertices_that_are_not_finite_go_with_their_faces() {
        let text = "v NaN 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 4\n";
        let (mesh, dropped) = read_obj_mesh(text.as_bytes()).expect("valid");
        assert_eq!((mesh.vertices.len(), mesh.faces.as_slice()), (3, [[0, 1, 2]].as_slice()));
        assert_eq!(dropped, Dropped { points: 1, faces: 1 });
    }
}
