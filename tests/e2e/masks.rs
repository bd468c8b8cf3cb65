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
    // What decides stands on the card: with another one no mask is taken over.
    let masked = |report: &Value| report["masks"]["masked_ratio"].as_f64().unwrap();
    let card = std::fs::read_to_string(dive.path("models/mine.toml")).unwrap();
    assert!(masked(&report) < 1.0 && card.contains("decision = -1.0"), "{card}");
    dive.write("models/mine.toml", &card.replace("decision = -1.0", "decision = 50.0"));
    let none: Value = serde_json::from_str(&dive.ok(&["run", "--until", "mask", "--json"])).unwrap();
    assert_eq!(masked(&none), 1.0, "{none:#}");
    dive.write("models/mine.toml", &card);
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

/// Intersection over union of the masks below a folder with the truth, over all images together.
fn agreement(dive: &Dive, masks: &str) -> f64 {
    let (mut common, mut either) = (0u32, 0u32);
    for (name, truth) in tree(&dive.path("truth/masks")) {
        let found = imaging::decode_grey_u8(&std::fs::read(dive.path(&format!("{masks}/{name}"))).unwrap()).unwrap();
        let truth = imaging::decode_grey_u8(&truth).unwrap();
        common += truth.data().iter().zip(found.data()).filter(|(t, f)| **t > 127 && **f > 127).count() as u32;
        either += truth.data().iter().zip(found.data()).filter(|(t, f)| **t > 127 || **f > 127).count() as u32;
    }
    f64::from(common) / f64::from(either)
}

/// Masks from files, that of one exposure wrong: the vote of its neighbours mends it, and leaves true masks as they are.
#[test]
fn a_wrong_mask_of_a_single_exposure_is_overruled_by_its_neighbours() {
    let mut options = DiveOptions::small(6, 320, 200);
    // 5 degrees from exposure to exposure, as `sfm synth` does.
    options.motion.arc_deg = 25.0;
    let dive = labelled_dive(&options);
    let with = |vote: u32, out: &str, threads: &str| {
        let text = DIVE.replace("C1\"", "C1\"\nmask = \"drawn/C1/{stem}.png\"").replace("C2\"", "C2\"\nmask = \"drawn/C2/{stem}.png\"");
        dive.write("dive.toml", &format!("{text}[mask]\nvote = {vote}\n"));
        dive.ok(&["mask", "--out", out, "--threads", threads]);
        agreement(&dive, &format!("{out}/files"))
    };
    for (name, bytes) in tree(&dive.path("truth/masks")) {
        let path = dive.path("drawn").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    // Parallax moves the border of true masks by a pixel here and there.
    let harmless = with(1, "true", "2");
    assert!(harmless > 0.995, "{harmless}");
    let empty = imaging::encode_png_grey(&scene::Raster::filled(320, 200, 0)).unwrap();
    std::fs::write(dive.path("drawn/C1/0002.png"), empty).unwrap();
    let (wrong, mended) = (with(0, "wrong", "2"), with(1, "mended", "2"));
    // One of twelve masks is lost, a twelfth of the structure; the vote brings back what both neighbours show, which is not all at the sides.
    assert!(wrong < 0.94 && mended > 0.96, "{wrong} {mended}");
    with(1, "one", "1");
    assert_eq!(tree(&dive.path("one")), tree(&dive.path("mended")), "the same with one thread");
}

#[test]
fn what_moves_is_cut_out_of_the_masks_of_every_strategy() {
    let dive = labelled_dive(&DiveOptions::small(2, 320, 200));
    std::fs::create_dir_all(dive.path("moving/C1")).unwrap();
    dive.write("moving/C1/0001.json", r#"{"shapes": [{"label": "tether", "points": [[0, 0], [320, 100]], "shape_type": "rectangle"}]}"#);
    dive.write("moving/C1/7.json", r#"{"shapes": [{"label": "tether", "points": [[0, 0], [320, 100]], "shape_type": "rectangle"}]}"#);
    let upper_half = |strategy: &str, name: &str| {
        let mask = imaging::decode_grey_u8(&std::fs::read(dive.path(&format!("out/masks/{strategy}/{name}"))).unwrap()).unwrap();
        mask.data()[..320 * 100].iter().filter(|v| **v > 127).count()
    };
    for strategy in ["none", "ip"] {
        dive.write("dive.toml", &format!("{DIVE}[mask]\nstrategy = \"{strategy}\"\nmoving = \"moving\"\n"));
        let output = dive.sfm(&["run", "--until", "mask", "--json"]);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && error.contains("7.json") && error.contains("no image of the dive"), "{error}");
        assert_eq!(upper_half(strategy, "C1/0001.png"), 0);
        let ratios = std::fs::read_to_string(dive.path(&format!("out/masks/{strategy}/masked_ratio.csv"))).unwrap();
        assert!(ratios.starts_with("image,masked_ratio\nC1/000"), "{ratios}");
    }
    assert!(upper_half("ip", "C1/0000.png") > 0, "the other images keep theirs");
    // Other labels move: the tether stays.
    dive.write("dive.toml", &format!("{DIVE}[mask]\nmoving = \"moving\"\nmoving_labels = [\"fish\"]\n"));
    dive.ok(&["run", "--until", "mask"]);
    assert!(!dive.path("out/masks/none/C1/0001.png").exists());
    dive.write("dive.toml", &format!("{DIVE}[mask]\nmoving = \"moved\"\n"));
    let (code, error) = dive.fails(&["run", "--until", "mask"]);
    assert!(code == 2 && error.contains("mask.moving") && error.contains("there is no folder"), "{code} {error}");
}

/// A network by hand: an input and an output of given axes, 0 for any length, joined by one operator.
fn network(operator: &str, input: &[i64], output: (&str, &[i64])) -> Vec<u8> {
    fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
        assert!(bytes.len() < 128, "one byte of length");
        [&[number << 3 | 2, bytes.len() as u8], bytes].concat()
    }
    let tensor = |name: &str, axes: &[i64]| {
        let axes = axes.iter().flat_map(|&n| field(1, &if n > 0 { vec![0x08, n as u8] } else { field(2, b"n") }));
        let tensor = [vec![0x08, 1], field(2, &axes.collect::<Vec<u8>>())].concat();
        [field(1, name.as_bytes()), field(2, &field(1, &tensor))].concat()
    };
    let node = [field(1, b"image"), field(2, output.0.as_bytes()), field(4, operator.as_bytes())].concat();
    let graph = [field(1, &node), field(2, b"g"), field(11, &tensor("image", input)), field(12, &tensor(output.0, output.1))].concat();
    [vec![0x08, 8], field(7, &graph), field(8, &[0x10, 17])].concat()
}

/// Networks that are no classifiers of two classes, a file that is none, a card that is missing: each is named with the reason, before any image is masked.
#[test]
fn models_that_cannot_be_used_are_told() {
    if !has_runtime() {
        return;
    }
    let dive = Dive::of_noise();
    dive.write("dive.toml", "[[camera]]\nimages = \"frames/left\"\n[mask]\nstrategy = \"ml\"\nmodel = \"mine.onnx\"\n");
    let card = |bytes: &[u8]| {
        format!(
            "name = \"mine\"\nsha256 = \"{}\"\noutput = \"logits\"\nclasses = [\"background\", \"structure\"]\n[input]\nname = \"image\"\nwidth = 8\nheight = 8\n\
             mean = [0.0, 0.0, 0.0]\nstd = [1.0, 1.0, 1.0]\n",
            models::sha256(bytes)
        )
    };
    let two = network("Flatten", &[0, 3, 0, 0], ("logits", &[0, 2]));
    let refused: [(Vec<u8>, &[&str]); 6] = [
        (
            network("Flatten", &[0, 3, 0, 0], ("logits", &[0, 3])),
            &["no classifier of two classes", "logits is [-1, 3]", "[n, 2] is needed"],
        ),
        (network("Identity", &[0, 3, 0, 0], ("logits", &[0, 3, 0, 0])), &["logits is [-1, 3, -1, -1]"]),
        (network("Identity", &[0, 2], ("logits", &[0, 2])), &["its input is [-1, 2]", "[n, 3, 8, 8] is needed"]),
        (network("Identity", &[0, 3, 0], ("logits", &[0, 3, 0])), &["its input is [-1, 3, -1]"]),
        (network("Flatten", &[0, 1, 0, 0], ("logits", &[0, 2])), &["its input is [-1, 1, -1, -1]"]),
        (two[..two.len() / 2].to_vec(), &["mine.onnx cannot be used"]),
    ];
    for (bytes, expected) in refused {
        std::fs::write(dive.path("mine.onnx"), &bytes).unwrap();
        dive.write("mine.toml", &card(&bytes));
        let (code, error) = dive.fails(&["run", "--until", "mask"]);
        assert!(code == 1 && error.contains("mine.onnx") && expected.iter().all(|e| error.contains(e)), "{code} {error}");
    }
    // All that its axes do not say shows when it runs: 8 x 8 pixels of three colours are 192 values, not 2.
    std::fs::write(dive.path("mine.onnx"), network("Flatten", &[0, 3, 0, 0], ("logits", &[0, 0]))).unwrap();
    dive.write("mine.toml", &card(&std::fs::read(dive.path("mine.onnx")).unwrap()));
    let (code, error) = dive.fails(&["run", "--until", "mask"]);
    assert!(code == 1 && error.contains("[1, 192] for 1 patches; [1, 2] is needed"), "{code} {error}");
    std::fs::remove_file(dive.path("mine.toml")).unwrap();
    let (code, error) = dive.fails(&["run", "--until", "mask"]);
    assert!(code == 1 && error.contains("mine.onnx has no card") && error.contains("mine.toml"), "{code} {error}");
}

/// Images of a few pixels have fewer levels than asked for, and a mask of their size by every strategy.
#[test]
fn images_smaller_than_the_smallest_cell_are_masked() {
    let strategies: &[&str] = if has_runtime() { &["ip", "ml", "ip+ml"] } else { &["ip"] };
    for (width, height) in [(5, 3), (1, 1), (130, 2)] {
        let dive = Dive::empty();
        std::fs::create_dir(dive.path("frames")).unwrap();
        for i in 0..2 {
            std::fs::write(dive.path(&format!("frames/{i}.png")), support::png(width, height, i)).unwrap();
        }
        dive.write("dive.toml", "[[camera]]\nname = \"C1\"\nimages = \"frames\"\n");
        dive.ok(&["mask", "--strategy", &strategies.join(","), "--out", "masks"]);
        for strategy in strategies {
            let mask = imaging::decode_grey_u8(&std::fs::read(dive.path(&format!("masks/{strategy}/C1/1.png"))).unwrap()).unwrap();
            assert_eq!((mask.width(), mask.height()), (width, height), "{strategy}");
        }
    }
}

/// Masks of another size and with grey values, grey images, odd sizes.
#[test]
fn odd_images_and_masks_are_told_or_taken() {
    let dive = Dive::empty();
    for folder in ["frames", "drawn"] {
        std::fs::create_dir(dive.path(folder)).unwrap();
    }
    for (i, (width, height)) in [(101, 77), (101, 77), (101, 77)].into_iter().enumerate() {
        std::fs::write(dive.path(&format!("frames/{i}.png")), support::png(width, height, i as u32)).unwrap();
    }
    let grey = |width: usize, height: usize, value: u8| imaging::encode_png_grey(&scene::Raster::filled(width, height, value)).unwrap();
    std::fs::write(dive.path("drawn/0.png"), grey(101, 77, 128)).unwrap();
    std::fs::write(dive.path("drawn/1.png"), grey(77, 101, 255)).unwrap();
    std::fs::write(dive.path("drawn/2.png"), grey(101, 77, 127)).unwrap();
    dive.write("dive.toml", "[[camera]]\nname = \"C1\"\nimages = \"frames\"\nmask = \"drawn/{stem}.png\"\n");
    let output = dive.sfm(&["run", "--until", "mask", "--json"]);
    let error = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success() && error.contains("C1/1.png") && error.contains("77 x 101"), "{error}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((report["masks"]["masks"].as_u64(), report["masks"]["empty_images"][0].as_str()), (Some(2), Some("C1/2.png")), "{report:#}");
    let strategies = if has_runtime() { "ip,ml" } else { "ip" };
    let text = dive.ok(&["mask", "--strategy", strategies]);
    assert!(text.contains("ip"), "{text}");
}
