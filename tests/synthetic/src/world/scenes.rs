//! How each scene is furnished.

use super::all::World;
use super::bars::bar;
use super::bottom::{bottom, height, stones};
use super::movers::{CARRIED_BAR_M, Mover, fish, plate, vehicle};
use super::options::{SceneKind, WorldOptions};
use super::panel::{Art, Panel};
use super::part::{Label, Material, Part};
use super::structure::{REEF_HALF_M, part, pipeline, reef, unbury, wreck};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use scene::{Mesh, Rigid3};

/// Spacing of the bottom's mesh over that of structure: sand is smooth.
const SAND_SPACING: f64 = 1.75;

pub(super) fn furnish(options: &WorldOptions) -> World {
    let mut world = match options.scene {
        SceneKind::Reef => reef_scene(options),
        SceneKind::Hull => wreck_scene(options),
        SceneKind::Pipeline => pipeline_scene(options),
        SceneKind::Hemispheres => hemispheres(options),
        SceneKind::Tank => tank(),
    };
    if matches!(options.scene, SceneKind::Hemispheres | SceneKind::Tank) {
        return world;
    }
    if options.fish > 0 {
        world.movers.extend(fish(options.fish, world.centre + Vector3::z() * 0.5, 3.0, options.seed));
    }
    if options.vehicle {
        let place = world.centre + Vector3::new(-2.6, 0.9, 0.9);
        let (way, parts, panel) = vehicle(place, world.panels.len(), options.seed);
        world.panels.push(panel);
        if options.tether {
            world.movers.push(Mover::Tether { way: way.clone(), radius_m: 0.006 });
        }
        world.movers.push(Mover::Body { parts, way });
    }
    world
}

/// Sand and stones; `covered` is what the structure hides, `clear_m` the radius without stones.
fn ground(options: &WorldOptions, covered: Option<[f64; 4]>, clear_m: f64) -> Vec<Part> {
    let spacing = SAND_SPACING * options.detail_m;
    let mut parts = vec![bottom(options.bottom_half_m, spacing, options.seed, covered)];
    parts.extend(stones(options.stones, clear_m, options.bottom_half_m, options.seed));
    parts
}

fn add_bars(world: &mut World, bars: [(&'static str, [f64; 3], usize, f64); 2]) {
    for (name, end, axis, length_m) in bars {
        let built = bar(name, end, axis, length_m, world.panels.len());
        world.bars.push(built.bar);
        world.parts.extend(built.parts);
        world.panels.extend(built.panels);
    }
}

fn reef_scene(options: &WorldOptions) -> World {
    let half = REEF_HALF_M + 0.2;
    let mut structure = part(
        "reef",
        Material::Concrete,
        &reef(options.growth_m, options.seed),
        [[-half, -half, -0.45], [half, half, 3.2]],
        options.detail_m,
    );
    unbury(&mut structure, |x, y| height(x, y, options.seed));
    let inner = REEF_HALF_M - 0.15;
    let mut world = World { centre: Vector3::new(0.0, 0.0, 1.2), ..World::default() };
    world.parts.push(structure);
    world.parts.extend(ground(options, Some([-inner, inner, -inner, inner]), 2.2));
    if options.bars {
        let z = height(-0.1, -1.95, options.seed) + 0.05;
        let post = [-REEF_HALF_M + 0.19, -REEF_HALF_M - 0.12, 0.55];
        add_bars(&mut world, [("bar on the sand", [-0.6, -1.95, z], 0, 1.0), ("bar on the post", post, 2, CARRIED_BAR_M)]);
    }
    world
}

fn wreck_scene(options: &WorldOptions) -> World {
    let (solid, turn, place) = wreck(options.growth_m, options.seed);
    let world_from_ship = Rigid3::new(turn, place);
    let mut hull =
        part("wreck", Material::Steel, &solid, [[-6.2, -1.9, -2.3], [6.2, 1.9, 1.1]], options.detail_m.max(0.025)).moved(&world_from_ship);
    unbury(&mut hull, |x, y| height(x, y, options.seed));
    let mut world = World { centre: Vector3::new(0.0, 0.0, 0.9), ..World::default() };
    world.parts.push(hull);
    world.parts.extend(ground(options, None, 2.6));
    if options.bars {
        let z = height(-0.5, -2.6, options.seed) + 0.05;
        let stand = [1.6, -2.4, height(1.6, -2.4, options.seed) - 0.02];
        add_bars(&mut world, [("bar on the sand", [-1.0, -2.6, z], 0, 1.0), ("standing bar", stand, 2, CARRIED_BAR_M)]);
    }
    world
}

fn pipeline_scene(options: &WorldOptions) -> World {
    let half = options.bottom_half_m;
    let (pipe, mats) = pipeline(half, options.growth_m, options.seed);
    let mut world = World { centre: Vector3::new(0.0, 0.0, 0.3), ..World::default() };
    for (name, material, solid) in [("pipe", Material::Pipe, &pipe), ("mattresses", Material::Concrete, &mats)] {
        let mut part = part(name, material, solid, [[-half - 0.1, -0.8, -0.25], [half + 0.1, 0.8, 0.9]], options.detail_m);
        unbury(&mut part, |x, y| height(x, y, options.seed));
        world.parts.push(part);
    }
    world.parts.extend(ground(options, None, 1.0));
    if options.bars {
        let z = height(-0.5, -0.9, options.seed) + 0.05;
        let stand = [0.9, -0.6, height(0.9, -0.6, options.seed) - 0.02];
        add_bars(&mut world, [("bar on the sand", [-1.0, -0.9, z], 0, 1.0), ("standing bar", stand, 2, CARRIED_BAR_M)]);
    }
    world
}

/// Hemispheres in hexagonal packing on a plate of 1.2 x 0.9 m.
fn hemispheres(options: &WorldOptions) -> World {
    let radius = options.hemisphere_radius_m;
    let half = [0.6, 0.45];
    let ball = super::bottom::ball(4);
    let mut mesh = Mesh::default();
    let rows = (2.0 * half[1] / (radius * 3f64.sqrt())) as i32;
    for row in 0..rows {
        let y = -half[1] + radius * (1.0 + 3f64.sqrt() * f64::from(row));
        let shift = if row % 2 == 1 { radius } else { 0.0 };
        let mut x = -half[0] + radius + shift;
        while x <= half[0] - radius && y <= half[1] - radius {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend(ball.vertices.iter().map(|v| Point3::from(Vector3::new(x, y, 0.0) + v.coords * radius)));
            // The lower half is within the plate.
            let upper = |f: &&[u32; 3]| f.iter().any(|&v| ball.vertices[v as usize].z > 0.0);
            mesh.faces.extend(ball.faces.iter().filter(upper).map(|f| f.map(|v| v + first)));
            x += 2.0 * radius;
        }
    }
    let balls = Part::new("hemispheres", Label::Structure, Material::Stone, mesh);
    let board = Part::new(
        "plate",
        Label::Structure,
        Material::Concrete,
        plate([-half[0] - 0.1, -half[1] - 0.1, -0.02], [half[0] + 0.1, half[1] + 0.1, 0.0]),
    );
    World { parts: vec![board, balls], centre: Vector3::new(0.0, 0.0, 0.02), ..World::default() }
}

/// A tank, 2 x 1.5 m and 1.4 m deep, with a grid of 7 x 4 tags on its bottom and a tilted one of 7 x 7 smaller tags.
fn tank() -> World {
    let (columns, rows, side_m, gap_m) = (7, 4, 0.075, 0.025);
    let size = [7.0 * (side_m + gap_m) + gap_m, 4.0 * (side_m + gap_m) + gap_m];
    let flat = Panel {
        origin: Vector3::new(-size[0] / 2.0, size[1] / 2.0 - 0.25, 0.012),
        u: Vector3::x(),
        v: -Vector3::y(),
        size_m: size,
        art: Art::Tags { columns, rows, side_m, gap_m, first_id: 0 },
    };
    let small = [7.0 * 0.055 + 0.015; 2];
    let turn = UnitQuaternion::from_scaled_axis(Vector3::x() * 0.9);
    let tilted = Panel {
        origin: Vector3::new(-small[0] / 2.0, 0.38, 0.04) + turn * Vector3::new(0.0, small[1], 0.0),
        u: Vector3::x(),
        v: -(turn * Vector3::y()),
        size_m: small,
        art: Art::Tags { columns: 7, rows: 7, side_m: 0.04, gap_m: 0.015, first_id: 100 },
    };
    let mut world = World { centre: Vector3::new(0.0, 0.05, 0.1), ..World::default() };
    let floor = plate([-1.0, -0.75, -0.02], [1.0, 0.75, 0.0]);
    world.parts.push(Part::new("floor", Label::Structure, Material::Plain { albedo: [0.42, 0.52, 0.58] }, floor));
    let grey = [0.38, 0.48, 0.55];
    for (low, high) in
        [([-1.02, -0.75, 0.0], [-1.0, 0.75, 1.4]), ([1.0, -0.75, 0.0], [1.02, 0.75, 1.4]), ([-1.0, 0.75, 0.0], [1.0, 0.77, 1.4])]
    {
        world.parts.push(Part::new("wall", Label::Structure, Material::Plain { albedo: grey }, plate(low, high)));
    }
    for panel in [flat, tilted] {
        let mesh = sheet(&panel);
        world.parts.push(Part::new("tags", Label::Target, Material::Panel(world.panels.len()), mesh));
        world.panels.push(panel);
    }
    world
}

/// A panel as two triangles that face the side from which `u` goes right and `v` down.
pub(crate) fn sheet(panel: &Panel) -> Mesh {
    let at = |x: f64, y: f64| Point3::from(panel.origin + panel.u * x + panel.v * y);
    let [w, h] = panel.size_m;
    Mesh { vertices: vec![at(0.0, 0.0), at(w, 0.0), at(w, h), at(0.0, h)], faces: vec![[0, 2, 1], [0, 3, 2]], ..Mesh::default() }
}
