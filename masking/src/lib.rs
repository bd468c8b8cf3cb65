//! Package `masking`.
