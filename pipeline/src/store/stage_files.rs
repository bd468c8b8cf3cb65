//! The files of one stage while it runs.

use super::folder::{journal_file, read_stamp, stamp_file};
use super::{Fingerprint, Identity, Output, Stamp, Store, StoreError, Warning};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};

/// Takes the files of a stage one by one, from any thread. Each is recorded as it is written, so that a run that is
/// stopped loses only the files that were being made.
///
/// The record is a journal of one line a file (`key content bytes path`), beside the stamp of the last complete run. The
/// line is written just before the file gets its name, so that no file of ours is ever unknown; a line without its file
/// is found out by the content. A file is used again when either record says that it was made from the same key, and its
/// content is what was written then. [`StageFiles::finish`] writes the stamp and removes the journal.
pub struct StageFiles<'s> {
    store: &'s Store,
    stage: &'static str,
    force: bool,
    /// What earlier runs recorded, whole or stopped.
    before: BTreeMap<String, Vec<Output>>,
    now: Mutex<BTreeMap<String, Output>>,
}

impl<'s> StageFiles<'s> {
    /// Starts a stage. `force` makes every file anew.
    ///
    /// # Errors
    /// [`StoreError::Write`].
    pub fn begin(store: &'s Store, stage: &'static str, force: bool) -> Result<Self, StoreError> {
        let stamped = read_stamp(store.root(), stage).map(|stamp| stamp.outputs).unwrap_or_default();
        let journal = std::fs::read(store.path(&journal_file(stage))).unwrap_or_default();
        let mut before: BTreeMap<String, Vec<Output>> = BTreeMap::new();
        for (path, output) in stamped.into_iter().chain(String::from_utf8_lossy(&journal).lines().filter_map(parse_line)) {
            before.entry(path).or_default().push(output);
        }
        let files = Self { store, stage, force, before, now: Mutex::default() };
        // From here on the stamp no longer vouches for the files. The line break ends a line that a stopped run left torn.
        files.append_to_journal("\n")?;
        Ok(files)
    }

    /// Makes a file unless it is there already, made from the same `key`.
    ///
    /// # Errors
    /// What `make` gives, or [`StoreError`].
    pub fn item<E: From<StoreError>>(&self, path: &str, key: Fingerprint, make: impl FnOnce() -> Result<Vec<u8>, E>) -> Result<(), E> {
        if self.reuse(path, key) {
            return Ok(());
        }
        let bytes = make()?;
        Ok(self.save(path, key, &bytes)?)
    }

    /// Whether a file is there already, made from the same `key`; it then counts as one of this run.
    #[must_use]
    pub fn reuse(&self, path: &str, key: Fingerprint) -> bool {
        let known: Vec<&Output> = self.before.get(path).into_iter().flatten().filter(|o| o.key == key).collect();
        if self.force || known.is_empty() {
            return false;
        }
        let content = Fingerprint::of_file(&self.store.path(path)).ok();
        let found = known.into_iter().find(|o| Some(o.content) == content);
        if let Some(output) = found {
            self.note(path, output.clone());
        }
        found.is_some()
    }

    /// Writes a file that is made from `key`.
    ///
    /// # Errors
    /// [`StoreError::Write`].
    pub fn save(&self, path: &str, key: Fingerprint, bytes: &[u8]) -> Result<(), StoreError> {
        let output = Output { key, content: Fingerprint::of_bytes(bytes), bytes: bytes.len() as u64 };
        let line = format!("{} {} {} {path}\n", output.key, output.content, output.bytes);
        self.store.write_recorded(path, bytes, || self.append_to_journal(&line))?;
        self.note(path, output);
        Ok(())
    }

    /// Ends the stage: removes files of earlier runs that this one no longer makes, unless someone changed them, and
    /// writes the stamp.
    ///
    /// # Errors
    /// [`StoreError::Write`].
    pub fn finish(self, identity: Identity, figures: Value, mut warnings: Vec<Warning>) -> Result<Stamp, StoreError> {
        let outputs = self.now.into_inner().unwrap_or_else(PoisonError::into_inner);
        for (path, old) in self.before.iter().filter(|(path, _)| !outputs.contains_key(*path)) {
            let content = Fingerprint::of_file(&self.store.path(path)).ok();
            if old.iter().any(|o| Some(o.content) == content) {
                self.store.remove(path)?;
            }
        }
        let folders: BTreeSet<&str> = outputs.keys().filter_map(|path| Some(path.rsplit_once('/')?.0)).collect();
        for folder in folders {
            let folder = self.store.path(folder);
            self.store.disk().sync_folder(&folder).map_err(StoreError::write(&folder))?;
        }
        warnings.sort();
        warnings.dedup();
        let stamp = Stamp { fingerprint: identity.fingerprint(self.stage), identity, outputs, figures, warnings };
        let text = serde_json::to_vec_pretty(&stamp)
            .map_err(|e| StoreError::Write { path: self.store.path(&stamp_file(self.stage)), cause: e.into() })?;
        self.store.write(&stamp_file(self.stage), &text)?;
        let journal = self.store.path(&journal_file(self.stage));
        self.store.disk().remove(&journal).map_err(StoreError::write(&journal))?;
        Ok(stamp)
    }

    fn note(&self, path: &str, output: Output) {
        self.now.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned(), output);
    }

    fn append_to_journal(&self, line: &str) -> Result<(), StoreError> {
        let journal = self.store.path(&journal_file(self.stage));
        if let Some(folder) = journal.parent() {
            self.store.disk().create_folder(folder).map_err(StoreError::write(folder))?;
        }
        // A single write, in append mode: lines of several threads do not mix.
        self.store.disk().append(&journal, line.as_bytes()).map_err(StoreError::write(&journal))
    }
}

fn parse_line(line: &str) -> Option<(String, Output)> {
    let mut parts = line.splitn(4, ' ');
    let key = parts.next()?.parse().ok()?;
    let content = parts.next()?.parse().ok()?;
    let bytes = parts.next()?.parse().ok()?;
    Some((parts.next()?.to_owned(), Output { key, content, bytes }))
}
