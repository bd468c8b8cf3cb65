//! Height models and their difference.

use crate::EvalError;
use nalgebra::Point3;
use serde::Serialize;

/// Most cells of a height model.
const MAX_CELLS: f64 = 1e8;

/// Mean heights z in square cells of x and y.
#[derive(Clone, Debug)]
pub struct HeightModel {
    origin: [f64; 2],
    cell_m: f64,
    columns: usize,
    sums: Vec<(f64, u32)>,
}

impl HeightModel {
    /// An empty model whose cells cover `low` to `high`; two models made with the same arguments can be compared.
    ///
    /// # Errors
    /// [`EvalError::BadOption`] where the cell is not positive, [`EvalError::TooFine`] for more than 100 million cells.
    pub fn new(low: [f64; 2], high: [f64; 2], cell_m: f64) -> Result<Self, EvalError> {
        if !(cell_m > 0.0 && cell_m.is_finite()) {
            return Err(EvalError::BadOption { name: "dem_cell_m", value: cell_m });
        }
        let [columns, rows] = [0, 1].map(|i| ((high[i] - low[i]) / cell_m).floor() + 1.0);
        if !(columns >= 1.0 && rows >= 1.0 && columns * rows <= MAX_CELLS) {
            return Err(EvalError::TooFine {
                what: "cells of the height model",
                cell_m,
                extent_m: (high[0] - low[0]).max(high[1] - low[1]),
            });
        }
        Ok(Self { origin: low, cell_m, columns: columns as usize, sums: vec![(0.0, 0); (columns * rows) as usize] })
    }

    /// Adds points; those outside the cells are left out.
    pub fn add(&mut self, points: &[Point3<f64>]) {
        for p in points {
            let [x, y] = [p.x - self.origin[0], p.y - self.origin[1]].map(|d| (d / self.cell_m).floor());
            if x >= 0.0
                && y >= 0.0
                && x < self.columns as f64
                && let Some((sum, count)) = self.sums.get_mut(y as usize * self.columns + x as usize)
            {
                *sum += p.z;
                *count += 1;
            }
        }
    }

    /// Mean height of each cell, along x first; `None` without points.
    pub fn heights(&self) -> impl Iterator<Item = Option<f64>> + '_ {
        self.sums.iter().map(|&(sum, count)| (count > 0).then(|| sum / f64::from(count)))
    }
}

/// Difference of two height models, the second minus the first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HeightDifference {
    /// Edge of a cell, metres.
    pub cell_m: f64,
    /// Differences smaller than this count for nothing in the volumes: the level of detection, metres.
    pub detection_m: f64,
    /// Cells with heights in both.
    pub cells: usize,
    /// Their area, square metres.
    pub area_m2: f64,
    /// Cells with a height in the first only.
    pub only_first: usize,
    /// Cells with a height in the second only.
    pub only_second: usize,
    /// Mean difference, metres.
    pub mean_m: f64,
    /// Root of the mean squared difference, metres.
    pub rms_m: f64,
    /// Volume where the second lies above the first, cubic metres.
    pub raised_m3: f64,
    /// Volume where the second lies below the first, cubic metres, positive.
    pub lowered_m3: f64,
    /// Raised less lowered, cubic metres.
    pub net_m3: f64,
}

/// DEM of difference (Wheaton et al., *Accounting for uncertainty in DEMs from repeat topographic surveys*, Earth Surface
/// Processes and Landforms, 2010): dz = z2 - z1 per cell, volumes are sums of |dz| times the area of a cell over cells with
/// |dz| at least `detection_m`.
///
/// # Errors
/// [`EvalError::BadCount`] where the models differ in their cells or no cell has a height in both;
/// [`EvalError::BadOption`] for a negative level of detection.
pub fn height_difference(first: &HeightModel, second: &HeightModel, detection_m: f64) -> Result<HeightDifference, EvalError> {
    if !(detection_m >= 0.0 && detection_m.is_finite()) {
        return Err(EvalError::BadOption { name: "detection_m", value: detection_m });
    }
    let same = first.origin == second.origin && first.cell_m == second.cell_m && first.columns == second.columns;
    let (mut both, mut only_first, mut only_second) = (Vec::new(), 0, 0);
    for pair in first.heights().zip(second.heights()) {
        match pair {
            (Some(a), Some(b)) => both.push(b - a),
            (Some(_), None) => only_first += 1,
            (None, Some(_)) => only_second += 1,
            (None, None) => {}
        }
    }
    if !same || first.sums.len() != second.sums.len() || both.is_empty() {
        return Err(EvalError::BadCount { found: second.sums.len(), truth: first.sums.len(), needed: 1 });
    }
    let (n, cell_area) = (both.len() as f64, first.cell_m * first.cell_m);
    let volume = |sign: f64| both.iter().map(|d| d * sign).filter(|&d| d > 0.0 && d >= detection_m).sum::<f64>() * cell_area;
    let (raised_m3, lowered_m3) = (volume(1.0), volume(-1.0));
    Ok(HeightDifference {
        cell_m: first.cell_m,
        detection_m,
        cells: both.len(),
        area_m2: n * cell_area,
        only_first,
        only_second,
        mean_m: both.iter().sum::<f64>() / n,
        rms_m: (both.iter().map(|d| d * d).sum::<f64>() / n).sqrt(),
        raised_m3,
        lowered_m3,
        net_m3: raised_m3 - lowered_m3,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(z: impl Fn(f64, f64) -> f64) -> HeightModel {
        let mut model = HeightModel::new([-2.0, -2.0], [1.99, 1.99], 0.02).expect("cells");
        let at = |k: usize| -2.0 + 0.02 * (k as f64 + 0.5);
        let points: Vec<_> = (0..40_000).map(|k| (at(k % 200), at(k / 200))).map(|(x, y)| Point3::new(x, y, z(x, y))).collect();
        model.add(&points);
        model
    }

    #[test]
    fn slab_and_hemisphere_have_their_volumes() {
        let flat = model(|_, _| 0.5);
        let slab = height_difference(&flat, &model(|x, _| if x < 0.0 { 0.6 } else { 0.3 }), 0.0).expect("comparable");
        assert!(
            (slab.raised_m3 - 0.8).abs() < 1e-9 && (slab.lowered_m3 - 1.6).abs() < 1e-9 && (slab.net_m3 + 0.8).abs() < 1e-9,
            "{slab:?}"
        );
        assert!((slab.mean_m + 0.05).abs() < 1e-9 && (slab.rms_m - 0.025f64.sqrt()).abs() < 1e-9 && (slab.area_m2 - 16.0).abs() < 1e-9);
        let detected = height_difference(&flat, &model(|x, _| if x < 0.0 { 0.6 } else { 0.3 }), 0.15).expect("comparable");
        assert_eq!(detected.raised_m3, 0.0);
        // 2/3 pi r^3; cells of a hundredth of the diameter sum it to 1e-3.
        let dome = height_difference(&flat, &model(|x, y| 0.5 + (1.0 - x * x - y * y).max(0.0).sqrt()), 0.0).expect("comparable");
        assert!((dome.raised_m3 / (2.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{dome:?}");
    }

    #[test]
    fn what_cannot_be_compared_is_an_error() {
        let empty = HeightModel::new([-2.0, -2.0], [1.99, 1.99], 0.02).expect("cells");
        assert!(height_difference(&model(|_, _| 0.0), &empty, 0.0).is_err());
        assert!(HeightModel::new([0.0; 2], [1e6; 2], 1e-3).is_err() && HeightModel::new([0.0; 2], [1.0; 2], f64::NAN).is_err());
    }
}
