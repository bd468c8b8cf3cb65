//! Package `dense`.
