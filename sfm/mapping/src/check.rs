//! Refuses input that contradicts itself.

use crate::error::MapError;
use crate::input::{ImagePick, MapInput, RigMode, WorldInput};
use nalgebra::{Vector2, Vector3};
use scene::Rigid3;

fn are_positive(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite() && *v > 0.0)
}

impl MapInput {
    /// Refuses input that contradicts itself.
    pub(crate) fn check(&self) -> Result<(), MapError> {
        let bad = |what: String| Err(MapError::Inconsistent(what));
        if self.keypoints.len() != self.images.len() {
            return bad(format!("{} images, but keypoints of {}", self.images.len(), self.keypoints.len()));
        }
        let mut seen = std::collections::BTreeSet::new();
        for image in &self.images {
            if image.camera.index() >= self.cameras.len() {
                return bad(format!("image {} was taken by camera {}, which does not exist", image.name, image.camera));
            }
            if self.rig.mode != RigMode::None && !seen.insert((image.camera, image.exposure)) {
                return bad(format!("image {} is the second of camera {} in exposure {}", image.name, image.camera, image.exposure));
            }
        }
        for camera in &self.cameras {
            let (held, sigmas, count) = (camera.held.len(), camera.sigmas.len(), camera.camera.params().len());
            if (held != 0 && held != count) || (sigmas != 0 && sigmas != count) {
                return bad(format!(
                    "camera {} has {count} parameters, but {held} are held or not and {sigmas} have deviations or not",
                    camera.name
                ));
            }
            if !camera.sigmas.iter().flatten().all(|s| are_positive(&[*s])) {
                return bad(format!("a standard deviation of a parameter of camera {} is not positive", camera.name));
            }
        }
        for pair in &self.pairs {
            let (a, b) = (pair.images.0.index(), pair.images.1.index());
            if a == b || a >= self.images.len() || b >= self.images.len() {
                return bad(format!("a pair of images {a} and {b}"));
            }
            let (na, nb) = (self.keypoints[a].len(), self.keypoints[b].len());
            if pair.matches.iter().any(|(ka, kb)| ka.index() >= na || kb.index() >= nb) {
                return bad(format!("a match between images {a} and {b} names a keypoint that does not exist"));
            }
        }
        for keypoints in &self.keypoints {
            if keypoints.iter().any(|k| !Vector2::from(*k).iter().all(|v| v.is_finite())) {
                return bad("a keypoint is not a number".into());
            }
        }
        for (i, sigmas) in self.sigmas_px.iter().enumerate().filter(|(_, sigmas)| !sigmas.is_empty()) {
            if self.keypoints.get(i).is_none_or(|k| k.len() != sigmas.len()) || sigmas.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
                return bad(format!("standard deviations of image {i} that are not one positive number a keypoint"));
            }
        }
        for baseline in &self.rig.baselines {
            if baseline.cameras.0.index().max(baseline.cameras.1.index()) >= self.cameras.len() || baseline.cameras.0 == baseline.cameras.1
            {
                return bad(format!("a baseline between cameras {} and {}", baseline.cameras.0, baseline.cameras.1));
            }
            if !are_positive(&[baseline.length_m, baseline.sigma_m]) {
                return bad(format!("a baseline of {} m with a standard deviation of {} m", baseline.length_m, baseline.sigma_m));
            }
        }
        for (index, bar) in self.scale_bars.iter().enumerate() {
            if !are_positive(&[bar.length_m, bar.sigma_m]) {
                return bad(format!("scale bar {index} of {} m with a standard deviation of {} m", bar.length_m, bar.sigma_m));
            }
        }
        for pick in self.scale_bars.iter().flat_map(|bar| bar.ends.iter().flatten()) {
            if pick.image.index() >= self.images.len() {
                return bad(format!("a scale bar is picked in image {}, which does not exist", pick.image));
            }
            if !(pick.pixel.iter().all(|v| v.is_finite()) && are_positive(&[pick.sigma_px])) {
                return bad(format!(
                    "a scale bar is picked at no place of image {}, or with a standard deviation that is not positive",
                    pick.image
                ));
            }
        }
        self.world.check(self.images.len())?;
        if self.rig.poses.len() > self.cameras.len() {
            return bad(format!("{} poses in the rig of {} cameras", self.rig.poses.len(), self.cameras.len()));
        }
        for (camera, pose) in self.rig.poses.iter().enumerate() {
            let Some(pose) = pose else { continue };
            let Rigid3 { rotation, translation } = pose.cam_from_rig;
            if !rotation.coords.iter().chain(&translation).all(|v| v.is_finite()) {
                return bad(format!("the pose in the rig of camera {camera} is not finite"));
            }
            if pose.sigma.is_some_and(|(rotation, translation)| !are_positive(&[rotation, translation])) {
                return bad(format!("the pose in the rig of camera {camera} has standard deviations that are not positive"));
            }
        }
        Ok(())
    }
}

impl WorldInput {
    fn check(&self, images: usize) -> Result<(), MapError> {
        let bad = |what: String| Err(MapError::Inconsistent(what));
        let is_finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        let is_direction = |v: &Vector3<f64>| is_finite(v) && v.norm() > 0.0;
        // Infinite: not known along this axis.
        let are_sigmas = |v: &Vector3<f64>| v.iter().all(|s| *s > 0.0);
        for o in &self.positions {
            if !(is_finite(&o.in_rig) && is_finite(&o.xyz) && are_sigmas(&o.sigma_m)) {
                return bad(format!("the position of exposure {} is not finite, or its standard deviation not positive", o.exposure));
            }
        }
        let ups = self.ups.iter().map(|o| (o.exposure, is_direction(&o.up_in_rig) && are_positive(&[o.sigma_rad])));
        let headings = self
            .headings
            .iter()
            .map(|o| (o.exposure, is_direction(&o.axis_in_rig) && o.heading_rad.is_finite() && are_positive(&[o.sigma_rad])));
        if let Some((exposure, _)) = ups.chain(headings).find(|(_, good)| !good) {
            return bad(format!("a direction or heading of exposure {exposure} is not one, or its standard deviation not positive"));
        }
        for (index, point) in self.control_points.iter().enumerate() {
            if !(is_finite(&point.xyz) && are_sigmas(&point.sigma_m)) {
                return bad(format!("control point {index} is not finite, or its standard deviation not positive"));
            }
            let is_pick = |p: &ImagePick| p.image.index() < images && p.pixel.iter().all(|v| v.is_finite()) && are_positive(&[p.sigma_px]);
            if !point.picks.iter().all(is_pick) {
                return bad(format!("control point {index} is picked in an image that does not exist, or at no place of it"));
            }
        }
        Ok(())
    }
}
