//! Tests of the adjuster.

mod edges;
mod lengths;
mod normal_equations;
mod oracle;
mod robustness;
mod scene;
mod truth;
