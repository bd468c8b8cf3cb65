//! Binary little-endian PLY.

use crate::format::FormatError;
use crate::{Cloud, Mesh};
use std::io::Write;

/// Records gathered before they go to the stream.
const RECORDS_PER_WRITE: usize = 4096;

/// Writes a cloud as binary little-endian PLY: `x y z` as double; where present `nx ny nz` as float, `red green blue` as
/// uchar, `views` as ushort, `sigma` as float.
///
/// # Errors
/// [`FormatError::NotRepresentable`] where an attribute list is neither empty nor as long as the positions;
/// [`FormatError::Stream`] where writing fails.
pub fn write_ply_cloud(cloud: &Cloud, mut out: impl Write) -> Result<(), FormatError> {
    let n = cloud.len();
    let lengths = [cloud.normals.len(), cloud.colours.len(), cloud.views.len(), cloud.sigmas.len()];
    let names = ["normals", "colours", "views", "sigmas"];
    for (length, name) in lengths.into_iter().zip(names) {
        check_length(name, length, n)?;
    }
    let [normals, colours, views, sigmas] = lengths.map(|length| length > 0);
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {n}\n");
    let mut property = |present: bool, kind: &str, names: &[&str]| {
        for name in names.iter().filter(|_| present) {
            header.push_str(&format!("property {kind} {name}\n"));
        }
    };
    property(true, "double", &["x", "y", "z"]);
    property(normals, "float", &["nx", "ny", "nz"]);
    property(colours, "uchar", &["red", "green", "blue"]);
    property(views, "ushort", &["views"]);
    property(sigmas, "float", &["sigma"]);
    header.push_str("end_header\n");
    out.write_all(header.as_bytes())?;
    let mut buffer = Vec::with_capacity(RECORDS_PER_WRITE * 48);
    for start in (0..n).step_by(RECORDS_PER_WRITE) {
        buffer.clear();
        for i in start..n.min(start + RECORDS_PER_WRITE) {
            cloud.positions[i].iter().for_each(|v| buffer.extend_from_slice(&v.to_le_bytes()));
            if normals {
                cloud.normals[i].iter().for_each(|v| buffer.extend_from_slice(&v.to_le_bytes()));
            }
            if colours {
                buffer.extend_from_slice(&cloud.colours[i]);
            }
            if views {
                buffer.extend_from_slice(&cloud.views[i].to_le_bytes());
            }
            if sigmas {
                buffer.extend_from_slice(&cloud.sigmas[i].to_le_bytes());
            }
        }
        out.write_all(&buffer)?;
    }
    out.flush()?;
    Ok(())
}

/// Writes a mesh as binary little-endian PLY: `x y z` as double, `red green blue` as uchar where present, faces as
/// `list uchar uint vertex_indices`.
///
/// # Errors
/// [`FormatError::NotRepresentable`] where the colours are neither empty nor as many as the vertices, or a face names a
/// vertex that does not exist; [`FormatError::Stream`] where writing fails.
pub fn write_ply_mesh(mesh: &Mesh, mut out: impl Write) -> Result<(), FormatError> {
    check_length("colours", mesh.colours.len(), mesh.vertices.len())?;
    if let Some((i, face)) = mesh.faces.iter().enumerate().find(|(_, f)| f.iter().any(|&v| v as usize >= mesh.vertices.len())) {
        let what = format!("face {i} names vertices {face:?} of {}", mesh.vertices.len());
        return Err(FormatError::NotRepresentable { format: "PLY", what });
    }
    let colours = if mesh.colours.is_empty() { "" } else { "property uchar red\nproperty uchar green\nproperty uchar blue\n" };
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\n{colours}\
         element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.faces.len()
    )?;
    let mut buffer = Vec::with_capacity(RECORDS_PER_WRITE * 27);
    for start in (0..mesh.vertices.len()).step_by(RECORDS_PER_WRITE) {
        buffer.clear();
        for i in start..mesh.vertices.len().min(start + RECORDS_PER_WRITE) {
            mesh.vertices[i].iter().for_each(|v| buffer.extend_from_slice(&v.to_le_bytes()));
            if let Some(colour) = mesh.colours.get(i) {
                buffer.extend_from_slice(colour);
            }
        }
        out.write_all(&buffer)?;
    }
    for faces in mesh.faces.chunks(RECORDS_PER_WRITE) {
        buffer.clear();
        for face in faces {
            buffer.push(3);
            face.iter().for_each(|v| buffer.extend_from_slice(&v.to_le_bytes()));
        }
        out.write_all(&buffer)?;
    }
    out.flush()?;
    Ok(())
}

fn check_length(name: &str, found: usize, points: usize) -> Result<(), FormatError> {
    if found == 0 || found == points {
        return Ok(());
    }
    Err(FormatError::NotRepresentable { format: "PLY", what: format!("{found} {name} for {points} points") })
}
