//! The dive.toml of a synthetic dive.

use nalgebra::Vector3;
use std::fmt::Write;
use synthetic::dive::{Dive, DiveOptions, DiveScene, Pick};

/// Standard deviation of the given baselines, metres: as of a rig measured in a pool.
const BASELINE_SIGMA_M: f64 = 0.0005;
/// Standard deviation of the bars, metres.
const BAR_SIGMA_M: f64 = 0.0005;
/// Picks of each end of a bar.
const PICKS: usize = 6;

const HEAD: &str = "\
# Written by `sfm synth`: a rendered dive, whose truth lies beside it in truth/.
# Do it with `sfm run dive.toml`, or with the path of this file. docs/dive-toml.md explains every key.
";

pub(super) fn dive_toml(dive: &DiveScene, options: &DiveOptions) -> String {
    let mut text = String::from(HEAD);
    let _ = write!(
        text,
        "\n[dive]\nname = \"Synthetic reef, seed {}\"\noutput = \"out\"\nframes_from = \"stem\"  # files of the same name belong together\n",
        options.seed
    );
    for (c, camera) in dive.cameras.iter().enumerate() {
        let name = format!("C{}", c + 1);
        let _ = write!(text, "\n[[camera]]\nname = \"{name}\"\nimages = \"frames/{name}\"\n");
        let _ = writeln!(text, "mask = \"truth/masks/{name}/{{stem}}.png\"  # the true masks; [mask] says whether they are used");
        if let [f, cx, cy, k] = camera.params() {
            text.push_str("# The true interior orientation, refined all the same; without it a guess is the start.\n");
            let _ = writeln!(text, "interior = {{ model = \"simple-radial\", f = {f:.3}, cx = {cx:.3}, cy = {cy:.3}, k = {k:.4} }}");
        }
    }
    baselines(&mut text, dive);
    for (i, bar) in dive.scale_bars.iter().enumerate() {
        let ends = bar.ends.map(|end| picks(dive, &end));
        if ends.iter().any(|picks| picks.len() < 2) {
            continue;
        }
        // The last one is held out.
        let check = i + 1 == dive.scale_bars.len();
        let word = if check { "held out: only compared with what is found" } else { "takes part in the adjustment" };
        let _ = write!(text, "\n# A known length in the scene, {word}. Its ends were picked by hand, to 0.3 px.\n[[scale_bar]]\n");
        let _ = write!(text, "name = \"{}\"\nlength_m = {:.6}\nsigma_m = {BAR_SIGMA_M}\ncheck = {check}\n", bar.name, bar.length_m());
        text.push_str("endpoints = [\n");
        for end in ends {
            text.push_str("    [\n");
            for Pick { camera, exposure, pixel: [x, y] } in end {
                let name = Dive::name(camera, exposure, "jpg");
                let _ = writeln!(text, "        {{ image = \"{name}\", x = {x:.1}, y = {y:.1} }},");
            }
            text.push_str("    ],\n");
        }
        text.push_str("]\n");
    }
    text.push_str("\n[mask]\nstrategy = \"none\"  # \"files\" takes the masks named above, \"ip\" makes some by image processing\n");
    text.push_str("\n[densify]\nquality = \"low\"  # quick; \"medium\" takes the frames as they are up to 960 pixels\n");
    text.push_str(
        "\n[evaluate]\nreference = \"truth/mesh.ply\"\npositions = \"truth/positions.txt\"  # moves the model to the frame of the mesh\n",
    );
    text
}

fn baselines(text: &mut String, dive: &DiveScene) {
    let centres: Vec<Vector3<f64>> = dive.cam_from_rig.iter().map(|pose| pose.centre()).collect();
    if centres.len() > 1 {
        text.push_str("\n# Distances between the cameras make the model metric.\n");
    }
    for second in 1..centres.len() {
        for first in 0..second {
            let length_m = (centres[second] - centres[first]).norm();
            let _ = write!(
                text,
                "[[rig.baseline]]\nbetween = [\"C{}\", \"C{}\"]\nlength_m = {length_m:.5}\nsigma_m = {BASELINE_SIGMA_M}\n\n",
                first + 1,
                second + 1
            );
        }
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
}

/// A few picks, spread evenly over the frames that show the point.
fn picks(dive: &DiveScene, point: &Vector3<f64>) -> Vec<Pick> {
    let all = dive.picks(point);
    let count = all.len().min(PICKS);
    (0..count).map(|i| all[i * all.len() / count]).collect()
}
