//! Row-major rasters: grey and colour images, masks, depth maps.

/// A row-major raster of `width` x `height` values; (0, 0) is the top-left pixel, whose centre is at (0.5, 0.5).
#[derive(Clone, Debug, PartialEq)]
pub struct Raster<T> {
    width: usize,
    height: usize,
    data: Vec<T>,
}

/// Which pixels take part: 255 structure, 0 background.
pub type Mask = Raster<u8>;

impl<T: Clone> Raster<T> {
    /// A raster of one value.
    #[must_use]
    pub fn filled(width: usize, height: usize, value: T) -> Self {
        Self { width, height, data: vec![value; width * height] }
    }
}

impl<T> Raster<T> {
    /// A raster over existing values, row after row; `None` when their number is not `width * height`.
    #[must_use]
    pub fn from_vec(width: usize, height: usize, data: Vec<T>) -> Option<Self> {
        (width.checked_mul(height)? == data.len()).then_some(Self { width, height, data })
    }

    /// Number of columns.
    #[must_use]
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    #[must_use]
    pub fn height(&self) -> usize {
        self.height
    }

    /// All values, row after row.
    #[must_use]
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, row after row.
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The values of row `y`.
    ///
    /// # Panics
    /// When `y` is not below the height.
    #[must_use]
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width..(y + 1) * self.width]
    }

    /// The values of row `y`.
    ///
    /// # Panics
    /// When `y` is not below the height.
    pub fn row_mut(&mut self, y: usize) -> &mut [T] {
        &mut self.data[y * self.width..(y + 1) * self.width]
    }

    /// The value at column `x` and row `y`, or `None` outside.
    #[must_use]
    pub fn get(&self, x: usize, y: usize) -> Option<&T> {
        if x < self.width && y < self.height { self.data.get(y * self.width + x) } else { None }
    }

    /// The value at the pixel that contains the point (x, y) in pixel coordinates, or `None` outside.
    #[must_use]
    pub fn at_point(&self, x: f64, y: f64) -> Option<&T> {
        if x >= 0.0 && y >= 0.0 { self.get(x as usize, y as usize) } else { None }
    }

    /// The values, row after row.
    #[must_use]
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }

    /// A raster of the same size with every value replaced.
    #[must_use]
    pub fn map<U>(&self, f: impl FnMut(&T) -> U) -> Raster<U> {
        Raster { width: self.width, height: self.height, data: self.data.iter().map(f).collect() }
    }
}

impl<T> std::ops::Index<(usize, usize)> for Raster<T> {
    type Output = T;
    /// The value at (column, row).
    fn index(&self, (x, y): (usize, usize)) -> &T {
        &self.row(y)[x]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Raster<T> {
    /// The value at (column, row).
    fn index_mut(&mut self, (x, y): (usize, usize)) -> &mut T {
        &mut self.row_mut(y)[x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_fall_into_their_pixel() {
        let raster = Raster::from_vec(2, 2, vec![1, 2, 3, 4]).expect("four values");
        assert_eq!(raster.at_point(0.99, 0.0), Some(&1));
        assert_eq!(raster.at_point(1.0, 1.5), Some(&4));
        assert_eq!(raster.at_point(-0.1, 0.5), None);
        assert_eq!(raster.at_point(2.0, 0.5), None);
        assert_eq!(raster.at_point(f64::NAN, 0.5), None);
    }
}
