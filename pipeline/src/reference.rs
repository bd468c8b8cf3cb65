//! Files of known truth: meshes, clouds, positions.

use anyhow::{Context, Result, bail};
use eval::Reference;
use nalgebra::Vector3;
use scene::format::{read_obj_mesh, read_ply_cloud, read_ply_mesh};
use std::collections::BTreeMap;
use std::path::Path;

/// A mesh (PLY with faces, OBJ), or a cloud (PLY without).
///
/// # Errors
/// When the file cannot be read or is neither.
pub fn read_reference(path: &Path) -> Result<Reference> {
    let name = || path.display().to_string();
    let bytes = std::fs::read(path).with_context(name)?;
    let is_obj = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let (mesh, _) = if is_obj { read_obj_mesh(bytes.as_slice()) } else { read_ply_mesh(bytes.as_slice()) }.with_context(name)?;
    if !mesh.faces.is_empty() {
        return Ok(Reference::Mesh(mesh));
    }
    if is_obj {
        bail!("{}: has no faces", path.display());
    }
    Ok(Reference::Cloud(read_ply_cloud(bytes.as_slice()).with_context(name)?.0))
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
