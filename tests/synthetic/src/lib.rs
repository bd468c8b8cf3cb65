//! Package `synthetic`.
