//! Package `imaging`.
