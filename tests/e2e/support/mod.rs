//! A folder to run the program in.

#![allow(dead_code, reason = "each test file uses a part")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A temporary folder with images, and the program.
pub struct Dive {
    folder: tempfile::TempDir,
}

impl Dive {
    /// An empty folder.
    pub fn empty() -> Self {
        Self { folder: tempfile::tempdir().unwrap() }
    }

    /// Two cameras of three small images each, below `frames`.
    pub fn of_noise() -> Self {
        let dive = Self::empty();
        for (c, camera) in ["left", "right"].iter().enumerate() {
            std::fs::create_dir_all(dive.path(&format!("frames/{camera}"))).unwrap();
            for i in 0..3 {
                std::fs::write(dive.path(&format!("frames/{camera}/{i}.png")), png(64, 48, (10 * c + i) as u32)).unwrap();
            }
        }
        dive
    }

    /// A rendered dive of two cameras: `frames/C1/0000.png` and so on, and `reference.ply`, its true surface.
    pub fn rendered(options: &synthetic::dive::DiveOptions) -> (Self, synthetic::dive::Dive) {
        let (folder, dive) = (Self::empty(), synthetic::dive::render_dive(options).unwrap());
        for image in &dive.images {
            let path = folder.path("frames").join(synthetic::dive::DiveScene::name(image.camera, image.exposure, "png"));
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, imaging::encode_png_rgb(&image.rgb).unwrap()).unwrap();
        }
        let mut mesh = Vec::new();
        scene::format::write_ply_mesh(&dive.scene.world.mesh(), &mut mesh).unwrap();
        std::fs::write(folder.path("reference.ply"), mesh).unwrap();
        (folder, dive)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn write(&self, name: &str, text: &str) {
        std::fs::write(self.path(name), text).unwrap();
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sfm"));
        command.args(arguments).current_dir(self.folder.path());
        command
    }

    pub fn sfm(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// The standard output of a call that succeeds.
    pub fn ok(&self, arguments: &[&str]) -> String {
        let output = self.sfm(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    /// Exit code and standard error of a call that fails without a panic.
    pub fn fails(&self, arguments: &[&str]) -> (i32, String) {
        let output = self.sfm(arguments);
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(!stderr.contains("panicked"), "{stderr}");
        assert!(output.stdout.is_empty(), "nothing but data belongs on stdout");
        (output.status.code().unwrap(), stderr)
    }
}

/// A grey image of deterministic noise.
pub fn png(width: usize, height: usize, seed: u32) -> Vec<u8> {
    let mut state = seed.wrapping_mul(2_654_435_761).wrapping_add(1);
    let values = std::iter::repeat_with(|| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    });
    imaging::encode_png_grey(&scene::Raster::from_vec(width, height, values.take(width * height).collect()).unwrap()).unwrap()
}

/// Every file of an output folder whose bytes are promised.
pub fn tree(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                folders.push(path);
            } else if !["log.jsonl", "timings.json", ".hashes.json"].contains(&name.as_str()) {
                files.insert(name, std::fs::read(&path).unwrap());
            }
        }
    }
    files
}

/// Paths of all figures of a report.
pub fn keys(report: &serde_json::Value) -> Vec<String> {
    let mut keys = Vec::new();
    collect_keys(report, "", &mut keys);
    keys
}

/// Paths of the leaves; names that data bring are `*`.
fn collect_keys(value: &serde_json::Value, path: &str, keys: &mut Vec<String>) {
    match value {
        serde_json::Value::Object(map) => {
            for (name, below) in map {
                let free = matches!(
                    path,
                    "stages"
                        | "world"
                        | "masks.masked_ratio_by_camera"
                        | "cameras[].params"
                        | "cameras[].sigmas"
                        | "evaluation.c2m_percentiles_m"
                );
                let name = if free { "*" } else { name };
                collect_keys(below, &if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }, keys);
            }
        }
        serde_json::Value::Array(items) if items.iter().any(serde_json::Value::is_object) => {
            items.iter().for_each(|item| collect_keys(item, &format!("{path}[]"), keys));
        }
        // An empty list, or null for a table whose stage was not done.
        serde_json::Value::Array(items) if items.is_empty() => {}
        serde_json::Value::Null => {}
        _ => keys.push(path.to_owned()),
    }
}
