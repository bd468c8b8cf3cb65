//! Rotations of all nodes from rotations between pairs.

use super::components::{components, root};
use super::laplacian::Laplacian;
use crate::lie::{so3_exp, so3_log};
use nalgebra::UnitQuaternion;
use thiserror::Error;

/// Weights of the sum of absolute values do not grow beyond that of a residual of this many radians.
const LEAST_RESIDUAL_RAD: f64 = 1e-4;

/// A measured rotation between two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RelativeRotation {
    /// One node.
    pub a: usize,
    /// The other.
    pub b: usize,
    /// `R_b R_a^-1`, where R is `node_from_world`.
    pub b_from_a: UnitQuaternion<f64>,
    /// How much it counts, positive; of edges between the same nodes, the larger starts.
    pub weight: f64,
}

/// How rotations are averaged.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AveragingOptions {
    /// Rounds that minimise the sum of the angles.
    pub l1_rounds: usize,
    /// Rounds that minimise the sum of a function of the angles that levels off.
    pub robust_rounds: usize,
    /// Where that function levels off, radians.
    pub robust_scale_rad: f64,
    /// Stop when the rotations change by less than this on average, radians.
    pub tolerance_rad: f64,
}

impl Default for AveragingOptions {
    fn default() -> Self {
        Self { l1_rounds: 10, robust_rounds: 100, robust_scale_rad: 5f64.to_radians(), tolerance_rad: 1e-6 }
    }
}

/// Rotations that agree best with the measured ones.
#[derive(Clone, Debug, PartialEq)]
pub struct AveragedRotations {
    /// `node_from_world` of each node; that of node 0 is the identity.
    pub rotations: Vec<UnitQuaternion<f64>>,
    /// The angle by which each measured rotation deviates, radians.
    pub residuals_rad: Vec<f64>,
    /// Rounds made.
    pub rounds: usize,
}

/// Why rotations could not be averaged.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum AveragingError {
    /// An edge is not one between two nodes that exist, or not a number.
    #[error("edge {0} is not one between two nodes")]
    BadEdge(usize),
    /// No chain of edges leads to a node.
    #[error("node {0} is not connected with the first")]
    NotConnected(usize),
    /// The linear system could not be solved.
    #[error("the system of {0} rotations could not be solved")]
    Unsolvable(usize),
}

/// Averages rotations over a connected graph, tolerating wrong edges.
///
/// From a maximum spanning tree, by rounds of a linear problem: with R <- R exp(w) the edge wants `w_b - w_a = log(R_b^-1 M R_a)`, the same
/// graph Laplacian for each axis. Weights first minimise the sum of absolute values, then that of s^2 r^2 / (s^2 + r^2) (Geman & McClure):
/// Chatterjee & Govindu, *Efficient and robust large-scale rotation averaging*, ICCV 2013, with iterative reweighting in both parts.
///
/// # Errors
/// [`AveragingError`].
pub fn average_rotations(
    nodes: usize,
    edges: &[RelativeRotation],
    options: &AveragingOptions,
) -> Result<AveragedRotations, AveragingError> {
    let is_bad = |e: &RelativeRotation| {
        e.a == e.b || e.a.max(e.b) >= nodes || !e.b_from_a.coords.iter().all(|x| x.is_finite()) || !(e.weight > 0.0 && e.weight.is_finite())
    };
    if let Some(bad) = edges.iter().position(is_bad) {
        return Err(AveragingError::BadEdge(bad));
    }
    let parts = components(nodes, edges.iter().map(|e| (e.a, e.b)));
    if let Some(apart) = parts.iter().find(|part| part[0] != 0) {
        return Err(AveragingError::NotConnected(apart[0]));
    }
    let mut rotations = spanning_tree(nodes, edges);
    let mut rounds = 0;
    if nodes > 1 {
        let unsolvable = AveragingError::Unsolvable(nodes);
        let mut laplacian = Laplacian::new(nodes, edges.iter().map(|e| (e.a, e.b)).collect()).ok_or(unsolvable.clone())?;
        let s2 = options.robust_scale_rad.powi(2);
        let absolute = |r: f64| 1.0 / r.max(LEAST_RESIDUAL_RAD);
        let levelling = |r: f64| (s2 / (s2 + r * r)).powi(2);
        for (most, weigh) in [(options.l1_rounds, &absolute as &dyn Fn(f64) -> f64), (options.robust_rounds, &levelling)] {
            for _ in 0..most {
                rounds += 1;
                if round(&mut laplacian, edges, &mut rotations, weigh).ok_or(unsolvable.clone())? < options.tolerance_rad {
                    break;
                }
            }
        }
    }
    let residuals_rad = edges.iter().map(|e| residual(&rotations, e).norm()).collect();
    Ok(AveragedRotations { rotations, residuals_rad, rounds })
}

/// One linear step; returns the mean change.
fn round(
    laplacian: &mut Laplacian,
    edges: &[RelativeRotation],
    rotations: &mut [UnitQuaternion<f64>],
    weigh: &dyn Fn(f64) -> f64,
) -> Option<f64> {
    let residuals: Vec<nalgebra::Vector3<f64>> = edges.iter().map(|e| residual(rotations, e)).collect();
    let weights: Vec<f64> = residuals.iter().zip(edges).map(|(r, e)| e.weight * weigh(r.norm())).collect();
    let differences: Vec<[f64; 3]> = residuals.iter().map(|r| (*r).into()).collect();
    let steps = laplacian.solve(&weights, &differences)?;
    let mut sum = 0.0;
    for (rotation, step) in rotations.iter_mut().zip(steps) {
        let step = nalgebra::Vector3::from(step);
        sum += step.norm();
        *rotation *= so3_exp(&step);
        rotation.renormalize();
    }
    Some(sum / rotations.len() as f64)
}

fn residual(rotations: &[UnitQuaternion<f64>], e: &RelativeRotation) -> nalgebra::Vector3<f64> {
    so3_log(&(rotations[e.b].inverse() * e.b_from_a * rotations[e.a]))
}

/// Rotations along the edges of largest weight, from node 0.
fn spanning_tree(nodes: usize, edges: &[RelativeRotation]) -> Vec<UnitQuaternion<f64>> {
    let mut order: Vec<usize> = (0..edges.len()).collect();
    order.sort_by(|&i, &j| edges[j].weight.total_cmp(&edges[i].weight).then(i.cmp(&j)));
    let mut parent: Vec<usize> = (0..nodes).collect();
    let mut neighbours: Vec<Vec<(usize, UnitQuaternion<f64>)>> = vec![Vec::new(); nodes];
    for i in order {
        let e = &edges[i];
        let (a, b) = (root(&mut parent, e.a), root(&mut parent, e.b));
        if a != b {
            parent[a.max(b)] = a.min(b);
            neighbours[e.a].push((e.b, e.b_from_a));
            neighbours[e.b].push((e.a, e.b_from_a.inverse()));
        }
    }
    let mut rotations = vec![None; nodes];
    let mut queue = std::collections::VecDeque::from([0]);
    rotations[0] = Some(UnitQuaternion::identity());
    while let Some(a) = queue.pop_front() {
        let Some(from) = rotations[a] else { continue };
        for &(b, b_from_a) in &neighbours[a] {
            if rotations[b].is_none() {
                rotations[b] = Some(b_from_a * from);
                queue.push_back(b);
            }
        }
    }
    rotations.into_iter().map(Option::unwrap_or_default).collect()
}
