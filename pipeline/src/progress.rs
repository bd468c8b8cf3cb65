//! How stages say how far they are. Only the command line knows terminals.

/// Listens to a run.
pub trait Progress: Sync {
    /// A stage starts.
    fn stage(&self, name: &str);
    /// A stage has been found done.
    fn skipped(&self, name: &str);
    /// A part of a stage starts, of `total` items.
    fn begin(&self, what: &str, total: usize);
    /// Items are done.
    fn advance(&self, items: usize);
    /// The stage is done.
    fn done(&self, name: &str, seconds: f64, note: &str);
}

/// Says nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &str) {}
    fn skipped(&self, _: &str) {}
    fn begin(&self, _: &str, _: usize) {}
    fn advance(&self, _: usize) {}
    fn done(&self, _: &str, _: f64, _: &str) {}
}
