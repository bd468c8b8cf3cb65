//! Points as text, one a line.

use super::FormatError;
use super::ply::Dropped;
use nalgebra::Point3;
use std::io::{BufRead, Read};

/// Points handed over at once.
const PIECE: usize = 1 << 18;

/// Reads lines of `x y z`, separated by blanks, commas or semicolons; what follows on a line is skipped, and so are empty
/// lines, lines that start with `#` or `//`, and a first line that is not numbers. Points go to `each` in pieces; those that
/// are not finite are dropped and counted.
///
/// # Errors
/// [`FormatError::Line`] where a line is something else; [`FormatError::Stream`] where reading fails; what `each` returns.
pub fn read_xyz<E: From<FormatError>>(
    mut input: impl BufRead,
    mut each: impl FnMut(&[Point3<f64>]) -> Result<(), E>,
) -> Result<Dropped, E> {
    let (mut piece, mut text, mut dropped) = (Vec::new(), Vec::new(), Dropped::default());
    let mut line = 0;
    loop {
        text.clear();
        line += 1;
        if input.by_ref().take(MAX_LINE).read_until(b'\n', &mut text).map_err(FormatError::from)? == 0 {
            break;
        }
        let error = |what: String| FormatError::Line { file: "XYZ", line, what };
        let text = std::str::from_utf8(&text).map_err(|_| error("is not text".into()))?.trim();
        if text.is_empty() || text.starts_with('#') || text.starts_with("//") {
            continue;
        }
        let mut words = text.split(|c: char| c.is_whitespace() || c == ',' || c == ';').filter(|w| !w.is_empty());
        let mut number = || words.next().and_then(|w| w.parse::<f64>().ok());
        match (number(), number(), number()) {
            (Some(x), Some(y), Some(z)) if [x, y, z].iter().all(|v| v.is_finite()) => piece.push(Point3::new(x, y, z)),
            (Some(_), Some(_), Some(_)) => dropped.points += 1,
            _ if line == 1 => {}
            _ => return Err(error(format!("expected `x y z`, found `{}`", text.chars().take(60).collect::<String>())).into()),
        }
        if piece.len() == PIECE {
            each(&piece)?;
            piece.clear();
        }
    }
    if !piece.is_empty() {
        each(&piece)?;
    }
    Ok(dropped)
}

/// Longest line: a file without line ends must not fill the memory.
const MAX_LINE: u64 = 1 << 16;

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &[u8]) -> Result<(Vec<Point3<f64>>, Dropped), FormatError> {
        let mut all = Vec::new();
        let dropped = read_xyz(text, |piece| {
            all.extend_from_slice(piece);
            Ok::<_, FormatError>(())
        })?;
        Ok((all, dropped))
    }

    #[test]
    fn separators_comments_and_a_heading_are_taken() {
        let (points, dropped) = read(b"x,y,z,r\n# made by hand\n1 2 3\n\n4;5;6;255\r\n7, 8,9e1\nnan 0 0\n").expect("valid");
        assert_eq!(points, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 90.0]].map(Point3::from));
        assert_eq!(dropped.points, 1);
        assert!(matches!(read(b"1 2 3\n4 5\n"), Err(FormatError::Line { line: 2, .. })));
        assert!(matches!(read(&[0xff, 0xfe, 0x00]), Err(FormatError::Line { line: 1, .. })));
        assert_eq!(read(b"").expect("empty").0, []);
    }
}
