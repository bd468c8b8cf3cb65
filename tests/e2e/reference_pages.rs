//! The reference pages say what the program knows, and nothing else.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

use std::collections::BTreeSet;
use std::path::PathBuf;

fn page(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// First cells of the tables: "| `key` | ...".
fn keys_of(page: &str) -> Vec<String> {
    page.lines().filter_map(|line| Some(line.strip_prefix("| `")?.split_once("` |")?.0.to_owned())).collect()
}

#[test]
fn every_key_of_dive_toml_is_on_its_page_and_no_other() {
    let listed = keys_of(&page("dive-toml.md"));
    let documented: BTreeSet<&str> = listed.iter().map(String::as_str).collect();
    let known: BTreeSet<&str> = pipeline::config::KEYS.iter().map(|(key, _)| *key).collect();
    assert_eq!(listed.len(), documented.len(), "a key is documented twice");
    let missing: Vec<_> = known.difference(&documented).collect();
    let unknown: Vec<_> = documented.difference(&known).collect();
    assert!(missing.is_empty() && unknown.is_empty(), "not on the page: {missing:?}; not in the program: {unknown:?}");
}

/// The examples between ```toml and ``` of the page.
fn examples(page: &str) -> Vec<String> {
    page.split("```toml\n").skip(1).filter_map(|rest| Some(rest.split_once("```")?.0.to_owned())).collect()
}

/// Every example is accepted as it stands, next to the files that it names.
#[test]
fn the_examples_of_the_page_are_accepted() {
    let folder = tempfile::tempdir().unwrap();
    for file in [
        "frames/left/0001.jpg",
        "frames/left/0002.jpg",
        "frames/right/0001.jpg",
        "frames/right/0002.jpg",
        "port.mp4",
        "reference.ply",
        "models/mine.onnx",
        "labels/moving/C1/0001.json",
        "libonnxruntime.so",
        "positions.txt",
        "sensors.csv",
    ] {
        let path = folder.path().join(file);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "x").unwrap();
    }
    let examples = examples(&page("dive-toml.md"));
    assert!(examples.len() >= 3, "{} examples", examples.len());
    for example in &examples {
        // An example without camera is a part of one.
        let cameras = "[[camera]]\nname = \"C1\"\nimages = \"frames/left\"\n[[camera]]\nname = \"C2\"\nimages = \"frames/right\"\n";
        let file = if example.contains("[[camera]]") { example.clone() } else { format!("{cameras}{example}") };
        // A calibration file has its keys at the top.
        if example.starts_with("# calib/c1.toml") {
            std::fs::create_dir_all(folder.path().join("calib")).unwrap();
            std::fs::write(folder.path().join("calib/c1.toml"), example).unwrap();
            continue;
        }
        if let Err(error) = pipeline::config::parse(&folder.path().join("dive.toml"), &file) {
            panic!("{error}\n{file}");
        }
    }
    // Every key is used in some example.
    let all = examples.join("\n");
    let unused: Vec<&str> = pipeline::config::KEYS
        .iter()
        .map(|(key, _)| *key)
        .filter(|key| {
            // A name that the user chooses stands for its table.
            let name = key.trim_end_matches(".*").rsplit('.').next().unwrap_or(key);
            !all.lines().any(|line| line.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|word| word == name))
        })
        .collect();
    assert!(unused.is_empty(), "no example uses {unused:?}");
}
