//! Compares a PLY cloud with a PLY mesh: `cargo run --release -p eval --example c2m -- mesh.ply cloud.ply threshold_m`.

use std::fs::File;
use std::io::BufReader;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mesh, cloud, threshold] = arguments.as_slice() else {
        return Err("usage: c2m mesh.ply cloud.ply threshold_m".into());
    };
    let (mesh, _) = scene::format::read_ply_mesh(BufReader::new(File::open(mesh)?))?;
    let (cloud, dropped) = scene::format::read_ply_cloud(BufReader::new(File::open(cloud)?))?;
    if dropped.points > 0 {
        eprintln!("{} points without a finite position were left out", dropped.points);
    }
    let options = eval::EvalOptions { threshold_m: Some(threshold.parse()?), ..Default::default() };
    let metrics = eval::evaluate(&cloud, &eval::Reference::Mesh(mesh), &options)?;
    println!("{}", serde_json::to_string_pretty(&metrics)?);
    Ok(())
}
