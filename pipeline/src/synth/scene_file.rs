//! A file of settings for a synthetic dive.

use super::error::SynthError;
use std::fs;
use std::path::Path;
use synthetic::dive::DiveOptions;
use toml::{Table, Value};

/// Reads the settings of a file; what it does not name is as in `preset`.
///
/// # Errors
/// When the file cannot be read, or a key or value is wrong: with line and key.
pub fn read_scene(path: &Path, preset: &DiveOptions) -> Result<DiveOptions, SynthError> {
    let text = fs::read_to_string(path).map_err(|cause| SynthError::File { path: path.to_path_buf(), cause })?;
    let wrong = |detail: String| SynthError::Scene { path: path.to_path_buf(), detail };
    // Read alone first: its errors know their lines.
    toml::from_str::<DiveOptions>(&text).map_err(|e| wrong(e.to_string()))?;
    let changes: Table = toml::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    let named = |table: &str| changes.get(table).and_then(|t| t.get("seed")).and_then(Value::as_integer);
    let (seed, path, world) = (changes.contains_key("seed"), named("motion"), named("world"));
    let mut all = Table::try_from(preset).map_err(|e| wrong(e.to_string()))?;
    overlay(&mut all, changes);
    let mut options: DiveOptions = all.try_into().map_err(|e: toml::de::Error| wrong(e.to_string()))?;
    if seed {
        // One seed stands for all that have none of their own.
        let own = (options.motion.seed, options.world.seed);
        options.reseed(options.seed);
        options.motion.seed = path.map_or(options.motion.seed, |_| own.0);
        options.world.seed = world.map_or(options.world.seed, |_| own.1);
    }
    Ok(options)
}

/// Tables are merged, everything else is replaced.
fn overlay(base: &mut Table, changes: Table) {
    for (key, value) in changes {
        match (base.get_mut(&key), value) {
            (Some(Value::Table(base)), Value::Table(changes)) => overlay(base, changes),
            (_, value) => {
                base.insert(key, value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use synthetic::dive::Preset;

    fn read(text: &str) -> Result<DiveOptions, SynthError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.toml");
        fs::write(&path, text).unwrap();
        read_scene(&path, &DiveOptions::preset(Preset::Survey))
    }

    #[test]
    fn a_file_changes_what_it_names_and_nothing_else() {
        let preset = DiveOptions::preset(Preset::Survey);
        assert_eq!(read("").unwrap(), preset);
        let changed = read("seed = 3\n[water]\njerlov = \"3\"\n[rig.port]\nkind = \"none\"\n[[rig.cameras]]\nfocal_mm = 8.0\n").unwrap();
        assert_eq!((changed.motion.seed, changed.world.seed), (3, 3), "one seed for all");
        assert_eq!(read("seed = 3\n[motion]\nseed = 5\n").unwrap().motion.seed, 5);
        assert_eq!((changed.seed, changed.rig.cameras.len(), changed.rig.cameras[0].focal_mm), (3, 1, 8.0));
        assert_eq!((changed.water.depth_m, changed.rig.width), (preset.water.depth_m, preset.rig.width));
        // What is written down reads back.
        let text = toml::to_string(&preset).unwrap();
        assert_eq!(read(&text).unwrap(), preset);
    }

    #[test]
    fn unknown_keys_and_wrong_values_are_told_with_their_line() {
        for (text, told) in [("[water]\nsalt = 3\n", "line 2"), ("seed = \"x\"\n", "line 1"), ("[world]\nscene = \"castle\"\n", "castle")] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(told) && error.contains("scene.toml"), "{error}");
        }
    }
}
