//! Folders of labelled images.

use anyhow::{Context, Result, bail};
use masking::train::{Polygon, coco_polygons, labelme_polygons, rasterise};
use scene::{Mask, Raster};
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Labels of what is no structure, where it is not said which are.
pub const NO_STRUCTURE: [&str; 10] = ["background", "water", "fish", "diver", "human", "robot", "rov", "tether", "moving", "ignore"];

/// An image, and where its label is.
#[derive(Clone, Debug)]
pub struct Labelled {
    /// The image.
    pub image: PathBuf,
    label: Label,
}

#[derive(Clone, Debug)]
enum Label {
    /// All of it is structure, or none.
    Whole(bool),
    /// A grey image: above 127 is structure.
    MaskFile(PathBuf),
    /// Polygons by name.
    Polygons(Vec<Polygon>),
}

/// The images of folders with their labels, by path, and the images that have none. What lies in folders `masks` and `truth` is no image.
///
/// An image is labelled by, in this order: a mask of its name with the ending `png`, in a folder `masks` (or `truth/masks`) that stands where the image has `images` or `frames`;
/// a JSON file of labelme of its name beside it; a JSON file of COCO anywhere in the folder that names it; a folder `water` or `structure` that it lies in, which shows nothing else.
///
/// # Errors
/// Where a folder or label file cannot be read.
pub fn find(folders: &[PathBuf]) -> Result<(Vec<Labelled>, Vec<PathBuf>)> {
    let (mut found, mut without) = (Vec::new(), Vec::new());
    for folder in folders {
        let mut files = Vec::new();
        walk(folder, 0, &mut files)?;
        let coco = coco_labels(&files)?;
        for image in files.iter().filter(|f| is_image(f) && !["masks", "truth"].iter().any(|n| has_folder(f, folder, n))) {
            match label_of(image, folder, &coco)? {
                Some(label) => found.push(Labelled { image: image.clone(), label }),
                None => without.push(image.clone()),
            }
        }
    }
    Ok((found, without))
}

/// Deeper folders are not looked into: links may go round.
const MAX_DEPTH: usize = 16;

pub(crate) fn walk(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let mut paths = entries.map(|e| Ok(e?.path())).collect::<std::io::Result<Vec<_>>>().with_context(|| folder.display().to_string())?;
    paths.sort();
    for path in paths {
        if is_hidden(&path) {
            continue;
        }
        if path.is_dir() {
            // The output of a run holds no labels.
            if depth < MAX_DEPTH && !path.join("run.toml").is_file() {
                walk(&path, depth + 1, files)?;
            }
        } else {
            files.push(path);
        }
    }
    Ok(())
}

fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'))
}

pub(crate) fn ending(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

pub(crate) fn is_image(path: &Path) -> bool {
    ["jpg", "jpeg", "png", "tif", "tiff", "bmp"].contains(&ending(path).as_str())
}

fn has_folder(path: &Path, below: &Path, name: &str) -> bool {
    path.strip_prefix(below).ok().and_then(Path::parent).is_some_and(|p| p.components().any(|c| c.as_os_str() == name))
}

/// Polygons of all files of COCO, by the names that these give to images.
fn coco_labels(files: &[PathBuf]) -> Result<BTreeMap<String, Vec<Polygon>>> {
    let mut all = BTreeMap::new();
    for file in files.iter().filter(|f| ending(f) == "json" && !beside_an_image(f, files)) {
        let bytes = std::fs::read(file).with_context(|| file.display().to_string())?;
        all.extend(coco_polygons(&bytes).with_context(|| file.display().to_string())?);
    }
    Ok(all)
}

fn beside_an_image(json: &Path, files: &[PathBuf]) -> bool {
    files.iter().any(|f| is_image(f) && f.with_extension("json") == json)
}

fn label_of(image: &Path, folder: &Path, coco: &BTreeMap<String, Vec<Polygon>>) -> Result<Option<Label>> {
    if let Some(mask) = mask_files(image, folder).into_iter().find(|m| m.is_file()) {
        return Ok(Some(Label::MaskFile(mask)));
    }
    let json = image.with_extension("json");
    if json.is_file() {
        let bytes = std::fs::read(&json).with_context(|| json.display().to_string())?;
        return Ok(Some(Label::Polygons(labelme_polygons(&bytes).with_context(|| json.display().to_string())?)));
    }
    if let Some((_, polygons)) = coco.iter().find(|(name, _)| image.ends_with(name)) {
        return Ok(Some(Label::Polygons(polygons.clone())));
    }
    let whole = [("water", false), ("structure", true)]
        .into_iter()
        .find(|(name, _)| has_folder(image, folder, name) || folder.file_name().is_some_and(|n| n == *name));
    Ok(whole.map(|(_, structure)| Label::Whole(structure)))
}

/// Where the mask of an image may lie.
fn mask_files(image: &Path, folder: &Path) -> Vec<PathBuf> {
    let Ok(inside) = image.strip_prefix(folder) else { return Vec::new() };
    let parts: Vec<Component<'_>> = inside.components().collect();
    let place = parts.iter().rposition(|c| ["images", "frames"].iter().any(|name| c.as_os_str() == *name));
    let Some(place) = place else { return Vec::new() };
    let with = |name: &str| {
        let before: PathBuf = parts[..place].iter().collect();
        let after: PathBuf = parts[place + 1..].iter().collect();
        folder.join(before).join(name).join(after).with_extension("png")
    };
    vec![with("masks"), with("truth/masks")]
}

impl Labelled {
    /// The image and its mask; `is_structure` tells labels of polygons.
    ///
    /// # Errors
    /// Where a file cannot be read, is damaged, or the sizes differ.
    pub fn load(&self, is_structure: &dyn Fn(&str) -> bool) -> Result<(Raster<[u8; 3]>, Mask)> {
        let read = |path: &Path| std::fs::read(path).with_context(|| format!("cannot read {}", path.display()));
        let rgb = imaging::decode_rgb(&read(&self.image)?).with_context(|| self.image.display().to_string())?;
        let (width, height) = (rgb.width(), rgb.height());
        let mask = match &self.label {
            Label::Whole(structure) => Raster::filled(width, height, if *structure { 255 } else { 0 }),
            Label::Polygons(polygons) => rasterise(polygons, width, height, is_structure),
            Label::MaskFile(path) => {
                let grey = imaging::decode_grey_u8(&read(path)?).with_context(|| path.display().to_string())?;
                masking::mask_from_file(&grey, (width, height)).with_context(|| path.display().to_string())?
            }
        };
        Ok((rgb, mask))
    }
}

/// Fails where nothing is labelled, and says how to label.
///
/// # Errors
/// See above.
pub fn require_some(found: &[Labelled], folders: &[PathBuf]) -> Result<()> {
    if found.is_empty() {
        let names: Vec<String> = folders.iter().map(|f| f.display().to_string()).collect();
        bail!(
            "no labelled image in {}: put masks of the images in images/ into masks/ (255 structure, 0 background), JSON files of labelme beside them, or \
             images of water alone into water/; docs/masks.md tells more",
            names.join(", ")
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(folder: &Path, name: &str, bytes: &[u8]) {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, bytes).expect("written");
    }

    fn png(width: usize, height: usize) -> Vec<u8> {
        imaging::encode_png_rgb(&Raster::filled(width, height, [9; 3])).expect("encoded")
    }

    fn grey(width: usize, height: usize, value: u8) -> Vec<u8> {
        imaging::encode_png_grey(&Raster::filled(width, height, value)).expect("encoded")
    }

    fn share(labelled: &Labelled) -> f64 {
        let (_, mask) = labelled.load(&|label| label == "reef").expect("loaded");
        masking::structure_share(&mask)
    }

    #[test]
    fn labels_are_found_in_all_their_forms() {
        let folder = tempfile::tempdir().expect("a folder");
        let at = folder.path();
        write(at, "a/images/C1/1.png", &png(8, 4));
        write(at, "a/masks/C1/1.png", &grey(8, 4, 200));
        write(at, "b/frames/2.png", &png(8, 4));
        write(at, "b/truth/masks/2.png", &grey(8, 4, 100));
        write(at, "c/3.png", &png(8, 4));
        write(at, "c/3.json", br#"{"shapes": [{"label": "reef", "points": [[0, 0], [4, 4]], "shape_type": "rectangle"}]}"#);
        write(at, "d/4.png", &png(8, 4));
        write(
            at,
            "d/annotations/instances.json",
            br#"{"images": [{"id": 1, "file_name": "4.png"}], "categories": [{"id": 1, "name": "reef"}],
                "annotations": [{"image_id": 1, "category_id": 1, "segmentation": [[0, 0, 8, 0, 8, 1, 0, 1]]}]}"#,
        );
        write(at, "structure/5.png", &png(8, 4));
        write(at, "water/6.png", &png(8, 4));
        write(at, "z/7.png", &png(8, 4));
        // The output of a run is passed over.
        write(at, "b/out/run.toml", b"");
        write(at, "b/out/.hashes.json", b"{}");
        write(at, "b/out/report.json", b"{}");
        write(at, "b/out/masks-compared/ip/2.png", &png(8, 4));
        let (found, without) = find(&[at.to_path_buf()]).expect("found");
        assert_eq!(found.iter().map(share).collect::<Vec<_>>(), [1.0, 0.0, 0.5, 0.25, 1.0, 0.0]);
        assert_eq!(without, [at.join("z/7.png")]);
    }

    #[test]
    fn a_mask_of_another_size_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), "images/1.png", &png(8, 4));
        write(folder.path(), "masks/1.png", &grey(4, 8, 0));
        let (found, _) = find(&[folder.path().to_path_buf()]).expect("found");
        let error = format!("{:#}", found[0].load(&|_| true).expect_err("sizes differ"));
        assert!(error.contains("masks/1.png") && error.contains("4 x 8"), "{error}");
    }

    #[test]
    fn a_broken_label_file_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        write(folder.path(), "1.png", &png(8, 4));
        write(folder.path(), "1.json", b"{");
        let error = format!("{:#}", find(&[folder.path().to_path_buf()]).expect_err("broken"));
        assert!(error.contains("1.json"), "{error}");
        let empty = tempfile::tempdir().expect("a folder");
        let folders = [empty.path().to_path_buf()];
        assert!(require_some(&find(&folders).expect("found").0, &folders).is_err());
    }
}
