//! `sfm init`: a commented dive.toml from what a folder holds.

use super::args::InitArgs;
use super::dispatch::print;
use crate::init;
use anyhow::Result;

pub(super) fn init(args: &InitArgs) -> Result<()> {
    let found = init::look(&args.folder)?;
    print(&init::dive_toml(&found))
}
