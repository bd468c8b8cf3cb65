//! Masks that were drawn elsewhere, and the figures of a mask.

use crate::MaskError;
use scene::{Mask, Raster};

/// The mask in a grey image of `width` x `height` pixels: values above 127 are structure.
///
/// # Errors
/// [`MaskError::Size`] where the image has another size.
pub fn mask_from_file(grey: &Raster<u8>, (width, height): (usize, usize)) -> Result<Mask, MaskError> {
    if (grey.width(), grey.height()) != (width, height) {
        return Err(MaskError::Size {
            found_width: grey.width(),
            found_height: grey.height(),
            expected_width: width,
            expected_height: height,
        });
    }
    Ok(grey.map(|&v| if v > 127 { 255 } else { 0 }))
}

/// Share of structure among all pixels, 0..=1; 0 for a mask without pixels.
#[must_use]
pub fn structure_share(mask: &Mask) -> f64 {
    let structure = mask.data().iter().filter(|&&v| v > 127).count();
    structure as f64 / mask.data().len().max(1) as f64
}

/// The masked ratio M of Rofallski et al. 2020, table 6: the share of pixels that a mask takes away, 0..=1.
#[must_use]
pub fn masked_ratio(mask: &Mask) -> f64 {
    1.0 - structure_share(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_above_127_are_structure() {
        let grey = Raster::from_vec(4, 1, vec![0, 127, 128, 255]).expect("four values");
        let mask = mask_from_file(&grey, (4, 1)).expect("same size");
        assert_eq!(mask.data(), [0, 0, 255, 255]);
        assert_eq!((structure_share(&mask), masked_ratio(&mask)), (0.5, 0.5));
    }

    #[test]
    fn another_size_is_an_error_that_names_both() {
        let error = mask_from_file(&Raster::filled(30, 20, 0), (60, 40)).expect_err("sizes differ");
        assert_eq!(error.to_string(), "the mask has 30 x 20 pixels, its image 60 x 40");
        assert_eq!(structure_share(&Raster::filled(0, 0, 0)), 0.0);
    }
}
