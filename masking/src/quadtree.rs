//! Split and merge over a quadtree.

use scene::{Mask, Raster};

/// A rectangle of the quadtree: at level `l` the image is cut into 2^l columns and 2^l rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Patch {
    /// 0 is the whole image.
    pub level: usize,
    /// From the left.
    pub column: usize,
    /// From the top.
    pub row: usize,
}

impl Patch {
    /// The whole image.
    pub const ROOT: Self = Self { level: 0, column: 0, row: 0 };

    /// Columns and rows of pixels of an image of `width` x `height`, each first and one past the last. The patches of a level tile the image.
    #[must_use]
    pub fn pixels(&self, width: usize, height: usize) -> [usize; 4] {
        let edge = |i: usize, length: usize| (i * length) >> self.level;
        [edge(self.column, width), edge(self.column + 1, width), edge(self.row, height), edge(self.row + 1, height)]
    }

    /// All patches of a level, row after row.
    #[must_use]
    pub fn of_level(level: usize) -> Vec<Self> {
        let side = 1 << level;
        (0..side * side).map(|i| Self { level, column: i % side, row: i / side }).collect()
    }

    fn quarters(self) -> [Self; 4] {
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| Self { level: self.level + 1, column: 2 * self.column + x, row: 2 * self.row + y })
    }
}

/// Tells structure from background.
pub trait PatchClassifier {
    /// What can go wrong.
    type Error;

    /// Whether each patch of the image shows structure. All patches are of one level.
    ///
    /// # Errors
    /// What the classifier says.
    fn classify(&mut self, image: &Raster<[u8; 3]>, patches: &[Patch]) -> Result<Vec<bool>, Self::Error>;
}

/// Masks an image by split and merge, after Rofallski et al. 2020, section 4.2.2 and figure 6: a patch without structure is background altogether, a patch with
/// structure is split into quarters, down to `levels`; structure are the patches of the last level that show it.
///
/// All patches of a level are classified in one call. Levels at which a patch would have no pixels are left out.
///
/// # Errors
/// What the classifier says.
pub fn segment<C: PatchClassifier>(image: &Raster<[u8; 3]>, classifier: &mut C, levels: usize) -> Result<Mask, C::Error> {
    let (width, height) = (image.width(), image.height());
    let mut mask = Raster::filled(width, height, 0);
    for patch in leaves(image, classifier, levels)? {
        let [left, right, top, bottom] = patch.pixels(width, height);
        for y in top..bottom {
            mask.row_mut(y)[left..right].fill(255);
        }
    }
    Ok(mask)
}

/// The patches of the last level that show structure, see [`segment`].
///
/// # Errors
/// What the classifier says.
pub fn leaves<C: PatchClassifier>(image: &Raster<[u8; 3]>, classifier: &mut C, levels: usize) -> Result<Vec<Patch>, C::Error> {
    let last = usable_levels(image.width(), image.height(), levels);
    let Some(last) = last else { return Ok(Vec::new()) };
    let mut patches = vec![Patch::ROOT];
    for level in 0..=last {
        if patches.is_empty() {
            break;
        }
        let labels = classifier.classify(image, &patches)?;
        let structure = patches.iter().zip(labels).filter_map(|(patch, label)| label.then_some(*patch));
        patches = if level < last { structure.flat_map(Patch::quarters).collect() } else { structure.collect() };
    }
    Ok(patches)
}

/// The last level, at most `levels`, at which every patch has a pixel; `None` for an image without pixels.
#[must_use]
pub fn usable_levels(width: usize, height: usize, levels: usize) -> Option<usize> {
    width.min(height).checked_ilog2().map(|most| levels.min(most as usize))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::convert::Infallible;

    /// Structure where any pixel is red; counts what it was asked.
    struct AnyRed(Vec<Patch>);

    impl PatchClassifier for AnyRed {
        type Error = Infallible;

        fn classify(&mut self, image: &Raster<[u8; 3]>, patches: &[Patch]) -> Result<Vec<bool>, Infallible> {
            self.0.extend(patches);
            Ok(patches.iter().map(|p| any_red(image, p.pixels(image.width(), image.height()))).collect())
        }
    }

    fn any_red(image: &Raster<[u8; 3]>, [left, right, top, bottom]: [usize; 4]) -> bool {
        (top..bottom).any(|y| (left..right).any(|x| image[(x, y)][0] > 0))
    }

    /// Figure 6 word for word: classify; background stops, structure is quartered down to level n.
    fn by_the_book(image: &Raster<[u8; 3]>, patch: Patch, levels: usize, mask: &mut Mask) {
        let [left, right, top, bottom] = patch.pixels(image.width(), image.height());
        let label = any_red(image, [left, right, top, bottom]);
        if label && patch.level < levels {
            for quarter in patch.quarters() {
                by_the_book(image, quarter, levels, mask);
            }
        } else {
            for y in top..bottom {
                mask.row_mut(y)[left..right].fill(if label { 255 } else { 0 });
            }
        }
    }

    proptest! {
        #[test]
        fn is_the_recursion_of_the_paper(w in 1usize..70, h in 1usize..50, levels in 0usize..8, red in prop::collection::vec((0usize..70, 0usize..50), 0..12)) {
            let mut image = Raster::filled(w, h, [0u8; 3]);
            for (x, y) in red {
                image[(x % w, y % h)] = [255, 0, 0];
            }
            let usable = usable_levels(w, h, levels).expect("it has pixels");
            let mut expected = Raster::filled(w, h, 7);
            by_the_book(&image, Patch::ROOT, usable, &mut expected);
            let mut classifier = AnyRed(Vec::new());
            let Ok(mask) = segment(&image, &mut classifier, levels);
            prop_assert_eq!(mask.data(), expected.data());
        }

        #[test]
        fn patches_of_a_level_tile_the_image(w in 1usize..300, h in 1usize..300, level in 0usize..8) {
            let mut covered = Raster::filled(w, h, 0u8);
            for row in 0..1 << level {
                for column in 0..1 << level {
                    let [left, right, top, bottom] = Patch { level, column, row }.pixels(w, h);
                    (top..bottom).for_each(|y| covered.row_mut(y)[left..right].iter_mut().for_each(|c| *c += 1));
                }
            }
            prop_assert!(covered.data().iter().all(|&c| c == 1));
        }
    }

    #[test]
    fn background_is_asked_once_and_structure_to_the_last_level() {
        let mut image = Raster::filled(64, 64, [0u8; 3]);
        let mut water = AnyRed(Vec::new());
        let Ok(mask) = segment(&image, &mut water, 6);
        assert_eq!((water.0.as_slice(), mask.data().iter().any(|&v| v > 0)), ([Patch::ROOT].as_slice(), false));
        image[(63, 0)] = [9, 0, 0];
        let mut corner = AnyRed(Vec::new());
        let Ok(mask) = segment(&image, &mut corner, 3);
        // The root, and four quarters at each of three levels.
        assert_eq!(corner.0.len(), 1 + 3 * 4);
        assert_eq!(mask.data().iter().filter(|&&v| v == 255).count(), 8 * 8);
    }

    #[test]
    fn levels_of_an_image_that_is_smaller_than_its_cells_are_left_out() {
        assert_eq!(usable_levels(1920, 1200, 7), Some(7));
        assert_eq!(usable_levels(100, 90, 7), Some(6));
        assert_eq!(usable_levels(1, 5000, 7), Some(0));
        assert_eq!(usable_levels(0, 3, 7), None);
        // At level 7 the cells of the paper's images are of 15 x 9 pixels, some of 15 x 10.
        assert_eq!(Patch { level: 7, column: 3, row: 1 }.pixels(1920, 1200), [45, 60, 9, 18]);
    }

    #[test]
    fn an_error_of_the_classifier_is_passed_on() {
        struct Broken;
        impl PatchClassifier for Broken {
            type Error = &'static str;
            fn classify(&mut self, _: &Raster<[u8; 3]>, _: &[Patch]) -> Result<Vec<bool>, &'static str> {
                Err("no")
            }
        }
        assert_eq!(segment(&Raster::filled(8, 8, [0; 3]), &mut Broken, 2), Err("no"));
    }
}
