//! The stages: each loads what it needs, calls an algorithm of another package, and saves what came out.

pub mod images;
pub mod ingest;
mod pairing;
