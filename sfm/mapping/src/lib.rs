//! Package `mapping`.
