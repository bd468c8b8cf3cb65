//! Which files a camera's `images` names.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

/// Extensions, in lower case, of the images that a folder is searched for.
pub const IMAGE_EXTENSIONS: &[&str] = &["jpg", "jpeg", "png", "tif", "tiff", "webp"];

/// Why no files were found.
#[derive(Debug)]
pub(super) enum NoFiles {
    /// The pattern is not one.
    Pattern(String),
    /// The folder or a folder in the pattern cannot be read.
    Unreadable(String),
    /// Nothing matches.
    Nothing,
}

/// The files that a folder (all images in it) or else a pattern (everything it matches) names, in natural order.
pub(super) fn image_files(base: &Path, images: &str, pattern: &str) -> Result<Vec<PathBuf>, NoFiles> {
    let path = base.join(images);
    let mut files = if path.is_dir() { images_in(&path)? } else { matching(base, pattern)? };
    files.sort_by(|a, b| natural_order(a, b));
    if files.is_empty() { Err(NoFiles::Nothing) } else { Ok(files) }
}

/// The images in a folder, in natural order; empty where it cannot be read.
pub(crate) fn images_of_folder(folder: &Path) -> Vec<PathBuf> {
    let mut files = images_in(folder).unwrap_or_default();
    files.sort_by(|a, b| natural_order(a, b));
    files
}

fn images_in(folder: &Path) -> Result<Vec<PathBuf>, NoFiles> {
    let unreadable = |e: std::io::Error| NoFiles::Unreadable(format!("{}: {e}", folder.display()));
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = entry.map_err(unreadable)?.path();
        if is_image(&path) && path.is_file() {
            files.push(path);
        }
    }
    Ok(files)
}

fn matching(base: &Path, pattern: &str) -> Result<Vec<PathBuf>, NoFiles> {
    let pattern = if Path::new(pattern).is_absolute() {
        pattern.to_owned()
    } else {
        let base = base.to_str().ok_or_else(|| NoFiles::Pattern("the folder's name is not valid Unicode".to_owned()))?;
        if base.is_empty() { pattern.to_owned() } else { format!("{}/{pattern}", glob::Pattern::escape(base)) }
    };
    let mut files = Vec::new();
    for path in glob::glob(&pattern).map_err(|e| NoFiles::Pattern(e.msg.to_owned()))? {
        let path = path.map_err(|e| NoFiles::Unreadable(e.to_string()))?;
        if path.is_file() {
            files.push(path);
        }
    }
    Ok(files)
}

/// Whether the extension is one of an image.
pub(crate) fn is_image(path: &Path) -> bool {
    path.extension().and_then(|e| e.to_str()).is_some_and(|e| IMAGE_EXTENSIONS.contains(&e.to_lowercase().as_str()))
}

fn natural_order(a: &Path, b: &Path) -> Ordering {
    let name = |p: &Path| p.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    natural_key(&name(a)).cmp(&natural_key(&name(b))).then_with(|| a.cmp(b))
}

/// A part of a name: numbers sort by value and before text.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum NamePart {
    /// Digits without leading zeros, after their count: sorts as the number does, of any length.
    Number(usize, String),
    /// All else.
    Text(String),
}

/// Sort key that puts `img2` before `img10`.
pub(crate) fn natural_key(name: &str) -> Vec<NamePart> {
    let mut parts = Vec::new();
    let mut rest = name;
    while let Some(first) = rest.chars().next() {
        let digits = first.is_ascii_digit();
        let end = rest.find(|c: char| c.is_ascii_digit() != digits).unwrap_or(rest.len());
        let (part, after) = rest.split_at(end);
        parts.push(if digits {
            let number = part.trim_start_matches('0').to_owned();
            NamePart::Number(number.len(), number)
        } else {
            NamePart::Text(part.to_owned())
        });
        rest = after;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_sort_by_value() {
        let mut names = ["img10.png", "img2.png", "img002b.png", "a1", "img2.jpg"];
        names.sort_by_key(|n| natural_key(n));
        assert_eq!(names, ["a1", "img2.jpg", "img2.png", "img002b.png", "img10.png"]);
    }

    #[test]
    fn folders_give_images_only_and_patterns_give_all() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b2.JPG", "b10.jpg", "K.txt"] {
            std::fs::write(folder.path().join(name), "x").unwrap();
        }
        let names =
            |found: Vec<PathBuf>| -> Vec<String> { found.iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect() };
        assert_eq!(names(image_files(folder.path(), ".", ".").unwrap()), ["b2.JPG", "b10.jpg"]);
        assert_eq!(names(image_files(folder.path(), "*", "*").unwrap()).len(), 3);
        assert!(matches!(image_files(folder.path(), "*.png", "*.png"), Err(NoFiles::Nothing)));
        assert!(matches!(image_files(folder.path(), "[.png", "[.png"), Err(NoFiles::Pattern(_))));
    }
}
