//! All parts of a scene.

use super::bars::Bar;
use super::movers::Mover;
use super::options::WorldOptions;
use super::panel::Panel;
use super::part::Part;
use super::scenes::furnish;
use nalgebra::Vector3;
use scene::Mesh;

/// A scene.
#[derive(Clone, Debug, Default)]
pub struct World {
    /// What stays where it is.
    pub parts: Vec<Part>,
    /// What moves.
    pub movers: Vec<Mover>,
    /// Printed panels, by the numbers in [`super::Material::Panel`].
    pub panels: Vec<Panel>,
    /// Known lengths.
    pub bars: Vec<Bar>,
    /// What a survey looks at.
    pub centre: Vector3<f64>,
}

impl World {
    /// The scene of some options. The same on any number of threads.
    #[must_use]
    pub fn new(options: &WorldOptions) -> Self {
        furnish(options)
    }

    /// The true surface: all parts that stay, metres, z up.
    #[must_use]
    pub fn mesh(&self) -> Mesh {
        let mut mesh = Mesh::default();
        for part in &self.parts {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(&part.mesh.vertices);
            mesh.faces.extend(part.mesh.faces.iter().map(|face| face.map(|v| v + first)));
        }
        mesh
    }

    /// For each part, the number of its first face in [`World::mesh`].
    #[must_use]
    pub fn first_faces(&self) -> Vec<u32> {
        let counts = self.parts.iter().map(|part| part.mesh.faces.len() as u32);
        counts.scan(0, |sum, count| Some(std::mem::replace(sum, *sum + count))).collect()
    }
}
