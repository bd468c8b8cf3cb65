//! Scenes against what is known of them.

use super::*;
use nalgebra::Vector3;
use scene::Mesh;
use std::collections::BTreeMap;

fn scene(kind: SceneKind) -> World {
    World::new(&WorldOptions { scene: kind, detail_m: 0.06, stones: 5, fish: 2, ..WorldOptions::default() })
}

/// Every edge is passed once in each direction: closed, and all faces turned the same way.
fn is_closed(mesh: &Mesh) -> bool {
    let mut edges = BTreeMap::new();
    for face in &mesh.faces {
        for k in 0..3 {
            let (a, b) = (face[k], face[(k + 1) % 3]);
            *edges.entry((a.min(b), a.max(b))).or_insert(0) += if a < b { 1 } else { -1 };
        }
    }
    edges.values().all(|&balance| balance == 0)
}

fn volume(mesh: &Mesh) -> f64 {
    let part = |f: &[u32; 3]| {
        let [a, b, c] = f.map(|i| mesh.vertices[i as usize].coords);
        a.dot(&b.cross(&c)) / 6.0
    };
    mesh.faces.iter().map(part).sum()
}

#[test]
fn a_solid_becomes_a_closed_surface_that_faces_outwards() {
    let reef = structure::reef(0.05, 1);
    let (mesh, normals) = nets::mesh(&reef, Vector3::new(-1.7, -1.7, -0.5), Vector3::new(1.7, 1.7, 3.2), 0.06);
    assert!(mesh.faces.len() > 20_000, "{}", mesh.faces.len());
    assert!(is_closed(&mesh));
    // Slabs 2 x 9 m2 x 0.25..0.47 m, posts, beams, walls, less the openings.
    assert!((7.0..12.0).contains(&volume(&mesh)), "{}", volume(&mesh));
    // On the surface: the distance of a vertex is small against the cell; thin parts and edges keep the mean of the cell.
    let off = mesh.vertices.iter().filter(|v| reef.distance(&v.coords).abs() > 0.01).count();
    assert!(off * 50 < mesh.vertices.len(), "{off} of {}", mesh.vertices.len());
    assert!(normals.iter().all(|n| (n.norm() - 1.0).abs() < 1e-4));
}

#[test]
fn a_block_has_its_volume() {
    let block = solid::Solid { add: vec![solid::Shape::block([0.0; 3], [1.0, 0.5, 0.3], 0.0)], ..Default::default() };
    let (mesh, _) = nets::mesh(&block, Vector3::repeat(-0.1), Vector3::repeat(1.1), 0.02);
    assert!(is_closed(&mesh));
    // Edges are cut by less than a cell: 6 m of edges of 0.02 x 0.02 / 2.
    assert!((volume(&mesh) - 0.15).abs() < 0.0015, "{}", volume(&mesh));
}

#[test]
fn every_scene_has_a_surface_and_the_same_on_one_and_two_threads() {
    for kind in [SceneKind::Reef, SceneKind::Hull, SceneKind::Pipeline, SceneKind::Hemispheres, SceneKind::Tank] {
        let on = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| scene(kind))
        };
        let (one, two) = (on(1), on(2));
        assert_eq!(one.mesh(), two.mesh(), "{kind:?}");
        assert!(one.mesh().faces.len() > 50, "{kind:?}");
        assert_eq!(one.first_faces().len(), one.parts.len());
        for part in &one.parts {
            assert_eq!(part.normals.len(), part.mesh.vertices.len(), "{}", part.name);
            assert!(part.label.is_static());
        }
    }
}

#[test]
fn bars_have_their_lengths_between_the_centres_of_their_targets() {
    for kind in [SceneKind::Reef, SceneKind::Hull, SceneKind::Pipeline] {
        let world = scene(kind);
        let lengths: Vec<f64> = world.bars.iter().map(Bar::length_m).collect();
        assert!((lengths[0] - 1.0).abs() < 1e-12 && (lengths[1] - 0.825_222).abs() < 1e-12, "{lengths:?}");
        let targets: Vec<&Part> = world.parts.iter().filter(|p| p.name == "target").collect();
        let ends = world.bars.iter().flat_map(|bar| bar.ends.map(|end| (bar, end)));
        assert_eq!(targets.len(), 4);
        for ((bar, end), part) in ends.zip(targets) {
            let Material::Panel(index) = part.material else { panic!("a target is printed") };
            let panel = &world.panels[index];
            let grey = |p: Vector3<f64>| panel.albedo((p - panel.origin).dot(&panel.u), (p - panel.origin).dot(&panel.v), 1e-4);
            // The front of the plate goes through the end, and what is printed there is a disc about it.
            let front = part.mesh.vertices.iter().map(|v| (v.coords - end).dot(&bar.normal)).fold(f64::NEG_INFINITY, f64::max);
            assert!(front.abs() < 1e-12, "{kind:?} {}: {front}", bar.name);
            for direction in bar.target_axes().into_iter().flat_map(|a| [a, -a]) {
                assert!(
                    grey(end + direction * (0.98 * bar.target_radius_m)) < 0.1
                        && grey(end + direction * (1.02 * bar.target_radius_m)) > 0.8
                );
            }
            assert!(bar.normal.y < -0.5, "targets face where cameras come from");
        }
    }
}

#[test]
fn hemispheres_lie_on_their_radius() {
    let world = World::new(&WorldOptions { scene: SceneKind::Hemispheres, hemisphere_radius_m: 0.1, ..WorldOptions::default() });
    let balls = world.parts.iter().find(|p| p.name == "hemispheres").expect("there");
    let one = &balls.mesh.vertices[..balls.mesh.vertices.len() / 23];
    let (first, radius) = (one[0], 0.1);
    // The first vertex of a ball of radius 1 is (-1, g, 0) / |..|: its centre follows.
    let g = f64::midpoint(1.0, 5f64.sqrt());
    let centre = first.coords - Vector3::new(-1.0, g, 0.0).normalize() * radius;
    assert!(one.iter().take(1000).all(|v| ((v.coords - centre).norm() - radius).abs() < 1e-12));
}

#[test]
fn the_carried_bar_has_its_length_and_moves() {
    let world = scene(SceneKind::Reef);
    let panel = world.panels.iter().find(|p| matches!(p.art, Art::Rings { .. })).expect("carried");
    let Art::Rings { centres, .. } = &panel.art else { unreachable!() };
    let [a, b] = [0, 1].map(|k| panel.origin + panel.u * centres[k][0] + panel.v * centres[k][1]);
    assert!(((a - b).norm() - CARRIED_BAR_M).abs() < 1e-12);
    let at = |t: f64| world.movers.iter().map(|m| m.at(t).0).collect::<Vec<_>>();
    let (early, late) = (at(0.0), at(5.0));
    assert_eq!(early.len(), 4, "two fish, vehicle, tether");
    for (a, b) in early.iter().zip(&late) {
        assert_ne!(a[0].mesh.vertices, b[0].mesh.vertices);
        assert!(a.iter().all(|part| !part.label.is_static()));
    }
}

/// Where a cell comes to lie when a tag is turned.
type Turn = fn(i64, i64) -> (i64, i64);

/// A tag read back cell by cell has the code of its id; white surrounds it.
#[test]
fn tags_read_as_their_ids() {
    let world = scene(SceneKind::Tank);
    let Art::Tags { columns, side_m, gap_m, first_id, .. } = world.panels[0].art else { panic!("tags") };
    for (i, j) in [(0, 0), (6, 0), (3, 2), (6, 3)] {
        let id = first_id + j * columns + i;
        let corner = |k: u32| gap_m + f64::from(k) * (side_m + gap_m);
        for row in -1..9i64 {
            for column in -1..9i64 {
                let at = |corner: f64, cell: i64| corner + (cell as f64 + 0.5) * side_m / 8.0;
                let seen = world.panels[0].albedo(at(corner(i), column), at(corner(j), row), 1e-4) > 0.4;
                assert_eq!(seen, tag_cell(id, row, column), "tag {id} row {row} column {column}");
            }
        }
    }
    // As published: the first two codes, from the top left row by row.
    let code = |id: u32| (0..36).fold(0u64, |code, k| code << 1 | u64::from(tag_cell(id, 1 + k / 6, 1 + k % 6)));
    assert_eq!([code(0), code(1)], [0xd_5d62_8584, 0xd_97f1_8b49]);
    // Codes differ, in any turn, by at least 11 bits: what 36h11 promises (checked here for some).
    for other in 1..40 {
        let turned: [Turn; 4] = [|r, c| (r, c), |r, c| (c, 7 - r), |r, c| (7 - r, 7 - c), |r, c| (7 - c, r)];
        for turn in turned {
            let differ = (0..36).filter(|k| {
                let (row, column) = turn(1 + k / 6, 1 + k % 6);
                tag_cell(0, 1 + k / 6, 1 + k % 6) != tag_cell(other, row, column)
            });
            assert!(differ.count() >= 11, "{other}");
        }
    }
}

#[test]
fn edges_of_marks_are_smooth() {
    let panel = Panel {
        origin: Vector3::zeros(),
        u: Vector3::x(),
        v: -Vector3::y(),
        size_m: [1.0; 2],
        art: Art::Dots { radius_m: 0.1, centres: vec![[0.5, 0.5]] },
    };
    let at = |x: f64| panel.albedo(x, 0.5, 0.02);
    assert!(at(0.5) < 0.05 && at(0.7) > 0.8);
    assert!((at(0.6) - 0.445).abs() < 0.01, "half of it on the edge: {}", at(0.6));
}
