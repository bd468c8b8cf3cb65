//! Small numerical tools that the solvers share.

pub(crate) mod minimise;
pub(crate) mod null_space;
pub(crate) mod packed_inverse;
pub(crate) mod polynomial;
pub(crate) mod sparse_cholesky;
