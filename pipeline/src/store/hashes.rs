//! Content hashes of input files, remembered so that a dive of thousands of images is not read anew at each call.

use super::{Fingerprint, Store, StoreError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// Where they are remembered. Holds paths and times, and so is no artefact: it may differ between runs, and be deleted.
pub(super) const FILE: &str = ".hashes.json";
/// A file that changed less than this before it was read could change again without its time changing, seconds.
const SETTLED_SECS: f64 = 2.0;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Entry {
    bytes: u64,
    modified: f64,
    read: f64,
    content: Fingerprint,
}

/// Content hashes by path. A file of the same length and time of change as before is not read again.
#[derive(Debug, Default)]
pub struct Hashes {
    known: BTreeMap<PathBuf, Entry>,
    used: Mutex<BTreeMap<PathBuf, Entry>>,
}

impl Hashes {
    /// What an output folder remembers; nothing where there is none.
    #[must_use]
    pub fn load(root: &Path) -> Self {
        let known = std::fs::read(root.join(FILE)).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default();
        Self { known, used: Mutex::default() }
    }

    /// Remembers the files that were asked for.
    ///
    /// # Errors
    /// [`StoreError::Write`].
    pub fn save(&self, store: &Store) -> Result<(), StoreError> {
        let used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        if *used == self.known {
            return Ok(());
        }
        // Paths that are not Unicode cannot be keys: nothing is remembered then.
        serde_json::to_vec(&*used).map_or(Ok(()), |bytes| store.write(FILE, &bytes))
    }

    /// Hashes of named files; of one that cannot be read the reason.
    #[must_use]
    pub fn of_files(&self, files: Vec<(String, PathBuf)>) -> BTreeMap<String, String> {
        let hash = |path: &Path| self.of_file(path).map_or_else(|e| format!("unreadable: {}", e.kind()), |f| f.to_string());
        files.into_par_iter().map(|(name, path)| (name, hash(&path))).collect()
    }

    fn of_file(&self, path: &Path) -> std::io::Result<Fingerprint> {
        let metadata = std::fs::metadata(path)?;
        let seconds = |time: SystemTime| time.duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        let (bytes, modified) = (metadata.len(), metadata.modified().map_or(f64::NAN, seconds));
        let known = self.known.get(path).filter(|e| e.bytes == bytes && e.modified == modified && e.read - e.modified > SETTLED_SECS);
        let entry = match known {
            Some(entry) => entry.clone(),
            None => {
                let read = seconds(SystemTime::now());
                Entry { bytes, modified, read, content: Fingerprint::of_file(path)? }
            }
        };
        let content = entry.content;
        if entry.modified.is_finite() {
            self.used.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_path_buf(), entry);
        }
        Ok(content)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn set_time(path: &Path, seconds_ago: u64) {
        let time = SystemTime::now() - Duration::from_secs(seconds_ago);
        std::fs::File::options().append(true).open(path).unwrap().set_modified(time).unwrap();
    }

    fn one(hashes: &Hashes, path: &Path) -> String {
        hashes.of_files(vec![("f".to_owned(), path.to_path_buf())])["f"].clone()
    }

    #[test]
    fn a_change_is_seen_and_a_settled_file_is_not_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let (file, out) = (folder.path().join("a.jpg"), folder.path().join("out"));
        let store = Store::open(&out).unwrap();
        std::fs::write(&file, "one").unwrap();
        set_time(&file, 100);
        let first = Hashes::load(&out);
        assert_eq!(one(&first, &file), Fingerprint::of_bytes(b"one").to_string());
        first.save(&store).unwrap();
        // The same length and time: taken from memory. This is what the rule costs, and what it is for.
        let modified = std::fs::metadata(&file).unwrap().modified().unwrap();
        std::fs::write(&file, "two").unwrap();
        std::fs::File::options().append(true).open(&file).unwrap().set_modified(modified).unwrap();
        assert_eq!(one(&Hashes::load(&out), &file), Fingerprint::of_bytes(b"one").to_string());
        set_time(&file, 50);
        assert_eq!(one(&Hashes::load(&out), &file), Fingerprint::of_bytes(b"two").to_string());
    }

    #[test]
    fn a_file_that_changed_just_now_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let (file, out) = (folder.path().join("a.jpg"), folder.path().join("out"));
        let store = Store::open(&out).unwrap();
        std::fs::write(&file, "one").unwrap();
        let modified = std::fs::metadata(&file).unwrap().modified().unwrap();
        let first = Hashes::load(&out);
        let _ = one(&first, &file);
        first.save(&store).unwrap();
        std::fs::write(&file, "two").unwrap();
        std::fs::File::options().append(true).open(&file).unwrap().set_modified(modified).unwrap();
        assert_eq!(one(&Hashes::load(&out), &file), Fingerprint::of_bytes(b"two").to_string());
        assert!(one(&first, &folder.path().join("none")).starts_with("unreadable"));
    }
}
