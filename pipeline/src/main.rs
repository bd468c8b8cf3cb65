//! The `sfm` program.

fn main() {}
