//! What is taken of a PLY vertex and of a PLY face; everything else is skipped.

use ply_rs_bw::ply::{BeginList, PropertyAccess, PropertyAccessResult as Outcome};

/// A vertex; what the file does not tell stays NaN or 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub position: [f64; 3],
    pub normal: [f32; 3],
    pub colour: [u8; 3],
    pub views: u16,
    pub sigma: f32,
}

impl Vertex {
    fn set(&mut self, name: &str, value: f64) -> Outcome {
        match name {
            "x" => self.position[0] = value,
            "y" => self.position[1] = value,
            "z" => self.position[2] = value,
            "nx" => self.normal[0] = value as f32,
            "ny" => self.normal[1] = value as f32,
            "nz" => self.normal[2] = value as f32,
            "views" => self.views = value as u16,
            "sigma" => self.sigma = value as f32,
            _ => return Outcome::Ignored,
        }
        Outcome::Set
    }

    /// Real colours run from 0 to 1, whole ones from 0 to 255.
    fn set_real(&mut self, name: &str, value: f64) -> Outcome {
        match channel(name) {
            Some(i) => self.colour[i] = (value * 255.0).round() as u8,
            None => return self.set(name, value),
        }
        Outcome::Set
    }

    fn set_whole(&mut self, name: &str, value: f64) -> Outcome {
        match channel(name) {
            Some(i) => self.colour[i] = value as u8,
            None => return self.set(name, value),
        }
        Outcome::Set
    }
}

/// Which channel a colour property is.
fn channel(name: &str) -> Option<usize> {
    match name {
        "red" | "r" | "diffuse_red" => Some(0),
        "green" | "g" | "diffuse_green" => Some(1),
        "blue" | "b" | "diffuse_blue" => Some(2),
        _ => None,
    }
}

/// Which attributes the properties of an element give.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Attributes {
    pub positions: bool,
    pub normals: bool,
    pub colours: bool,
    pub views: bool,
    pub sigmas: bool,
}

impl Attributes {
    pub fn of<'a>(names: impl Iterator<Item = &'a str> + Clone) -> Self {
        let has = |wanted: &[&str]| wanted.iter().all(|w| names.clone().any(|n| n == *w));
        let colours = (0..3).all(|i| names.clone().any(|n| channel(n) == Some(i)));
        Self {
            positions: has(&["x", "y", "z"]),
            normals: has(&["nx", "ny", "nz"]),
            colours,
            views: has(&["views"]),
            sigmas: has(&["sigma"]),
        }
    }
}

macro_rules! whole {
    ($($setter:ident: $type:ty),*) => {
        $(fn $setter(&mut self, name: &str, value: $type) -> Outcome {
            self.set_whole(name, f64::from(value))
        })*
    };
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], normal: [f32::NAN; 3], colour: [0; 3], views: 0, sigma: f32::NAN }
    }

    whole!(set_char: i8, set_uchar: u8, set_short: i16, set_ushort: u16, set_int: i32, set_uint: u32);

    fn set_float(&mut self, name: &str, value: f32) -> Outcome {
        self.set_real(name, f64::from(value))
    }

    fn set_double(&mut self, name: &str, value: f64) -> Outcome {
        self.set_real(name, value)
    }
}

/// A polygon: vertex indices, negative where the file says so.
#[derive(Clone, Debug, Default)]
pub(super) struct Face {
    pub indices: Vec<i64>,
}

fn is_indices(name: &str) -> bool {
    matches!(name, "vertex_indices" | "vertex_index")
}

macro_rules! indices {
    ($($setter:ident: $type:ty),*) => {
        $(fn $setter(&mut self, name: &str, values: Vec<$type>) -> Outcome {
            if !is_indices(name) {
                return Outcome::Ignored;
            }
            self.indices.clear();
            self.indices.extend(values.into_iter().map(i64::from));
            Outcome::Set
        })*
    };
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    indices!(set_list_char: i8, set_list_uchar: u8, set_list_short: i16, set_list_ushort: u16, set_list_int: i32, set_list_uint: u32);

    fn set_list_double(&mut self, name: &str, _: Vec<f64>) -> Outcome {
        if is_indices(name) { Outcome::UnsupportedType } else { Outcome::Ignored }
    }

    fn begin_list_float(&mut self, name: &str, _: usize) -> BeginList<'_, f32> {
        if is_indices(name) { BeginList::UnsupportedType } else { BeginList::UseSetter }
    }

    fn begin_list_double(&mut self, name: &str, _: usize) -> BeginList<'_, f64> {
        if is_indices(name) { BeginList::UnsupportedType } else { BeginList::UseSetter }
    }
}

/// An element of which nothing is wanted.
pub(super) struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}
