//! How a problem lies in memory while it is adjusted.
//!
//! The unknowns are split: **eliminated** are the free points, **kept** are the blocks of the reduced system, in this
//! order: frames (6), sensors (6), cameras (their free parameters), points at the end of a scale bar and control points (3). A scale bar
//! couples two points, and elimination needs each point to meet only kept blocks, so these few points are kept.
//!
//! Observations are sorted by point. Each point owns consecutive *incidences*, one for every kept block that its
//! observations meet, ascending by block; an incidence carries W = sum of F^T E over these observations.

use super::problem::{ImageObservation, Problem};
use super::state::State;
use scene::camera::MAX_CAMERA_PARAMS;

/// No block: what it would describe is fixed.
pub(super) const NONE: u32 = u32::MAX;
/// Observations of a piece of parallel work, at least. Pieces do not depend on the number of threads.
const PIECE_OBSERVATIONS: usize = 2048;
/// The largest number of pieces. Each has its own sums over views, which together shall not take more memory than
/// [`VIEW_SUMS_PER_OBSERVATION`] values an observation.
const MAX_PIECES: usize = 32;
const VIEW_SUMS_PER_OBSERVATION: usize = 16;

/// Whose parameters a kept block holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Owner {
    Frame(u32),
    Sensor(u32),
    Camera(u32),
    /// Index into [`Layout::kept_points`].
    Point(u32),
}

/// A distinct (frame, sensor, camera) of the observations.
#[derive(Clone, Copy, Debug)]
pub(super) struct View {
    pub frame: u32,
    pub sensor: u32,
    pub camera: u32,
    /// Kept blocks of frame, sensor and camera, ascending where they are not [`NONE`].
    pub block: [u32; 3],
    /// Where each begins in a row of the Jacobian; the last is the length of the row.
    pub start: [u8; 4],
    /// Whether the sensor is the identity and stays so.
    pub plain_sensor: bool,
}

impl View {
    pub fn row_len(&self) -> usize {
        self.start[3] as usize
    }

    pub fn dim(&self, segment: usize) -> usize {
        (self.start[segment + 1] - self.start[segment]) as usize
    }
}

/// An observation of a point that is not kept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Obs {
    pub view: u32,
    /// Incidences of the view's blocks, counted from the first one of the point; [`NONE`] where there is none.
    pub incidence: [u32; 3],
    pub pixel: [f64; 2],
    pub inverse_sigma: f64,
}

/// An observed point that is not kept.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slot {
    pub point: u32,
    pub free: bool,
    pub first_obs: u32,
    pub first_incidence: u32,
    pub first_w: usize,
    /// Number of its first product in the elimination: incidences i <= j in order, i outermost.
    pub first_product: usize,
}

/// One kept block that a point meets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Incidence {
    pub block: u32,
    /// Where its W (3 columns of the block's dimension) begins.
    pub w: usize,
}

/// Which parameters of a camera are free.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FreeParams {
    pub count: u8,
    pub index: [u8; MAX_CAMERA_PARAMS],
}

impl FreeParams {
    pub fn indices(&self) -> impl Iterator<Item = usize> + '_ {
        self.index[..self.count as usize].iter().map(|&i| i as usize)
    }
}

/// Where each piece of work by point begins in the arrays by point, by observation and by incidence.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    pub slots: Vec<usize>,
    pub w: Vec<usize>,
    /// 0, 1, 2...: one entry a piece.
    pub ones: Vec<usize>,
}

/// See the module.
#[derive(Debug, Default)]
pub(super) struct Layout {
    pub owners: Vec<Owner>,
    /// First unknown of each kept block; one more entry, the size of the reduced system.
    pub offsets: Vec<usize>,
    pub frame_block: Vec<u32>,
    pub sensor_block: Vec<u32>,
    pub camera_block: Vec<u32>,
    pub camera_free: Vec<FreeParams>,
    /// Points at the end of a scale bar and control points, ascending, and their blocks.
    pub kept_points: Vec<u32>,
    pub kept_block: Vec<u32>,
    /// Observations of kept points, with their views.
    pub kept_observations: Vec<(u32, ImageObservation)>,
    pub views: Vec<View>,
    pub obs: Vec<Obs>,
    /// One more entry at the end, for the ends of the lists.
    pub slots: Vec<Slot>,
    pub incidences: Vec<Incidence>,
    /// Pieces of the work by point: where each begins, and the end of the last.
    pub pieces: Pieces,
    /// Number of products of the elimination that go to each block's panel.
    pub block_products: Vec<usize>,
    /// (view, segment) of each kept block, and where each block's begin.
    pub block_views: Vec<(u32, u8)>,
    pub block_views_start: Vec<usize>,
    pub left_out: usize,
}

impl Layout {
    /// Sorts the problem. Observations whose point does not project at the start are left out.
    pub fn new(problem: &Problem, state: &mut State) -> Self {
        let mut layout = Self::default();
        let view_of = layout.find_views(problem);
        state.update_views(&layout.views);
        let active = layout.find_active(problem, state, &view_of);
        layout.number_blocks(problem, &view_of, &active);
        layout.group_by_point(problem, &view_of, &active);
        layout.index_blocks();
        layout
    }

    pub fn block_count(&self) -> usize {
        self.owners.len()
    }

    /// Number of kept unknowns.
    pub fn unknowns(&self) -> usize {
        self.offsets.last().copied().unwrap_or(0)
    }

    pub fn dim(&self, block: usize) -> usize {
        self.offsets[block + 1] - self.offsets[block]
    }

    pub fn slot_count(&self) -> usize {
        self.slots.len() - 1
    }

    /// Number of pieces of the work by point.
    pub fn piece_count(&self) -> usize {
        self.pieces.slots.len() - 1
    }

    /// Where the normal equations of each view begin, d x d and d values, and their length.
    pub fn view_start(&self) -> Vec<usize> {
        let mut start = vec![0];
        for view in &self.views {
            let d = view.row_len();
            start.push(start[start.len() - 1] + d * d + d);
        }
        start
    }

    /// Length of the W of all incidences.
    pub fn w_len(&self) -> usize {
        self.slots.last().map_or(0, |s| s.first_w)
    }

    /// View of each observation; views are numbered as they first appear.
    fn find_views(&mut self, problem: &Problem) -> Vec<u32> {
        // A frame has few views: a linked list of each frame's is searched.
        let mut first = vec![NONE; problem.frames.len()];
        let mut next: Vec<u32> = Vec::new();
        let mut view_of = Vec::with_capacity(problem.observations.len());
        for o in &problem.observations {
            let mut view = first[o.frame as usize];
            while view != NONE {
                let v = &self.views[view as usize];
                if v.sensor == o.sensor && v.camera == o.camera {
                    break;
                }
                view = next[view as usize];
            }
            if view == NONE {
                view = self.views.len() as u32;
                let sensor = &problem.sensors[o.sensor as usize];
                self.views.push(View {
                    frame: o.frame,
                    sensor: o.sensor,
                    camera: o.camera,
                    block: [NONE; 3],
                    start: [0; 4],
                    plain_sensor: !sensor.free && sensor.pose == scene::Rigid3::identity(),
                });
                next.push(first[o.frame as usize]);
                first[o.frame as usize] = view;
            }
            view_of.push(view);
        }
        view_of
    }

    fn find_active(&mut self, problem: &Problem, state: &State, view_of: &[u32]) -> Vec<bool> {
        let mut active = Vec::with_capacity(view_of.len());
        for (o, &view) in problem.observations.iter().zip(view_of) {
            let xyz = &problem.points[o.point as usize].xyz;
            let pose = &state.views[view as usize];
            let projects = state.cameras[o.camera as usize].project(&pose.x_in_cam(xyz)).is_some();
            self.left_out += usize::from(!projects);
            active.push(projects);
        }
        active
    }

    /// Numbers the kept blocks: those that are free and that a residual depends on.
    fn number_blocks(&mut self, problem: &Problem, view_of: &[u32], active: &[bool]) {
        let mut used_frames = vec![false; problem.frames.len()];
        let mut used_sensors = vec![false; problem.sensors.len()];
        let mut used_cameras = vec![false; problem.cameras.len()];
        let mut used_views = vec![false; self.views.len()];
        for (&view, &active) in view_of.iter().zip(active) {
            used_views[view as usize] |= active;
        }
        for (view, _) in self.views.iter().zip(&used_views).filter(|(_, used)| **used) {
            used_frames[view.frame as usize] = true;
            used_sensors[view.sensor as usize] = true;
            used_cameras[view.camera as usize] = true;
        }
        for (frame, sensor) in problem.baselines.iter().flat_map(|b| [b.a, b.b]) {
            used_frames[frame as usize] = true;
            used_sensors[sensor as usize] = true;
        }
        let of_sensors = problem.positions.iter().map(|o| o.frame).chain(problem.directions.iter().map(|o| o.frame));
        for frame in of_sensors.chain(problem.headings.iter().map(|o| o.frame)) {
            used_frames[frame as usize] = true;
        }
        self.offsets.push(0);
        self.frame_block = vec![NONE; problem.frames.len()];
        for (i, block) in problem.frames.iter().enumerate() {
            if block.free && (used_frames[i] || block.prior.is_some()) {
                self.frame_block[i] = self.push_block(Owner::Frame(i as u32), 6);
            }
        }
        self.sensor_block = vec![NONE; problem.sensors.len()];
        for (i, block) in problem.sensors.iter().enumerate() {
            if block.free && (used_sensors[i] || block.prior.is_some()) {
                self.sensor_block[i] = self.push_block(Owner::Sensor(i as u32), 6);
            }
        }
        self.camera_block = vec![NONE; problem.cameras.len()];
        for (i, block) in problem.cameras.iter().enumerate() {
            let mut free = FreeParams::default();
            for k in (0..block.camera.params().len()).filter(|&k| block.free[k] && (used_cameras[i] || block.priors[k].is_some())) {
                free.index[free.count as usize] = k as u8;
                free.count += 1;
            }
            if free.count > 0 {
                self.camera_block[i] = self.push_block(Owner::Camera(i as u32), free.count as usize);
            }
            self.camera_free.push(free);
        }
        self.kept_points =
            problem.scale_bars.iter().flat_map(|b| [b.a, b.b]).chain(problem.control_points.iter().map(|o| o.point)).collect();
        self.kept_points.sort_unstable();
        self.kept_points.dedup();
        for i in 0..self.kept_points.len() {
            let free = problem.points[self.kept_points[i] as usize].free;
            let block = if free { self.push_block(Owner::Point(i as u32), 3) } else { NONE };
            self.kept_block.push(block);
        }
        for view in &mut self.views {
            view.block =
                [self.frame_block[view.frame as usize], self.sensor_block[view.sensor as usize], self.camera_block[view.camera as usize]];
            for (i, dim) in [6, 6, self.camera_free[view.camera as usize].count].into_iter().enumerate() {
                view.start[i + 1] = view.start[i] + if view.block[i] == NONE { 0 } else { dim };
            }
        }
    }

    fn push_block(&mut self, owner: Owner, dim: usize) -> u32 {
        self.owners.push(owner);
        self.offsets.push(self.unknowns() + dim);
        (self.owners.len() - 1) as u32
    }

    fn group_by_point(&mut self, problem: &Problem, view_of: &[u32], active: &[bool]) {
        const KEPT: u32 = NONE - 1;
        // Count, then place: a stable counting sort by point.
        let mut position = vec![0u32; problem.points.len()];
        for &p in &self.kept_points {
            position[p as usize] = KEPT;
        }
        for (o, _) in problem.observations.iter().zip(active).filter(|(_, a)| **a) {
            let count = &mut position[o.point as usize];
            *count += u32::from(*count != KEPT);
        }
        let mut total = 0;
        for (p, count) in position.iter_mut().enumerate().filter(|(_, c)| **c != 0 && **c != KEPT) {
            let free = problem.points[p].free;
            self.slots.push(Slot { point: p as u32, free, first_obs: total, first_incidence: 0, first_w: 0, first_product: 0 });
            (total, *count) = (total + *count, total);
        }
        self.slots.push(Slot { point: NONE, free: false, first_obs: total, first_incidence: 0, first_w: 0, first_product: 0 });
        let empty = Obs { view: 0, incidence: [NONE; 3], pixel: [0.0; 2], inverse_sigma: 0.0 };
        self.obs = vec![empty; total as usize];
        for ((o, &view), _) in problem.observations.iter().zip(view_of).zip(active).filter(|(_, a)| **a) {
            let place = &mut position[o.point as usize];
            if *place == KEPT {
                self.kept_observations.push((view, *o));
            } else {
                self.obs[*place as usize] =
                    Obs { view, incidence: [NONE; 3], pixel: [o.pixel.x, o.pixel.y], inverse_sigma: 1.0 / o.sigma_px };
                *place += 1;
            }
        }
        self.find_incidences();
    }

    fn find_incidences(&mut self) {
        let mut blocks: Vec<u32> = Vec::new();
        self.block_products = vec![0; self.owners.len()];
        let view_sums = self.view_start()[self.views.len()].max(1);
        let pieces = (self.obs.len() / PIECE_OBSERVATIONS).min(VIEW_SUMS_PER_OBSERVATION * self.obs.len() / view_sums).clamp(1, MAX_PIECES);
        let piece_len = self.obs.len().div_ceil(pieces) as u32;
        let (mut w, mut piece_end, mut products) = (0, 0, 0);
        for s in 0..self.slots.len() {
            self.slots[s].first_incidence = self.incidences.len() as u32;
            self.slots[s].first_w = w;
            self.slots[s].first_product = products;
            if s + 1 == self.slots.len() {
                break;
            }
            if self.slots[s].first_obs >= piece_end {
                self.push_piece(s);
                piece_end += piece_len;
            }
            let slot = &self.slots[s];
            if !slot.free {
                continue;
            }
            let range = slot.first_obs as usize..self.slots[s + 1].first_obs as usize;
            blocks.clear();
            for o in &self.obs[range.clone()] {
                blocks.extend(self.views[o.view as usize].block.iter().filter(|&&b| b != NONE));
            }
            blocks.sort_unstable();
            blocks.dedup();
            for o in &mut self.obs[range] {
                let view = &self.views[o.view as usize];
                for (incidence, block) in o.incidence.iter_mut().zip(view.block) {
                    *incidence = blocks.binary_search(&block).map_or(NONE, |i| i as u32);
                }
            }
            for (i, &block) in blocks.iter().enumerate() {
                self.incidences.push(Incidence { block, w });
                self.block_products[block as usize] += blocks.len() - i;
                products += blocks.len() - i;
                w += 3 * (self.offsets[block as usize + 1] - self.offsets[block as usize]);
            }
        }
        self.push_piece(self.slots.len() - 1);
    }

    fn push_piece(&mut self, slot: usize) {
        let first = &self.slots[slot];
        self.pieces.ones.push(self.pieces.slots.len());
        self.pieces.slots.push(slot);
        self.pieces.w.push(first.first_w);
    }

    fn index_blocks(&mut self) {
        let views = &self.views;
        (self.block_views_start, self.block_views) = group(self.owners.len(), || {
            views
                .iter()
                .enumerate()
                .flat_map(|(v, view)| (0..3).filter(|&k| view.block[k] != NONE).map(move |k| (view.block[k] as usize, (v as u32, k as u8))))
        });
    }
}

/// Values grouped by key, in order, and where each group begins.
fn group<T: Copy + Default, I: Iterator<Item = (usize, T)>>(keys: usize, items: impl Fn() -> I) -> (Vec<usize>, Vec<T>) {
    let mut start = vec![0usize; keys + 1];
    for (key, _) in items() {
        start[key + 1] += 1;
    }
    for k in 0..keys {
        start[k + 1] += start[k];
    }
    let mut values = vec![T::default(); start[keys]];
    let mut next = start.clone();
    for (key, value) in items() {
        values[next[key]] = value;
        next[key] += 1;
    }
    (start, values)
}
