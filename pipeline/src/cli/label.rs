//! `sfm label`.

use super::args::LabelArgs;
use super::dispatch::{print, require_empty, start_threads};
use super::mask::write;
use super::terminal::Terminal;
use crate::config::{self, MaskStrategy};
use crate::masker::Masker;
use crate::progress::Progress;
use crate::recipe::RECIPE;
use crate::run::{Selection, run};
use crate::stages::images::{self, ImageList};
use anyhow::{Context, Result, bail};
use rayon::prelude::*;
use std::path::Path;

/// A mask as PNG, and how unsure the classifier is of it.
struct Judged {
    doubt: f64,
    mask: Vec<u8>,
}

pub(super) fn label(args: &LabelArgs) -> Result<()> {
    start_threads(args.threads)?;
    require_empty(&args.out)?;
    let mut config = config::read(&args.dive)?;
    config.mask.strategy = MaskStrategy::Ml;
    let masker = Masker::new(&config.mask)?;
    let terminal = Terminal::new();
    let done = run(RECIPE, &config, &Selection { until: Some("ingest".to_owned()), ..Selection::default() }, &terminal);
    terminal.close();
    done?;
    let list: ImageList = serde_json::from_slice(&std::fs::read(config.output.join(images::FILE))?)?;
    terminal.stage("label");
    terminal.begin("masks", list.images.len());
    let judged: Vec<Result<Option<Judged>>> = list
        .images
        .par_iter()
        .map(|image| {
            let rgb = imaging::decode_rgb(&list.bytes_in(&config, image)?);
            terminal.advance(1);
            let rgb = match rgb {
                Ok(rgb) => rgb,
                Err(error) => {
                    eprintln!("warning: {}: {error}", image.name);
                    return Ok(None);
                }
            };
            let made = masker.mask(&masker.prepared(rgb), None).with_context(|| image.name.clone())?;
            Ok(Some(Judged { doubt: made.doubt.unwrap_or(0.0), mask: imaging::encode_png_grey(&made.mask)? }))
        })
        .collect();
    terminal.close();
    let mut found = Vec::new();
    for (i, judged) in judged.into_iter().enumerate() {
        if let Some(judged) = judged? {
            found.push((i, judged));
        }
    }
    if found.is_empty() {
        bail!("no image can be read");
    }
    found.sort_by(|a, b| b.1.doubt.total_cmp(&a.1.doubt).then(a.0.cmp(&b.0)));
    found.truncate(args.suggest as usize);
    let mut text = String::from("doubt  image\n");
    for (i, Judged { doubt, mask }) in &found {
        let image = &list.images[*i];
        let file = list.path_for("images", image, &Path::new(&image.name).extension().unwrap_or_default().to_string_lossy());
        // Frames of videos have no file of their own: they are PNG files in the store.
        let file = if image.position.is_none() { list.path_for("images", image, "png") } else { file };
        write(&args.out.join(&file), &list.bytes_in(&config, image)?)?;
        write(&args.out.join(list.path_for("masks", image, "png")), mask)?;
        text.push_str(&format!("{doubt:.3}  {}\n", image.name));
    }
    text.push_str(&format!(
        "\ncorrect the masks in {} (white is structure), then: sfm train {} --out mine.onnx\n",
        args.out.join("masks").display(),
        args.out.display()
    ));
    print(&text)
}
