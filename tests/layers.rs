//! The packages import each other only as ARCHITECTURE.md allows.

use std::collections::BTreeSet;
use std::process::Command;

/// Package, and what it may import of ours outside its tests.
const ALLOWED: &[(&str, &[&str])] = &[
    ("scene", &[]),
    ("imaging", &["scene"]),
    ("solve", &["scene"]),
    ("eval", &["scene"]),
    ("synthetic", &["scene", "imaging"]),
    ("features", &["scene", "imaging", "solve"]),
    ("calibrate", &["scene", "imaging", "solve"]),
    ("models", &[]),
    ("masking", &["scene", "imaging", "models"]),
    ("mapping", &["scene", "solve"]),
    ("dense", &["scene", "imaging"]),
    ("surface", &["scene"]),
    (
        "pipeline",
        &["scene", "imaging", "solve", "eval", "synthetic", "features", "calibrate", "models", "masking", "mapping", "dense", "surface"],
    ),
];

#[test]
fn packages_import_only_what_lies_below_them() {
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version", "1", "--no-deps", "--offline"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("cargo runs");
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("cargo prints JSON");
    let packages = metadata["packages"].as_array().expect("a list of packages");
    let ours: BTreeSet<&str> = packages.iter().filter_map(|p| p["name"].as_str()).collect();
    let listed: BTreeSet<&str> = ALLOWED.iter().map(|(name, _)| *name).collect();
    assert_eq!(ours, listed, "every package of the workspace has a row in the table above and in ARCHITECTURE.md");
    for package in packages {
        let name = package["name"].as_str().expect("a package has a name");
        let (_, allowed) = ALLOWED.iter().find(|(n, _)| *n == name).expect("checked above");
        for dependency in package["dependencies"].as_array().expect("a list of dependencies") {
            let target = dependency["name"].as_str().expect("a dependency has a name");
            let in_tests = dependency["kind"] == "dev";
            let fine = !ours.contains(target) || allowed.contains(&target) || (in_tests && target == "synthetic");
            assert!(fine, "{name} must not import {target}");
        }
    }
}
