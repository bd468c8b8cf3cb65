use super::*;
use crate::format::FormatError;
use crate::{Cloud, Mesh};
use nalgebra::{Point3, Vector3};
use proptest::prelude::*;

fn cloud() -> Cloud {
    Cloud {
        positions: vec![Point3::new(0.1, -2.0, 1e-9), Point3::new(3.0, 4.0, 5.0)],
        normals: vec![Vector3::new(0.0, 0.0, 1.0), Vector3::new(1.0, 0.0, 0.0)],
        colours: vec![[1, 2, 3], [255, 0, 128]],
        views: vec![3, 40_000],
        sigmas: vec![0.01, 0.5],
    }
}

fn bytes(cloud: &Cloud) -> Vec<u8> {
    let mut out = Vec::new();
    write_ply_cloud(cloud, &mut out).expect("memory");
    out
}

#[test]
fn clouds_survive_with_every_set_of_attributes() {
    for kept in 0..16 {
        let mut cloud = cloud();
        if kept & 1 == 0 {
            cloud.normals.clear()
        }
        if kept & 2 == 0 {
            cloud.colours.clear()
        }
        if kept & 4 == 0 {
            cloud.views.clear()
        }
        if kept & 8 == 0 {
            cloud.sigmas.clear()
        }
        let (found, dropped) = read_ply_cloud(bytes(&cloud).as_slice()).expect("our own bytes");
        assert_eq!((found, dropped), (cloud, Dropped::default()));
    }
    let (empty, _) = read_ply_cloud(bytes(&Cloud::default()).as_slice()).expect("an empty cloud is a cloud");
    assert!(empty.is_empty());
}

#[test]
fn layout_is_the_documented_one() {
    let bytes = bytes(&cloud());
    let end = bytes.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let header = std::str::from_utf8(&bytes[..end]).expect("text");
    assert!(header.starts_with("ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty double x\n"), "{header}");
    assert_eq!(bytes.len() - end, 2 * (24 + 12 + 3 + 2 + 4));
    assert_eq!(bytes[end..end + 8], 0.1f64.to_le_bytes());
    assert_eq!(bytes[end + 36..end + 41], [1, 2, 3, 3, 0]);
}

#[test]
fn attributes_of_the_wrong_length_are_refused() {
    let mut cloud = cloud();
    cloud.views.pop();
    assert!(matches!(write_ply_cloud(&cloud, Vec::new()), Err(FormatError::NotRepresentable { .. })));
    let mesh = Mesh { vertices: vec![Point3::origin()], faces: vec![[0, 0, 1]], colours: vec![] };
    assert!(matches!(write_ply_mesh(&mesh, Vec::new()), Err(FormatError::NotRepresentable { .. })));
}

#[test]
fn any_order_type_and_encoding_is_read() {
    let header = |encoding: &str| {
        format!(
            "ply\nformat {encoding} 1.0\ncomment made by hand\nelement camera 1\nproperty float view\nproperty list uchar short marks\n\
             element vertex 2\nproperty uchar blue\nproperty float z\nproperty int y\nproperty uchar red\nproperty double x\nproperty uchar green\n\
             element face 1\nproperty list uchar int vertex_index\nend_header\n"
        )
    };
    let ascii = header("ascii") + "0.5 2 -7 9\n3 0.25 -4 1 1.5 2\n30 nan 5 10 2.5 20\n4 0 0 0 0\n";
    let binary = |big: bool| {
        let mut out = header(if big { "binary_big_endian" } else { "binary_little_endian" }).into_bytes();
        let mut put = |little: &[u8]| if big { out.extend(little.iter().rev()) } else { out.extend(little) };
        put(&0.5f32.to_le_bytes());
        put(&[2]);
        put(&(-7i16).to_le_bytes());
        put(&9i16.to_le_bytes());
        for (blue, z, y, red, x, green) in [(3u8, 0.25f32, -4i32, 1u8, 1.5f64, 2u8), (30, f32::NAN, 5, 10, 2.5, 20)] {
            put(&[blue]);
            put(&z.to_le_bytes());
            put(&y.to_le_bytes());
            put(&[red]);
            put(&x.to_le_bytes());
            put(&[green]);
        }
        put(&[4]);
        (0..4).for_each(|_| put(&0i32.to_le_bytes()));
        out
    };
    for bytes in [ascii.replace('\n', "\r\n").into_bytes(), ascii.into_bytes(), binary(false), binary(true)] {
        let (cloud, dropped) = read_ply_cloud(bytes.as_slice()).expect("valid");
        assert_eq!(cloud.positions, [Point3::new(1.5, -4.0, 0.25)]);
        assert_eq!(cloud.colours, [[1, 2, 3]]);
        assert!(cloud.normals.is_empty() && cloud.views.is_empty());
        assert_eq!(dropped.points, 1);
        let (mesh, dropped) = read_ply_mesh(bytes.as_slice()).expect("valid");
        assert_eq!((mesh.vertices.len(), mesh.faces.len(), mesh.colours.len(), dropped), (1, 2, 1, Dropped { points: 1, faces: 0 }));
    }
}

#[test]
fn meshes_survive_and_polygons_are_fanned() {
    let mesh = Mesh {
        vertices: vec![Point3::origin(), Point3::new(1.0, 0.0, 0.0), Point3::new(0.0, 1.0, 0.5)],
        faces: vec![[0, 1, 2], [2, 1, 0]],
        colours: vec![[9, 8, 7]; 3],
    };
    let mut bytes = Vec::new();
    write_ply_mesh(&mesh, &mut bytes).expect("memory");
    assert_eq!(read_ply_mesh(bytes.as_slice()).expect("our own bytes"), (mesh, Dropped::default()));
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar uint vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n2 0 1\n";
    let (mesh, dropped) = read_ply_mesh(text.as_bytes()).expect("valid");
    assert_eq!((mesh.faces, dropped.faces), (vec![[0, 1, 2], [0, 2, 3]], 1));
}

#[test]
fn errors_say_where() {
    let head = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    for (text, expected) in [("1 2 3\n4 5\n", 9), ("1 2 3\n", 9), ("a 2 3\n", 8)] {
        match read_ply_cloud((head.to_owned() + text).as_bytes()) {
            Err(FormatError::Line { line, .. }) => assert_eq!(line, expected, "{text:?}"),
            other => panic!("{text:?}: {other:?}"),
        }
    }
    let whole = bytes(&cloud());
    match read_ply_cloud(&whole[..whole.len() - 3]) {
        Err(FormatError::Bytes { offset, what, .. }) => {
            assert!(offset as usize >= whole.len() - 7 && what.contains("vertex 1 of 2"), "{offset}: {what}");
        }
        other => panic!("{other:?}"),
    }
    for bad in [
        "",
        "ply\n",
        "solid cube\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n",
        "ply\nformat ascii 1.0\nend_header\n",
    ] {
        assert!(read_ply_cloud(bad.as_bytes()).is_err(), "{bad:?}");
    }
    let face = head.replace("end_header", "element face 1\nproperty list uchar int vertex_indices\nend_header") + "0 0 0\n0 0 0\n3 0 1 2\n";
    assert!(read_ply_mesh(face.as_bytes()).is_err(), "vertex 2 does not exist");
}

#[test]
fn announced_counts_cost_nothing() {
    let head = "ply\nformat binary_little_endian 1.0\nelement nothing 18446744073709551615\nelement vertex 18446744073709551615\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    assert!(read_ply_cloud(head.as_bytes()).is_err());
}

proptest! {
    #[test]
    fn broken_files_do_not_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..5), cut in any::<prop::sample::Index>()) {
        let mesh = Mesh { vertices: vec![Point3::origin(); 3], faces: vec![[0, 1, 2]], colours: vec![[1, 2, 3]; 3] };
        let mut of_mesh = Vec::new();
        write_ply_mesh(&mesh, &mut of_mesh).expect("memory");
        for mut bytes in [of_mesh, bytes(&cloud())] {
            for (at, value) in &changes {
                let at = at.index(bytes.len());
                bytes[at] = *value;
            }
            bytes.truncate(cut.index(bytes.len()) + 1);
            let _ = read_ply_cloud(bytes.as_slice());
            if let Ok((mesh, _)) = read_ply_mesh(bytes.as_slice()) {
                prop_assert!(mesh.faces.iter().flatten().all(|&v| (v as usize) < mesh.vertices.len()));
            }
        }
    }
}
