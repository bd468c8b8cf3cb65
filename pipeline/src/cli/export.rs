//! `sfm export`.

use super::args::{ExportArgs, ExportFormat};
use super::dispatch::require_empty;
use anyhow::{Context, Result};
use scene::format::{read_colmap_model, write_bundler, write_colmap_text, write_nerfstudio};
use std::path::Path;

pub(super) fn export(args: &ExportArgs) -> Result<()> {
    let named = |path: &Path| path.display().to_string();
    let model = read_colmap_model(&args.model).with_context(|| named(&args.model))?;
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
