//! Tests of the whole extraction on images that are made here.

mod bits;
mod blobs;
mod limits;
mod picture;
mod warps;
