//! Positions of nodes and points from directions alone, when rotations are known.

use super::block_system::BlockSystem;
use crate::robust::Loss;
use nalgebra::{Matrix3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// A measured direction from a node to a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bearing {
    /// The node: an image, or a frame of a rig.
    pub node: u32,
    /// The point.
    pub point: u32,
    /// Unit direction in the axes of the world.
    pub direction: Vector3<f64>,
    /// From the node to where the direction begins, in the axes of the world: zero for an image, the arm of the camera for a rig.
    pub offset: Vector3<f64>,
}

/// How positions are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositioningOptions {
    /// Where the loss of a direction becomes linear, as the sine of an angle.
    pub loss_scale: f64,
    /// Steps at most.
    pub max_iterations: usize,
    /// Stop when a step lowers the cost by less than this share.
    pub function_tolerance: f64,
    /// Half the side of the cube in which everything begins at random.
    pub start_size: f64,
    /// Seed of the start.
    pub seed: u64,
}

impl Default for PositioningOptions {
    fn default() -> Self {
        Self { loss_scale: 0.1, max_iterations: 150, function_tolerance: 1e-5, start_size: 10.0, seed: 0 }
    }
}

/// Positions up to a translation, and where no bearing has an offset up to a scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Positioned {
    /// Of the nodes.
    pub nodes: Vec<Vector3<f64>>,
    /// Of the points.
    pub points: Vec<Vector3<f64>>,
    /// Half the robust sum of squares.
    pub cost: f64,
    /// Steps tried.
    pub iterations: usize,
}

/// Finds positions from bearings, which must be sorted by point.
///
/// Minimises the sum of rho(|v - d (X - c - o)|^2) over node positions c, points X and a scale d >= 0 of each bearing, from a random start:
/// with d free the problem is nearly linear in each group of unknowns and converges from anywhere, as Pan, Barath, Pollefeys & Schoenberger
/// found (*Global Structure-from-Motion Revisited*, ECCV 2024). Levenberg-Marquardt; the d and then the X are eliminated, and the system of
/// the nodes is factorised.
///
/// `None` when an index is out of range, a bearing is not finite, or memory runs out.
#[must_use]
pub fn position(nodes: usize, points: usize, bearings: &[Bearing], options: &PositioningOptions) -> Option<Positioned> {
    let is_good = |b: &Bearing| {
        (b.node as usize) < nodes
            && (b.point as usize) < points
            && b.direction.iter().chain(b.offset.iter()).all(|x| x.is_finite())
            && (b.direction.norm() - 1.0).abs() < 1e-6
    };
    if !bearings.iter().all(is_good) || !bearings.is_sorted_by_key(|b| b.point) {
        return None;
    }
    let problem = Problem { bearings, starts: starts(points, bearings), loss: Loss::Huber { scale_px: options.loss_scale } };
    let mut state = State::random(nodes, points, bearings.len(), options);
    let mut system = BlockSystem::new(nodes, problem.groups().map(|g| g.iter().map(|b| b.node as usize)))?;
    let (mut cost, mut radius, mut shrink, mut iterations) = (problem.cost(&state), 1e4, 2.0, 0);
    while iterations < options.max_iterations && radius > 1e-12 {
        iterations += 1;
        let (step, model_decrease) = problem.step(&state, &mut system, radius)?;
        let candidate = state.moved(&step);
        let new = problem.cost(&candidate);
        let ratio = (cost - new) / model_decrease;
        if new.is_finite() && ratio > 1e-3 {
            let gain = cost - new;
            (state, cost) = (candidate, new);
            let x: f64 = 2.0 * ratio - 1.0;
            (radius, shrink) = ((radius / (1.0 - x.powi(3)).max(1.0 / 3.0)).min(1e8), 2.0);
            if gain <= options.function_tolerance * cost {
                break;
            }
        } else {
            (radius, shrink) = (radius / shrink, shrink * 2.0);
        }
    }
    Some(Positioned { nodes: state.nodes, points: state.points, cost, iterations })
}

/// Where the bearings of each point begin, and the end.
fn starts(points: usize, bearings: &[Bearing]) -> Vec<usize> {
    (0..=points).map(|p| bearings.partition_point(|b| (b.point as usize) < p)).collect()
}

#[derive(Clone)]
struct State {
    nodes: Vec<Vector3<f64>>,
    points: Vec<Vector3<f64>>,
    scales: Vec<f64>,
}

impl State {
    fn random(nodes: usize, points: usize, bearings: usize, options: &PositioningOptions) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(options.seed);
        let mut uniform = || options.start_size * (2.0 * (random.next_u64() >> 11) as f64 / (1u64 << 53) as f64 - 1.0);
        let mut cloud = |count: usize| (0..count).map(|_| Vector3::new(uniform(), uniform(), uniform())).collect();
        Self { nodes: cloud(nodes), points: cloud(points), scales: vec![1.0; bearings] }
    }

    fn moved(&self, step: &State) -> Self {
        let add = |a: &[Vector3<f64>], b: &[Vector3<f64>]| a.iter().zip(b).map(|(a, b)| a + b).collect();
        Self {
            nodes: add(&self.nodes, &step.nodes),
            points: add(&self.points, &step.points),
            scales: self.scales.iter().zip(&step.scales).map(|(a, b)| (a + b).max(0.0)).collect(),
        }
    }
}

struct Problem<'a> {
    bearings: &'a [Bearing],
    starts: Vec<usize>,
    loss: Loss,
}

/// A bearing's part of the normal equations once its scale is eliminated.
struct Part {
    /// d^2 M, M the weight across the ray.
    a: Matrix3<f64>,
    /// d M r.
    g: Vector3<f64>,
    /// From the camera to the point.
    u: Vector3<f64>,
    r: Vector3<f64>,
    weight: f64,
    /// Of the scale, damped.
    h: f64,
    added: f64,
}

impl Problem<'_> {
    fn groups(&self) -> impl Iterator<Item = &[Bearing]> {
        self.starts.windows(2).map(|w| &self.bearings[w[0]..w[1]])
    }

    fn residual(&self, state: &State, i: usize) -> (Vector3<f64>, Vector3<f64>) {
        let b = &self.bearings[i];
        let u = state.points[b.point as usize] - state.nodes[b.node as usize] - b.offset;
        (b.direction - state.scales[i] * u, u)
    }

    fn cost(&self, state: &State) -> f64 {
        (0..self.bearings.len()).map(|i| 0.5 * self.loss.evaluate(self.residual(state, i).0.norm_squared()).0).sum()
    }

    fn part(&self, state: &State, i: usize, radius: f64) -> Part {
        let (r, u) = self.residual(state, i);
        let (d, weight) = (state.scales[i], self.loss.evaluate(r.norm_squared()).1);
        let plain = weight * u.norm_squared();
        let added = damping(plain, radius);
        let h = plain + added;
        let m = weight * (Matrix3::identity() - (weight / h) * u * u.transpose());
        Part { a: d * d * m, g: d * (m * r), u, r, weight, h, added }
    }

    /// A step of all unknowns, and the decrease of the cost that the linear model promises.
    fn step(&self, state: &State, system: &mut BlockSystem, radius: f64) -> Option<(State, f64)> {
        let parts: Vec<Part> = (0..self.bearings.len()).map(|i| self.part(state, i, radius)).collect();
        system.clear();
        // Of each point: (sum of a + damping)^-1, gradient, damping.
        let mut points = Vec::with_capacity(state.points.len());
        let mut decrease = 0.0;
        let mut gradients = vec![Vector3::zeros(); state.nodes.len()];
        let mut rhs = vec![Vector3::zeros(); state.nodes.len()];
        let mut diagonal = vec![Vector3::zeros(); state.nodes.len()];
        for (p, w) in self.starts.windows(2).enumerate() {
            let (group, bearings) = (&parts[w[0]..w[1]], &self.bearings[w[0]..w[1]]);
            let sum = group.iter().fold(Matrix3::zeros(), |sum, part| sum + part.a);
            // a step of X changes r by -d: its gradient is minus that of the node.
            let g = group.iter().fold(Vector3::zeros(), |g, part| g - part.g);
            let added = sum.diagonal().map(|h| damping(h, radius));
            let inverse = (sum + Matrix3::from_diagonal(&added)).try_inverse().unwrap_or_default();
            for (i, (part, b)) in group.iter().zip(bearings).enumerate() {
                let node = b.node as usize;
                gradients[node] += part.g;
                diagonal[node] += part.a.diagonal();
                system.add(p, i, i, &part.a);
                let y = part.a * inverse;
                // H_cX = -a: S = H_cc - H_cX H_XX^-1 H_Xc, and the gradient g_c - H_cX H_XX^-1 g_X.
                rhs[node] -= part.g + y * g;
                for (j, other) in group.iter().enumerate() {
                    system.add(p, i, j, &-(y * other.a));
                }
            }
            points.push((inverse, g, added));
        }
        let added: Vec<Vector3<f64>> = diagonal.iter().map(|h| h.map(|h| damping(h, radius))).collect();
        let nodes = system.solve(&added, &rhs)?;
        let mut step = State { nodes, points: Vec::with_capacity(state.points.len()), scales: vec![0.0; state.scales.len()] };
        let halves = |x: &Vector3<f64>, added: &Vector3<f64>, g: &Vector3<f64>| 0.5 * (x.dot(&added.component_mul(x)) - g.dot(x));
        for ((x, added), g) in step.nodes.iter().zip(&added).zip(&gradients) {
            decrease += halves(x, added, g);
        }
        for (p, (inverse, g, added)) in points.iter().enumerate() {
            let range = self.starts[p]..self.starts[p + 1];
            let pulled = range.clone().fold(-g, |sum, i| sum + parts[i].a * step.nodes[self.bearings[i].node as usize]);
            let x = inverse * pulled;
            decrease += halves(&x, added, g);
            step.points.push(x);
            for i in range {
                let part = &parts[i];
                let relative = x - step.nodes[self.bearings[i].node as usize];
                // The gradient of d is -w u . r.
                let gradient = -part.weight * part.u.dot(&part.r);
                let s = (-gradient - part.weight * state.scales[i] * part.u.dot(&relative)) / part.h;
                decrease += 0.5 * (s * part.added * s - gradient * s);
                step.scales[i] = s;
            }
        }
        Some((step, decrease))
    }
}

fn damping(h: f64, radius: f64) -> f64 {
    h.max(1e-6) / radius
}
