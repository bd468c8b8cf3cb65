//! PLY of any encoding and property order.

use super::ascii;
use super::counted::Counted;
use super::elements::{Attributes, Face, Skipped, Vertex};
use crate::format::FormatError;
use crate::format::obj::fan;
use crate::{Cloud, Mesh};
use nalgebra::{Point3, Vector3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Encoding, Header, PropertyAccess};
use std::io::BufRead;

/// What a reader left out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Points or vertices whose position is not finite.
    pub points: usize,
    /// Faces with fewer than three corners, or with a corner that was dropped.
    pub faces: usize,
}

/// Most memory that is taken on the word of a header alone, in elements.
const MAX_RESERVED: usize = 1 << 16;

/// Reads a PLY cloud: ascii or binary of either byte order, properties in any order, positions float, double or whole.
///
/// Takes `x y z`, and where present `nx ny nz`, `red green blue` (0 to 255, or 0 to 1 where they are float), `views`,
/// `sigma`; all else is skipped. Points whose position is not finite are dropped and counted.
///
/// # Errors
/// [`FormatError::Line`] (ascii) and [`FormatError::Bytes`] (binary) where the file is not PLY, ends early or has no
/// vertex positions; [`FormatError::Stream`] where reading fails.
pub fn read_ply_cloud(input: impl BufRead) -> Result<(Cloud, Dropped), FormatError> {
    let mut file = PlyReader::open(input)?;
    let (mut cloud, mut dropped) = (Cloud::default(), Dropped::default());
    for element in file.elements() {
        if element.name != "vertex" {
            file.read::<Skipped>(&element, |_, _| Ok(()))?;
            continue;
        }
        let has = file.attributes(&element)?;
        reserve(&mut cloud, has, element.count.min(MAX_RESERVED));
        file.read::<Vertex>(&element, |_, vertex| {
            if vertex.position.iter().all(|v| v.is_finite()) {
                push(&mut cloud, has, &vertex);
            } else {
                dropped.points += 1;
            }
            Ok(())
        })?;
        // What follows the vertices does not matter to a cloud, nor whether it is complete.
        return Ok((cloud, dropped));
    }
    Err(file.error("there is no element vertex".into()))
}

fn reserve(cloud: &mut Cloud, has: Attributes, count: usize) {
    cloud.positions.reserve(count);
    cloud.normals.reserve(if has.normals { count } else { 0 });
    cloud.colours.reserve(if has.colours { count } else { 0 });
    cloud.views.reserve(if has.views { count } else { 0 });
    cloud.sigmas.reserve(if has.sigmas { count } else { 0 });
}

fn push(cloud: &mut Cloud, has: Attributes, vertex: &Vertex) {
    cloud.positions.push(Point3::from(vertex.position));
    if has.normals {
        cloud.normals.push(Vector3::from(vertex.normal));
    }
    if has.colours {
        cloud.colours.push(vertex.colour);
    }
    if has.views {
        cloud.views.push(vertex.views);
    }
    if has.sigmas {
        cloud.sigmas.push(vertex.sigma);
    }
}

/// Reads a PLY mesh, as [`read_ply_cloud`] reads a cloud; polygons become fans of triangles.
///
/// Vertices whose position is not finite are dropped with their faces, and so are faces with fewer than three corners.
///
/// # Errors
/// As [`read_ply_cloud`], and where a face names a vertex that does not exist. A file without faces is a mesh without
/// faces.
pub fn read_ply_mesh(input: impl BufRead) -> Result<(Mesh, Dropped), FormatError> {
    let mut file = PlyReader::open(input)?;
    let (mut mesh, mut has_vertices) = (Mesh::default(), false);
    let mut dropped = Dropped::default();
    for element in file.elements() {
        match element.name.as_str() {
            "vertex" => {
                let has = file.attributes(&element)?;
                has_vertices = true;
                file.read::<Vertex>(&element, |_, vertex| {
                    mesh.vertices.push(Point3::from(vertex.position));
                    if has.colours {
                        mesh.colours.push(vertex.colour);
                    }
                    Ok(())
                })?;
            }
            "face" => file.read::<Face>(&element, |i, face| {
                if has_vertices && let Some(index) = face.indices.iter().find(|&&v| v < 0 || v as usize >= mesh.vertices.len()) {
                    return Err(format!("face {i} names vertex {index} of {}", mesh.vertices.len()));
                }
                if !fan(&face.indices, &mut mesh.faces) {
                    dropped.faces += 1;
                }
                Ok(())
            })?,
            _ => file.read::<Skipped>(&element, |_, _| Ok(()))?,
        }
    }
    if !has_vertices {
        return Err(file.error("there is no element vertex".into()));
    }
    // Faces that came before the vertices could not be checked.
    if let Some(face) = mesh.faces.iter().find(|f| f.iter().any(|&v| v as usize >= mesh.vertices.len())) {
        return Err(file.error(format!("a face names vertices {face:?} of {}", mesh.vertices.len())));
    }
    drop_not_finite(&mut mesh, &mut dropped);
    Ok((mesh, dropped))
}

/// Removes vertices that are not finite, and the faces that use them.
pub(in crate::format) fn drop_not_finite(mesh: &mut Mesh, dropped: &mut Dropped) {
    let keep: Vec<bool> = mesh.vertices.iter().map(|v| v.iter().all(|c| c.is_finite())).collect();
    let bad = keep.iter().filter(|k| !**k).count();
    if bad == 0 {
        return;
    }
    dropped.points += bad;
    let mut next = 0;
    let renumbered: Vec<u32> = keep
        .iter()
        .map(|&k| {
            if k {
                next += 1;
                next - 1
            } else {
                u32::MAX
            }
        })
        .collect();
    let before = mesh.faces.len();
    mesh.faces.retain_mut(|face| {
        *face = face.map(|v| renumbered[v as usize]);
        face.iter().all(|&v| v != u32::MAX)
    });
    dropped.faces += before - mesh.faces.len();
    let mut flags = keep.iter().copied();
    mesh.vertices.retain(|_| flags.next().unwrap_or(true));
    let mut flags = keep.iter().copied();
    mesh.colours.retain(|_| flags.next().unwrap_or(true));
}

/// An open PLY file: the header is read, elements come one by one, so that no intermediate list is built.
pub(super) struct PlyReader<R: BufRead> {
    pub(super) reader: Reader<Counted<R>>,
    pub(super) header: Header,
    line: u64,
}

impl<R: BufRead> PlyReader<R> {
    pub(super) fn open(input: R) -> Result<Self, FormatError> {
        let mut reader = Reader::new(Counted::new(input));
        let header = Parser::<Skipped>::new().read_header(&mut reader).map_err(|e| {
            let what = e.to_string().replace(['\n', '\t'], " ");
            FormatError::Line { file: "PLY header", line: reader.line() as u64, what }
        })?;
        let line = reader.line() as u64;
        Ok(Self { reader, header, line })
    }

    pub(super) fn elements(&self) -> Vec<ElementDef> {
        self.header.elements.iter().map(|(_, e)| e.clone()).collect()
    }

    pub(super) fn attributes(&self, element: &ElementDef) -> Result<Attributes, FormatError> {
        let has = Attributes::of(element.properties.iter().map(|(name, _)| name.as_str()));
        if has.positions { Ok(has) } else { Err(self.error("vertices have no x, y, z".into())) }
    }

    pub(super) fn error(&self, what: String) -> FormatError {
        match self.header.encoding {
            Encoding::Ascii => FormatError::Line { file: "PLY", line: self.line, what },
            _ => FormatError::Bytes { file: "PLY", offset: self.reader.get_ref().offset, what },
        }
    }

    /// Hands every record of an element to `each`, which may refuse it.
    pub(super) fn read<E: PropertyAccess>(
        &mut self,
        element: &ElementDef,
        mut each: impl FnMut(usize, E) -> Result<(), String>,
    ) -> Result<(), FormatError> {
        if element.properties.is_empty() {
            // Records without properties take no bytes: a header may announce any number of them.
            return Ok(());
        }
        let parser = Parser::<E>::new();
        let mut text = String::new();
        for i in 0..element.count {
            let record = match self.header.encoding {
                Encoding::Ascii => {
                    text.clear();
                    match self.reader.get_mut().read_line(&mut text) {
                        Ok(0) => Err("the file ends here".into()),
                        Ok(_) => ascii::record(&text, element),
                        Err(e) => Err(e.to_string()),
                    }
                }
                Encoding::BinaryLittleEndian => {
                    parser.read_little_endian_element(self.reader.get_mut(), element).map_err(|e| e.to_string())
                }
                Encoding::BinaryBigEndian => parser.read_big_endian_element(self.reader.get_mut(), element).map_err(|e| e.to_string()),
            };
            record.and_then(|record| each(i, record)).map_err(|what| {
                let what = what.replace(['\n', '\t'], " ");
                self.error(format!("{} {i} of {}: {what}", element.name, element.count))
            })?;
            self.line += 1;
        }
        Ok(())
    }
}
