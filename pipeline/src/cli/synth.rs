//! `sfm synth`: a dive with known truth.

use super::args::{SynthArgs, Water};
use super::dispatch::start_threads;
use super::terminal::Terminal;
use crate::progress::Progress;
use crate::synth;
use anyhow::Result;
use std::time::Instant;
use synthetic::dive::DiveOptions;

pub(super) fn synth(args: &SynthArgs) -> Result<()> {
    start_threads(args.threads)?;
    let (width, height) = args.size;
    let options = DiveOptions {
        exposures: usize::from(args.frames),
        cameras: usize::from(args.cameras),
        width,
        height,
        water: args.water == Water::Clear,
        noise: args.noise,
        seed: args.seed,
    };
    let terminal = Terminal::new();
    let start = Instant::now();
    terminal.stage("synth");
    let written = synth::synth(&args.folder, &options, &terminal);
    terminal.close();
    let written = written?;
    let note = format!("{} images of {width} x {height} pixels by {} cameras", written.images, args.cameras);
    terminal.done("synth", start.elapsed().as_secs_f64(), &note);
    eprintln!("next: sfm run {}", written.dive_toml.display());
    Ok(())
}
