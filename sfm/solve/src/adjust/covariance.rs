//! How well the adjusted parameters are determined.

use super::conjugate::System;
use super::error::AdjustError;
use super::layout::{Layout, Owner};
use super::lengths::KeptNormal;
use super::linearise::Linearised;
use super::options::Loss;
use super::pattern::{Kind, Pattern};
use super::problem::Problem;
use super::schur::Reduced;
use super::solve_reduced::Solver;
use super::state::State;
use nalgebra::{DMatrix, Matrix3, Matrix6};
use rayon::prelude::*;

/// Columns of the inverse that are solved for at once.
const BATCH: usize = 48;
/// A parameter of which the others explain all but this share of its weight is not determined: the world floats.
const SINGULAR_SHARE: f64 = 1e-12;

/// The covariance of the parameters at an optimum, and what each observation of few contributes to the redundancy.
///
/// Cov = (J^T J)^-1 with the residuals divided by their given standard deviations: right where these are. What is not free, or what no
/// residual depends on, has none. Elements of different blocks that no residual joins are not computed.
#[derive(Clone, Debug, PartialEq)]
pub struct Covariance {
    /// Of each free frame: of the step (w, d) of [`super::PoseBlock`], radians and the unit of the world.
    pub frames: Vec<Option<Matrix6<f64>>>,
    /// Of each free sensor, alike.
    pub sensors: Vec<Option<Matrix6<f64>>>,
    /// Of the free parameters of each camera, in order.
    pub cameras: Vec<Option<DMatrix<f64>>>,
    /// Of each free point.
    pub points: Vec<Option<Matrix3<f64>>>,
    /// Part of the redundancy of each scalar residual that is not an image observation, in the order baselines, scale bars, axes of
    /// control points, priors of frames, sensors and camera parameters, axes of positions, directions (two each), headings: 1
    /// where the rest of the problem says nothing of it less than a hundred times better, 0 where nothing checks it (Baarda 1968).
    pub redundancy: Vec<f64>,
    /// Number of scalar residuals minus the number of unknowns.
    pub total_redundancy: f64,
}

/// Why there is no covariance.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CovarianceError {
    /// The problem is wrong in itself.
    #[error(transparent)]
    Adjust(#[from] AdjustError),
    /// Nothing fixes the position, the orientation or the scale of the world, or a block hangs free.
    #[error("the observations do not determine all parameters: hold a frame, and give a length")]
    Singular,
    /// The reduced system fills up.
    #[error("a reduced system of {unknowns} unknowns fills up: its inverse would take too long")]
    TooLarge {
        /// Its size.
        unknowns: usize,
    },
}

/// The covariance of the free parameters of a problem at its values, which should be those of an optimum.
///
/// The world must be fixed by what is held or observed. The result is the same to the bit whatever the number of threads.
///
/// # Errors
/// [`CovarianceError`].
pub fn covariance(problem: &Problem, loss: &Loss) -> Result<Covariance, CovarianceError> {
    super::error::validate(problem)?;
    let mut state = State::new(problem);
    let layout = Layout::new(problem, &mut state);
    state.load_points(problem, &layout);
    let mut linear = Linearised::new(&layout);
    let mut kept = KeptNormal::new(problem, &layout, &state, loss, Loss::Trivial);
    linear.update(&layout, &state, loss, true);
    kept.update(problem, &layout, &state, loss);
    let pattern = Pattern::new(&layout, &kept);
    if matches!(pattern.kind, Kind::Clusters(_)) {
        return Err(CovarianceError::TooLarge { unknowns: layout.unknowns() });
    }
    let mut reduced = Reduced::with_pattern(&layout, pattern, rayon::current_num_threads());
    reduced.build(&layout, &linear, &kept, f64::INFINITY, true);
    let diagonal = diagonal(&layout, &reduced);
    let mut solver = Solver::new(&layout, &reduced.pattern)?;
    let system = System { layout: &layout, linear: &linear, kept: &kept, parallel: true };
    if !solver.solve(&system, &mut reduced) {
        return Err(CovarianceError::Singular);
    }
    let inverse = Inverse::new(&layout, &solver, &reduced).ok_or(CovarianceError::Singular)?;
    // The part of each parameter that the others do not explain, against all of it.
    let weak = (0..layout.unknowns()).any(|u| {
        let a = layout.offsets.partition_point(|&o| o <= u) - 1;
        let mut unit = [0.0; super::linearise::MAX_ROW];
        unit[u - layout.offsets[a]] = 1.0;
        let unit = &unit[..layout.dim(a)];
        let variance = inverse.product((a, unit), (a, unit));
        !(variance > 0.0 && variance.is_finite() && variance * diagonal[u] * SINGULAR_SHARE < 1.0)
    });
    if weak {
        return Err(CovarianceError::Singular);
    }
    let parts = Collected { layout: &layout, linear: &linear, reduced: &reduced, inverse: &inverse };
    Ok(collect(problem, &parts, &kept, &state, loss))
}

fn diagonal(layout: &Layout, reduced: &Reduced) -> Vec<f64> {
    let pattern = &reduced.pattern;
    let of = |a: usize| {
        let row = pattern.diagonal_row(a);
        (0..layout.dim(a)).map(move |j| (a, row + j, j))
    };
    let values = (0..layout.block_count()).flat_map(of);
    values.map(|(a, row, j)| reduced.values[pattern.panel_start[a] + j * pattern.stride[a] + row]).collect()
}

/// The blocks of the inverse of the reduced system where that has any, in the same panels.
struct Inverse<'a> {
    pattern: &'a Pattern,
    values: Vec<f64>,
}

impl<'a> Inverse<'a> {
    fn new(layout: &Layout, solver: &Solver, reduced: &'a Reduced) -> Option<Self> {
        let (n, pattern) = (layout.unknowns(), &reduced.pattern);
        let mut batches = vec![0];
        for a in 0..layout.block_count() {
            if layout.offsets[a + 1] - layout.offsets[batches[batches.len() - 1]] >= BATCH || a + 1 == layout.block_count() {
                batches.push(a + 1);
            }
        }
        // The columns of some blocks, of which the rows of their panels are kept.
        let of_batch = |w: &[usize]| -> Option<Vec<f64>> {
            let (first, columns) = (layout.offsets[w[0]], layout.offsets[w[1]] - layout.offsets[w[0]]);
            let mut x = vec![0.0; n * columns];
            (0..columns).for_each(|j| x[j * n + first + j] = 1.0);
            solver.solve_again(reduced, &mut x, columns)?;
            let mut panels = Vec::with_capacity(pattern.panel_start[w[1]] - pattern.panel_start[w[0]]);
            for a in w[0]..w[1] {
                for j in 0..layout.dim(a) {
                    let column = &x[(layout.offsets[a] + j - first) * n..][..n];
                    pattern.for_rows(a, |block| panels.extend_from_slice(&column[layout.offsets[block]..layout.offsets[block + 1]]));
                }
            }
            Some(panels)
        };
        let panels: Vec<Option<Vec<f64>>> = batches.par_windows(2).map(of_batch).collect();
        let mut values = Vec::with_capacity(pattern.len());
        for panel in panels {
            values.extend(panel?);
        }
        Some(Self { pattern, values })
    }

    /// Where the block of the rows of `b` and the columns of `a`, which is not behind `b`, begins, and its stride.
    fn block(&self, a: usize, b: usize) -> Option<(usize, usize)> {
        Some((self.pattern.panel_start[a] + self.pattern.row(a, b as u32)?, self.pattern.stride[a]))
    }

    /// v^T Cov u, for parts v and u of two blocks that meet.
    fn product(&self, (a, u): (usize, &[f64]), (b, v): (usize, &[f64])) -> f64 {
        let ((low, of_low), (high, of_high)) = if a <= b { ((a, u), (b, v)) } else { ((b, v), (a, u)) };
        let Some((start, stride)) = self.block(low, high) else { return 0.0 };
        let column = |j: usize| of_high.iter().zip(&self.values[start + j * stride..]).map(|(v, c)| v * c).sum::<f64>();
        of_low.iter().enumerate().map(|(j, u)| u * column(j)).sum()
    }

    fn square(&self, layout: &Layout, a: usize) -> DMatrix<f64> {
        let (dim, (start, stride)) = (layout.dim(a), self.block(a, a).unwrap_or((0, 0)));
        DMatrix::from_fn(dim, dim, |i, j| self.values[start + i.min(j) * stride + i.max(j)])
    }
}

struct Collected<'a> {
    layout: &'a Layout,
    linear: &'a Linearised,
    reduced: &'a Reduced,
    inverse: &'a Inverse<'a>,
}

impl Collected<'_> {
    /// C^-1 + C^-1 W^T S^-1 W C^-1.
    fn point(&self, s: usize) -> Matrix3<f64> {
        let Self { layout, linear, reduced, inverse } = *self;
        let [c00, c10, c11, c20, c21, c22] = reduced.point_inverse[s];
        let own = Matrix3::new(c00, c10, c20, c10, c11, c21, c20, c21, c22);
        let range = layout.slots[s].first_incidence as usize..layout.slots[s + 1].first_incidence as usize;
        let incidences = &layout.incidences[range];
        let mut middle = Matrix3::zeros();
        for (k, a) in incidences.iter().enumerate() {
            let (dim_a, w_a) = (layout.dim(a.block as usize), &linear.w[a.w..]);
            for b in &incidences[k..] {
                let (dim_b, w_b) = (layout.dim(b.block as usize), &linear.w[b.w..]);
                for i in 0..3 {
                    for j in 0..3 {
                        let u = (a.block as usize, &w_a[i * dim_a..(i + 1) * dim_a]);
                        let v = (b.block as usize, &w_b[j * dim_b..(j + 1) * dim_b]);
                        let value = inverse.product(u, v);
                        middle[(i, j)] += value;
                        if a.block != b.block {
                            middle[(j, i)] += value;
                        }
                    }
                }
            }
        }
        own + own * middle * own
    }
}

fn pose_matrix(square: &DMatrix<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| square[(i, j)])
}

fn collect(problem: &Problem, parts: &Collected<'_>, kept: &KeptNormal, state: &State, loss: &Loss) -> Covariance {
    let Collected { layout, inverse, .. } = *parts;
    let mut covariance = Covariance {
        frames: vec![None; problem.frames.len()],
        sensors: vec![None; problem.sensors.len()],
        cameras: vec![None; problem.cameras.len()],
        points: vec![None; problem.points.len()],
        redundancy: Vec::new(),
        total_redundancy: 0.0,
    };
    for (a, &owner) in layout.owners.iter().enumerate() {
        let square = inverse.square(layout, a);
        match owner {
            Owner::Frame(i) => covariance.frames[i as usize] = Some(pose_matrix(&square)),
            Owner::Sensor(i) => covariance.sensors[i as usize] = Some(pose_matrix(&square)),
            Owner::Camera(i) => covariance.cameras[i as usize] = Some(square),
            Owner::Point(i) => {
                covariance.points[layout.kept_points[i as usize] as usize] = Some(Matrix3::from_fn(|i, j| square[(i, j)]));
            }
        }
    }
    let free = (0..layout.slot_count()).filter(|&s| layout.slots[s].free);
    let free: Vec<usize> = free.collect();
    let of_points: Vec<Matrix3<f64>> = free.par_iter().with_min_len(64).map(|&s| parts.point(s)).collect();
    for (&s, matrix) in free.iter().zip(of_points) {
        covariance.points[layout.slots[s].point as usize] = Some(matrix);
    }
    let observations = layout.obs.len() + layout.kept_observations.len();
    let mut rows = 0;
    kept.visit_rows(problem, layout, state, loss, |blocks, gradients| {
        rows += 1;
        let mut leverage = 0.0;
        for (&a, u) in blocks.iter().zip(gradients) {
            for (&b, v) in blocks.iter().zip(gradients) {
                let (a, b) = (a as usize, b as usize);
                leverage += inverse.product((a, &u[..layout.dim(a)]), (b, &v[..layout.dim(b)]));
            }
        }
        covariance.redundancy.push(1.0 - leverage);
    });
    // Observations of kept points come last, and are image observations.
    covariance.redundancy.truncate(rows - 2 * layout.kept_observations.len());
    let unknowns = layout.unknowns() + 3 * free.len();
    covariance.total_redundancy = (2 * observations + covariance.redundancy.len()) as f64 - unknowns as f64;
    covariance
}
