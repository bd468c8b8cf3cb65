//! Photographs under water; the folder is named by SFM_DATA.

use masking::{IpOptions, Polarity, ip_mask, structure_share};
use std::path::{Path, PathBuf};

fn data() -> Option<PathBuf> {
    let folder = std::env::var_os("SFM_DATA").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: SFM_DATA does not name the folder of test data");
    }
    folder
}

/// Every third image of a folder.
fn masks(folder: &Path) -> Vec<(String, masking::IpMask)> {
    let mut files: Vec<_> = std::fs::read_dir(folder).expect("part of the data").map(|e| e.expect("readable").path()).collect();
    files.sort();
    let mask = |path: &PathBuf| {
        let rgb = imaging::decode_rgb(&std::fs::read(path).expect("readable")).expect("valid");
        (path.display().to_string(), ip_mask(&rgb, &IpOptions::default()))
    };
    files.iter().step_by(3).map(mask).collect()
}

#[test]
fn water_alone_is_empty() {
    let Some(data) = data() else { return };
    for folder in ["aurlab-tower/water-left", "aurlab-tower/water-right"] {
        for (name, found) in masks(&data.join(folder)) {
            assert!(found.empty && structure_share(&found.mask) == 0.0, "{name}: {}", found.edge_share);
        }
    }
}

#[test]
fn a_lit_tower_is_bright_structure_in_masked_water() {
    let Some(data) = data() else { return };
    for (name, found) in masks(&data.join("aurlab-tower/left")) {
        let share = structure_share(&found.mask);
        assert_eq!((found.empty, found.side), (false, Some(Polarity::Bright)), "{name}");
        // By eye the tower fills 15 to 40 % of these pictures.
        assert!((0.12..0.55).contains(&share), "{name}: {share}");
    }
}

#[test]
fn sea_floor_is_kept_whole() {
    let Some(data) = data() else { return };
    for folder in ["haltbrekken/left", "haltbrekken/right"] {
        for (name, found) in masks(&data.join(folder)) {
            assert!(structure_share(&found.mask) > 0.95, "{name}: {}", structure_share(&found.mask));
        }
    }
}
