//! Labels that were drawn as polygons.

use scene::{Mask, Raster};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A polygon of one class: corners in pixels, (0, 0) the top left corner of the image.
#[derive(Clone, Debug, PartialEq)]
pub struct Polygon {
    /// What it was called.
    pub label: String,
    /// Corners, in order, closed by the first.
    pub corners: Vec<[f64; 2]>,
}

/// Why a label file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum LabelError {
    /// No JSON, or JSON of another kind.
    #[error("no {format} file: {reason}")]
    Format {
        /// The format.
        format: &'static str,
        /// What is wrong.
        reason: String,
    },
    /// A shape that has no area.
    #[error("the shape {label} is a {kind}: draw polygons or rectangles")]
    Shape {
        /// Its label.
        label: String,
        /// What it is.
        kind: String,
    },
}

#[derive(Deserialize)]
struct Labelme {
    shapes: Vec<LabelmeShape>,
}

#[derive(Deserialize)]
struct LabelmeShape {
    label: String,
    points: Vec<[f64; 2]>,
    #[serde(default)]
    shape_type: Option<String>,
}

/// The polygons in a file of labelme, one file an image; rectangles are polygons too.
///
/// # Errors
/// Where the file is no such file or holds other shapes.
pub fn labelme_polygons(json: &[u8]) -> Result<Vec<Polygon>, LabelError> {
    let file: Labelme = serde_json::from_slice(json).map_err(|e| LabelError::Format { format: "labelme", reason: e.to_string() })?;
    let polygon = |shape: LabelmeShape| {
        let corners = match (shape.shape_type.as_deref().unwrap_or("polygon"), shape.points.as_slice()) {
            ("polygon", points) if points.len() >= 3 => shape.points,
            ("rectangle", &[[x0, y0], [x1, y1]]) => vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]],
            (kind, points) => {
                let kind = if kind == "polygon" { format!("polygon of {} corners", points.len()) } else { kind.to_owned() };
                return Err(LabelError::Shape { label: shape.label, kind });
            }
        };
        Ok(Polygon { label: shape.label, corners })
    };
    file.shapes.into_iter().map(polygon).collect()
}

#[derive(Deserialize)]
struct Coco {
    images: Vec<CocoImage>,
    annotations: Vec<CocoAnnotation>,
    categories: Vec<CocoCategory>,
}

#[derive(Deserialize)]
struct CocoImage {
    id: i64,
    file_name: String,
}

#[derive(Deserialize)]
struct CocoAnnotation {
    image_id: i64,
    category_id: i64,
    segmentation: serde_json::Value,
}

#[derive(Deserialize)]
struct CocoCategory {
    id: i64,
    name: String,
}

/// The polygons of every image in a file of COCO instances, which CVAT exports as "COCO 1.0", by the file name of the image.
///
/// # Errors
/// Where the file is no such file, or holds run lengths where polygons are needed.
pub fn coco_polygons(json: &[u8]) -> Result<BTreeMap<String, Vec<Polygon>>, LabelError> {
    let wrong = |reason: String| LabelError::Format { format: "COCO", reason };
    let file: Coco = serde_json::from_slice(json).map_err(|e| wrong(e.to_string()))?;
    let categories: BTreeMap<i64, String> = file.categories.into_iter().map(|c| (c.id, c.name)).collect();
    let names: BTreeMap<i64, String> = file.images.into_iter().map(|i| (i.id, i.file_name)).collect();
    let mut found: BTreeMap<String, Vec<Polygon>> = names.values().map(|name| (name.clone(), Vec::new())).collect();
    for annotation in file.annotations {
        let label =
            categories.get(&annotation.category_id).ok_or_else(|| wrong(format!("there is no category {}", annotation.category_id)))?;
        let name = names.get(&annotation.image_id).ok_or_else(|| wrong(format!("there is no image {}", annotation.image_id)))?;
        let rings: Vec<Vec<f64>> = serde_json::from_value(annotation.segmentation)
            .map_err(|_| LabelError::Shape { label: label.clone(), kind: format!("mask of run lengths in {name}") })?;
        for ring in rings {
            let corners = ring.as_chunks::<2>().0.to_vec();
            found.entry(name.clone()).or_default().push(Polygon { label: label.clone(), corners });
        }
    }
    Ok(found)
}

/// Fills the polygons for which `is_structure` holds of their label, then takes out those for which it does not: a hole, or a diver before the reef.
///
/// A pixel belongs to a polygon where its centre lies inside, by the even-odd rule.
#[must_use]
pub fn rasterise(polygons: &[Polygon], width: usize, height: usize, is_structure: impl Fn(&str) -> bool) -> Mask {
    let mut mask = Raster::filled(width, height, 0);
    let mut crossings = Vec::new();
    for value in [255, 0] {
        for polygon in polygons.iter().filter(|p| is_structure(&p.label) == (value == 255)) {
            for y in 0..height {
                crossings.clear();
                crossings.extend(crossings_of(&polygon.corners, y as f64 + 0.5));
                crossings.sort_by(f64::total_cmp);
                for pair in crossings.as_chunks::<2>().0 {
                    // Centres at i + 0.5 with pair[0] <= i + 0.5 < pair[1].
                    let column = |x: f64| (x - 0.5).ceil().clamp(0.0, width as f64) as usize;
                    let (from, to) = (column(pair[0]), column(pair[1]));
                    // Corners that are no numbers may turn them round.
                    mask.row_mut(y)[from.min(to)..to].fill(value);
                }
            }
        }
    }
    mask
}

fn crossings_of(corners: &[[f64; 2]], y: f64) -> impl Iterator<Item = f64> {
    let next = corners.iter().cycle().skip(1);
    corners
        .iter()
        .zip(next)
        .filter(move |(a, b)| (a[1] <= y) != (b[1] <= y))
        .map(move |(a, b)| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_of_labelme_are_filled_and_what_is_no_structure_is_cut_out() {
        let json = br#"{"version": "5.4", "imageHeight": 8, "shapes": [
            {"label": "diver", "points": [[4, 0], [8, 0], [8, 8], [4, 8]], "shape_type": "polygon"},
            {"label": "structure", "points": [[2, 1], [7, 6]], "shape_type": "rectangle"},
            {"label": "structure", "points": [[0, 0], [0, 4], [4, 0]]}]}"#;
        let polygons = labelme_polygons(json).expect("good");
        let mask = rasterise(&polygons, 8, 8, |label| label == "structure");
        let rows: Vec<String> = (0..8).map(|y| mask.row(y).iter().map(|v| if *v == 255 { '#' } else { '.' }).collect()).collect();
        // A triangle whose slanted side passes through centres belongs to the right of it, and a box of two columns left of the diver.
        assert_eq!(rows, ["###.....", "####....", "#.##....", "..##....", "..##....", "..##....", "........", "........"]);
    }

    #[test]
    fn polygons_of_coco_belong_to_their_images() {
        let json = br#"{"images": [{"id": 1, "file_name": "C1/a.png"}, {"id": 2, "file_name": "b.png"}],
            "categories": [{"id": 7, "name": "reef"}],
            "annotations": [{"image_id": 1, "category_id": 7, "segmentation": [[0, 0, 4, 0, 4, 4]], "bbox": [0, 0, 4, 4]}]}"#;
        let found = coco_polygons(json).expect("good");
        assert_eq!(found["C1/a.png"], [Polygon { label: "reef".to_owned(), corners: vec![[0.0, 0.0], [4.0, 0.0], [4.0, 4.0]] }]);
        assert!(found["b.png"].is_empty(), "an image without any structure");
    }

    #[test]
    fn other_files_and_shapes_are_told() {
        for (json, expected) in [
            (r#"{"shapes": [{"label": "reef", "points": [[1, 2]], "shape_type": "point"}]}"#, "the shape reef is a point"),
            (r#"{"shapes": [{"label": "reef", "points": [[1, 2], [3, 4]]}]}"#, "polygon of 2 corners"),
            (r#"{"images": []}"#, "no labelme file"),
            ("PNG", "no labelme file"),
        ] {
            let error = labelme_polygons(json.as_bytes()).expect_err(json).to_string();
            assert!(error.contains(expected), "{error}");
        }
        let runs = br#"{"images": [{"id": 1, "file_name": "a"}], "categories": [{"id": 7, "name": "reef"}],
            "annotations": [{"image_id": 1, "category_id": 7, "segmentation": {"counts": [1], "size": [2, 2]}}]}"#;
        assert!(coco_polygons(runs).expect_err("run lengths").to_string().contains("run lengths in a"));
    }

    #[test]
    fn absurd_corners_do_not_panic() {
        let corners = vec![[f64::NAN, 1.0], [1e300, -1e300], [-5.0, f64::INFINITY], [3.0, 3.0]];
        let mask = rasterise(&[Polygon { label: String::new(), corners }], 6, 5, |_| true);
        assert_eq!(mask.data().len(), 30);
    }
}
