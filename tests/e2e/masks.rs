//! Masks from the command line: strategies, training, proposals. What needs ONNX Runtime is skipped, with the reason, where there is none.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use serde_json::Value;
use support::{Dive, tree};
use synthetic::dive::DiveOptions;

const DIVE: &str = "[[camera]]\nimages = \"frames/C1\"\n[[camera]]\nimages = \"frames/C2\"\n";

/// Whether masks by a classifier can be made here.
fn has_runtime() -> bool {
    let found = models::Runtime::load(None);
    if let Err(error) = &found {
        println!("skipped: {error}");
    }
    found.is_ok()
}

/// A rendered dive with its true masks in `truth/masks`.
fn labelled_dive(options: &DiveOptions) -> Dive {
    let (dive, rendered) = Dive::rendered(options);
    for image in &rendered.images {
        let path = dive.path("truth/masks").join(synthetic::dive::DiveScene::name(image.camera, image.exposure, "png"));
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, imaging::encode_png_grey(&image.mask).unwrap()).unwrap();
    }
    dive.write("dive.toml", DIVE);
    dive
}

#[test]
fn strategies_are_compared_side_by_side() {
    let dive = labelled_dive(&DiveOptions::small(4, 320, 200));
    let text = dive.ok(&["mask", "--strategy", "ip,none", "--preview"]);
    assert!(text.contains("ip") && text.contains("preview.jpg"), "{text}");
    let masks = tree(&dive.path("out/masks-compared"));
    assert_eq!(masks.keys().filter(|k| k.starts_with("ip/C") && k.ends_with(".png")).count(), 8, "{:?}", masks.keys());
    let preview = imaging::decode_rgb(&masks["preview.jpg"]).unwrap();
    assert!(preview.width() > 1000 && preview.height() > 1000, "eight rows of an image and two masks");
    let (code, error) = dive.fails(&["mask", "--strategy", "ipp"]);
    assert!(code == 2 && error.contains("ip+ml"), "{error}");
}

#[test]
fn a_threshold_of_the_dive_is_one_for_all_images_of_a_camera() {
    let dive = labelled_dive(&DiveOptions::small(4, 320, 200));
    let masks = |otsu: &str, out: &str| {
        dive.write("dive.toml", &format!("{DIVE}[mask]\nstrategy = \"ip\"\notsu = \"{otsu}\"\n"));
        dive.ok(&["mask", "--out", out]);
        tree(&dive.path(out))
    };
    let (image, whole) = (masks("image", "a"), masks("dive", "b"));
    assert_eq!(image.keys().collect::<Vec<_>>(), whole.keys().collect::<Vec<_>>());
    assert_ne!(image, whole);
}

#[test]
fn without_the_runtime_masks_by_a_classifier_stop_with_a_hint() {
    let dive = Dive::of_noise();
    dive.write("dive.toml", "[[camera]]\nimages = \"frames/left\"\n[mask]\nstrategy = \"ml\"\n");
    let output = dive.command(&["run", "--until", "mask"]).env("ORT_DYLIB_PATH", "/nowhere/libonnxruntime.so").output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && error.contains("/nowhere/libonnxruntime.so") && error.contains("classifier"), "{error}");
}

/// The built-in model on a dive that it never saw: masks agree with the truth, and are the same with one thread and two.
#[test]
fn masks_by_the_classifier_agree_with_the_truth_at_any_number_of_threads() {
    if !has_runtime() {
        return;
    }
    let dive = labelled_dive(&DiveOptions::small(3, 480, 300));
    dive.ok(&["mask", "--strategy", "ml,ip+ml", "--out", "two", "--threads", "2"]);
    dive.ok(&["run", "--until", "mask"]);
    std::fs::remove_dir_all(dive.path("out")).unwrap();
    dive.ok(&["mask", "--strategy", "ml,ip+ml", "--out", "one", "--threads", "1"]);
    assert_eq!(tree(&dive.path("one")), tree(&dive.path("two")));
    let (mut common, mut either) = (0, 0);
    for (name, truth) in tree(&dive.path("truth/masks")) {
        let (truth, found) = (imaging::decode_grey_u8(&truth).unwrap(), std::fs::read(dive.path(&format!("one/ml/{name}"))).unwrap());
        let found = imaging::decode_grey_u8(&found).unwrap();
        common += truth.data().iter().zip(found.data()).filter(|(t, f)| **t > 127 && **f > 127).count();
        either += truth.data().iter().zip(found.data()).filter(|(t, f)| **t > 127 || **f > 127).count();
    }
    // The worst dive of clear water in docs/masks.md has 0.95.
    assert!(common as f64 > 0.93 * either as f64, "{common} of {either}");
    dive.write("dive.toml", &format!("{DIVE}[mask]\nstrategy = \"ml\"\n"));
    let report: Value = serde_json::from_str(&dive.ok(&["run", "--until", "mask", "--json"])).unwrap();
    assert_eq!(report["masks"]["classifier"]["name"], "structure", "{report:#}");
    assert!(report["masks"]["classifier"]["runtime"].as_str().unwrap().contains("onnxruntime"));
}

/// From proposals over training to masks by the new model.
#[test]
fn a_model_is_trained_with_corrected_proposals() {
    if !has_runtime() {
        return;
    }
    let dive = labelled_dive(&DiveOptions::small(4, 320, 200));
    let text = dive.ok(&["label", "--suggest", "6", "--out", "labels"]);
    assert!(text.contains("sfm train labels"), "{text}");
    let proposed = tree(&dive.path("labels"));
    assert_eq!(proposed.len(), 12, "{:?}", proposed.keys());
    // Corrected: the truth in place of what was proposed.
    for name in proposed.keys().filter_map(|k| k.strip_prefix("masks/")) {
        std::fs::copy(dive.path(&format!("truth/masks/{name}")), dive.path(&format!("labels/masks/{name}"))).unwrap();
    }
    let figures: Value = serde_json::from_str(&dive.ok(&["train", "labels", "--out", "models/mine.onnx", "--json"])).unwrap();
    assert!(figures["accuracy"].as_f64().unwrap() > 0.9, "{figures:#}");
    let again = std::fs::read(dive.path("models/mine.onnx")).unwrap();
    dive.ok(&["train", "labels", "--out", "models/mine.onnx", "--threads", "1"]);
    assert_eq!(std::fs::read(dive.path("models/mine.onnx")).unwrap(), again, "the same with one thread");
    dive.write("dive.toml", &format!("{DIVE}[mask]\nstrategy = \"ml\"\nmodel = \"models/mine.onnx\"\n"));
    let report: Value = serde_json::from_str(&dive.ok(&["run", "--until", "mask", "--json"])).unwrap();
    assert_eq!(report["masks"]["classifier"]["name"], "mine");
    // Another file than the card describes.
    std::fs::write(dive.path("models/mine.onnx"), &again[..again.len() - 1]).unwrap();
    let (code, error) = dive.fails(&["run", "--until", "mask"]);
    assert!(code == 1 && error.contains("mine.onnx") && error.contains("sha256"), "{error}");
    std::fs::remove_file(dive.path("models/mine.toml")).unwrap();
    let (_, error) = dive.fails(&["run", "--until", "mask"]);
    assert!(error.contains("mine.toml") && error.contains("card"), "{error}");
}

#[test]
fn labels_that_teach_nothing_are_told() {
    if !has_runtime() {
        return;
    }
    let dive = Dive::empty();
    let (_, error) = dive.fails(&["train", ".", "--out", "mine.onnx"]);
    assert!(error.contains("no labelled image"), "{error}");
    std::fs::create_dir(dive.path("water")).unwrap();
    for i in 0..6 {
        std::fs::write(dive.path(&format!("water/{i}.png")), support::png(120, 80, i)).unwrap();
    }
    let (_, error) = dive.fails(&["train", ".", "--out", "mine.onnx"]);
    assert!(error.contains("the labels show background alone"), "{error}");
    std::fs::write(dive.path("water/2.png"), b"no image").unwrap();
    let (_, error) = dive.fails(&["train", ".", "--out", "mine.onnx"]);
    assert!(error.contains("2.png"), "{error}");
    let (_, error) = dive.fails(&["train", ".", "--out", "mine.bin"]);
    assert!(error.contains(".onnx"), "{error}");
}
