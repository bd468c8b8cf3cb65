//! How well the adjusted parameters are determined.

use super::error::AdjustError;
use super::inverse::Inverse;
use super::layout::{Layout, Owner};
use super::lengths::{KeptNormal, mean_bend};
use super::linearise::Linearised;
use super::options::Loss;
use super::pattern::{PACKED_UNKNOWNS, Pattern};
use super::problem::Problem;
use super::schur::Reduced;
use super::state::State;
use nalgebra::{DMatrix, Matrix3, Matrix6};
use rayon::prelude::*;
use scene::camera::MAX_CAMERA_PARAMS;

/// The covariance of the parameters at an optimum, and what each observation of few contributes to the redundancy.
///
/// Cov = (J^T J)^-1 with the residuals divided by their given standard deviations: right where these are, and where nothing was robustified;
/// see [`CovarianceOptions::loss`]. It is exact, of the whole system, whatever its size: no approximation takes its place. What is not free,
/// or what no residual depends on, has none.
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
    /// By how much the residual of each baseline changes on average, to second order, when its ends move with this covariance. The norm of
    /// several is the number of standard deviations by which the optimum may be displaced (cf. the intrinsic curvature of Bates & Watts,
    /// *J. Royal Statistical Society* B 42, 1980). Well below 1 the covariance holds; above, errors are larger than it says: where a
    /// camera is across the line to another, a distance tells by its bend only, and that is the same on either side of the line.
    pub baseline_bends: Vec<f64>,
}

/// What a covariance is computed with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CovarianceOptions {
    /// Loss of the image observations: each counts with its robust weight, rho' of its residual. That states too much rather than too little
    /// where errors are normal: variances 1.27 times those of what the loss leads to for [`Loss::Cauchy`] of 2 sigma, and 1.6 times for
    /// 1 sigma (Huber & Ronchetti, *Robust statistics*, 2009, 7.6, for residuals in the plane). Variances are exact for
    /// [`Loss::Trivial`], once wrong observations are taken out and the rest is adjusted without a loss. Default that.
    pub loss: Loss,
    /// Loss of each position, direction and heading: see [`super::AdjustOptions::sensor_loss`]. Default none.
    pub sensor_loss: Loss,
    /// The most memory that the inverse may take, bytes. An inverse without zeros takes 4 bytes n^2 for n unknowns of frames, sensors,
    /// cameras and points of lengths; one of a sequence without loops takes far less. Default 4 GiB: 32,000 unknowns.
    pub max_bytes: u64,
}

impl Default for CovarianceOptions {
    fn default() -> Self {
        Self { loss: Loss::Trivial, sensor_loss: Loss::Trivial, max_bytes: 4 << 30 }
    }
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
    /// The inverse of the reduced system does not fit.
    #[error("the inverse of a system of {unknowns} unknowns takes {bytes} bytes, of which {allowed} are allowed")]
    TooLarge {
        /// Its size.
        unknowns: usize,
        /// What it would take.
        bytes: u64,
        /// [`CovarianceOptions::max_bytes`].
        allowed: u64,
    },
}

/// The covariance of the free parameters of a problem at its values, which should be those of an optimum.
///
/// The world must be fixed by what is held or observed. The result is the same to the bit whatever the number of threads.
///
/// # Errors
/// [`CovarianceError`].
pub fn covariance(problem: &Problem, options: &CovarianceOptions) -> Result<Covariance, CovarianceError> {
    let mut system = Normal::new(problem, options)?;
    let pattern = system.pattern(options)?;
    let inverse = system.invert(pattern)?;
    Ok(system.collect(problem, &inverse, options))
}

/// The normal equations of a problem at its values, without damping.
pub(super) struct Normal {
    pub layout: Layout,
    state: State,
    linear: Linearised,
    pub kept: KeptNormal,
    /// C_p^-1 of each point, once the system was reduced.
    point_inverse: Vec<[f64; 6]>,
}

impl Normal {
    pub fn new(problem: &Problem, options: &CovarianceOptions) -> Result<Self, CovarianceError> {
        super::error::validate(problem)?;
        let mut state = State::new(problem);
        let layout = Layout::new(problem, &mut state);
        state.load_points(problem, &layout);
        let mut linear = Linearised::new(&layout);
        let mut kept = KeptNormal::new(problem, &layout, &state, &options.loss, options.sensor_loss);
        linear.update(&layout, &state, &options.loss, true);
        linear.forget_pieces();
        kept.update(problem, &layout, &state, &options.loss);
        Ok(Self { layout, state, linear, kept, point_inverse: Vec::new() })
    }

    /// A pattern whose inverse can be had, of which some blocks may be left out.
    fn pattern(&self, options: &CovarianceOptions) -> Result<Pattern, CovarianceError> {
        Pattern::invertible(&self.layout, &self.kept, options.max_bytes as f64 / 8.0).map_err(|values| self.too_large(values, options))
    }

    /// A pattern whose inverse can be had whole.
    pub fn packed(&self, options: &CovarianceOptions) -> Result<Pattern, CovarianceError> {
        let packed = Pattern::packed(&self.layout, PACKED_UNKNOWNS);
        let fits = packed.len() as u64 <= options.max_bytes / 8;
        if fits { Ok(packed) } else { Err(self.too_large(packed.len() as f64, options)) }
    }

    fn too_large(&self, values: f64, options: &CovarianceOptions) -> CovarianceError {
        CovarianceError::TooLarge { unknowns: self.layout.unknowns(), bytes: (8.0 * values) as u64, allowed: options.max_bytes }
    }

    /// The reduced system.
    pub fn reduce(&self, pattern: Pattern) -> Reduced {
        let mut reduced = Reduced::with_pattern(&self.layout, pattern, rayon::current_num_threads());
        reduced.build(&self.layout, &self.linear, &self.kept, f64::INFINITY, true);
        reduced
    }

    /// The inverse of the reduced system.
    pub fn invert(&mut self, pattern: Pattern) -> Result<Inverse, CovarianceError> {
        let reduced = self.reduce(pattern);
        self.invert_reduced(reduced)
    }

    pub fn invert_reduced(&mut self, mut reduced: Reduced) -> Result<Inverse, CovarianceError> {
        self.point_inverse = std::mem::take(&mut reduced.point_inverse);
        Inverse::new(&self.layout, reduced).ok_or(CovarianceError::Singular)
    }
}

impl Normal {
    /// C^-1 + C^-1 W^T S^-1 W C^-1.
    fn point(&self, inverse: &Inverse, s: usize) -> Matrix3<f64> {
        let layout = &self.layout;
        let [c00, c10, c11, c20, c21, c22] = self.point_inverse[s];
        let own = Matrix3::new(c00, c10, c20, c10, c11, c21, c20, c21, c22);
        let range = layout.slots[s].first_incidence as usize..layout.slots[s + 1].first_incidence as usize;
        let incidences = &layout.incidences[range];
        let mut middle = Matrix3::zeros();
        for (k, a) in incidences.iter().enumerate() {
            let dim_a = layout.dim(a.block as usize);
            let w_a = &self.linear.w[a.w..a.w + 3 * dim_a];
            for b in &incidences[k..] {
                let w_b = &self.linear.w[b.w..b.w + 3 * layout.dim(b.block as usize)];
                let product = inverse.weighted(a.block as usize, w_a, b.block as usize, w_b);
                middle += product;
                if a.block != b.block {
                    middle += product.transpose();
                }
            }
        }
        own + own * middle * own
    }

    pub fn collect(&self, problem: &Problem, inverse: &Inverse, options: &CovarianceOptions) -> Covariance {
        let Self { layout, state, kept, .. } = self;
        let mut covariance = Covariance {
            frames: vec![None; problem.frames.len()],
            sensors: vec![None; problem.sensors.len()],
            cameras: vec![None; problem.cameras.len()],
            points: vec![None; problem.points.len()],
            redundancy: Vec::new(),
            total_redundancy: 0.0,
            baseline_bends: Vec::new(),
        };
        for (a, &owner) in layout.owners.iter().enumerate() {
            let square = inverse.between(layout, a, a).unwrap_or_default();
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
        let of_points: Vec<Matrix3<f64>> = free.par_iter().with_min_len(64).map(|&s| self.point(inverse, s)).collect();
        for (&s, matrix) in free.iter().zip(of_points) {
            covariance.points[layout.slots[s].point as usize] = Some(matrix);
        }
        let observations = layout.obs.len() + layout.kept_observations.len();
        let variance = |blocks: &[u32], gradients: &[[f64; MAX_CAMERA_PARAMS]]| {
            let parts = || blocks.iter().map(|&a| a as usize).zip(gradients).map(|(a, u)| (a, &u[..layout.dim(a)]));
            parts().flat_map(|u| parts().map(move |v| inverse.product(u, v))).sum::<f64>()
        };
        let mut rows = 0;
        kept.visit_rows(problem, layout, state, &options.loss, |blocks, gradients| {
            rows += 1;
            covariance.redundancy.push(1.0 - variance(blocks, gradients));
        });
        covariance.baseline_bends = problem.baselines.iter().map(|b| mean_bend(layout, state, b, variance)).collect();
        // Observations of kept points come last, and are image observations.
        covariance.redundancy.truncate(rows - 2 * layout.kept_observations.len());
        let unknowns = layout.unknowns() + 3 * free.len();
        covariance.total_redundancy = (2 * observations + covariance.redundancy.len()) as f64 - unknowns as f64;
        covariance
    }
}

fn pose_matrix(square: &DMatrix<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|i, j| square[(i, j)])
}
