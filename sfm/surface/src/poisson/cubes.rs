//! The triangles of a cube whose corners lie inside or outside (Lorensen & Cline, *Marching cubes*, SIGGRAPH 1987).
//!
//! The table is derived, not copied. On each face the crossed edges are joined so that corners inside are parted from each other; that depends
//! on the face alone, so that two cubes agree on the face between them and the surface has no cracks. The joints make loops around the
//! cube, and each loop is cut into triangles without a cut along a face, where the neighbour might make the same: every edge of the
//! surface then has two triangles.

use std::sync::LazyLock;

/// Edges of a cube: number 4 axis + i, i the number of the two other coordinates of its lower corner, the lower axis first.
pub(super) const EDGES: usize = 12;

/// Corner of a cube, bit 0 for x, 1 for y, 2 for z, at the start of an edge, and the axis of the edge.
pub(super) fn edge(number: usize) -> (usize, usize) {
    let (axis, i) = (number / 4, number % 4);
    let corner = match axis {
        0 => i << 1,
        1 => (i & 1) | (i & 2) << 1,
        _ => i,
    };
    (corner, axis)
}

/// The edge between two corners.
fn edge_between(a: usize, b: usize) -> usize {
    (0..EDGES).find(|&e| edge(e).0 == a.min(b) && a ^ b == 1 << edge(e).1).unwrap_or_default()
}

/// For each pattern of corners inside, bit by bit: triangles of edges, counter-clockwise seen from outside.
pub(super) static TRIANGLES: LazyLock<Vec<Vec<[u8; 3]>>> = LazyLock::new(|| (0..256).map(triangles).collect());

/// The corners around each face, counter-clockwise seen from outside of the cube.
const FACES: [[usize; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];

fn triangles(inside: usize) -> Vec<[u8; 3]> {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    let mut next = [None; EDGES];
    for face in FACES {
        for (i, &corner) in face.iter().enumerate() {
            // A run of corners inside begins here: it is cut off from where it is left to where it is entered.
            let before = face[(i + 3) % 4];
            if !is_inside(corner) || is_inside(before) {
                continue;
            }
            let mut last = i;
            while is_inside(face[(last + 1) % 4]) {
                last += 1;
            }
            let left = edge_between(face[last % 4], face[(last + 1) % 4]);
            next[edge_between(before, corner)] = Some(left);
        }
    }
    let mut out = Vec::new();
    for start in 0..EDGES {
        let (mut ring, mut at) = (Vec::new(), start);
        while let Some(following) = next[at].take() {
            ring.push(at);
            at = following;
        }
        if ring.len() >= 3 {
            let cut = cut(&ring).unwrap_or_default();
            out.extend(cut.into_iter().map(|t| t.map(|e| e as u8)));
        }
    }
    out
}

/// Whether two edges of the cube lie on one face.
fn share_face(a: usize, b: usize) -> bool {
    let on = |face: &[usize; 4], e: usize| {
        let (corner, axis) = edge(e);
        face.contains(&corner) && face.contains(&(corner | 1 << axis))
    };
    FACES.iter().any(|face| on(face, a) && on(face, b))
}

/// Cuts a ring into triangles; no cut joins two edges of one face.
fn cut(ring: &[usize]) -> Option<Vec<[usize; 3]>> {
    let n = ring.len();
    if n == 3 {
        return Some(vec![[ring[0], ring[1], ring[2]]]);
    }
    // The triangle at the side from the last corner to the first.
    (1..n - 1).find_map(|k| {
        let free = |a: usize, b: usize, side: bool| side || !share_face(ring[a], ring[b]);
        if !free(0, k, k == 1) || !free(k, n - 1, k == n - 2) {
            return None;
        }
        let mut all = vec![[ring[0], ring[k], ring[n - 1]]];
        if k >= 2 {
            all.extend(cut(&ring[..=k])?);
        }
        if n - 1 - k >= 2 {
            all.extend(cut(&ring[k..])?);
        }
        Some(all)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_is_cut_without_cuts_along_faces() {
        for inside in 0..256usize {
            let triangles = &TRIANGLES[inside];
            let crossed: Vec<usize> =
                (0..EDGES).filter(|&e| (inside >> edge(e).0 ^ inside >> (edge(e).0 | 1 << edge(e).1)) & 1 == 1).collect();
            let mut used: Vec<usize> = triangles.iter().flatten().map(|&e| usize::from(e)).collect();
            used.sort_unstable();
            used.dedup();
            assert_eq!(used, crossed, "{inside:08b}");
            // Sides that have no opposite lie on faces: they are the joints.
            let sides: Vec<(u8, u8)> = triangles.iter().flat_map(|t| (0..3).map(|i| (t[i], t[(i + 1) % 3]))).collect();
            for &(a, b) in &sides {
                let twice = sides.iter().filter(|&&s| s == (b, a)).count();
                assert!(twice == 1 || share_face(a.into(), b.into()), "{inside:08b}");
                assert!(twice == 0 || !share_face(a.into(), b.into()), "{inside:08b}: a cut along a face");
            }
        }
    }

    #[test]
    fn a_corner_inside_is_seen_from_outside() {
        // Corner 0 inside: the normal points away from it.
        let middle = |e: u8| {
            let (corner, axis) = edge(e.into());
            let c: [f64; 3] = std::array::from_fn(|a| (corner >> a & 1) as f64 + if a == axis { 0.5 } else { 0.0 });
            nalgebra::Vector3::from(c)
        };
        let [a, b, c] = TRIANGLES[1][0].map(middle);
        assert!((b - a).cross(&(c - a)).sum() > 0.0);
    }
}
