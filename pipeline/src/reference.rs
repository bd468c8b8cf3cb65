//! Files of known truth: meshes, clouds, positions.

use anyhow::{Context, Result, bail};
use eval::{EachPiece, EvalError, Points, Reference};
use nalgebra::{Point3, Vector3};
use scene::format::{FormatError, read_obj_mesh, read_off_mesh, read_ply_mesh, read_ply_positions, read_stl_mesh, read_xyz};
use scene::{Cloud, Mesh};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// A mesh (PLY with faces, OBJ, OFF, STL), or a cloud (PLY without, lines of x y z).
///
/// # Errors
/// When the file cannot be read or is neither.
pub fn read_reference(path: &Path) -> Result<Reference> {
    let name = || path.display().to_string();
    let kind = Kind::of(path);
    if kind == Kind::Xyz {
        let mut cloud = Cloud::default();
        read_xyz(reader(path)?, |piece| {
            cloud.positions.extend_from_slice(piece);
            Ok::<_, FormatError>(())
        })
        .with_context(name)?;
        return Ok(Reference::Cloud(cloud));
    }
    let mesh = read_mesh(path, kind)?;
    if !mesh.faces.is_empty() {
        return Ok(Reference::Mesh(mesh));
    }
    if kind != Kind::Ply {
        bail!("{}: has no faces", path.display());
    }
    Ok(Reference::Cloud(Cloud { positions: mesh.vertices, ..Cloud::default() }))
}

/// What a file is, by its ending; what has none that is known is PLY.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Ply,
    Xyz,
    Obj,
    Off,
    Stl,
}

impl Kind {
    fn of(path: &Path) -> Self {
        match path.extension().map(|e| e.to_string_lossy().to_lowercase()).as_deref() {
            Some("xyz" | "txt" | "asc" | "csv" | "pts") => Self::Xyz,
            Some("obj") => Self::Obj,
            Some("off") => Self::Off,
            Some("stl") => Self::Stl,
            _ => Self::Ply,
        }
    }
}

fn reader(path: &Path) -> Result<BufReader<File>> {
    Ok(BufReader::with_capacity(1 << 18, File::open(path).with_context(|| path.display().to_string())?))
}

fn read_mesh(path: &Path, kind: Kind) -> Result<Mesh> {
    let name = || path.display().to_string();
    let read = match kind {
        Kind::Obj => read_obj_mesh(reader(path)?),
        Kind::Off => read_off_mesh(reader(path)?),
        Kind::Stl => read_stl_mesh(&std::fs::read(path).with_context(name)?),
        Kind::Ply | Kind::Xyz => read_ply_mesh(reader(path)?),
    };
    Ok(read.with_context(name)?.0)
}

/// A cloud in a file, read anew each time it is gone through: PLY and text piece by piece, of meshes the vertices at once.
pub struct CloudFile<'a> {
    path: &'a Path,
    kind: Kind,
}

impl<'a> CloudFile<'a> {
    /// The cloud in a file, whose ending tells what it is.
    pub fn new(path: &'a Path) -> Self {
        Self { path, kind: Kind::of(path) }
    }

    /// Goes through the cloud and tells how many points had no finite position and were left out.
    ///
    /// # Errors
    /// What `each` returns, and [`EvalError::Input`] where the file cannot be read.
    pub fn read(&self, each: &mut EachPiece<'_>) -> Result<usize, EvalError> {
        let failed = |e: anyhow::Error| EvalError::Input(format!("{e:#}"));
        let unread = |e: Failure| match e {
            Failure::Eval(e) => e,
            Failure::Format(e) => EvalError::Input(format!("{}: {e}", self.path.display())),
        };
        let each = |piece: &[Point3<f64>]| each(piece).map_err(Failure::Eval);
        let dropped = match self.kind {
            Kind::Ply => read_ply_positions(reader(self.path).map_err(failed)?, each).map_err(unread)?,
            Kind::Xyz => read_xyz(reader(self.path).map_err(failed)?, each).map_err(unread)?,
            Kind::Obj | Kind::Off | Kind::Stl => {
                let mesh = read_mesh(self.path, self.kind).map_err(failed)?;
                let mut each = each;
                mesh.vertices.chunks(1 << 20).try_for_each(&mut each).map_err(unread)?;
                return Ok(0);
            }
        };
        Ok(dropped.points)
    }
}

impl Points for CloudFile<'_> {
    fn visit(&self, each: &mut EachPiece<'_>) -> Result<(), EvalError> {
        self.read(each).map(|_| ())
    }
}

enum Failure {
    Eval(EvalError),
    Format(FormatError),
}

impl From<FormatError> for Failure {
    fn from(error: FormatError) -> Self {
        Self::Format(error)
    }
}

/// Lines of `N` numbers, separated by blanks or commas; `#` starts a comment.
///
/// # Errors
/// When the file cannot be read, or a line is something else, with its number.
pub fn read_numbers<const N: usize>(path: &Path) -> Result<Vec<[f64; N]>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let words = line.split(|c: char| c.is_whitespace() || c == ',').filter(|w| !w.is_empty());
        let numbers: Vec<Option<f64>> = words.map(|w| w.parse().ok().filter(|n: &f64| n.is_finite())).collect();
        if numbers.is_empty() {
            continue;
        }
        let row: Option<Vec<f64>> = numbers.into_iter().collect();
        match row.and_then(|r| <[f64; N]>::try_from(r).ok()) {
            Some(row) => rows.push(row),
            None => bail!("{}:{}: expected {N} numbers, found `{}`", path.display(), i + 1, line.trim()),
        }
    }
    Ok(rows)
}

/// Known positions of projection centres: lines of `image x y z`, separated by blanks or commas; `#` starts a comment.
///
/// # Errors
/// When the file cannot be read, or a line is something else, with its number.
pub fn read_positions(path: &Path) -> Result<BTreeMap<String, Vector3<f64>>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let mut positions = BTreeMap::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let fields: Vec<&str> = line.split(|c: char| c.is_whitespace() || c == ',').filter(|f| !f.is_empty()).collect();
        let numbers: Vec<f64> = fields.iter().skip(1).filter_map(|f| f.parse().ok()).filter(|n: &f64| n.is_finite()).collect();
        match (fields.as_slice(), numbers.as_slice()) {
            ([], _) => {}
            ([name, _, _, _], &[x, y, z]) => {
                positions.insert((*name).to_owned(), Vector3::new(x, y, z));
            }
            _ => bail!("{}:{}: expected `image x y z`, found `{}`", path.display(), i + 1, line.trim()),
        }
    }
    Ok(positions)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_read_and_mistakes_named_by_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("positions.txt");
        std::fs::write(&path, "# image x y z\nC1/1.jpg 1 2 3\n\nC1/2.jpg, 4.5,-5,6e1 # end\n").unwrap();
        let positions = read_positions(&path).unwrap();
        assert_eq!(positions["C1/2.jpg"], Vector3::new(4.5, -5.0, 60.0));
        assert_eq!(positions.len(), 2);
        for bad in ["C1/1.jpg 1 2", "C1/1.jpg 1 2 nan", "C1/1.jpg 1 2 3 4"] {
            std::fs::write(&path, format!("# first\n{bad}\n")).unwrap();
            assert!(read_positions(&path).unwrap_err().to_string().contains("positions.txt:2: "), "{bad}");
        }
    }
}
