//! A bounded cache of depth maps.

use crate::DepthMap;
use scene::ImageId;
use std::collections::VecDeque;
use std::sync::Arc;

/// Keeps the maps that were asked for last.
pub(crate) struct Cache<F> {
    load: F,
    capacity: usize,
    /// Least recently used first. `None`: there is no map of this image.
    entries: VecDeque<(ImageId, Option<Arc<DepthMap>>)>,
}

impl<E, F: FnMut(ImageId) -> Result<Option<DepthMap>, E>> Cache<F> {
    pub fn new(capacity: usize, load: F) -> Self {
        Self { load, capacity: capacity.max(1), entries: VecDeque::new() }
    }

    pub fn get(&mut self, image: ImageId) -> Result<Option<Arc<DepthMap>>, E> {
        let entry = match self.entries.iter().position(|(id, _)| *id == image).and_then(|i| self.entries.remove(i)) {
            Some(entry) => entry,
            None => {
                while self.entries.len() >= self.capacity {
                    self.entries.pop_front();
                }
                (image, (self.load)(image)?.map(Arc::new))
            }
        };
        let map = entry.1.clone();
        self.entries.push_back(entry);
        Ok(map)
    }
}
