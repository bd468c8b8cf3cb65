//! Tests of the adjuster.

mod covariance;
mod edges;
mod lengths;
mod normal_equations;
mod oracle;
mod robustness;
mod scene;
mod truth;
