//! Which keypoints show the same thing: the correspondence graph.

use scene::{ImageId, KeypointIndex, Observation, VerifiedPair};

/// For every keypoint of every image, the keypoints that it was matched with.
#[derive(Debug)]
pub(crate) struct CorrespondenceGraph {
    /// For each image, where the links of a keypoint start; one more than there are keypoints.
    offsets: Vec<Vec<u32>>,
    /// For each image, the links of all its keypoints.
    links: Vec<Vec<Observation>>,
}

impl CorrespondenceGraph {
    /// The graph of all matches; links of a keypoint are in ascending order.
    pub(crate) fn new(keypoint_counts: &[usize], pairs: &[VerifiedPair]) -> Self {
        let mut offsets: Vec<Vec<u32>> = keypoint_counts.iter().map(|&n| vec![0; n + 1]).collect();
        for pair in pairs {
            for &(a, b) in &pair.matches {
                offsets[pair.images.0.index()][a.index() + 1] += 1;
                offsets[pair.images.1.index()][b.index() + 1] += 1;
            }
        }
        for image in &mut offsets {
            let mut sum = 0;
            for offset in image.iter_mut() {
                sum += *offset;
                *offset = sum;
            }
        }
        let mut next = offsets.clone();
        let placeholder = Observation { image: ImageId(0), keypoint: KeypointIndex(0) };
        let mut links: Vec<Vec<Observation>> = offsets.iter().map(|o| vec![placeholder; o.last().map_or(0, |&n| n as usize)]).collect();
        let mut put = |at: Observation, link: Observation| {
            let slot = &mut next[at.image.index()][at.keypoint.index()];
            links[at.image.index()][*slot as usize] = link;
            *slot += 1;
        };
        for pair in pairs {
            for &(a, b) in &pair.matches {
                let a = Observation { image: pair.images.0, keypoint: a };
                let b = Observation { image: pair.images.1, keypoint: b };
                put(a, b);
                put(b, a);
            }
        }
        for (image_links, image_offsets) in links.iter_mut().zip(&offsets) {
            for range in image_offsets.windows(2) {
                image_links[range[0] as usize..range[1] as usize].sort_unstable();
            }
        }
        Self { offsets, links }
    }

    /// The keypoints that were matched with this one.
    pub(crate) fn of(&self, observation: Observation) -> &[Observation] {
        let offsets = &self.offsets[observation.image.index()];
        let k = observation.keypoint.index();
        &self.links[observation.image.index()][offsets[k] as usize..offsets[k + 1] as usize]
    }

    /// Number of matches of an image with all others.
    pub(crate) fn link_count(&self, image: ImageId) -> usize {
        self.links[image.index()].len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use scene::PairConfiguration;

    #[test]
    fn links_are_mutual_and_sorted() {
        let pair = |a, b, matches: &[(u32, u32)]| VerifiedPair {
            images: (ImageId(a), ImageId(b)),
            matches: matches.iter().map(|&(x, y)| (KeypointIndex(x), KeypointIndex(y))).collect(),
            configuration: PairConfiguration::Uncalibrated { fundamental: Matrix3::zeros() },
            homography_inliers: 0,
        };
        let graph = CorrespondenceGraph::new(&[2, 2, 1], &[pair(1, 2, &[(1, 0)]), pair(0, 2, &[(1, 0)]), pair(0, 1, &[(0, 1)])]);
        let at = |image, keypoint| Observation { image: ImageId(image), keypoint: KeypointIndex(keypoint) };
        assert_eq!(graph.of(at(2, 0)), &[at(0, 1), at(1, 1)]);
        assert_eq!(graph.of(at(1, 1)), &[at(0, 0), at(2, 0)]);
        assert_eq!(graph.of(at(1, 0)), &[]);
        assert_eq!(graph.link_count(ImageId(0)), 2);
    }
}
