//! What conjugate gradients keep of the reduced system.

use super::layout::{Layout, Owner};

/// Blocks of frames in clusters of consecutive ones, and of what frames share with each other: sensors, cameras, kept points. Stored are
/// the blocks inside a cluster and all blocks with something shared.
#[derive(Debug)]
pub(super) struct Clusters {
    /// First block of each cluster, and the end of the last, which is where the shared blocks begin.
    pub start: Vec<usize>,
    /// The end of the cluster of each block of a frame.
    end_of: Vec<u32>,
}

impl Clusters {
    pub fn new(layout: &Layout, cluster_unknowns: usize) -> Self {
        let frames = layout.owners.iter().take_while(|o| matches!(o, Owner::Frame(_))).count();
        let count = layout.offsets[frames].div_ceil(cluster_unknowns).max(1);
        let start: Vec<usize> = (0..=count).map(|i| i * frames / count).collect();
        let end_of = start.windows(2).flat_map(|w| std::iter::repeat_n(w[1] as u32, w[1] - w[0])).collect();
        Self { start, end_of }
    }

    /// The first shared block.
    pub fn shared(&self) -> usize {
        self.start[self.start.len() - 1]
    }

    /// Rows of the panel of block `a` before the shared ones.
    pub fn own_rows(&self, a: usize, offsets: &[usize]) -> usize {
        self.end_of.get(a).map_or(0, |&end| offsets[end as usize] - offsets[a])
    }

    pub fn row(&self, a: usize, b: u32, offsets: &[usize]) -> Option<usize> {
        let b = b as usize;
        let shared = self.shared();
        if a >= shared || self.end_of[a] as usize > b {
            return Some(offsets[b] - offsets[a]);
        }
        (b >= shared).then(|| self.own_rows(a, offsets) + offsets[b] - offsets[shared])
    }
}
