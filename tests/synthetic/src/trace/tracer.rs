//! The triangles of a scene, ready for rays.

use super::build::{Bounds, Node, build};
use super::packet::{HitPacket, RAYS, RayPacket, Triangle, walk};
use crate::world::Part;
use nalgebra::Vector3;

/// Where a ray meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Along the unit direction of the ray, metres.
    pub distance: f64,
    /// Number of the part, in the order they were given in.
    pub part: u32,
    /// Face of that part.
    pub face: u32,
    /// Unit normal of the face.
    pub normal: Vector3<f64>,
    /// Unit normal interpolated between the corners, for light.
    pub shading_normal: Vector3<f64>,
}

/// What a triangle belongs to.
#[derive(Clone, Copy, Debug)]
struct Owner {
    part: u32,
    face: u32,
    normals: [[f32; 3]; 3],
}

/// Triangles in a hierarchy of boxes.
#[derive(Clone, Debug)]
pub struct Tracer {
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
    owners: Vec<Owner>,
}

impl Tracer {
    /// The triangles of some parts. The same on any number of threads.
    pub fn new<'a>(parts: impl IntoIterator<Item = &'a Part>) -> Self {
        let (mut bounds, mut triangles, mut owners) = (Vec::new(), Vec::new(), Vec::new());
        for (p, part) in parts.into_iter().enumerate() {
            for (f, face) in part.mesh.faces.iter().enumerate() {
                let corners = face.map(|v| part.mesh.vertices[v as usize].coords.cast::<f32>());
                let [a, b, c] = corners;
                bounds.push(Bounds { low: a.inf(&b).inf(&c).into(), high: a.sup(&b).sup(&c).into(), index: triangles.len() as u32 });
                triangles.push(Triangle { corner: a.into(), sides: [(b - a).into(), (c - a).into()] });
                owners.push(Owner { part: p as u32, face: f as u32, normals: face.map(|v| part.normals[v as usize].into()) });
            }
        }
        let nodes = if bounds.is_empty() { Vec::new() } else { build(&mut bounds, 0) };
        Self {
            nodes,
            triangles: bounds.iter().map(|b| triangles[b.index as usize]).collect(),
            owners: bounds.iter().map(|b| owners[b.index as usize]).collect(),
        }
    }

    /// Looks for nearer hits than those in `hits` already.
    pub fn packet(&self, rays: &RayPacket, hits: &mut HitPacket) {
        if self.nodes.is_empty() {
            return;
        }
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has what the function is compiled for.
            return unsafe { walk_avx2(&self.nodes, &self.triangles, rays, hits) };
        }
        walk(&self.nodes, &self.triangles, rays, hits);
    }

    /// The first thing that one ray meets. For few rays: a packet costs the same.
    #[must_use]
    pub fn ray(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        let all = |v: &Vector3<f64>| std::array::from_fn(|k| [v[k] as f32; RAYS]);
        let mut hits = HitPacket::default();
        self.packet(&RayPacket { origin: all(origin), direction: all(direction) }, &mut hits);
        (hits.triangle[0] != HitPacket::NONE).then(|| self.hit(hits.triangle[0], origin, direction))
    }

    /// The hit of a ray with a triangle that a packet found, computed again in double precision.
    ///
    /// # Panics
    /// When there is no such triangle.
    #[must_use]
    pub fn hit(&self, triangle: u32, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Hit {
        let (t, owner) = (&self.triangles[triangle as usize], &self.owners[triangle as usize]);
        let wide = |v: [f32; 3]| Vector3::from(v).cast::<f64>();
        let (corner, a, b) = (wide(t.corner), wide(t.sides[0]), wide(t.sides[1]));
        let normal = a.cross(&b);
        let distance = (corner - origin).dot(&normal) / direction.dot(&normal);
        // Weights of the corners by the areas opposite to them.
        let from = origin + distance * direction - corner;
        let area = normal.norm_squared();
        let (u, v) = (from.cross(&b).dot(&normal) / area, a.cross(&from).dot(&normal) / area);
        let [n0, n1, n2] = owner.normals.map(wide);
        let smooth = n0 * (1.0 - u - v) + n1 * u + n2 * v;
        let normal = normal / area.sqrt();
        let shading_normal = smooth.try_normalize(1e-9).unwrap_or(normal);
        Hit { distance, part: owner.part, face: owner.face, normal, shading_normal }
    }
}

/// The same walk with wider vectors: the same operations in the same order, so the same bits.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn walk_avx2(nodes: &[Node], triangles: &[Triangle], rays: &RayPacket, hits: &mut HitPacket) {
    walk(nodes, triangles, rays, hits);
}
