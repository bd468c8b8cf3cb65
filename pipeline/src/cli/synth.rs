//! `sfm synth`: a dive with known truth.

use super::args::{Port, Preset, Scene, SynthArgs, Water};
use super::dispatch::start_threads;
use super::terminal::Terminal;
use crate::progress::Progress;
use crate::synth;
use anyhow::Result;
use std::path::Path;
use std::time::Instant;
use synthetic::dive::{DiveOptions, PortKind, WaterKind};
use synthetic::world::SceneKind;

pub(super) fn synth(args: &SynthArgs) -> Result<()> {
    start_threads(args.threads)?;
    let (file, folder) = match args.paths.as_slice() {
        [file, folder] => (Some(file.as_path()), folder.as_path()),
        [folder, ..] => (None, folder.as_path()),
        [] => return Err(synth::SynthError::NoFolder.into()),
    };
    let options = options(args, file, folder)?;
    let terminal = Terminal::new();
    let start = Instant::now();
    terminal.stage("synth");
    let written = synth::synth(folder, &options, &terminal);
    terminal.close();
    let written = written?;
    let (width, height) = (options.rig.width, options.rig.height);
    let note = format!("{} images of {width} x {height} pixels by {} cameras", written.images, options.rig.cameras.len());
    terminal.done("synth", start.elapsed().as_secs_f64(), &note);
    eprintln!("next: sfm run {}", written.dive_toml.display());
    Ok(())
}

/// The preset, what the file changes of it, and what the command line changes of both.
fn options(args: &SynthArgs, file: Option<&Path>, folder: &Path) -> Result<DiveOptions, synth::SynthError> {
    let preset = DiveOptions::preset(match args.preset {
        Preset::Demo => synthetic::dive::Preset::Demo,
        Preset::Survey => synthetic::dive::Preset::Survey,
        Preset::Calibration => synthetic::dive::Preset::Calibration,
        Preset::Tank => synthetic::dive::Preset::Tank,
    });
    if file.is_none() && folder.extension().is_some_and(|e| e == "toml") {
        return Err(synth::SynthError::NoFolder);
    }
    let mut options = match file {
        Some(file) => synth::read_scene(file, &preset)?,
        None => preset,
    };
    if let Some(scene) = args.scene {
        options.set_scene(match scene {
            Scene::Reef => SceneKind::Reef,
            Scene::Hull => SceneKind::Hull,
            Scene::Pipeline => SceneKind::Pipeline,
            Scene::Hemispheres => SceneKind::Hemispheres,
            Scene::Tank => SceneKind::Tank,
        });
    }
    if let Some(frames) = args.frames {
        options.motion.frames = usize::from(frames);
    }
    if let Some(cameras) = args.cameras {
        let all = synthetic::dive::RigOptions::default().cameras;
        let have = options.rig.cameras.len();
        options.rig.cameras.extend(all.into_iter().skip(have));
        options.rig.cameras.truncate(usize::from(cameras));
    }
    if let Some((width, height)) = args.size {
        (options.rig.width, options.rig.height) = (width, height);
    }
    if let Some(water) = args.water {
        let kind = match water {
            Water::Clear => WaterKind::Clear,
            Water::Coastal => WaterKind::Coastal,
            Water::Turbid => WaterKind::Turbid,
            Water::None => WaterKind::None,
        };
        kind.apply(&mut options.water);
    }
    if let Some(port) = args.port {
        (options.rig.port.kind, options.rig.port.known) = match port {
            Port::Flat => (PortKind::Flat, false),
            Port::Known => (PortKind::Flat, true),
            Port::None => (PortKind::None, false),
        };
    }
    if let Some(noise) = args.noise {
        options.response.noise = noise;
    }
    if let Some(seed) = args.seed {
        options.reseed(seed);
    }
    Ok(options)
}
