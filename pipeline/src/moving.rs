//! Labels of what moves in the images of a dive, to be cut out of their masks.

use crate::labels::{ending, is_image, walk};
use crate::stages::images::{ImageEntry, ImageList};
use crate::store::Fingerprint;
use anyhow::{Context, Result};
use masking::BitMask;
use masking::train::{Polygon, coco_polygons, labelme_polygons, rasterise};
use scene::Mask;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Labels of what moves, where it is not said which do.
pub const MOVING: [&str; 8] = ["fish", "diver", "human", "robot", "rov", "tether", "moving", "ignore"];

/// What moves, by the name of the image.
#[derive(Debug, Default)]
pub struct Moving {
    by_image: BTreeMap<String, Vec<Cut>>,
    /// Files that cannot be used or belong to no image, and why.
    pub unusable: Vec<(String, String)>,
}

#[derive(Debug)]
struct Cut {
    /// Of what it was read from.
    fingerprint: Fingerprint,
    shape: Shape,
}

#[derive(Debug)]
enum Shape {
    Polygons(Vec<Polygon>),
    /// Of the size of the image.
    Pixels(BitMask),
}

/// All files below a folder that may be labels, by their path below it.
///
/// # Errors
/// When the folder cannot be read.
pub fn files(folder: &Path) -> Result<Vec<(String, PathBuf)>> {
    let mut paths = Vec::new();
    walk(folder, 0, &mut paths)?;
    let inside = |p: PathBuf| (p.strip_prefix(folder).unwrap_or(&p).to_string_lossy().replace('\\', "/"), p);
    Ok(paths.into_iter().filter(|p| ending(p) == "json" || is_image(p)).map(inside).collect())
}

impl Moving {
    /// Reads the labels below a folder: `CAMERA/STEM.json` of labelme, `CAMERA/STEM.png` (white moves), COCO files of any name. In a dive of one
    /// camera the folder of the camera may be left out. `labels` are those of polygons that move; empty: [`MOVING`].
    ///
    /// # Errors
    /// When the folder cannot be read. What is wrong with a single file stands in [`Moving::unusable`].
    pub fn read(folder: &Path, labels: &[String], list: &ImageList) -> Result<Self> {
        let mut moving = Self::default();
        for (name, path) in files(folder)? {
            let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            if let Err(reason) = moving.add(&name, bytes, labels, list) {
                moving.unusable.push((path.display().to_string(), reason));
            }
        }
        Ok(moving)
    }

    fn add(&mut self, name: &str, bytes: Vec<u8>, labels: &[String], list: &ImageList) -> Result<(), String> {
        let image = image_of(Path::new(name), list);
        let nowhere = || format!("belongs to no image of the dive; such files are named CAMERA/STEM, as {}", example(list));
        if ending(Path::new(name)) != "json" {
            let image = image.ok_or_else(nowhere)?;
            let grey = imaging::decode_grey_u8(&bytes).map_err(|e| e.to_string())?;
            let pixels = masking::mask_from_file(&grey, (image.width as usize, image.height as usize)).map_err(|e| e.to_string())?;
            self.put(image, Fingerprint::of_bytes(&bytes), Shape::Pixels(BitMask::from_mask(&pixels)));
            return Ok(());
        }
        let moves = |polygon: &Polygon| match labels {
            [] => MOVING.contains(&polygon.label.to_lowercase().as_str()),
            some => some.contains(&polygon.label),
        };
        let only_moving = |polygons: Vec<Polygon>| Shape::Polygons(polygons.into_iter().filter(|p| moves(p)).collect());
        let fingerprint = Fingerprint::of_bytes(&bytes);
        let coco = coco_polygons(&bytes);
        match (coco, image) {
            (Ok(images), _) => {
                let mut missing = Vec::new();
                for (file, polygons) in images {
                    match image_of(Path::new(&file), list) {
                        Some(image) => self.put(image, fingerprint, only_moving(polygons)),
                        None => missing.push(file),
                    }
                }
                if missing.is_empty() { Ok(()) } else { Err(format!("it names {}, which {}", missing.join(", "), nowhere())) }
            }
            (Err(_), Some(image)) => {
                self.put(image, fingerprint, only_moving(labelme_polygons(&bytes).map_err(|e| e.to_string())?));
                Ok(())
            }
            (Err(coco), None) => Err(if labelme_polygons(&bytes).is_ok() { nowhere() } else { coco.to_string() }),
        }
    }

    fn put(&mut self, image: &ImageEntry, fingerprint: Fingerprint, shape: Shape) {
        let nothing = matches!(&shape, Shape::Polygons(polygons) if polygons.is_empty());
        if !nothing {
            self.by_image.entry(image.name.clone()).or_default().push(Cut { fingerprint, shape });
        }
    }

    /// Fingerprint of what is cut out of an image; `None` where nothing is.
    #[must_use]
    pub fn fingerprint(&self, image: &ImageEntry) -> Option<Fingerprint> {
        let cuts = self.by_image.get(&image.name)?;
        Some(Fingerprint::of_parts(cuts.iter().map(|cut| ("cut", cut.fingerprint.as_bytes().as_slice()))))
    }

    /// Makes background of what moves in an image.
    pub fn cut(&self, image: &ImageEntry, mask: &mut Mask) {
        let (width, height) = (mask.width(), mask.height());
        for cut in self.by_image.get(&image.name).into_iter().flatten() {
            let moves = match &cut.shape {
                Shape::Polygons(polygons) => rasterise(polygons, width, height, |_| true),
                Shape::Pixels(pixels) => pixels.to_mask(width, height, 1),
            };
            mask.data_mut().iter_mut().zip(moves.data()).filter(|(_, m)| **m > 127).for_each(|(value, _)| *value = 0);
        }
    }
}

/// The image that a path without regard to its ending means: `camera/stem`, or the stem alone where there is one camera.
fn image_of<'l>(path: &Path, list: &'l ImageList) -> Option<&'l ImageEntry> {
    let stem = path.with_extension("");
    let means = |image: &&ImageEntry| {
        let camera = Path::new(&list.cameras[image.camera].name);
        stem == camera.join(&image.stem) || (list.cameras.len() == 1 && stem == Path::new(&image.stem))
    };
    list.images.iter().find(means)
}

fn example(list: &ImageList) -> String {
    list.images.first().map_or_else(|| "C1/0001".to_owned(), |image| format!("{}/{}.json", list.cameras[image.camera].name, image.stem))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::images::CameraEntry;
    use scene::Raster;

    fn list(cameras: usize) -> ImageList {
        let image = |camera: usize, stem: &str| ImageEntry {
            name: format!("C{}/{stem}.jpg", camera + 1),
            camera,
            stem: stem.to_owned(),
            position: Some(0),
            exposure: 0,
            time_secs: None,
            width: 8,
            height: 4,
            content: Fingerprint::of_bytes(b""),
        };
        let camera = |c: usize| CameraEntry { name: format!("C{}", c + 1), size: Some((8, 4)), exif_focal_px: None };
        let images = (0..cameras).flat_map(|c| [image(c, "0001"), image(c, "a.b")]).collect();
        ImageList { cameras: (0..cameras).map(camera).collect(), images, found: 2 * cameras }
    }

    fn write(folder: &Path, name: &str, bytes: &[u8]) {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, bytes).expect("written");
    }

    fn kept(moving: &Moving, image: &ImageEntry) -> usize {
        let mut mask = Raster::filled(8, 4, 255u8);
        moving.cut(image, &mut mask);
        mask.data().iter().filter(|v| **v == 255).count()
    }

    #[test]
    fn what_moves_is_cut_out_whatever_the_form_of_its_label() {
        let folder = tempfile::tempdir().expect("a folder");
        let labelme = br#"{"shapes": [{"label": "Fish", "points": [[0, 0], [2, 4]], "shape_type": "rectangle"},
            {"label": "reef", "points": [[0, 0], [8, 4]], "shape_type": "rectangle"}]}"#;
        write(folder.path(), "C1/0001.json", labelme);
        let mut picture = Raster::filled(8, 4, 0u8);
        picture.row_mut(3).fill(255);
        write(folder.path(), "C1/a.b.png", &imaging::encode_png_grey(&picture).expect("encoded"));
        write(
            folder.path(),
            "export/instances.json",
            br#"{"images": [{"id": 1, "file_name": "C2/0001.jpg"}], "categories": [{"id": 1, "name": "tether"}],
                "annotations": [{"image_id": 1, "category_id": 1, "segmentation": [[0, 0, 8, 0, 8, 1, 0, 1]]}]}"#,
        );
        let list = list(2);
        let moving = Moving::read(folder.path(), &[], &list).expect("read");
        assert!(moving.unusable.is_empty(), "{:?}", moving.unusable);
        assert_eq!(list.images.iter().map(|i| kept(&moving, i)).collect::<Vec<_>>(), [24, 24, 24, 32]);
        assert_eq!(list.images.iter().map(|i| moving.fingerprint(i).is_some()).collect::<Vec<_>>(), [true, true, true, false]);
        let named = Moving::read(folder.path(), &["reef".to_owned()], &list).expect("read");
        assert_eq!(list.images.iter().map(|i| kept(&named, i)).collect::<Vec<_>>(), [0, 24, 32, 32]);
    }

    #[test]
    fn files_that_cut_nothing_are_told() {
        let folder = tempfile::tempdir().expect("a folder");
        let good = br#"{"shapes": [{"label": "fish", "points": [[0, 0], [2, 4]], "shape_type": "rectangle"}]}"#;
        write(folder.path(), "0001.json", good);
        write(folder.path(), "C1/9999.json", good);
        write(folder.path(), "C1/0001.json", b"{");
        write(folder.path(), "C2/0001.png", &imaging::encode_png_grey(&Raster::filled(4, 8, 255)).expect("encoded"));
        let two = list(2);
        let moving = Moving::read(folder.path(), &[], &two).expect("read");
        let told: Vec<&str> = moving.unusable.iter().map(|(_, reason)| reason.as_str()).collect();
        assert_eq!(told.len(), 4, "{told:?}");
        assert!(told[0].contains("belongs to no image") && told[0].contains("C1/0001.json"), "two cameras may have a 0001: {told:?}");
        assert!(told[1].contains("no labelme file") && told[2].contains("belongs to no image"), "{told:?}");
        assert!(told[3].contains("4 x 8 pixels") && moving.unusable[3].0.ends_with("C2/0001.png"), "{told:?}");
        let one = list(1);
        assert_eq!(kept(&Moving::read(folder.path(), &[], &one).expect("read"), &one.images[0]), 24, "one camera needs no folder");
    }
}
