//! Picks by hand, and the circular targets that are measured where somebody pointed.

use super::images::{ImageEntry, ImageList};
use crate::config::{PickConfig, TargetConfig};
use crate::store::Warning;
use anyhow::Result;
use imaging::{CircleTarget, NoTarget, decode_grey, measure_circle};
use mapping::{ImagePick, PICK_SIGMA_PX};
use rayon::prelude::*;
use scene::{Camera, ImageId};
use serde_json::{Value, json};

/// Least standard deviation of a target's image, pixels: what a camera model and the ground a target is printed on leave, however little the
/// noise.
const FLOOR_PX: f64 = 0.05;

/// Measures picks in the images.
pub(super) struct Picker<'a> {
    pub list: &'a ImageList,
    /// Interior orientation of each camera, as it is known before.
    pub cameras: Vec<Camera>,
    /// The file of an image.
    pub load: &'a (dyn Fn(&ImageEntry) -> Result<Vec<u8>> + Sync),
}

/// Picks, and what is told of the targets among them.
#[derive(Default)]
pub(super) struct Picked {
    pub picks: Vec<ImagePick>,
    pub targets: Vec<Value>,
}

impl Picker<'_> {
    /// The picks in images that are there; with a target, its centre in each. Picks without image or target are left out with a warning.
    pub(super) fn picks(&self, picks: &[PickConfig], target: Option<&TargetConfig>, about: &str, warnings: &mut Vec<Warning>) -> Picked {
        let (mut found, mut missing) = (Vec::with_capacity(picks.len()), Vec::new());
        for pick in picks {
            match self.list.images.iter().position(|i| i.name == pick.image) {
                Some(i) => found.push(ImagePick { image: ImageId::new(i), pixel: [pick.x, pick.y], sigma_px: PICK_SIGMA_PX }),
                None => missing.push(pick.image.as_str()),
            }
        }
        let mut warn = |message: String| warnings.push(Warning { about: about.to_owned(), message });
        if !missing.is_empty() {
            warn(format!("{} of {} picks are not used: there is no usable image {}", missing.len(), picks.len(), missing.join(", ")));
        }
        let Some(target) = target else { return Picked { picks: found, targets: Vec::new() } };
        let measured: Vec<Result<CircleTarget, String>> =
            found.par_iter().map(|pick| self.measure(pick, target.search_radius_px)).collect();
        let mut out = Picked::default();
        for (pick, measured) in found.iter().zip(measured) {
            let name = &self.list.images[pick.image.index()].name;
            match measured {
                Ok(target) => {
                    let sigma_px = target.mean_sigma_px().hypot(self.eccentricity(&target, pick)).hypot(FLOOR_PX);
                    out.picks.push(ImagePick { pixel: target.centre, sigma_px, ..*pick });
                    out.targets.push(json!({
                        "image": name, "picked_px": pick.pixel, "centre_px": target.centre, "sigma_px": sigma_px,
                        "diameter_px": target.diameter_px(), "refused": null,
                    }));
                }
                Err(reason) => {
                    warn(format!("its pick in {name} is left out: {reason}"));
                    out.targets.push(json!({"image": name, "picked_px": pick.pixel, "refused": reason}));
                }
            }
        }
        if out.picks.len() < 2 && found.len() >= 2 {
            warn(format!("it is not used: targets were found in {} of {} images, two are needed", out.picks.len(), found.len()));
        }
        out
    }

    fn measure(&self, pick: &ImagePick, search_px: f64) -> Result<CircleTarget, String> {
        let bytes = (self.load)(&self.list.images[pick.image.index()]).map_err(|e| format!("{e:#}"))?;
        let grey = decode_grey(&bytes).map_err(|e| e.to_string())?;
        measure_circle(&grey, pick.pixel, search_px).map_err(|e: NoTarget| e.to_string())
    }

    /// What perspective may move the centre by; nothing where the camera is not known so far that it sees the target.
    fn eccentricity(&self, target: &CircleTarget, pick: &ImagePick) -> f64 {
        let camera = &self.cameras[self.list.images[pick.image.index()].camera];
        target.eccentricity_px(camera).unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::images::CameraEntry;
    use crate::store::Fingerprint;
    use imaging::encode_png_rgb;
    use scene::{CameraModel, Raster};

    const SIZE: usize = 40;

    /// A dark disc of 9 pixels on white, drawn with soft edges.
    fn picture(centre: [f64; 2]) -> Vec<u8> {
        let grey = |x: usize, y: usize| {
            let radius = (x as f64 + 0.5 - centre[0]).hypot(y as f64 + 0.5 - centre[1]);
            (40.0 + 180.0 * (radius - 4.5 + 0.5).clamp(0.0, 1.0)) as u8
        };
        let pixels = (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| [grey(x, y); 3])).collect();
        encode_png_rgb(&Raster::from_vec(SIZE, SIZE, pixels).unwrap()).unwrap()
    }

    fn list(count: usize) -> ImageList {
        let image = |i: usize| ImageEntry {
            name: format!("C1/{i}.png"),
            camera: 0,
            stem: i.to_string(),
            position: Some(i),
            exposure: i as u32,
            time_secs: None,
            width: SIZE as u32,
            height: SIZE as u32,
            content: Fingerprint::of_bytes(&[]),
        };
        let camera = CameraEntry { name: "C1".to_owned(), size: Some((SIZE as u32, SIZE as u32)), exif_focal_px: None };
        ImageList { cameras: vec![camera], images: (0..count).map(image).collect(), found: count }
    }

    #[test]
    fn targets_are_measured_and_what_is_none_is_left_out_with_a_reason() {
        let list = list(3);
        let centre = [19.3, 20.6];
        let load = |image: &ImageEntry| -> Result<Vec<u8>> {
            match image.position {
                Some(2) => Ok(picture([100.0, 100.0])),
                _ => Ok(picture(centre)),
            }
        };
        let cameras = vec![Camera::from_focal(CameraModel::Pinhole, SIZE as u32, SIZE as u32, 50.0).unwrap()];
        let picker = Picker { list: &list, cameras, load: &load };
        let pick = |i: usize| PickConfig { image: format!("C1/{i}.png"), x: 22.0, y: 19.0 };
        let mut warnings = Vec::new();
        let target = TargetConfig { search_radius_px: 10.0 };
        let picked = picker.picks(&[pick(0), pick(1), pick(2), pick(7)], Some(&target), "bar 1", &mut warnings);
        let used: Vec<u32> = picked.picks.iter().map(|p| p.image.0).collect();
        assert_eq!(used, [0, 1]);
        for pick in &picked.picks {
            // Rounded to 8 bits, the disc has its place to a few hundredths.
            assert!((pick.pixel[0] - centre[0]).hypot(pick.pixel[1] - centre[1]) < 0.03, "{pick:?}");
            assert!(pick.sigma_px >= FLOOR_PX && pick.sigma_px < 0.2, "{pick:?}");
        }
        let told: Vec<&str> = warnings.iter().map(|w| w.message.as_str()).collect();
        assert_eq!(
            told,
            [
                "1 of 4 picks are not used: there is no usable image C1/7.png",
                "its pick in C1/2.png is left out: no circular target is within 10 px"
            ]
        );
        assert_eq!((picked.targets.len(), &picked.targets[2]["refused"]), (3, &json!("no circular target is within 10 px")));
        // Without a target, picks are taken as they are.
        let plain = picker.picks(&[pick(0)], None, "bar 1", &mut warnings);
        assert_eq!(plain.picks, [ImagePick { image: ImageId(0), pixel: [22.0, 19.0], sigma_px: PICK_SIGMA_PX }]);
        // One that is left is not enough.
        let one = picker.picks(&[pick(0), pick(2)], Some(&target), "bar 1", &mut warnings);
        assert_eq!(one.picks.len(), 1);
        assert!(warnings.last().unwrap().message.starts_with("it is not used: targets were found in 1 of 2 images"));
    }
}
