//! The part of the surface that the frames show.

use super::render::{DiveImage, NO_FACE};
use scene::Mesh;
use std::sync::atomic::{AtomicU8, Ordering};

/// Counts in how many frames each face of a mesh is seen; frames may be added from many threads.
#[derive(Debug)]
pub struct SeenFaces {
    counts: Vec<AtomicU8>,
}

impl SeenFaces {
    /// No frame yet, for a mesh of so many faces.
    #[must_use]
    pub fn new(faces: usize) -> Self {
        Self { counts: (0..faces).map(|_| AtomicU8::new(0)).collect() }
    }

    /// Adds a frame.
    pub fn add(&self, image: &DiveImage) {
        let mut faces: Vec<u32> = image.faces.data().iter().copied().filter(|&f| f != NO_FACE).collect();
        faces.sort_unstable();
        faces.dedup();
        for face in faces {
            // Counting is the same in any order; it stops before it would begin anew.
            let _ = self.counts[face as usize].fetch_update(Ordering::Relaxed, Ordering::Relaxed, |count| count.checked_add(1));
        }
    }

    /// The faces that at least `frames` frames show, with those that share a corner with them: a face smaller than a pixel may be
    /// seen by no ray.
    #[must_use]
    pub fn mesh(&self, mesh: &Mesh, frames: u8) -> Mesh {
        let mut near = vec![false; mesh.vertices.len()];
        for (face, count) in mesh.faces.iter().zip(&self.counts) {
            if count.load(Ordering::Relaxed) >= frames {
                face.iter().for_each(|&v| near[v as usize] = true);
            }
        }
        let kept: Vec<[u32; 3]> = mesh.faces.iter().filter(|face| face.iter().any(|&v| near[v as usize])).copied().collect();
        let mut used = vec![u32::MAX; mesh.vertices.len()];
        let mut out = Mesh::default();
        for face in kept {
            out.faces.push(face.map(|v| {
                let slot = &mut used[v as usize];
                if *slot == u32::MAX {
                    *slot = out.vertices.len() as u32;
                    out.vertices.push(mesh.vertices[v as usize]);
                }
                *slot
            }));
        }
        out
    }
}
