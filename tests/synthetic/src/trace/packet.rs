//! 64 rays at once.

use super::build::Node;

/// Rays of a packet.
pub(super) const RAYS: usize = 64;
/// Rays that are tested against a box together.
const CHUNK: usize = 16;
/// Rays pass no gap between neighbouring triangles: each is larger by this share of its sides.
const OVERLAP: f32 = 1e-6;
/// Nodes that wait: one a level, and `super::build` makes no more than 98 levels.
const STACK: usize = 100;

/// 8 x 8 rays of neighbouring pixels, in the world frame; directions are unit vectors. Behind a window every ray has its own origin.
#[derive(Clone, Debug)]
pub struct RayPacket {
    /// Origins: x of all rays, then y, then z.
    pub origin: [[f32; RAYS]; 3],
    /// Directions, likewise.
    pub direction: [[f32; RAYS]; 3],
}

/// What the rays of a packet meet first.
#[derive(Clone, Debug)]
pub struct HitPacket {
    /// Distance; infinite where nothing is met.
    pub distance: [f32; RAYS],
    /// Number of the triangle for [`super::Tracer::hit`], or [`HitPacket::NONE`].
    pub triangle: [u32; RAYS],
}

impl HitPacket {
    /// No triangle.
    pub const NONE: u32 = u32::MAX;
}

impl Default for HitPacket {
    fn default() -> Self {
        Self { distance: [f32::INFINITY; RAYS], triangle: [Self::NONE; RAYS] }
    }
}

/// A triangle for the intersection: a corner and the two sides that begin there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub corner: [f32; 3],
    pub sides: [[f32; 3]; 2],
}

/// Walks the hierarchy. Always the same bits: nothing is fused or reordered, whatever the width of the vectors.
#[inline(always)]
pub(super) fn walk(nodes: &[Node], triangles: &[Triangle], rays: &RayPacket, hits: &mut HitPacket) {
    let beam = Beam::new(rays);
    let mut stack = [0u32; STACK];
    let mut height = 1;
    while height > 0 {
        height -= 1;
        let at = stack[height];
        let node = &nodes[at as usize];
        if !beam.may_meet(node, hits) || !beam.meets(node, rays, hits) {
            continue;
        }
        if node.count > 0 {
            for index in node.first..node.first + node.count {
                meet(&triangles[index as usize], index, rays, hits);
            }
        } else {
            // What is nearer is looked at first: it shortens the rays.
            let (left, right) = (at + 1, node.first);
            let along = |child: u32| {
                let n = &nodes[child as usize];
                (0..3).map(|k| (n.low[k] + n.high[k]) * beam.middle[k]).sum::<f32>()
            };
            let (near, far) = if along(left) <= along(right) { (left, right) } else { (right, left) };
            stack[height] = far;
            stack[height + 1] = near;
            height += 2;
        }
    }
}

/// Bounds of all rays of a packet.
struct Beam {
    inverse: [[f32; RAYS]; 3],
    /// Least and greatest origin and inverse direction of each axis, where all rays go the same way along it.
    origin: [[f32; 2]; 3],
    slopes: [Option<[f32; 2]>; 3],
    middle: [f32; 3],
}

impl Beam {
    #[inline(always)]
    fn new(rays: &RayPacket) -> Self {
        let range = |v: &[f32; RAYS]| v.iter().fold([f32::INFINITY, f32::NEG_INFINITY], |[l, h], &x| [l.min(x), h.max(x)]);
        let inverse = rays.direction.map(|axis| axis.map(|d| 1.0 / d));
        let slopes = std::array::from_fn(|k| {
            let [low, high] = range(&rays.direction[k]);
            (low > 1e-6 || high < -1e-6).then(|| range(&inverse[k]))
        });
        let middle = std::array::from_fn(|k| rays.direction[k][RAYS / 2 + 4]);
        Self { inverse, origin: std::array::from_fn(|k| range(&rays.origin[k])), slopes, middle }
    }

    /// A quick test that only fails where no ray meets the box: by intervals.
    #[inline(always)]
    fn may_meet(&self, node: &Node, hits: &HitPacket) -> bool {
        let furthest = hits.distance.iter().fold(0.0f32, |a, &b| if b > a { b } else { a });
        let (mut near, mut far) = (0.0f32, furthest);
        for k in 0..3 {
            let Some(slope) = self.slopes[k] else { continue };
            let positive = slope[0] > 0.0;
            let (entry, exit) = if positive { (node.low[k], node.high[k]) } else { (node.high[k], node.low[k]) };
            // Least of (entry - origin) * slope and greatest of (exit - origin) * slope over both intervals.
            let entries = [(entry - self.origin[k][0]), (entry - self.origin[k][1])];
            let exits = [(exit - self.origin[k][0]), (exit - self.origin[k][1])];
            let least = (entries[0] * slope[0]).min(entries[0] * slope[1]).min(entries[1] * slope[0]).min(entries[1] * slope[1]);
            let most = (exits[0] * slope[0]).max(exits[0] * slope[1]).max(exits[1] * slope[0]).max(exits[1] * slope[1]);
            near = near.max(least);
            far = far.min(most);
        }
        // Rounding may lift `near` over `far` by a few units in the last place.
        near <= far * 1.000_01 + 1e-6
    }

    /// Whether a ray meets the box before what it has met.
    #[inline(always)]
    fn meets(&self, node: &Node, rays: &RayPacket, hits: &HitPacket) -> bool {
        for start in (0..RAYS).step_by(CHUNK) {
            let mut any = 0u32;
            for i in start..start + CHUNK {
                let (mut near, mut far) = (0.0f32, hits.distance[i]);
                for k in 0..3 {
                    let a = (node.low[k] - rays.origin[k][i]) * self.inverse[k][i];
                    let b = (node.high[k] - rays.origin[k][i]) * self.inverse[k][i];
                    let (first, last) = (if a < b { a } else { b }, if a < b { b } else { a });
                    near = if first > near { first } else { near };
                    far = if last < far { last } else { far };
                }
                any |= u32::from(near <= far * 1.000_001);
            }
            if any != 0 {
                return true;
            }
        }
        false
    }
}

/// Moeller & Trumbore, *Fast, minimum storage ray/triangle intersection*, 1997, for all rays.
#[inline(always)]
fn meet(triangle: &Triangle, index: u32, rays: &RayPacket, hits: &mut HitPacket) {
    let (c, [a, b]) = (triangle.corner, triangle.sides);
    for i in 0..RAYS {
        let d = [rays.direction[0][i], rays.direction[1][i], rays.direction[2][i]];
        let s = [rays.origin[0][i] - c[0], rays.origin[1][i] - c[1], rays.origin[2][i] - c[2]];
        let p = [d[1] * b[2] - d[2] * b[1], d[2] * b[0] - d[0] * b[2], d[0] * b[1] - d[1] * b[0]];
        let inverse = 1.0 / (a[0] * p[0] + a[1] * p[1] + a[2] * p[2]);
        let u = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) * inverse;
        let q = [s[1] * a[2] - s[2] * a[1], s[2] * a[0] - s[0] * a[2], s[0] * a[1] - s[1] * a[0]];
        let v = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) * inverse;
        let t = (b[0] * q[0] + b[1] * q[1] + b[2] * q[2]) * inverse;
        let inside = (u >= -OVERLAP) & (v >= -OVERLAP) & (u + v <= 1.0 + OVERLAP) & (t > 0.0) & (t < hits.distance[i]);
        hits.distance[i] = if inside { t } else { hits.distance[i] };
        hits.triangle[i] = if inside { index } else { hits.triangle[i] };
    }
}
