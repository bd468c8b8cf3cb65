//! Clouds of any size, read in pieces.

use crate::EvalError;
use crate::region::Region;
use nalgebra::Point3;
use scene::{Cloud, Similarity3};

/// Points of a piece of a cloud that lies in memory.
const PIECE: usize = 1 << 20;

/// What is done with each piece of a cloud.
pub type EachPiece<'a> = dyn FnMut(&[Point3<f64>]) -> Result<(), EvalError> + 'a;

/// A cloud that can be gone through as often as asked, each time the same points in the same order. Sizes of the pieces do
/// not change any figure.
pub trait Points {
    /// Hands over all points, piece by piece.
    ///
    /// # Errors
    /// What `each` returns, and [`EvalError::Input`] where the points cannot be read.
    fn visit(&self, each: &mut EachPiece<'_>) -> Result<(), EvalError>;
}

impl Points for Cloud {
    fn visit(&self, each: &mut EachPiece<'_>) -> Result<(), EvalError> {
        self.positions.chunks(PIECE).try_for_each(each)
    }
}

/// A cloud as it is measured: moved first, then cut to a region.
pub struct Prepared<'a> {
    /// The cloud.
    pub points: &'a dyn Points,
    /// Motion onto the reference.
    pub motion: Option<Similarity3>,
    /// What is measured.
    pub region: Option<&'a Region>,
}

impl Points for Prepared<'_> {
    fn visit(&self, each: &mut EachPiece<'_>) -> Result<(), EvalError> {
        if self.motion.is_none() && self.region.is_none() {
            return self.points.visit(each);
        }
        let mut kept = Vec::new();
        self.points.visit(&mut |piece| {
            kept.clear();
            let moved = piece.iter().map(|p| self.motion.map_or(*p, |m| m.apply_point(p)));
            kept.extend(moved.filter(|p| self.region.is_none_or(|r| r.contains(p))));
            if kept.is_empty() { Ok(()) } else { each(&kept) }
        })
    }
}
