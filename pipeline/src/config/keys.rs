//! Every key of a dive.toml. `docs/dive-toml.md` describes each; a test compares the two.

use super::error::{Source, did_you_mean};
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Every key with its tables, and what it takes. `*` stands for a name that the user chooses; tables of an array share
/// their path.
pub const KEYS: &[(&str, &str)] = &[
    ("dive.name", "a text"),
    ("dive.output", "a folder"),
    ("dive.frames_from", "\"order\", \"stem\" or \"timestamp\""),
    ("camera.name", "a text of letters, digits, '-', '_' and '.'"),
    ("camera.images", "a folder or a pattern such as \"frames/left/*.jpg\""),
    ("camera.video", "a video file"),
    ("camera.rate_hz", "a number above 0, frames a second"),
    ("camera.offset_secs", "a number, seconds"),
    ("camera.mask", "a pattern such as \"masks/{stem}.png\""),
    ("camera.interior.file", "a TOML file"),
    ("camera.interior.model", "\"pinhole\", \"simple-radial\", \"radial\", \"opencv\", \"fisheye\" or \"brown\""),
    ("camera.interior.width", "a whole number above 0, pixels"),
    ("camera.interior.height", "a whole number above 0, pixels"),
    ("camera.interior.fixed", "true, false or a list of parameters, [\"c1\", \"c2\"]"),
    ("camera.interior.sigma.*", "a number above 0"),
    ("camera.interior.port.normal", "three numbers"),
    ("camera.interior.port.distance_m", "a number, metres"),
    ("camera.interior.port.thickness_m", "a number, metres"),
    ("camera.interior.port.index_air", "a number from 1"),
    ("camera.interior.port.index_port", "a number from 1"),
    ("camera.interior.port.index_water", "a number from 1"),
    ("camera.interior.port.object_distance_m", "a number above 0, metres"),
    ("camera.interior.f", "a number above 0, pixels"),
    ("camera.interior.fx", "a number above 0, pixels"),
    ("camera.interior.fy", "a number above 0, pixels"),
    ("camera.interior.cx", "a number, pixels"),
    ("camera.interior.cy", "a number, pixels"),
    ("camera.interior.k", "a number"),
    ("camera.interior.k1", "a number"),
    ("camera.interior.k2", "a number"),
    ("camera.interior.k3", "a number"),
    ("camera.interior.k4", "a number"),
    ("camera.interior.p1", "a number"),
    ("camera.interior.p2", "a number"),
    ("camera.interior.c", "a number above 0, pixels"),
    ("camera.interior.x0", "a number, pixels"),
    ("camera.interior.y0", "a number, pixels"),
    ("camera.interior.a1", "a number"),
    ("camera.interior.a2", "a number"),
    ("camera.interior.a3", "a number"),
    ("camera.interior.b1", "a number"),
    ("camera.interior.b2", "a number"),
    ("camera.interior.c1", "a number"),
    ("camera.interior.c2", "a number"),
    ("rig.file", "a TOML file"),
    ("rig.mode", "\"rigid\", \"baselines\" or \"none\""),
    ("rig.baseline.between", "the names of two cameras, [\"C1\", \"C2\"]"),
    ("rig.baseline.length_m", "a number above 0, metres"),
    ("rig.baseline.sigma_m", "a number above 0, metres"),
    ("rig.pose.*.quaternion_wxyz", "four numbers"),
    ("rig.pose.*.axis_angle_deg", "three numbers, degrees"),
    ("rig.pose.*.matrix", "three rows of three numbers"),
    ("rig.pose.*.translation_m", "three numbers, metres"),
    ("rig.pose.*.sigma_deg", "a number above 0, degrees"),
    ("rig.pose.*.sigma_m", "a number above 0, metres"),
    ("scale_bar.name", "a text"),
    ("scale_bar.length_m", "a number above 0, metres"),
    ("scale_bar.sigma_m", "a number above 0, metres"),
    ("scale_bar.check", "true or false"),
    ("scale_bar.target", "\"circle\""),
    ("scale_bar.search_radius_px", "a number from 1 to 100, pixels"),
    ("scale_bar.endpoints.image", "the name of an image, \"C1/0001.jpg\""),
    ("scale_bar.endpoints.x", "a number, pixels"),
    ("scale_bar.endpoints.y", "a number, pixels"),
    ("world.origin_m", "three numbers, metres"),
    ("sensors.file", "a CSV file"),
    ("sensors.offset_secs", "a number, seconds"),
    ("sensors.interval_secs", "a number above 0, seconds"),
    ("sensors.position_latency_secs", "a number, seconds"),
    ("sensors.position_sigma_m", "a number above 0, metres"),
    ("sensors.position_lever_m", "three numbers, metres"),
    ("sensors.depth_sigma_m", "a number above 0, metres"),
    ("sensors.depth_lever_m", "three numbers, metres"),
    ("sensors.water_level_m", "a number, metres"),
    ("sensors.tilt_sigma_deg", "a number above 0, degrees"),
    ("sensors.heading_sigma_deg", "a number above 0, degrees"),
    ("sensors.mounting.quaternion_wxyz", "four numbers"),
    ("sensors.mounting.axis_angle_deg", "three numbers, degrees"),
    ("sensors.mounting.matrix", "three rows of three numbers"),
    ("control_point.name", "a text"),
    ("control_point.xyz_m", "three numbers, metres"),
    ("control_point.sigma_m", "a number above 0, metres"),
    ("control_point.check", "true or false"),
    ("control_point.target", "\"circle\""),
    ("control_point.search_radius_px", "a number from 1 to 100, pixels"),
    ("control_point.picks.image", "the name of an image, \"C1/0001.jpg\""),
    ("control_point.picks.x", "a number, pixels"),
    ("control_point.picks.y", "a number, pixels"),
    ("mask.strategy", "\"none\", \"files\", \"ip\", \"ml\" or \"ip+ml\""),
    ("mask.polarity", "\"auto\", \"dark\" or \"bright\""),
    ("mask.channel", "\"red\", \"green\" or \"blue\""),
    ("mask.working_long_side_px", "a whole number, pixels"),
    ("mask.blur_sigma_px", "a number, pixels"),
    ("mask.canny_low", "a number, grey values a pixel"),
    ("mask.canny_high", "a number, grey values a pixel"),
    ("mask.closing_radius", "a share from 0 to 1"),
    ("mask.min_structure_area", "a share from 0 to 1"),
    ("mask.min_hole_area", "a share from 0 to 1"),
    ("mask.min_textured_share", "a share from 0 to 1"),
    ("mask.reach", "a share from 0 to 1"),
    ("mask.min_texture", "a share from 0 to 1"),
    ("mask.otsu", "\"image\" or \"dive\""),
    ("mask.min_structure_m2", "a number above 0, square metres"),
    ("mask.min_hole_m2", "a number above 0, square metres"),
    ("mask.gsd_m", "a number above 0, metres a pixel"),
    ("mask.preprocessing", "\"none\", \"equalise\", \"clahe\", \"lab\" or \"retinex\""),
    ("mask.model", "a path, .onnx"),
    ("mask.onnxruntime", "a path"),
    ("mask.route", "\"shared\" or \"patches\""),
    ("mask.levels", "a whole number from 0 to 10"),
    ("mask.combine", "\"and\" or \"or\""),
    ("mask.vote", "a whole number of exposures from 0 to 5"),
    ("mask.moving", "a folder"),
    ("mask.moving_labels", "a list of texts, [\"fish\", \"tether\"]"),
    ("features.method", "\"sift\" or \"harris-ncc\""),
    ("features.max_keypoints", "a whole number above 0"),
    ("features.double_up_to_mpx", "a number of megapixels"),
    ("features.contrast_threshold", "a number from 0 to 1"),
    ("matching.pairs", "\"auto\", \"exhaustive\" or \"sequential\""),
    ("matching.exhaustive_up_to", "a whole number of images"),
    ("matching.overlap", "a whole number of images"),
    ("matching.ratio", "a number from 0 to 1"),
    ("matching.min_correlation", "a number from 0 to 1"),
    ("matching.max_error_px", "a number above 0, pixels"),
    ("matching.min_inliers", "a whole number"),
    ("orient.mapper", "\"auto\", \"global\" or \"incremental\""),
    ("orient.initial_min_inliers", "a whole number"),
    ("orient.initial_min_angle_deg", "a number, degrees"),
    ("orient.register_max_error_px", "a number above 0, pixels"),
    ("orient.register_min_inliers", "a whole number"),
    ("orient.max_error_px", "a number above 0, pixels"),
    ("orient.min_angle_deg", "a number, degrees"),
    ("orient.refine_principal_point", "true or false"),
    ("orient.seed", "a whole number"),
    ("densify.quality", "\"low\", \"medium\" or \"high\""),
    ("densify.max_views", "a whole number above 0"),
    ("densify.min_views", "a whole number above 0"),
    ("densify.seed", "a whole number"),
    ("surface.cell_m", "a number above 0, metres"),
    ("surface.trim", "a share from 0 to 1"),
    ("surface.screening", "a number from 0 to 10000"),
    ("surface.samples_per_cell", "a number from 0.1 to 1000"),
    ("surface.sigma_weights", "true or false"),
    ("surface.closed", "true or false"),
    ("evaluate.reference", "a mesh or a cloud, PLY or OBJ"),
    ("evaluate.positions", "a text file"),
    ("evaluate.threshold_m", "a number above 0, metres"),
    ("evaluate.density_radius_m", "a number above 0, metres"),
    ("evaluate.grid_m", "a number above 0, metres"),
    ("report.thumbnails", "a whole number of images"),
    ("report.thumbnail_px", "a whole number, pixels"),
];

/// What a key takes, in words.
pub(super) fn kind_of(path: &str) -> Option<&'static str> {
    KEYS.iter().find(|(key, _)| matches(key, path)).map(|&(_, kind)| kind)
}

/// Notes a problem for every key that is not in [`KEYS`].
pub(super) fn check_names(source: &mut Source<'_>, table: &DeTable<'_>, below: &str) {
    let mut unknown = Vec::new();
    walk(table, below, &mut unknown);
    for (span, path, name) in unknown {
        let (parent, _) = path.rsplit_once('.').unwrap_or(("", &path));
        let hint = name_hint(parent, &name);
        source.problem(Some(span), &path, "unknown key", hint);
    }
}

/// The key whose value holds the byte at `position`, innermost first.
pub(super) fn key_at(table: &DeTable<'_>, position: usize) -> String {
    let mut best = (usize::MAX, String::new());
    spans(table, "", &mut |path, span| {
        let length = span.len();
        if span.contains(&position) && length < best.0 {
            best = (length, path.to_owned());
        }
    });
    best.1
}

fn spans(table: &DeTable<'_>, below: &str, visit: &mut impl FnMut(&str, Range<usize>)) {
    for (key, value) in table {
        let path = join(below, key.get_ref());
        visit(&path, key.span());
        visit(&path, value.span());
        tables_in(value.get_ref(), &mut |table| spans(table, &path, visit));
    }
}

fn walk(table: &DeTable<'_>, below: &str, unknown: &mut Vec<(Range<usize>, String, String)>) {
    for (key, value) in table {
        let path = join(below, key.get_ref());
        if is_table(&path) {
            tables_in(value.get_ref(), &mut |table| walk(table, &path, unknown));
        } else if kind_of(&path).is_none() {
            unknown.push((key.span(), path, key.get_ref().to_string()));
        }
    }
}

/// Calls `visit` with the table that a value is, or every table of the array that it is.
fn tables_in(value: &DeValue<'_>, visit: &mut impl FnMut(&DeTable<'_>)) {
    match value {
        DeValue::Table(table) => visit(table),
        DeValue::Array(array) => array.iter().for_each(|item| tables_in(item.get_ref(), visit)),
        _ => {}
    }
}

fn join(below: &str, name: &str) -> String {
    if below.is_empty() { name.to_owned() } else { format!("{below}.{name}") }
}

fn matches(key: &str, path: &str) -> bool {
    let (mut key, mut path) = (key.split('.'), path.split('.'));
    loop {
        match (key.next(), path.next()) {
            (None, None) => return true,
            (Some(k), Some(p)) if k == "*" || k == p => {}
            _ => return false,
        }
    }
}

/// Whether keys lie below this path.
fn is_table(path: &str) -> bool {
    let depth = path.split('.').count();
    KEYS.iter().any(|(key, _)| {
        let mut parts = key.split('.');
        let prefix: Vec<&str> = parts.by_ref().take(depth).collect();
        parts.next().is_some() && matches(&prefix.join("."), path)
    })
}

fn name_hint(parent: &str, name: &str) -> Option<String> {
    let siblings = names_below(parent);
    if let Some(meant) = did_you_mean(name, siblings.iter().copied()) {
        return Some(format!("did you mean `{meant}`?"));
    }
    let elsewhere = KEYS.iter().find(|(key, _)| key.rsplit('.').next() == Some(name)).and_then(|(key, _)| key.rsplit_once('.'));
    if let Some((table, _)) = elsewhere {
        return Some(format!("`{name}` belongs to [{table}]"));
    }
    (!siblings.is_empty()).then(|| format!("known here: {}", siblings.join(", ")))
}

/// Names of the keys and tables directly below a table.
fn names_below(parent: &str) -> Vec<&'static str> {
    let depth = if parent.is_empty() { 0 } else { parent.split('.').count() };
    let mut names: Vec<&'static str> = Vec::new();
    for (key, _) in KEYS {
        let parts: Vec<&'static str> = key.split('.').collect();
        if parts.len() > depth && matches(&parts[..depth].join("."), parent) && !names.contains(&parts[depth]) {
            names.push(parts[depth]);
        }
    }
    names
}
