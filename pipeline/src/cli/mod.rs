//! The command line: parses, calls, prints. Data go to stdout, all else to stderr.

mod args;
mod bundle;
mod calibrate;
mod coloured;
mod dispatch;
mod eval;
mod export;
mod help;
mod init;
mod keys;
mod label;
mod mask;
mod orient;
mod run;
mod status;
mod summary;
mod surface;
mod synth;
mod terminal;
mod train;
mod water;

pub use args::Cli;
pub use dispatch::main;
pub use keys::REPORT_KEYS;
