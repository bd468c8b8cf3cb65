//! glTF 2.0 in its binary form (Khronos Group, *glTF 2.0 specification*, 2021, section 4.4).

use super::FormatError;
use crate::Mesh;
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};
use std::io::Write;

/// Component types of accessors, and targets of buffer views.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_BYTE: u32 = 5121;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Writes a mesh as a GLB file with one primitive: positions as float from the middle of the mesh, which is the translation of the node (so that
/// world coordinates of millions of metres lose nothing within the mesh), vertex colours as linear RGBA bytes where present, y up as
/// glTF has it where z is up in the mesh.
///
/// # Errors
/// [`FormatError::NotRepresentable`] for a mesh without faces, colours that are neither absent nor one a vertex, a face that names no vertex, or more
/// than 4 GB; [`FormatError::Stream`] where writing fails.
pub fn write_glb_mesh(mesh: &Mesh, mut out: impl Write) -> Result<(), FormatError> {
    let refuse = |what: &str| Err(FormatError::NotRepresentable { format: "GLB", what: what.to_owned() });
    let count = mesh.vertices.len();
    if mesh.faces.is_empty() {
        return refuse("the mesh has no faces");
    }
    if !mesh.colours.is_empty() && mesh.colours.len() != count {
        return refuse("there is not one colour a vertex");
    }
    if mesh.faces.iter().flatten().any(|&v| v as usize >= count) {
        return refuse("a face names a vertex that does not exist");
    }
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for v in &mesh.vertices {
        (low, high) = (low.inf(&v.coords), high.sup(&v.coords));
    }
    let middle = (low + high) / 2.0;
    // From z up to y up.
    let turned = |v: &Point3<f64>| {
        let d = v.coords - middle;
        [d.x as f32, d.z as f32, -d.y as f32]
    };
    let mut bytes = Vec::with_capacity(count * 16 + mesh.faces.len() * 12);
    let (mut min, mut max) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for v in &mesh.vertices {
        for (k, c) in turned(v).into_iter().enumerate() {
            (min[k], max[k]) = (min[k].min(c), max[k].max(c));
            bytes.extend_from_slice(&c.to_le_bytes());
        }
    }
    let mut views = vec![json!({"buffer": 0, "byteOffset": 0, "byteLength": bytes.len(), "target": VERTICES})];
    let mut accessors = vec![json!({"bufferView": 0, "componentType": FLOAT, "count": count, "type": "VEC3", "min": min, "max": max})];
    let mut attributes = json!({"POSITION": 0});
    if !mesh.colours.is_empty() {
        let start = bytes.len();
        for colour in &mesh.colours {
            bytes.extend_from_slice(&colour.map(linear));
            bytes.push(255);
        }
        views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": bytes.len() - start, "target": VERTICES}));
        accessors.push(json!({"bufferView": 1, "componentType": UNSIGNED_BYTE, "normalized": true, "count": count, "type": "VEC4"}));
        attributes["COLOR_0"] = json!(1);
    }
    let start = bytes.len();
    mesh.faces.iter().flatten().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()));
    views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": bytes.len() - start, "target": INDICES}));
    let indices = accessors.len();
    accessors.push(json!({"bufferView": indices, "componentType": UNSIGNED_INT, "count": mesh.faces.len() * 3, "type": "SCALAR"}));
    let text = head(bytes.len(), [middle.x, middle.z, -middle.y], &attributes, indices, &views, &accessors);
    let total = 12 + 8 + text.len() + 8 + bytes.len();
    let Ok(total) = u32::try_from(total) else { return refuse("it takes more than 4 GB") };
    out.write_all(b"glTF")?;
    for word in [2, total, text.len() as u32, u32::from_le_bytes(*b"JSON")] {
        out.write_all(&word.to_le_bytes())?;
    }
    out.write_all(&text)?;
    for word in [bytes.len() as u32, u32::from_le_bytes(*b"BIN\0")] {
        out.write_all(&word.to_le_bytes())?;
    }
    out.write_all(&bytes)?;
    Ok(out.flush()?)
}

/// The JSON chunk, padded to four bytes with spaces.
fn head(bytes: usize, translation: [f64; 3], attributes: &Value, indices: usize, views: &[Value], accessors: &[Value]) -> Vec<u8> {
    let value = json!({
        "asset": {"version": "2.0", "generator": "sfm"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": translation}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": indices, "mode": 4, "material": 0}]}],
        "materials": [{"doubleSided": true, "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}],
        "buffers": [{"byteLength": bytes}],
        "bufferViews": views,
        "accessors": accessors,
    });
    let mut text = value.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    text
}

/// sRGB to linear (IEC 61966-2-1), as vertex colours of glTF are.
fn linear(value: u8) -> u8 {
    let v = f64::from(value) / 255.0;
    let linear = if v <= 0.040_45 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    (linear * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_have_the_lengths_they_say_and_hold_the_mesh() {
        let vertices = [[1e6, 0.0, 0.0], [1e6 + 2.0, 0.0, 0.0], [1e6, 4.0, 1.0]].map(Point3::from).to_vec();
        let mut mesh = Mesh { vertices, faces: vec![[0, 1, 2]], colours: vec![[0, 128, 255]; 3] };
        let mut bytes = Vec::new();
        write_glb_mesh(&mesh, &mut bytes).expect("written");
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().expect("four")) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (b"glTF".as_slice(), 2, bytes.len()));
        let json: Value = serde_json::from_slice(&bytes[20..20 + word(12)]).expect("JSON");
        let binary = &bytes[28 + word(12)..];
        assert_eq!(word(20 + word(12)), binary.len());
        assert_eq!(json["buffers"][0]["byteLength"], binary.len());
        assert_eq!(json["nodes"][0]["translation"], json!([1e6 + 1.0, 0.5, -2.0]));
        // The third vertex, (-1, 2, 0.5) from the middle, y up.
        let float = |at: usize| f32::from_le_bytes(binary[at..at + 4].try_into().expect("four"));
        assert_eq!([float(24), float(28), float(32)], [-1.0, 0.5, -2.0]);
        assert_eq!(&binary[36..40], &[0, 55, 255, 255], "sRGB 128 is 21.6 % of the light");
        assert_eq!(&binary[48..], &[0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]);
        mesh.faces[0][1] = 3;
        assert!(write_glb_mesh(&mesh, Vec::new()).is_err());
    }
}
