//! From the command line to an exit code.

use super::args::{Cli, Command};
use super::{bundle, calibrate, eval, export, help, init, label, mask, orient, run, status, surface, synth, train, water};
use crate::config::ConfigError;
use crate::error::{Misfit, NoResult};
use crate::synth::SynthError;
use anyhow::{Context, bail};
use clap::Parser;
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::process::ExitCode;

/// Wrong command line or dive.toml; clap uses the same.
const USAGE: u8 = 2;
/// The images give no result.
const NO_RESULT: u8 = 3;

/// The program.
#[must_use]
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let result = match &cli.command {
        Command::Run(args) => run::run(args),
        Command::Status(args) => status::status(args),
        Command::Init(args) => init::init(args),
        Command::Synth(args) => synth::synth(args),
        Command::Mask(args) => mask::mask(args),
        Command::Label(args) => label::label(args),
        Command::Train(args) => train::run(args),
        Command::Surface(args) => surface::surface(args),
        Command::Eval(args) => eval::eval(args),
        Command::Bundle(args) => bundle::bundle(args),
        Command::Orient(args) => orient::orient(args),
        Command::Export(args) => export::export(args),
        Command::Calibrate(args) => calibrate::calibrate(args),
        Command::Water(args) => water::water(args),
        Command::Help(args) => help::help(args),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if is_closed_pipe(&error) {
                return ExitCode::SUCCESS;
            }
            eprintln!("error: {error:#}");
            exit_code(&error)
        }
    }
}

fn exit_code(error: &anyhow::Error) -> ExitCode {
    let bad_synth = |e: &(dyn std::error::Error + 'static)| e.downcast_ref::<SynthError>().is_some_and(SynthError::is_usage);
    if error.chain().any(|e| e.is::<ConfigError>() || e.is::<Misfit>() || e.is::<super::help::NoTopic>() || bad_synth(e)) {
        ExitCode::from(USAGE)
    } else if error.chain().any(|e| e.is::<NoResult>()) {
        ExitCode::from(NO_RESULT)
    } else {
        ExitCode::FAILURE
    }
}

/// `sfm init frames | head` closes stdout early; that is no failure.
fn is_closed_pipe(error: &anyhow::Error) -> bool {
    error.chain().any(|e| e.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == ErrorKind::BrokenPipe))
}

/// Writes data to stdout.
pub(super) fn print(text: &str) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}

/// Refuses to write among files that are there already.
pub(super) fn require_empty(folder: &Path) -> anyhow::Result<()> {
    if std::fs::read_dir(folder).is_ok_and(|mut files| files.next().is_some()) {
        bail!("{} is not empty: give another folder with --out, or empty it", folder.display());
    }
    Ok(())
}

/// Starts the threads that all work is shared among.
pub(super) fn start_threads(threads: Option<u16>) -> anyhow::Result<()> {
    let threads = threads.map_or(0, usize::from);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().context("cannot start the threads")
}
