//! The hierarchy: boxes split where the surface area heuristic says (Wald, *On fast construction of SAH-based bounding volume
//! hierarchies*, IEEE Symposium on Interactive Ray Tracing, 2007), with 16 bins along the longest side of the centroids.

/// A box with two children, or triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub low: [f32; 3],
    pub high: [f32; 3],
    /// First triangle of a leaf; for a branch the right child, the left one follows the branch.
    pub first: u32,
    /// Triangles of a leaf; 0 for a branch.
    pub count: u32,
}

/// A triangle's box, its middle, and which triangle it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub low: [f32; 3],
    pub high: [f32; 3],
    pub index: u32,
}

impl Bounds {
    fn middle(&self, axis: usize) -> f32 {
        self.low[axis] + self.high[axis]
    }
}

const BINS: usize = 16;
/// No leaf holds more triangles.
const LEAF: usize = 4;
/// Below this level ranges are halved, whatever the surface area: fewer than 2^32 triangles end within 32 more.
const DEEP: usize = 64;
/// Ranges of more triangles are built on two threads.
const PARALLEL: usize = 8192;

/// Builds the hierarchy over `items`, which are brought into the order of the leaves. `first` is the place of `items[0]` in that order.
/// The result does not depend on the number of threads.
pub(super) fn build(items: &mut [Bounds], first: u32) -> Vec<Node> {
    subtree(items, first, 0)
}

fn subtree(items: &mut [Bounds], first: u32, level: usize) -> Vec<Node> {
    let mut nodes = Vec::with_capacity(if items.len() > PARALLEL { 0 } else { items.len() });
    grow(items, first, level, &mut nodes);
    nodes
}

fn grow(items: &mut [Bounds], first: u32, level: usize, nodes: &mut Vec<Node>) {
    let (low, high) = hull(items.iter().map(|b| (b.low, b.high)));
    let place = nodes.len();
    nodes.push(Node { low, high, first, count: items.len() as u32 });
    if items.len() <= LEAF {
        return;
    }
    let middle = if level < DEEP { split(items) } else { items.len() / 2 };
    let (left, right) = items.split_at_mut(middle);
    let right_first = first + middle as u32;
    nodes[place].count = 0;
    if left.len() + right.len() > PARALLEL {
        let (left, right) = rayon::join(|| subtree(left, first, level + 1), || subtree(right, right_first, level + 1));
        append(nodes, left);
        nodes[place].first = nodes.len() as u32;
        append(nodes, right);
    } else {
        grow(left, first, level + 1, nodes);
        nodes[place].first = nodes.len() as u32;
        grow(right, right_first, level + 1, nodes);
    }
}

/// Appends a subtree: its branches point into the joined list.
fn append(nodes: &mut Vec<Node>, subtree: Vec<Node>) {
    let offset = nodes.len() as u32;
    nodes.extend(subtree.into_iter().map(|node| if node.count == 0 { Node { first: node.first + offset, ..node } } else { node }));
}

/// Orders the items so that those before the returned place go left.
fn split(items: &mut [Bounds]) -> usize {
    let (low, high) = hull(items.iter().map(|b| {
        let middle = [b.middle(0), b.middle(1), b.middle(2)];
        (middle, middle)
    }));
    let axis = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    let extent = high[axis] - low[axis];
    let half = items.len() / 2;
    if extent <= 0.0 {
        return half;
    }
    let bin = |b: &Bounds| (((b.middle(axis) - low[axis]) / extent * BINS as f32) as usize).min(BINS - 1);
    let empty = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3], 0usize);
    let mut bins = [empty; BINS];
    for item in items.iter() {
        let b = &mut bins[bin(item)];
        (b.0, b.1) = hull([(b.0, b.1), (item.low, item.high)].into_iter());
        b.2 += 1;
    }
    let mut best = (f32::INFINITY, 0);
    for cut in 1..BINS {
        let cost = |bins: &[([f32; 3], [f32; 3], usize)]| {
            let count: usize = bins.iter().map(|b| b.2).sum();
            let (low, high) = hull(bins.iter().map(|b| (b.0, b.1)));
            if count == 0 { f32::INFINITY } else { area(low, high) * count as f32 }
        };
        let total = cost(&bins[..cut]) + cost(&bins[cut..]);
        if total < best.0 {
            best = (total, cut);
        }
    }
    // A stable partition: the order of the triangles depends on nothing but them.
    let (left, right): (Vec<Bounds>, Vec<Bounds>) = items.iter().partition(|b| bin(b) < best.1);
    let middle = left.len();
    if middle == 0 || right.is_empty() {
        return half;
    }
    items[..middle].copy_from_slice(&left);
    items[middle..].copy_from_slice(&right);
    middle
}

fn area(low: [f32; 3], high: [f32; 3]) -> f32 {
    let s: [f32; 3] = std::array::from_fn(|k| high[k] - low[k]);
    s[0] * s[1] + s[1] * s[2] + s[2] * s[0]
}

fn hull(boxes: impl Iterator<Item = ([f32; 3], [f32; 3])>) -> ([f32; 3], [f32; 3]) {
    boxes.fold(([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]), |(low, high), (l, h)| {
        (std::array::from_fn(|k| low[k].min(l[k])), std::array::from_fn(|k| high[k].max(h[k])))
    })
}
