//! What surfaces are: label, material, mesh.

use nalgebra::Vector3;
use scene::{Mesh, Rigid3};

/// What a pixel shows; the values of the label images.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Label {
    /// Nothing but water.
    Water = 0,
    /// The reef, wreck, pipe or plate that is surveyed, with what grows on it.
    Structure = 1,
    /// The bottom.
    Sand = 2,
    /// Stones on the bottom.
    Stone = 3,
    /// Scale bars and targets that stay.
    Target = 4,
    /// The other vehicle and what it carries.
    Vehicle = 5,
    /// The vehicle's tether.
    Tether = 6,
    /// Fish.
    Fish = 7,
}

impl Label {
    /// All labels, each at the place of its number.
    pub const ALL: [Self; 8] =
        [Self::Water, Self::Structure, Self::Sand, Self::Stone, Self::Target, Self::Vehicle, Self::Tether, Self::Fish];

    /// The name used in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Water => "water",
            Self::Structure => "structure",
            Self::Sand => "sand",
            Self::Stone => "stone",
            Self::Target => "target",
            Self::Vehicle => "vehicle",
            Self::Tether => "tether",
            Self::Fish => "fish",
        }
    }

    /// Whether it stays where it is, and so belongs to the true surface and mask.
    #[must_use]
    pub fn is_static(self) -> bool {
        matches!(self, Self::Structure | Self::Sand | Self::Stone | Self::Target)
    }
}

/// How a surface looks. Everything is a function of the position in the frame of its body: there are no texture coordinates.
#[derive(Clone, Debug, PartialEq)]
pub enum Material {
    /// Weathered concrete with growth.
    Concrete,
    /// The bottom.
    Sand,
    /// Stones.
    Stone,
    /// Painted plates, rusting.
    Steel,
    /// A coated pipe.
    Pipe,
    /// One colour, linear RGB.
    Plain {
        /// Albedo.
        albedo: [f32; 3],
    },
    /// A fish: dark above, bright below.
    Fish,
    /// A scale bar with dark and bright bands.
    Bar {
        /// Where the first band begins.
        origin: [f64; 3],
        /// Unit vector along the bar.
        axis: [f64; 3],
        /// Width of a band, metres.
        band_m: f64,
    },
    /// A printed panel: index into [`super::World::panels`].
    Panel(usize),
}

/// A surface of one material.
#[derive(Clone, Debug)]
pub struct Part {
    /// What it is called.
    pub name: &'static str,
    /// What its pixels are labelled.
    pub label: Label,
    /// How it looks.
    pub material: Material,
    /// Its triangles.
    pub mesh: Mesh,
    /// Unit normals of the vertices, for light.
    pub normals: Vec<Vector3<f32>>,
}

impl Part {
    /// A part whose normals are those of its faces, averaged at the vertices by area.
    #[must_use]
    pub fn new(name: &'static str, label: Label, material: Material, mesh: Mesh) -> Self {
        let mut sums = vec![Vector3::zeros(); mesh.vertices.len()];
        for face in &mesh.faces {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            let normal = (b - a).cross(&(c - a));
            face.iter().for_each(|&v| sums[v as usize] += normal);
        }
        let normals = sums.iter().map(|n| n.try_normalize(1e-30).unwrap_or(Vector3::z()).cast()).collect();
        Self { name, label, material, mesh, normals }
    }

    /// The same part elsewhere.
    #[must_use]
    pub fn moved(&self, b_from_a: &Rigid3) -> Self {
        let rotation = b_from_a.rotation.cast::<f32>();
        let mut mesh = self.mesh.clone();
        mesh.vertices.iter_mut().for_each(|v| *v = b_from_a.apply(&v.coords).into());
        Self { mesh, normals: self.normals.iter().map(|n| rotation * n).collect(), material: self.material.clone(), ..*self }
    }
}
