use super::patch::Patch;
use super::plane::Plane;
use super::score::{NO_MATCH, Question, Scratch};
use super::*;
use scene::{Raster, Rigid3};

fn textured(w: usize, h: usize) -> Raster<u16> {
    let data = (0..w * h).map(|i| {
        let (x, y) = ((i % w) as f32, (i / w) as f32);
        (30_000.0 + 9000.0 * (0.37 * x + 0.2 * y).sin() + 9000.0 * (0.23 * x - 0.41 * y).cos() + 3000.0 * (0.9 * x).sin()) as u16
    });
    Raster::from_vec(w, h, data.collect()).expect("one value a pixel")
}

const K: Pinhole = Pinhole { fx: 100.0, fy: 110.0, cx: 31.0, cy: 24.0 };

fn source(grey: &Raster<u16>, pose: &Rigid3) -> SourceView {
    SourceView::new(GreyView::new(grey, &Raster::filled(grey.width(), grey.height(), 3)), &K, &K, pose)
}

#[test]
fn the_plane_of_a_point_projects_it() {
    let pose = Rigid3::new(nalgebra::UnitQuaternion::from_euler_angles(0.02, -0.05, 0.1), nalgebra::Vector3::new(0.3, 0.1, -0.2));
    let source = source(&textured(64, 48), &pose);
    let plane = Plane { w: 0.4, gx: 0.001, gy: -0.002 };
    // The point of the pixel (40, 20) on the plane given at (33, 25).
    let z = 1.0 / f64::from(plane.moved(7.0, -5.0).w);
    let x = nalgebra::Vector3::new((40.0 - 31.0) / 100.0 * z, (20.0 - 24.0) / 110.0 * z, z);
    let y = pose.apply(&x);
    let expected = [100.0 * y.x / y.z + 31.0, 110.0 * y.y / y.z + 24.0];
    let h: Vec<f64> = (0..3)
        .map(|i| {
            f64::from(source.a[i][0]) * 40.0 + f64::from(source.a[i][1]) * 20.0 + f64::from(source.a[i][2]) + f64::from(source.b[i]) / z
        })
        .collect();
    assert!((h[0] / h[2] - expected[0]).abs() < 1e-4 && (h[1] / h[2] - expected[1]).abs() < 1e-4);
    // n . X = d for the point, with n / d from the plane.
    let n = plane.normal_over_distance(&K, 33.0, 25.0);
    let dot: f64 = n.iter().zip(x.iter()).map(|(&a, &b)| f64::from(a) * b).sum();
    assert!((dot - 1.0).abs() < 1e-5, "{dot}");
}

#[test]
fn a_view_matches_itself_and_only_at_the_right_place() {
    let grey = textured(64, 48);
    let weights = PatchWeights::new(30.0, 4.0, 0.01);
    let patch = Patch::new(&grey, &Raster::filled(64, 48, 3), 30, 24, &weights).expect("contrast");
    // A sideways step of 0.5 at inverse depth 0.1 is 5 pixels: the source shows the same texture 5 pixels further.
    let shifted = Raster::from_vec(64, 48, (0..64 * 48).map(|i| textured(80, 48)[(i % 64 + 5, i / 64)]).collect()).expect("size");
    let sources = [source(&shifted, &Rigid3::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::new(-0.5, 0.0, 0.0)))];
    let question =
        Question { sources: &sources, patch: &patch, at: [30.0, 24.0], offset: [0.0; 2], noise: weights.noise_variance, best: 1 };
    let cost = |w| Kernel::Portable.score(&question, Plane { w, gx: 0.0, gy: 0.0 }, &mut Scratch::new());
    assert!(cost(0.1) < 1e-3, "{}", cost(0.1));
    assert!(cost(0.13) > 0.05 && cost(0.07) > 0.05, "{} {}", cost(0.13), cost(0.07));
    // Far outside.
    assert_eq!(cost(0.9), NO_MATCH);
}

#[test]
fn all_kernels_give_the_same_bits() {
    let (grey, other) = (textured(64, 48), textured(50, 61));
    let weights = PatchWeights::new(30.0, 4.0, 0.7);
    let pose = Rigid3::new(nalgebra::UnitQuaternion::from_euler_angles(0.03, 0.02, 0.1), nalgebra::Vector3::new(0.3, 0.1, 0.05));
    let sources = [source(&other, &pose), source(&grey, &pose.inverse())];
    let mut compared = 0;
    for y in 0..48 {
        for x in 0..64 {
            let Some(patch) = Patch::new(&grey, &Raster::filled(64, 48, 3), x, y, &weights) else { continue };
            let plane = Plane { w: 0.1 + 0.003 * x as f32, gx: 0.001, gy: 0.0005 * (y as f32 - 20.0) / 20.0 };
            let question = Question {
                sources: &sources,
                patch: &patch,
                at: [x as f32, y as f32],
                offset: [0.0; 2],
                noise: weights.noise_variance,
                best: 2,
            };
            let cost = |kernel: Kernel| kernel.score(&question, plane, &mut Scratch::new()).to_bits();
            assert_eq!(cost(Kernel::Portable), cost(Kernel::detect()));
            compared += usize::from(f32::from_bits(cost(Kernel::Portable)) < NO_MATCH);
        }
    }
    assert!(compared > 500, "{compared}");
}
