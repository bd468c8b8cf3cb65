//! Package `solve`.
