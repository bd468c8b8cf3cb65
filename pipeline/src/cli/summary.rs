//! What a run comes to, in a few lines, and the files to open.

use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

/// Files worth opening: the stage that makes them, and what they are.
const FILES: &[(&str, &str, &str)] = &[
    ("report", "report.html", "figures, the scene in 3D, images with keypoints and masks"),
    ("surface", "surface/mesh.ply", "surface"),
    ("densify", "dense/cloud.ply", "dense cloud"),
    ("orient", "sparse/points.ply", "sparse points; the cameras lie beside them as a COLMAP model"),
    ("report", "report.json", "every figure; `sfm help json` explains them"),
];

/// Lines for people; `report` as in report.json.
pub(super) fn summary(report: &Value, output: &Path, is_done: impl Fn(&str) -> bool) -> String {
    let mut text = String::new();
    let mut line = |head: &str, what: String| {
        let _ = writeln!(text, "{head:<10} {what}");
    };
    let number = |path: &str| report.pointer(path).and_then(Value::as_f64);
    if let (Some(oriented), Some(total)) = (number("/images/oriented"), number("/images/total")) {
        let rms = number("/reprojection_rms_px").map_or(String::new(), |rms| format!(", reprojection error {rms:.2} px RMS"));
        let scale = if report["scale"] == "metric" { "in metres" } else { "in an arbitrary unit: no known length could be used" };
        line("oriented", format!("{oriented} of {total} images, {scale}{rms}"));
    }
    for baseline in list(report, "baselines") {
        let between = [&baseline["between"][0], &baseline["between"][1]].map(|n| n.as_str().unwrap_or("?"));
        if let Some((given, found)) = given_and_found(baseline) {
            line("baseline", format!("{} - {}: given {given:.4} m, found {found:.4} m", between[0], between[1]));
        }
    }
    for bar in list(report, "scale_bars") {
        let held_out = if bar["check"] == true { ", held out" } else { "" };
        let name = bar["name"].as_str().unwrap_or("?");
        if let Some((given, found)) = given_and_found(bar) {
            line("scale bar", format!("{name}: given {given:.4} m, found {found:.4} m{held_out}"));
        }
    }
    if let Some(rmse) = number("/evaluation/positions/rmse_m") {
        line("positions", format!("{:.1} mm from the known ones (RMS)", 1e3 * rmse));
    }
    if let (Some(points), Some(median), Some(mean)) =
        (number("/evaluation/points"), number("/evaluation/c2m_median_m"), number("/evaluation/c2m_mean_m"))
    {
        line("cloud", format!("{points} points; from the reference {:.1} mm (median), {:.1} mm (mean)", 1e3 * median, 1e3 * mean));
    }
    for (stage, file, what) in FILES {
        let path = output.join(file);
        // A stage that is not done may have left the file of an earlier dive.toml.
        if is_done(stage) && path.exists() {
            line("open", format!("{}  ({what})", path.display()));
        }
    }
    text
}

fn list<'a>(report: &'a Value, key: &str) -> &'a [Value] {
    report[key].as_array().map_or(&[], Vec::as_slice)
}

fn given_and_found(length: &Value) -> Option<(f64, f64)> {
    Some((length["given_m"].as_f64()?, length["found_m"].as_f64()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn says_what_is_known_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("report.json"), "{}").unwrap();
        let report = json!({
            "images": {"total": 4, "oriented": 3}, "scale": "metric", "reprojection_rms_px": 0.512,
            "baselines": [{"between": ["C1", "C2"], "given_m": 0.4, "found_m": 0.4004}],
            "scale_bars": [{"name": "bar", "given_m": 1.0, "found_m": null, "check": true}],
            "evaluation": {"points": 10, "c2m_median_m": 0.0021, "c2m_mean_m": 0.0034},
        });
        let text = summary(&report, folder.path(), |_| true);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 4, "{text}");
        assert_eq!(lines[0], "oriented   3 of 4 images, in metres, reprojection error 0.51 px RMS");
        assert_eq!(lines[1], "baseline   C1 - C2: given 0.4000 m, found 0.4004 m");
        assert_eq!(lines[2], "cloud      10 points; from the reference 2.1 mm (median), 3.4 mm (mean)");
        assert!(lines[3].starts_with("open       ") && lines[3].contains("report.json  ("));
        assert_eq!(summary(&json!({}), Path::new("/nowhere"), |_| true), "");
        assert_eq!(summary(&report, folder.path(), |stage| stage != "report").lines().count(), 3);
    }
}
