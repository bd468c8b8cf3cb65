//! `sfm mask`.

use super::args::MaskArgs;
use super::dispatch::{print, require_empty, start_threads};
use super::terminal::Terminal;
use crate::config::{self, Config, MaskStrategy};
use crate::mask_sheet::{Row, sheet};
use crate::recipe::RECIPE;
use crate::run::{Selection, run};
use crate::stages::images::{self, ImageEntry, ImageList};
use anyhow::{Context, Result};
use scene::{Mask, Raster};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

/// Images on the sheet.
const SHOWN: usize = 10;
/// Empty images that are named; the file has all.
const NAMED: usize = 5;

pub(super) fn mask(args: &MaskArgs) -> Result<()> {
    start_threads(args.threads)?;
    let mut config = config::read(&args.dive)?;
    let own = config.mask.strategy;
    let mut strategies = if args.strategy.is_empty() { vec![own] } else { args.strategy.clone() };
    // That of dive.toml last: its masks are then done when `sfm run` wants them.
    strategies.sort_by_key(|&s| s == own);
    strategies.dedup();
    let out = args.out.clone().unwrap_or_else(|| config.output.join("masks-compared"));
    if args.out.is_some() {
        require_empty(&out)?;
    }
    let terminal = Terminal::new();
    let mut results = Vec::new();
    for &strategy in &strategies {
        config.mask.strategy = strategy;
        let done = run(RECIPE, &config, &Selection { until: Some("mask".to_owned()), ..Selection::default() }, &terminal);
        terminal.close();
        let done = done?;
        let stamp = &done.stamps["mask"];
        let folder = out.join(strategy.name());
        if folder.exists() && args.out.is_none() {
            std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
        }
        // Not what a vote keeps of single images.
        let below = format!("masks/{}/", strategy.name());
        for path in stamp.outputs.keys() {
            if let Some(inside) = path.strip_prefix(&below) {
                copy(&config.output.join(path), &folder.join(inside))?;
            }
        }
        for warning in &stamp.warnings {
            eprintln!("warning: {}: {}", warning.about, warning.message);
        }
        let mut figures = stamp.figures.clone();
        figures["cpu_seconds"] = json!(done.timings.get("mask").map(|t| t.cpu_seconds));
        if strategy != MaskStrategy::None {
            write(&out.join(strategy.name()).join("empty.txt"), lines(&figures["empty_images"]).as_bytes())?;
        }
        results.push((strategy, figures));
    }
    let preview = out.join("preview.jpg");
    if args.preview {
        write(&preview, &imaging::encode_jpeg_rgb(&contact_sheet(&config, &strategies, &out)?, 85)?)?;
    }
    if args.json {
        let all: serde_json::Map<String, Value> = results.into_iter().map(|(s, figures)| (s.name().to_owned(), figures)).collect();
        return print(&format!("{}\n", serde_json::to_string_pretty(&all)?));
    }
    let mut text = format!("{:<9} {:>6} {:>6} {:>9} {:>11}\n", "strategy", "masks", "empty", "masked, %", "CPU s each");
    for (strategy, figures) in &results {
        let masks = figures["masks"].as_u64().unwrap_or(0);
        let ratio = figures["masked_ratio"].as_f64().map_or("-".to_owned(), |r| format!("{:.1}", 100.0 * r));
        let each = figures["cpu_seconds"].as_f64().filter(|_| masks > 0).map_or("-".to_owned(), |s| format!("{:.3}", s / masks as f64));
        let _ = writeln!(text, "{:<9} {masks:>6} {:>6} {ratio:>9} {each:>11}", strategy.name(), figures["empty"].as_u64().unwrap_or(0));
    }
    for (strategy, figures) in &results {
        let empty: Vec<&str> = figures["empty_images"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
        if !empty.is_empty() {
            let more = if empty.len() > NAMED { ", ..." } else { "" };
            let _ = writeln!(text, "without structure by {}: {}{more}", strategy.name(), empty[..empty.len().min(NAMED)].join(", "));
        }
    }
    let _ = writeln!(text, "{:<9} {}", "masks", out.display());
    if args.preview {
        let _ = writeln!(text, "{:<9} {}", "open", preview.display());
    }
    print(&text)
}

fn lines(names: &Value) -> String {
    names.as_array().into_iter().flatten().filter_map(Value::as_str).map(|name| format!("{name}\n")).collect()
}

fn copy(from: &Path, to: &Path) -> Result<()> {
    write(to, &std::fs::read(from).with_context(|| from.display().to_string())?)
}

pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let written = path.parent().map_or(Ok(()), std::fs::create_dir_all).and_then(|()| std::fs::write(path, bytes));
    written.with_context(|| format!("cannot write {}", path.display()))
}

/// Some images, evenly spread, each beside its masks.
fn contact_sheet(config: &Config, strategies: &[MaskStrategy], out: &Path) -> Result<Raster<[u8; 3]>> {
    let list: ImageList = serde_json::from_slice(&std::fs::read(config.output.join(images::FILE))?)?;
    let step = list.images.len().div_ceil(SHOWN).max(1);
    let rows = list.images.iter().step_by(step).map(|image| row(config, &list, image, strategies, out));
    Ok(sheet(&rows.collect::<Result<Vec<_>>>()?))
}

fn row(config: &Config, list: &ImageList, image: &ImageEntry, strategies: &[MaskStrategy], out: &Path) -> Result<Row> {
    let rgb = imaging::decode_rgb(&list.bytes_in(config, image)?).with_context(|| image.name.clone())?;
    let mask = |strategy: &MaskStrategy| -> Option<Mask> {
        let file = out.join(list.path_for(strategy.name(), image, "png"));
        imaging::decode_grey_u8(&std::fs::read(file).ok()?).ok()
    };
    Ok(Row { rgb, masks: strategies.iter().map(mask).collect() })
}
