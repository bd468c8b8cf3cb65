//! `sfm export`.

use super::args::{ExportArgs, ExportFormat};
use super::dispatch::require_empty;
use crate::foreign::{read_model, size_of_file};
use anyhow::{Context, Result};
use scene::format::{write_bundler, write_colmap_text, write_nerfstudio};
use std::path::Path;

pub(super) fn export(args: &ExportArgs) -> Result<()> {
    let named = |path: &Path| path.display().to_string();
    // Names of a Bundler list are paths from where it lies.
    let size_of = |name: &str| size_of_file(&args.model.with_file_name(name));
    let model = read_model(&args.model, &size_of)?;
    require_empty(&args.out)?;
    // Whole in memory first: a model that has no form in the format leaves no file.
    let mut files: Vec<(&str, Vec<u8>)> = Vec::new();
    match args.format {
        ExportFormat::ColmapText => return write_colmap_text(&model, &args.out).with_context(|| named(&args.out)),
        ExportFormat::Nerfstudio => {
            let mut bytes = Vec::new();
            write_nerfstudio(&model, &mut bytes)?;
            files.push(("transforms.json", bytes));
        }
        ExportFormat::Bundler => {
            let (mut bundle, mut list) = (Vec::new(), Vec::new());
            write_bundler(&model, &mut bundle, &mut list)?;
            files.extend([("bundle.out", bundle), ("list.txt", list)]);
        }
    }
    std::fs::create_dir_all(&args.out).with_context(|| named(&args.out))?;
    for (name, bytes) in files {
        let path = args.out.join(name);
        std::fs::write(&path, bytes).with_context(|| named(&path))?;
    }
    Ok(())
}
