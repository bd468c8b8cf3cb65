//! `poisson CLOUD.ply DEPTH OUT.ply [SCREENING [TOLERANCE]]`: the surface of a cloud, with the CPU seconds it took.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use surface::{PoissonOptions, Resolution, reconstruct};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let [_, cloud, depth, out, rest @ ..] = args.as_slice() else { return Err("CLOUD.ply DEPTH OUT.ply [SCREENING [TOLERANCE]]".into()) };
    let (cloud, _) = scene::format::read_ply_cloud(BufReader::new(File::open(cloud)?))?;
    let mut options = PoissonOptions { resolution: Resolution::Depth(depth.parse()?), ..PoissonOptions::default() };
    if let [screening, rest @ ..] = rest {
        options.screening = screening.parse()?;
        if let Some(tolerance) = rest.first() {
            options.tolerance = tolerance.parse()?;
        }
    }
    let (start, cpu) = (std::time::Instant::now(), cpu_time::ProcessTime::now());
    let surface = reconstruct(&cloud, &options)?;
    eprintln!("{:.2} s, {:.2} CPU s, {:?}", start.elapsed().as_secs_f64(), cpu.elapsed().as_secs_f64(), surface.summary);
    scene::format::write_ply_mesh(&surface.mesh, &mut BufWriter::new(File::create(out)?))?;
    Ok(())
}
