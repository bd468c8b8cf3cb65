//! The scan for extrema of the difference of Gaussians.

use super::simd::dispatched;

/// Rows y - 1, y, y + 1 of one level.
pub(super) type Rows<'a> = [&'a [f32]; 3];

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    // Not `f32::max`, whose treatment of NaN takes more than one instruction.
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn column_range_body(rows: Rows, highest: &mut [f32], lowest: &mut [f32]) {
    let n = highest.len();
    let [a, b, c] = rows.map(|r| &r[..n]);
    let lowest = &mut lowest[..n];
    for x in 0..n {
        highest[x] = larger(larger(a[x], b[x]), c[x]);
        lowest[x] = smaller(smaller(a[x], b[x]), c[x]);
    }
}

/// Pixels that the inner loop works on at a time.
const LANES: usize = 32;

#[inline(always)]
fn mark_body(centre: &[f32], highest: Rows, lowest: Rows, threshold: f32, max: &mut [f32], min: &mut [f32], found: &mut Vec<u32>) {
    let n = centre.len();
    let [h0, h1, h2] = highest.map(|r| &r[..n]);
    let [l0, l1, l2] = lowest.map(|r| &r[..n]);
    let (max, min) = (&mut max[..n], &mut min[..n]);
    for x in 0..n {
        max[x] = larger(larger(h0[x], h1[x]), h2[x]);
        min[x] = smaller(smaller(l0[x], l1[x]), l2[x]);
    }
    let mut x = 1;
    while x + LANES < n {
        let v: &[f32; LANES] = centre[x..x + LANES].try_into().expect("the slice has that length");
        let (a, b): (&[f32; LANES + 2], &[f32; LANES + 2]) = (
            max[x - 1..x + LANES + 1].try_into().expect("the slice has that length"),
            min[x - 1..x + LANES + 1].try_into().expect("the slice has that length"),
        );
        let mut bits = 0u32;
        for l in 0..LANES {
            let top = (v[l] > threshold) & (v[l] >= a[l]) & (v[l] >= a[l + 1]) & (v[l] >= a[l + 2]);
            let bottom = (v[l] < -threshold) & (v[l] <= b[l]) & (v[l] <= b[l + 1]) & (v[l] <= b[l + 2]);
            bits |= u32::from(top | bottom) << l;
        }
        while bits != 0 {
            found.push(x as u32 + bits.trailing_zeros());
            bits &= bits - 1;
        }
        x += LANES;
    }
    for x in x..n.saturating_sub(1) {
        let v = centre[x];
        let top = v > threshold && (x - 1..=x + 1).all(|i| v >= max[i]);
        let bottom = v < -threshold && (x - 1..=x + 1).all(|i| v <= min[i]);
        if top || bottom {
            found.push(x as u32);
        }
    }
}

dispatched!(
    /// Largest and smallest value of each column of three rows.
    column_range(rows: Rows, highest: &mut [f32], lowest: &mut [f32]) = column_range_body
);
dispatched!(
    /// Appends the columns of `centre`, but for the first and last, whose magnitude is above `threshold` and which no value of the 3 x 3 x 3
    /// block around exceeds. `highest` and `lowest` are the column ranges of the level below, of its own and of the level above; `max` and
    /// `min` are scratch space of the row's length.
    mark_extrema(centre: &[f32], highest: Rows, lowest: Rows, threshold: f32, max: &mut [f32], min: &mut [f32], found: &mut Vec<u32>) = mark_body
);
