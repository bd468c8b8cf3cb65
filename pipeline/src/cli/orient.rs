//! `sfm orient`.

use super::args::OrientArgs;
use super::dispatch::{print, require_empty, start_threads};
use super::summary::summary;
use crate::config;
use crate::foreign::read_model;
use crate::stages::adopt::{readjust, size_in_dive};
use anyhow::{Context, Result};
use serde_json::json;

pub(super) fn orient(args: &OrientArgs) -> Result<()> {
    start_threads(args.threads)?;
    let config = config::read(&args.dive)?;
    let model = read_model(&args.from, &|name| size_in_dive(&config, name))?;
    let out = args.out.clone().unwrap_or_else(|| config.output.join("adjusted"));
    require_empty(&out)?;
    let done = readjust(&config, &model)?;
    for (name, bytes) in &done.files {
        let path = out.join(name);
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(&path, bytes));
        written.with_context(|| path.display().to_string())?;
    }
    for warning in &done.warnings {
        eprintln!("warning: {}: {}", warning.about, warning.message);
    }
    let mut report = done.figures;
    report["images"] = json!({"oriented": report["oriented"], "total": model.images.len()});
    if args.json {
        return print(&format!("{}\n", serde_json::to_string_pretty(&report)?));
    }
    print(&format!("{}{:<10} {}  (COLMAP model)\n", summary(&report, &out, |_| false), "open", out.display()))
}
