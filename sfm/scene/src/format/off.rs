//! Object File Format: vertices and faces as text.

use super::FormatError;
use super::obj::fan;
use super::ply::{Dropped, drop_not_finite};
use crate::Mesh;
use nalgebra::Point3;
use std::io::BufRead;

/// Reads an OFF mesh (Geomview's ascii form; `OFF`, `COFF`, `NOFF`, `CNOFF`: colours and normals are skipped). Polygons
/// become fans of triangles; vertices that are not finite are dropped with their faces.
///
/// # Errors
/// [`FormatError::Line`] where the file is something else, ends early, or a face names a vertex that does not exist;
/// [`FormatError::Stream`] where reading fails.
pub fn read_off_mesh(mut input: impl BufRead) -> Result<(Mesh, Dropped), FormatError> {
    let mut lines = Lines { input: &mut input, text: String::new(), line: 0 };
    let mut head = lines.next()?;
    let word = head.first().cloned().unwrap_or_default();
    if !["OFF", "COFF", "NOFF", "CNOFF"].contains(&word.as_str()) {
        return Err(lines.error(format!("an OFF file starts with OFF, this one with {word:?}")));
    }
    head.remove(0);
    let counts = if head.is_empty() { lines.next()? } else { head };
    let count = |i: usize| counts.get(i).and_then(|w| w.parse::<usize>().ok());
    let (Some(vertices), Some(faces)) = (count(0), count(1)) else {
        return Err(lines.error("expected the numbers of vertices and faces".into()));
    };
    let (mut mesh, mut dropped, mut corners) = (Mesh::default(), Dropped::default(), Vec::new());
    for _ in 0..vertices {
        let words = lines.next()?;
        let numbers: Vec<f64> = words.iter().take(3).filter_map(|w| w.parse().ok()).collect();
        let &[x, y, z] = numbers.as_slice() else { return Err(lines.error("a vertex has three coordinates".into())) };
        mesh.vertices.push(Point3::new(x, y, z));
    }
    for _ in 0..faces {
        let words = lines.next()?;
        let size = words.first().and_then(|w| w.parse::<usize>().ok());
        corners.clear();
        corners.extend(words.iter().skip(1).take(size.unwrap_or(0)).map_while(|w| w.parse::<i64>().ok()));
        if size != Some(corners.len()) {
            return Err(lines.error("a face is its number of corners, then their indices".into()));
        }
        if let Some(corner) = corners.iter().find(|&&c| c < 0 || c as usize >= mesh.vertices.len()) {
            return Err(lines.error(format!("a face names vertex {corner} of {}", mesh.vertices.len())));
        }
        if !fan(&corners, &mut mesh.faces) {
            dropped.faces += 1;
        }
    }
    drop_not_finite(&mut mesh, &mut dropped);
    Ok((mesh, dropped))
}

struct Lines<'a, R> {
    input: &'a mut R,
    text: String,
    line: u64,
}

impl<R: BufRead> Lines<'_, R> {
    /// The words of the next line that has any.
    fn next(&mut self) -> Result<Vec<String>, FormatError> {
        loop {
            self.text.clear();
            self.line += 1;
            if self.input.read_line(&mut self.text).map_err(|e| self.error(e.to_string()))? == 0 {
                return Err(self.error("the file ends here".into()));
            }
            let words: Vec<String> = self.text.split('#').next().unwrap_or_default().split_ascii_whitespace().map(str::to_owned).collect();
            if !words.is_empty() {
                return Ok(words);
            }
        }
    }

    fn error(&self, what: String) -> FormatError {
        FormatError::Line { file: "OFF", line: self.line, what }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_and_comments_are_read() {
        let text = "OFF # a square\n4 2 0\n0 0 0\n1 0 0 255 0 0\n\n1 1 0\n0 1 nan\n4 0 1 2 3 0.5 0.5 0.5\n3 0 1 2\n";
        let (mesh, dropped) = read_off_mesh(text.as_bytes()).expect("valid");
        assert_eq!((mesh.vertices.len(), mesh.faces.as_slice()), (3, [[0, 1, 2], [0, 1, 2]].as_slice()));
        assert_eq!(dropped, Dropped { points: 1, faces: 1 });
    }

    #[test]
    fn wrong_counts_and_indices_are_errors() {
        for bad in [
            "",
            "ply\n",
            "OFF\n1\n",
            "OFF\n99999999999 1 0\n0 0 0\n",
            "OFF 1 1 0\n0 0 0\n3 0 1 2\n",
            "OFF 1 1 0\n0 0 0\n3 0 0\n",
            "OFF 1 0 0\n0 0\n",
        ] {
            assert!(matches!(read_off_mesh(bad.as_bytes()), Err(FormatError::Line { .. })), "{bad:?}");
        }
    }
}
