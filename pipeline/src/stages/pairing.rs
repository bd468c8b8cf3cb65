//! Which images of several cameras were exposed at the same instant.

use crate::config::{FramesFrom, natural_key};
use crate::store::Warning;
use std::collections::{BTreeMap, BTreeSet};

/// What is known of the instant of an image.
#[derive(Clone, Debug)]
pub(crate) struct Exposure {
    /// Index of the camera.
    pub(crate) camera: usize,
    /// Position among the camera's files, those that cannot be read included.
    pub(crate) position: usize,
    /// File name without extension.
    pub(crate) stem: String,
    /// Time of exposure, seconds from any origin that the cameras share.
    pub(crate) time_secs: Option<f64>,
}

/// Numbers the exposures from 0; images with one number were exposed together. What has no partner is a warning.
pub(crate) fn pair_up(cameras: &[&str], images: &[Exposure], rule: FramesFrom) -> (Vec<u32>, Vec<Warning>) {
    if cameras.len() < 2 {
        return ((0..images.len() as u32).collect(), Vec::new());
    }
    let mut warnings = Vec::new();
    let numbers = match rule {
        FramesFrom::Order => dense(images.iter().map(|i| i.position).collect()),
        FramesFrom::Stem => dense(stem_keys(images)),
        FramesFrom::Timestamp => by_time(cameras, images, &mut warnings),
    };
    warnings.extend(lonely(cameras, images, &numbers));
    (numbers, warnings)
}

/// Numbers equal keys equally, in the order of the keys.
fn dense<K: Ord + Clone>(keys: Vec<K>) -> Vec<u32> {
    let numbers: BTreeMap<K, u32> = keys.iter().cloned().collect::<BTreeSet<K>>().into_iter().zip(0..).collect();
    keys.iter().map(|key| numbers[key]).collect()
}

/// The stems where cameras share any; else the last number in them.
fn stem_keys(images: &[Exposure]) -> Vec<Vec<crate::config::NamePart>> {
    let mut camera_of: BTreeMap<&str, usize> = BTreeMap::new();
    let shared = images.iter().any(|i| *camera_of.entry(i.stem.as_str()).or_insert(i.camera) != i.camera);
    images.iter().map(|i| natural_key(if shared { &i.stem } else { last_number(&i.stem).unwrap_or(&i.stem) })).collect()
}

/// The last run of digits in a name.
fn last_number(stem: &str) -> Option<&str> {
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem[..end].rfind(|c: char| !c.is_ascii_digit()).map_or(0, |i| i + stem[i..].chars().next().map_or(1, char::len_utf8));
    Some(&stem[start..end])
}

/// Every camera's images to the nearest in time of the first camera, within half of its usual interval, one to one.
fn by_time(cameras: &[&str], images: &[Exposure], warnings: &mut Vec<Warning>) -> Vec<u32> {
    for (c, name) in cameras.iter().enumerate() {
        let timeless = images.iter().filter(|i| i.camera == c && i.time_secs.is_none()).count();
        if timeless > 0 {
            warnings.push(Warning {
                about: (*name).to_owned(),
                message: format!("{timeless} images have no time of exposure and pair with none"),
            });
        }
    }
    let mut reference: Vec<(f64, usize)> =
        images.iter().enumerate().filter(|(_, i)| i.camera == 0).filter_map(|(n, i)| Some((i.time_secs?, n))).collect();
    reference.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut intervals: Vec<f64> = reference.windows(2).map(|w| w[1].0 - w[0].0).filter(|d| *d > 0.0).collect();
    intervals.sort_by(f64::total_cmp);
    let tolerance = intervals.get(intervals.len() / 2).map_or(0.5, |interval| interval / 2.0);
    // Nearest pairs first, so that a late image does not take the partner of a better one.
    let mut candidates: Vec<(f64, usize, usize)> = Vec::new();
    for (n, image) in images.iter().enumerate().filter(|(_, i)| i.camera != 0) {
        let Some(time) = image.time_secs else { continue };
        let start = reference.partition_point(|(t, _)| *t < time - tolerance);
        candidates.extend(reference[start..].iter().take_while(|(t, _)| *t <= time + tolerance).map(|(t, r)| ((t - time).abs(), *r, n)));
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut partner: Vec<usize> = (0..images.len()).collect();
    let mut taken = BTreeSet::new();
    let mut placed = BTreeSet::new();
    for (_, r, n) in candidates {
        if !placed.contains(&n) && taken.insert((r, images[n].camera)) {
            placed.insert(n);
            partner[n] = r;
        }
    }
    // In the order of time; images without one come last, in the order of their files.
    let key = |n: usize| {
        let image = &images[partner[n]];
        let time = image.time_secs.unwrap_or(f64::INFINITY);
        // Total order of floats as integers.
        let bits = time.to_bits() as i64;
        (bits ^ (((bits >> 63) as u64) >> 1) as i64, partner[n])
    };
    dense((0..images.len()).map(key).collect())
}

/// One warning a camera that has images without partner.
fn lonely(cameras: &[&str], images: &[Exposure], numbers: &[u32]) -> Vec<Warning> {
    let mut members: BTreeMap<u32, BTreeSet<usize>> = BTreeMap::new();
    for (image, number) in images.iter().zip(numbers) {
        members.entry(*number).or_default().insert(image.camera);
    }
    let mut warnings = Vec::new();
    for (c, name) in cameras.iter().enumerate() {
        let alone: Vec<&str> = images
            .iter()
            .zip(numbers)
            .filter(|(image, number)| image.camera == c && members[number].len() == 1)
            .map(|(image, _)| image.stem.as_str())
            .collect();
        let message = match alone.as_slice() {
            [] => continue,
            [one] => format!("{one} pairs with no image of another camera"),
            [first, .., last] => format!("{} images pair with none of another camera, {first} to {last}", alone.len()),
        };
        warnings.push(Warning { about: (*name).to_owned(), message });
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;

    fn images(stems: &[&[&str]], times: &[&[f64]]) -> Vec<Exposure> {
        let mut images = Vec::new();
        for (camera, stems) in stems.iter().enumerate() {
            for (position, stem) in stems.iter().enumerate() {
                let time_secs = times.get(camera).and_then(|t| t.get(position)).copied();
                images.push(Exposure { camera, position, stem: (*stem).to_owned(), time_secs });
            }
        }
        images
    }

    #[test]
    fn order_pairs_by_position() {
        let list = images(&[&["a", "b", "c"], &["x", "y"]], &[]);
        let (numbers, warnings) = pair_up(&["L", "R"], &list, FramesFrom::Order);
        assert_eq!(numbers, [0, 1, 2, 0, 1]);
        assert_eq!(warnings, [Warning { about: "L".to_owned(), message: "c pairs with no image of another camera".to_owned() }]);
    }

    #[test]
    fn stems_pair_by_name_or_else_by_number() {
        let same = images(&[&["f2", "f10"], &["f2", "f11"]], &[]);
        assert_eq!(pair_up(&["L", "R"], &same, FramesFrom::Stem).0, [0, 1, 0, 2]);
        let numbered = images(&[&["left01", "left02"], &["right02", "right03x"]], &[]);
        let (numbers, warnings) = pair_up(&["L", "R"], &numbered, FramesFrom::Stem);
        assert_eq!(numbers, [0, 1, 1, 2]);
        assert_eq!(warnings.len(), 2);
        assert_eq!(last_number("ö12é7ü"), Some("7"));
        assert_eq!(last_number("none"), None);
    }

    #[test]
    fn times_pair_with_the_nearest_one_to_one() {
        // 2.4 and 2.1 both are nearest to 2; the nearer one gets it. 9 s pairs with none.
        let list = images(&[&["a", "b", "c"], &["x", "y", "z", "w"]], &[&[1.0, 2.0, 3.0], &[1.1, 2.4, 2.1, 9.0]]);
        let (numbers, warnings) = pair_up(&["L", "R"], &list, FramesFrom::Timestamp);
        assert_eq!(numbers[0], numbers[3]);
        assert_eq!(numbers[1], numbers[5]);
        assert_ne!(numbers[1], numbers[4]);
        assert_eq!(numbers, [0, 1, 3, 0, 2, 1, 4]);
        assert_eq!(warnings.len(), 2);
    }

    #[test]
    fn images_without_time_are_told() {
        let list = images(&[&["a"], &["x"]], &[&[1.0]]);
        let (numbers, warnings) = pair_up(&["L", "R"], &list, FramesFrom::Timestamp);
        assert_eq!(numbers, [0, 1]);
        assert!(warnings[0].message.contains("no time of exposure"), "{warnings:?}");
    }
}
