//! What makes figures doubtful.

use crate::distance::Reference;
use crate::hilbert;
use nalgebra::Point3;

/// Compares the places of the cloud (samples, box) with those of the reference (samples).
pub(crate) fn of_positions(
    samples: &[Point3<f64>],
    reference: &[Point3<f64>],
    bounds: (Point3<f64>, Point3<f64>),
    reach: f64,
) -> Vec<String> {
    let mut warnings = Vec::new();
    let ratio = spread(samples) / spread(reference);
    for (factor, units) in [
        (1000.0, "millimetres against metres"),
        (100.0, "centimetres against metres"),
        (0.01, "metres against centimetres"),
        (0.001, "metres against millimetres"),
    ] {
        // Half of that or twice as much is left for a cloud that covers more or less than the reference.
        if ratio > factor / 2.0 && ratio < factor * 2.0 {
            warnings.push(format!("the cloud is {ratio:.3} times as large as the reference: are the units different ({units})?"));
        }
    }
    let (low, high) = hilbert::bounds(reference);
    if (0..3).any(|i| bounds.0[i] > high[i] + reach || bounds.1[i] < low[i] - reach) {
        let text = |p: Point3<f64>| format!("({:.3}, {:.3}, {:.3})", p.x, p.y, p.z);
        warnings.push(format!(
            "cloud and reference do not overlap: {} to {} against {} to {}; are they in the same frame?",
            text(bounds.0),
            text(bounds.1),
            text(low),
            text(high)
        ));
    }
    warnings
}

/// Median distance of the points from their median place: outliers do not count.
fn spread(points: &[Point3<f64>]) -> f64 {
    let median = |mut values: Vec<f64>| {
        let middle = values.len() / 2;
        *values.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let few: Vec<&Point3<f64>> = points.iter().step_by(points.len().div_ceil(10_000)).collect();
    let centre = Point3::from([0, 1, 2].map(|i| median(few.iter().map(|p| p[i]).collect())));
    median(few.iter().map(|p| (*p - centre).norm()).collect())
}

/// Judges the distances themselves.
pub(crate) fn of_distances(accuracy: f64, median: f64, reference: &Reference) -> Vec<String> {
    let mut warnings = Vec::new();
    if accuracy == 0.0 {
        warnings.push("no point lies within the threshold of the reference: are both in the same frame?".to_owned());
    }
    let positions = match reference {
        Reference::Mesh(mesh) => &mesh.vertices,
        Reference::Cloud(cloud) => &cloud.positions,
    };
    let (low, high) = hilbert::bounds(positions);
    if median <= 1e-9 * (high - low).amax() {
        warnings.push("most points lie exactly on the reference: was it made from this cloud? Then it says nothing about it".to_owned());
    }
    if let Reference::Mesh(mesh) = reference {
        let flat = |f: &&[u32; 3]| {
            let [a, b, c] = f.map(|v| mesh.vertices[v as usize]);
            (b - a).cross(&(c - a)).norm() == 0.0
        };
        let count = mesh.faces.iter().filter(flat).count();
        if count > 0 {
            warnings
                .push(format!("{count} of {} triangles of the reference have no area; only their edges are measured to", mesh.faces.len()));
        }
    }
    warnings
}
