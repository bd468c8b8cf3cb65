//! Boards drawn with known corners.

use super::{BoardFinding, detect_board};
use nalgebra::{Matrix3, Vector2, Vector3};
use scene::Raster;

/// Draws a board of inner corners `columns` x `rows` with white about it, seen through a homography and with radial distortion `k`.
struct Drawing {
    columns: usize,
    rows: usize,
    image_from_board: Matrix3<f64>,
    k: f64,
    noise: f64,
    contrast: f64,
}

const SIZE: (usize, usize) = (640, 480);

impl Drawing {
    fn undistorted(&self, p: &Vector2<f64>) -> Vector2<f64> {
        let centre = Vector2::new(SIZE.0 as f64, SIZE.1 as f64) / 2.0;
        let d = (p - centre) / 320.0;
        centre + 320.0 * d * (1.0 + self.k * d.norm_squared())
    }

    fn value(&self, p: &Vector2<f64>) -> f64 {
        let q = self.image_from_board.try_inverse().unwrap() * self.undistorted(p).push(1.0);
        let (x, y) = (q.x / q.z + 1.0, q.y / q.z + 1.0);
        if x < 0.0 || y < 0.0 || x >= self.columns as f64 + 1.0 || y >= self.rows as f64 + 1.0 {
            return 0.9;
        }
        if (x.floor() + y.floor()) as i64 % 2 == 0 { 0.05 } else { 0.9 }
    }

    /// Where a corner is drawn: the inverse of the distortion by iteration.
    fn corner(&self, i: usize, j: usize) -> Vector2<f64> {
        let q = self.image_from_board * Vector3::new(i as f64, j as f64, 1.0);
        let target = q.xy() / q.z;
        let mut p = target;
        for _ in 0..50 {
            p += target - self.undistorted(&p);
        }
        p
    }

    fn image(&self) -> Raster<f32> {
        let mut random = synthetic::Random::new(5);
        let mut data = Vec::with_capacity(SIZE.0 * SIZE.1);
        for y in 0..SIZE.1 {
            for x in 0..SIZE.0 {
                let mut sum = 0.0;
                for k in 0..36 {
                    let at = Vector2::new(x as f64 + (f64::from(k % 6) + 0.5) / 6.0, y as f64 + (f64::from(k / 6) + 0.5) / 6.0);
                    sum += self.value(&at);
                }
                // Light falls off to one side, as of a lamp.
                let light = 1.0 - 0.6 * x as f64 / SIZE.0 as f64;
                data.push((0.3 + self.contrast * (sum / 36.0 - 0.5) * light + self.noise * random.normal()) as f32);
            }
        }
        imaging::gaussian_blur(&Raster::from_vec(SIZE.0, SIZE.1, data).unwrap(), 0.8)
    }
}

fn drawing() -> Drawing {
    let image_from_board = Matrix3::new(42.0, 6.0, 150.0, -9.0, 40.0, 160.0, -0.012, 0.02, 1.0);
    Drawing { columns: 9, rows: 6, image_from_board, k: 0.0, noise: 0.004, contrast: 0.5 }
}

fn errors(drawing: &Drawing) -> Vec<f64> {
    let BoardFinding::Found(board) = detect_board(&drawing.image(), drawing.columns, drawing.rows) else { panic!("not found") };
    let truth = (0..drawing.rows).flat_map(|j| (0..drawing.columns).map(move |i| (i, j)));
    truth.zip(&board.corners).map(|((i, j), p)| (drawing.corner(i, j) - p).norm()).collect()
}

#[test]
fn corners_come_in_order_and_to_a_few_hundredths_of_a_pixel() {
    for (k, noise, contrast) in [(0.0, 0.002, 0.6), (0.12, 0.004, 0.4), (-0.1, 0.004, 0.4), (0.0, 0.004, 0.12)] {
        let found = errors(&Drawing { k, noise, contrast, ..drawing() });
        let rms = (found.iter().map(|e| e * e).sum::<f64>() / found.len() as f64).sqrt();
        // Noise of a hundredth of the contrast; in the last case of a tenth of it in the dark half.
        let limit = if contrast < 0.2 { 0.15 } else { 0.04 };
        assert!(rms < limit && found.iter().all(|e| *e < 4.0 * limit), "k {k}, contrast {contrast}: {rms}");
    }
}

#[test]
fn a_board_upside_down_has_its_first_corner_at_the_other_end() {
    let mut upside_down = drawing();
    let turn = Matrix3::new(-1.0, 0.0, 640.0, 0.0, -1.0, 480.0, 0.0, 0.0, 1.0);
    upside_down.image_from_board = turn * upside_down.image_from_board;
    assert!(errors(&upside_down).iter().all(|e| *e < 0.2));
}

#[test]
fn boards_of_another_size_or_cut_off_are_told() {
    let image = drawing().image();
    assert_eq!(detect_board(&image, 8, 6), BoardFinding::OtherSize { columns: 9, rows: 6 });
    assert_eq!(detect_board(&image, 8, 5), BoardFinding::OtherSize { columns: 9, rows: 6 });
    // A larger one is not distinguished from one that is hidden in part.
    assert_eq!(detect_board(&image, 10, 7), BoardFinding::Part { corners: 54 });
    let mut cut = drawing();
    cut.image_from_board = Matrix3::new(1.0, 0.0, 250.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) * cut.image_from_board;
    assert!(matches!(detect_board(&cut.image(), 9, 6), BoardFinding::Part { .. }));
    assert_eq!(detect_board(&Raster::filled(640, 480, 0.4f32), 9, 6), BoardFinding::Nothing);
    assert_eq!(detect_board(&Raster::filled(3, 2, 0.4f32), 9, 6), BoardFinding::Nothing);
}

#[test]
fn noise_and_stripes_are_no_board() {
    let mut random = synthetic::Random::new(9);
    let noise = Raster::from_vec(640, 480, (0..640 * 480).map(|_| random.unit() as f32).collect()).unwrap();
    assert!(!matches!(detect_board(&noise, 9, 6), BoardFinding::Found(_)));
    let stripes = Raster::from_vec(640, 480, (0..640 * 480).map(|k| f32::from(u8::from(k % 640 / 20 % 2 == 0))).collect()).unwrap();
    assert_eq!(detect_board(&stripes, 9, 6), BoardFinding::Nothing);
}
