//! What stands in the scene: a rippled sandy bottom, a cube of concrete slabs and beams with cut-outs, scale bars.

use nalgebra::Vector3;

/// What a surface is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Material {
    /// The reef: concrete with growth.
    Concrete,
    /// The bottom.
    Sand,
    /// A scale bar with dark and bright bands.
    Bar,
}

/// An axis-aligned box in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Block {
    pub low: Vector3<f64>,
    pub high: Vector3<f64>,
    pub material: Material,
}

/// Where a ray meets the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hit {
    /// Along the unit direction of the ray, metres.
    pub distance: f64,
    pub normal: Vector3<f64>,
    pub material: Material,
}

/// Half the side of the bottom, metres: beyond it there is only water.
pub(super) const BOTTOM_HALF_M: f64 = 6.0;
const RIPPLE_M: f64 = 0.03;

/// Height of the bottom, metres (z up).
pub(super) fn bottom(x: f64, y: f64) -> f64 {
    RIPPLE_M * (4.0 * x + 0.8 * (1.7 * y).sin()).sin() + 0.1 * (0.6 * x + 0.4).cos() * (0.5 * y).sin()
}

/// d height / d (x, y).
fn bottom_slope(x: f64, y: f64) -> [f64; 2] {
    let phase = 4.0 * x + 0.8 * (1.7 * y).sin();
    let ripple = RIPPLE_M * phase.cos();
    let swell = (0.6 * x + 0.4, 0.5 * y);
    [4.0 * ripple - 0.06 * swell.0.sin() * swell.1.sin(), 0.8 * 1.7 * (1.7 * y).cos() * ripple + 0.05 * swell.0.cos() * swell.1.cos()]
}

fn bottom_normal(x: f64, y: f64) -> Vector3<f64> {
    let [dx, dy] = bottom_slope(x, y);
    Vector3::new(-dx, -dy, 1.0).normalize()
}

/// The artificial reef: two slabs on four corner posts and four cross beams, 2.4 m wide and 2.2 m high.
pub(super) fn reef() -> Vec<Block> {
    let block = |low: [f64; 3], high: [f64; 3]| Block { low: Vector3::from(low), high: Vector3::from(high), material: Material::Concrete };
    let (half, post) = (1.2, 0.35);
    let mut blocks = vec![
        block([-half, -half, -0.2], [half, half, 0.25]),
        // The upper slab has a square hole: four parts.
        block([-half, -half, 1.9], [half, -0.45, 2.2]),
        block([-half, 0.45, 1.9], [half, half, 2.2]),
        block([-half, -0.45, 1.9], [-0.45, 0.45, 2.2]),
        block([0.45, -0.45, 1.9], [half, 0.45, 2.2]),
        // A wall that closes a part of one side, and a block inside.
        block([-half, half - 0.2, 0.25], [-0.2, half, 1.9]),
        block([-0.3, -0.3, 0.25], [0.35, 0.3, 0.9]),
    ];
    for (sx, sy) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let (x, y): (f64, f64) = (sx * (half - post / 2.0), sy * (half - post / 2.0));
        blocks.push(block([x - post / 2.0, y - post / 2.0, 0.25], [x + post / 2.0, y + post / 2.0, 1.9]));
    }
    for side in [-1.0, 1.0] {
        let y: f64 = side * (half - 0.1);
        blocks.push(block([-half + post, y - 0.1, 0.95], [half - post, y + 0.1, 1.25]));
        blocks.push(block([y - 0.1, -half + post, 0.95], [y + 0.1, half - post, 1.25]));
    }
    blocks
}

/// The first thing that a ray from `origin` along the unit vector `direction` meets.
pub(super) fn trace(blocks: &[Block], origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for block in blocks {
        if let Some((distance, normal)) = enter(block, origin, direction)
            && best.is_none_or(|b| distance < b.distance)
        {
            best = Some(Hit { distance, normal, material: block.material });
        }
    }
    if let Some(distance) = meet_bottom(origin, direction)
        && best.is_none_or(|b| distance < b.distance)
    {
        let p = origin + distance * direction;
        best = Some(Hit { distance, normal: bottom_normal(p.x, p.y), material: Material::Sand });
    }
    best
}

/// Where a ray enters a box: the latest of the three entries, if it comes before the earliest exit.
fn enter(block: &Block, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<(f64, Vector3<f64>)> {
    let (mut near, mut far, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for i in 0..3 {
        let inverse = 1.0 / direction[i];
        let (a, b) = ((block.low[i] - origin[i]) * inverse, (block.high[i] - origin[i]) * inverse);
        let (first, last) = if a < b { (a, b) } else { (b, a) };
        if first > near {
            near = first;
            axis = i;
        }
        far = far.min(last);
    }
    if near >= far || near <= 0.0 {
        return None;
    }
    let mut normal = Vector3::zeros();
    normal[axis] = -direction[axis].signum();
    Some((near, normal))
}

/// Where a ray meets the bottom: steps that cannot pass through it, since its slope is bounded, then Newton's method.
fn meet_bottom(origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
    /// Highest point of the bottom, metres.
    const TOP: f64 = 0.14;
    /// Bound of its slope: |(0.18, 0.1)|.
    const SLOPE: f64 = 0.21;
    if direction.z > -1e-6 {
        return None;
    }
    let approach = -direction.z + SLOPE * direction.x.hypot(direction.y);
    let mut t = ((TOP - origin.z) / direction.z).max(0.0);
    for i in 0..200 {
        let p = origin + t * direction;
        if p.x.abs() > BOTTOM_HALF_M || p.y.abs() > BOTTOM_HALF_M {
            // Outside, on the way to the bottom's square or past it.
            let towards = p.x * direction.x < 0.0 || p.y * direction.y < 0.0;
            if !towards || p.z < -TOP {
                return None;
            }
        }
        let above = p.z - bottom(p.x, p.y);
        if above > 2e-3 && i < 190 {
            t += above / approach;
            continue;
        }
        let [dx, dy] = bottom_slope(p.x, p.y);
        let rate = direction.z - dx * direction.x - dy * direction.y;
        if rate > -1e-9 {
            return None;
        }
        t -= above / rate;
        if above.abs() < 1e-12 {
            break;
        }
    }
    let p = origin + t * direction;
    (p.x.abs() <= BOTTOM_HALF_M && p.y.abs() <= BOTTOM_HALF_M).then_some(t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_box_and_bottom_where_they_should() {
        let block = Block { low: Vector3::new(-1.0, -1.0, 1.0), high: Vector3::new(1.0, 1.0, 2.0), material: Material::Concrete };
        let down = trace(&[block], &Vector3::new(0.2, 0.3, 5.0), &-Vector3::z()).expect("hits the top");
        assert!((down.distance - 3.0).abs() < 1e-12 && down.material == Material::Concrete);
        assert_eq!(down.normal, Vector3::z());
        let past = trace(&[block], &Vector3::new(3.0, 0.3, 5.0), &-Vector3::z()).expect("hits the bottom");
        assert!((past.distance - (5.0 - bottom(3.0, 0.3))).abs() < 1e-9 && past.material == Material::Sand);
        assert!(trace(&[block], &Vector3::new(3.0, 0.3, 5.0), &Vector3::z()).is_none());
    }
}
