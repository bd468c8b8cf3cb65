//! Package `features`.
