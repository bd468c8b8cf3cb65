//! One way through a cloud, piece by piece, for all that its figures need.

use crate::cloud_metrics::{EachDistance, EvalOptions};
use crate::distance::{Index, Reference, Ruler, check_positions};
use crate::grid::{Cells, occupied};
use crate::points::Points;
use crate::{EvalError, hilbert, surface, warnings};
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;

/// What was gathered.
pub(crate) struct Gathered {
    /// Signed or unsigned distances in the order of the cloud.
    pub distances: Vec<f64>,
    /// Points within R of all the points at which the density was sampled.
    pub density_neighbours: u64,
    pub density_samples: usize,
    /// Squared distance of each sample of the reference to the cloud; infinite beyond the largest threshold.
    pub reference_squared: Vec<f64>,
    pub cells_found: usize,
    pub cells_true: usize,
    pub cells_common: usize,
    pub warnings: Vec<String>,
}

/// Goes through the cloud three times: for its size, for the samples of the density, for everything else. `scales`:
/// threshold, radius of the density, cell of the integrity, largest threshold.
pub(crate) fn gather(
    points: &dyn Points,
    reference: &Reference,
    ruler: &Ruler<'_>,
    scales: [f64; 4],
    options: &EvalOptions,
    each: &mut EachDistance<'_>,
) -> Result<Gathered, EvalError> {
    let [threshold, radius, grid, largest] = scales;
    let (count, bounds) = survey(points)?;
    let samples = density_samples(points, count, options.max_density_samples)?;
    let targets = reference_samples(reference, threshold, options)?;
    let (cells, truth) = true_cells(reference, grid, threshold, options)?;
    let warnings = warnings::of_positions(&samples, &targets, bounds, largest);
    let mut distances = Vec::with_capacity(count);
    let mut found: Vec<u64> = Vec::new();
    let mut squared = vec![largest * largest * (1.0 + 1e-12); targets.len()];
    let mut neighbours = 0;
    points.visit(&mut |piece| {
        let measured = ruler.distances(piece)?;
        each(piece, &measured)?;
        let signal: Vec<Point3<f64>> = piece.iter().zip(&measured).filter(|(_, d)| d.abs() <= threshold).map(|(p, _)| *p).collect();
        found = union(&found, &occupied(cells, &signal));
        let origin = piece[0];
        let index = Index::new(origin, piece.iter().map(|p| p - origin).collect());
        neighbours += count_within(&index, &samples, radius);
        squared.par_iter_mut().zip(&targets).with_min_len(256).for_each(|(best, target)| {
            if let Some(found) = index.nearest_below(&(target - origin), *best) {
                *best = found.squared;
            }
        });
        distances.extend(measured);
        Ok(())
    })?;
    if distances.len() != count {
        return Err(EvalError::Input(format!("the cloud had {count} points at first and {} later", distances.len())));
    }
    let beyond = largest * largest * (1.0 + 1e-12);
    squared.iter_mut().filter(|s| **s >= beyond).for_each(|s| *s = f64::INFINITY);
    let cells_common = found.iter().filter(|key| truth.binary_search(key).is_ok()).count();
    Ok(Gathered {
        distances,
        density_neighbours: neighbours,
        density_samples: samples.len(),
        reference_squared: squared,
        cells_found: found.len(),
        cells_true: truth.len(),
        cells_common,
        warnings,
    })
}

/// Smallest and largest coordinates.
type Bounds = (Point3<f64>, Point3<f64>);

/// Number of points and their box.
fn survey(points: &dyn Points) -> Result<(usize, Bounds), EvalError> {
    let (mut count, mut all) = (0, None);
    points.visit(&mut |piece| {
        check_positions("point", piece, &Point3::origin()).map_err(|e| match e {
            EvalError::BadPosition { what, index, position } => EvalError::BadPosition { what, index: index + count, position },
            other => other,
        })?;
        let (low, high) = hilbert::bounds(piece);
        let (a, b) = all.unwrap_or((low, high));
        all = Some((low.inf(&a), high.sup(&b)));
        count += piece.len();
        Ok(())
    })?;
    all.map(|bounds| (count, bounds)).ok_or(EvalError::EmptyCloud)
}

/// One point of every run of k points, k being the smallest that gives at most `max`; which one, a hash of the run decides,
/// so that rows of a regular cloud do not beat with k. In an order that keeps neighbours together.
fn density_samples(points: &dyn Points, count: usize, max: usize) -> Result<Vec<Point3<f64>>, EvalError> {
    let stride = count.div_ceil(max.max(1));
    let pick = |run: usize| run * stride + splitmix(run as u64) as usize % stride.min(count - run * stride);
    let mut samples = Vec::with_capacity(count.div_ceil(stride));
    let mut start = 0;
    points.visit(&mut |piece| {
        while samples.len() * stride < count {
            let next = pick(samples.len());
            match next.checked_sub(start).and_then(|i| piece.get(i)) {
                Some(p) => samples.push(*p),
                None => break,
            }
        }
        start += piece.len();
        Ok(())
    })?;
    Ok(hilbert::order(&samples).into_iter().map(|i| samples[i as usize]).collect())
}

/// SplitMix64 (Steele, Lea & Flood, *Fast splittable pseudorandom number generators*, OOPSLA 2014).
fn splitmix(seed: u64) -> u64 {
    let z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ z >> 31
}

/// Integers, so that no order matters.
fn count_within(index: &Index<Vector3<f64>>, samples: &[Point3<f64>], radius: f64) -> u64 {
    let one = |p: &Point3<f64>| {
        let mut count = 0;
        index.within(&(p - index.origin), radius, |_, _| count += 1);
        count
    };
    samples.par_chunks(256).map(|run| run.iter().map(one).sum::<u64>()).sum()
}

/// Points that stand for the reference: evenly over the area of a mesh, all of a cloud; cut to the region.
fn reference_samples(reference: &Reference, threshold: f64, options: &EvalOptions) -> Result<Vec<Point3<f64>>, EvalError> {
    let mut samples = match reference {
        Reference::Mesh(mesh) => {
            // Four samples for each disc of the threshold's radius resolve its coverage; more tell nothing new.
            let wanted = 4.0 * surface::area(mesh) / (threshold * threshold);
            surface::sample(mesh, (wanted as usize).clamp(1000, options.max_completeness_samples.max(1000)))
        }
        Reference::Cloud(other) => other.positions.clone(),
    };
    if samples.is_empty() {
        return Err(EvalError::EmptyReference("the mesh has no area"));
    }
    if let Some(region) = &options.region {
        samples.retain(|p| region.contains(p));
        if samples.is_empty() {
            return Err(EvalError::EmptyReference("nothing of it lies in the region"));
        }
    }
    Ok(samples)
}

/// Cells of the integrity, and those that the reference passes through.
fn true_cells(reference: &Reference, grid: f64, threshold: f64, options: &EvalOptions) -> Result<(Cells, Vec<u64>), EvalError> {
    let positions = match reference {
        Reference::Mesh(mesh) => &mesh.vertices,
        Reference::Cloud(other) => &other.positions,
    };
    let (min, max) = hilbert::bounds(positions);
    // One cell is centred on the corner of the reference; whole cells are added for the points beside it.
    let margin = (threshold / grid).ceil() * grid;
    let cells = Cells::distinct("cells of the integrity", min.map(|c| c - margin), max.map(|c| c + margin), grid)?;
    let mut truth = match reference {
        Reference::Mesh(mesh) => surface::raster(mesh, cells)?,
        Reference::Cloud(other) => occupied(cells, &other.positions),
    };
    if let Some(region) = &options.region {
        truth.retain(|key| region.contains(&cells.centre(*key)));
        if truth.is_empty() {
            return Err(EvalError::EmptyReference("no cell of the integrity lies in the region"));
        }
    }
    Ok((cells, truth))
}

/// Both ascending lists as one.
fn union(a: &[u64], b: &[u64]) -> Vec<u64> {
    let (mut i, mut j) = (0, 0);
    let mut out = Vec::with_capacity(a.len().max(b.len()));
    while i < a.len() || j < b.len() {
        let (x, y) = (a.get(i).copied().unwrap_or(u64::MAX), b.get(j).copied().unwrap_or(u64::MAX));
        out.push(x.min(y));
        i += usize::from(x <= y);
        j += usize::from(y <= x);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use scene::Cloud;

    #[test]
    fn one_sample_of_every_run_is_taken() {
        let positions: Vec<_> = (0..1003).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        let cloud = Cloud { positions, ..Cloud::default() };
        let mut samples: Vec<f64> = density_samples(&cloud, 1003, 100).expect("points").iter().map(|p| p.x).collect();
        samples.sort_unstable_by(f64::total_cmp);
        // Runs of eleven; the last has two points.
        assert_eq!(samples.len(), 92);
        assert!(samples.iter().enumerate().all(|(i, x)| *x >= 11.0 * i as f64 && *x < 11.0 * (i + 1) as f64), "{samples:?}");
        assert_eq!(density_samples(&cloud, 1003, 5000).expect("points").len(), 1003);
    }

    #[test]
    fn unions_hold_every_key_once() {
        assert_eq!(union(&[1, 4, 9], &[2, 4, 10, 11]), [1, 2, 4, 9, 10, 11]);
        assert_eq!((union(&[], &[3]), union(&[3], &[])), (vec![3], vec![3]));
    }
}
