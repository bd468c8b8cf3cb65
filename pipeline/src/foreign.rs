//! Models of other programs, by what they lie in.

use anyhow::{Context, Result};
use scene::Reconstruction;
use scene::format::{read_bundler, read_colmap_model, read_nerfstudio};
use std::ffi::OsStr;
use std::path::Path;

/// Name of the list of images beside a Bundler file.
const LIST: &str = "list.txt";

/// Reads a model: a folder with COLMAP's files (binary or text), nerfstudio's `transforms.json`, or Bundler's `bundle.out` with `list.txt` beside
/// it. `size_of` gives the width and height of an image by its name there, which Bundler's files lack.
///
/// # Errors
/// When a file cannot be read or is broken.
pub fn read_model(path: &Path, size_of: &dyn Fn(&str) -> Option<(u32, u32)>) -> Result<Reconstruction> {
    let named = || path.display().to_string();
    let is = |extension: &str| path.extension() == Some(OsStr::new(extension));
    if is("json") {
        let text = std::fs::read(path).with_context(named)?;
        return read_nerfstudio(&text).with_context(named);
    }
    if is("out") {
        let list = path.with_file_name(LIST);
        let bundle = std::fs::read_to_string(path).with_context(named)?;
        let names = std::fs::read_to_string(&list).with_context(|| format!("{}: the list of the images", list.display()))?;
        return read_bundler(&bundle, &names, size_of).with_context(named);
    }
    read_colmap_model(path).with_context(named)
}

/// Width and height of an image file, upright; `None` where it cannot be read.
#[must_use]
pub fn size_of_file(path: &Path) -> Option<(u32, u32)> {
    let info = imaging::probe(&std::fs::read(path).ok()?).ok()?;
    Some((info.width, info.height))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_is_known_by_what_it_lies_in() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("transforms.json"), "{\"frames\": []}").unwrap();
        assert!(read_model(&at("transforms.json"), &|_| None).unwrap().images.is_empty());
        std::fs::write(at("bundle.out"), "# Bundle file v0.3\n1 0\n400 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -5\n").unwrap();
        let missing = format!("{:#}", read_model(&at("bundle.out"), &|_| Some((30, 20))).unwrap_err());
        assert!(missing.contains("list.txt: the list of the images"), "{missing}");
        std::fs::write(at(LIST), "a.jpg\n").unwrap();
        let model = read_model(&at("bundle.out"), &|name| (name == "a.jpg").then_some((30, 20))).unwrap();
        assert_eq!((model.cameras[0].width(), model.images[0].name.as_str()), (30, "a.jpg"));
        let broken = format!("{:#}", read_model(&at("bundle.out"), &|_| None).unwrap_err());
        assert!(broken.contains("bundle.out") && broken.contains("the size of image a.jpg is not known"), "{broken}");
        assert!(read_model(folder.path(), &|_| None).is_err());
        assert_eq!(size_of_file(&at("a.jpg")), None);
    }
}
