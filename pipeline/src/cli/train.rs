//! `sfm train`.

use super::args::TrainArgs;
use super::dispatch::{print, start_threads};
use super::terminal::Terminal;
use crate::labels::{self, Labelled, NO_STRUCTURE};
use crate::progress::Progress;
use anyhow::{Context, Result, bail};
use masking::train::{TrainOptions, Trained, train};
use models::{BUILT_IN, BUILT_IN_CARD, Backbone, Card, InputCard, Runtime, TAPS};
use serde_json::json;
use std::borrow::Cow;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Images without a label that are named before they are counted.
const NAMED: usize = 3;
/// What a patch of a backbone without a card is brought to, pixels: those of the model that comes with the program.
const PATCH_PX: usize = 64;
/// Least share of the long side that such a patch shows.
const MIN_PATCH: f64 = 0.025;

/// A label that cannot be loaded.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Unreadable(String);

pub(super) fn run(args: &TrainArgs) -> Result<()> {
    start_threads(args.threads)?;
    let card_path = args.out.with_extension("toml");
    if args.out.extension().is_none_or(|e| e != "onnx") {
        bail!("--out {}: give it the ending .onnx", args.out.display());
    }
    let (found, without) = labels::find(&args.labels)?;
    labels::require_some(&found, &args.labels)?;
    for image in without.iter().take(NAMED) {
        eprintln!("warning: {}: has no label, and is left out", image.display());
    }
    if without.len() > NAMED {
        eprintln!("warning: {} images more have no label", without.len() - NAMED);
    }
    let runtime = Runtime::load(args.onnxruntime.as_deref())?;
    let backbone = backbone(args.backbone.as_deref(), &runtime)?;
    let name = args.out.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let options = TrainOptions { name, seed: args.seed, ..TrainOptions::default() };
    let is_structure = |label: &str| {
        if args.structure.is_empty() {
            !NO_STRUCTURE.contains(&label.to_lowercase().as_str())
        } else {
            args.structure.iter().any(|s| s == label)
        }
    };
    let load = |i: usize| found[i].load(&is_structure).map_err(|e| Unreadable(format!("{e:#}")));
    let terminal = Terminal::new();
    terminal.stage("train");
    let last = Mutex::new(("", 0));
    let progress = |what: &'static str, done: usize, total: usize| {
        let Ok(mut last) = last.lock() else { return };
        if last.0 != what {
            terminal.begin(what, total);
            *last = (what, 0);
        }
        if done > last.1 {
            terminal.advance(done - last.1);
            last.1 = done;
        }
    };
    let trained = train(&backbone, &runtime, found.len(), load, &options, &progress);
    terminal.close();
    let mut trained = trained?;
    let made = format!("A head trained with {} images, on the backbone of {}", trained.figures.images, backbone_name(args));
    trained.card.description = args.description.clone().unwrap_or(made);
    trained.card.licence = args.licence.clone().unwrap_or_default();
    if let Some(folder) = args.out.parent() {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::write(&args.out, &trained.onnx).with_context(|| args.out.display().to_string())?;
    std::fs::write(&card_path, trained.card.to_toml()).with_context(|| card_path.display().to_string())?;
    if args.json {
        return print(&format!("{}\n", serde_json::to_string_pretty(&as_json(&trained, &found))?));
    }
    print(&as_text(&trained, &found, &args.out))
}

fn backbone_name(args: &TrainArgs) -> String {
    let file = args.backbone.as_deref().and_then(Path::file_name);
    file.map_or_else(|| "the model that comes with sfm".to_owned(), |f| f.to_string_lossy().into_owned())
}

/// A file with the feature maps s8, s16 and s32, a model of ours or a bare backbone; the model that comes with the program where none is named.
fn backbone(path: Option<&Path>, runtime: &Runtime) -> Result<Backbone> {
    let Some(path) = path else {
        let input = Card::parse(BUILT_IN_CARD, Path::new("structure.toml"))?.input;
        return Ok(Backbone::new(PathBuf::from("structure.onnx"), Cow::Borrowed(BUILT_IN), input, &TAPS, runtime)?);
    };
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let card = path.with_extension("toml");
    let input = match std::fs::read_to_string(&card) {
        Ok(text) => Card::parse(&text, &card)?.input,
        Err(_) => {
            InputCard { name: "image".to_owned(), width: PATCH_PX, height: PATCH_PX, mean: [0.0; 3], std: [1.0; 3], min_patch: MIN_PATCH }
        }
    };
    Backbone::new(path.to_path_buf(), Cow::Owned(bytes), input, &TAPS, runtime).with_context(|| path.display().to_string())
}

fn as_json(trained: &Trained, found: &[Labelled]) -> serde_json::Value {
    let figures = &trained.figures;
    let mut value = json!(figures);
    let confusion = &figures.confusion;
    value["accuracy"] = json!(confusion.accuracy());
    value["precision"] = json!(confusion.precision());
    value["recall"] = json!(confusion.recall());
    value["worst"] = figures.worst.iter().map(|w| json!({"image": found[w.image].image, "iou": w.iou})).collect();
    value
}

fn as_text(trained: &Trained, found: &[Labelled], out: &Path) -> String {
    let (figures, c) = (&trained.figures, &trained.figures.confusion);
    let mut text = String::new();
    let _ = writeln!(
        text,
        "{} images to train with, {} held out with {} patches:\n",
        figures.images, figures.images_held_out, figures.patches_held_out
    );
    let _ = writeln!(text, "accuracy    {:.1} %", 100.0 * c.accuracy());
    let _ = writeln!(text, "precision   {:.1} % of what is called structure is", 100.0 * c.precision());
    let _ = writeln!(text, "recall      {:.1} % of the structure is called so", 100.0 * c.recall());
    let _ = writeln!(text, "mean IoU    {:.3} of the masks\n", figures.mean_iou);
    let _ = writeln!(text, "                   is structure  is background");
    let _ = writeln!(text, "called structure    {:>12}  {:>13}", c.true_structure, c.false_structure);
    let _ = writeln!(text, "called background   {:>12}  {:>13}\n", c.false_background, c.true_background);
    let _ = writeln!(text, "says   is     patches");
    for bin in &figures.reliability {
        let _ = writeln!(text, "{:<6.2} {:<6.2} {}", bin.predicted, bin.observed, bin.patches);
    }
    let _ = writeln!(text, "\nworst masks, by intersection over union:");
    for worst in &figures.worst {
        let _ = writeln!(text, "  {:.3}  {}", worst.iou, found[worst.image].image.display());
    }
    let _ = writeln!(
        text,
        "\n{} and its card {}\nuse it: mask.strategy = \"ml\", mask.model = {:?}",
        out.display(),
        out.with_extension("toml").display(),
        out.display().to_string()
    );
    text
}
