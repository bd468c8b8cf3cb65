//! The true surface as triangles.

use super::surface::{BOTTOM_HALF_M, Block, bottom};
use nalgebra::{Point3, Vector3};
use scene::Mesh;

/// Spacing of the bottom's grid, metres: the ripples' sagitta between grid points stays below 0.4 mm.
const GRID_M: f64 = 0.04;

/// Boxes as twelve triangles each, the bottom as a grid.
pub(super) fn mesh(blocks: &[Block]) -> Mesh {
    let mut mesh = Mesh::default();
    for block in blocks {
        add_block(&mut mesh, block);
    }
    let steps = (2.0 * BOTTOM_HALF_M / GRID_M).round() as u32;
    let first = mesh.vertices.len() as u32;
    for j in 0..=steps {
        for i in 0..=steps {
            let (x, y) = (-BOTTOM_HALF_M + GRID_M * f64::from(i), -BOTTOM_HALF_M + GRID_M * f64::from(j));
            mesh.vertices.push(Point3::new(x, y, bottom(x, y)));
        }
    }
    for j in 0..steps {
        for i in 0..steps {
            let a = first + j * (steps + 1) + i;
            let (b, c, d) = (a + 1, a + steps + 1, a + steps + 2);
            mesh.faces.push([a, b, d]);
            mesh.faces.push([a, d, c]);
        }
    }
    mesh
}

fn add_block(mesh: &mut Mesh, block: &Block) {
    let first = mesh.vertices.len() as u32;
    for corner in 0..8u32 {
        let pick = |axis: usize| if corner >> axis & 1 == 1 { block.high[axis] } else { block.low[axis] };
        mesh.vertices.push(Vector3::new(pick(0), pick(1), pick(2)).into());
    }
    // Corners are numbered by bits x, y, z; each side counter-clockwise from outside.
    for [a, b, c, d] in [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]] {
        mesh.faces.push([first + a, first + b, first + c]);
        mesh.faces.push([first + a, first + c, first + d]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::surface::Material;
    use super::*;

    #[test]
    fn a_box_is_closed_and_faces_outwards() {
        let mut mesh = Mesh::default();
        let (low, high) = (Vector3::zeros(), Vector3::new(2.0, 3.0, 4.0));
        add_block(&mut mesh, &Block { low, high, material: Material::Concrete });
        // The divergence theorem: a closed surface that faces outwards has a positive volume.
        let volume: f64 = mesh
            .faces
            .iter()
            .map(|f| {
                let [a, b, c] = f.map(|i| mesh.vertices[i as usize].coords);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((volume - 24.0).abs() < 1e-12, "{volume}");
    }
}
