//! What a stage is: its name, what it builds on, what decides its result, and the function that does it.

use crate::config::Config;
use crate::progress::Progress;
use crate::store::{Fingerprint, Hashes, StageFiles, Stamp, Store, StoreError, Warning};
use anyhow::Result;
use serde_json::Value;
use std::collections::BTreeMap;

/// One station of the recipe.
pub struct Stage {
    /// Name, for `--from`, `--until`, `--force` and the stamp.
    pub name: &'static str,
    /// Version of its code: goes up whenever its results change.
    pub version: u32,
    /// Names of the stages that it reads from.
    pub upstream: &'static [&'static str],
    /// The part of the configuration that its results depend on, without any path.
    pub options: fn(&Config) -> Value,
    /// Content of the files outside the store that it reads, by a name without path.
    pub inputs: fn(&Config, &Hashes) -> BTreeMap<String, String>,
    /// Loads, calls the algorithm, saves.
    pub work: fn(&Work<'_>) -> Result<Outcome>,
}

/// For stages that read nothing from outside the store.
#[must_use]
pub fn no_inputs(_: &Config, _: &Hashes) -> BTreeMap<String, String> {
    BTreeMap::new()
}

/// What a stage has to say when it is done; its files are in the store.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Figures for the report.
    pub figures: Value,
    /// What a user should know.
    pub warnings: Vec<Warning>,
}

/// What a stage works with.
pub struct Work<'w> {
    /// The configuration.
    pub config: &'w Config,
    /// The output folder.
    pub store: &'w Store,
    /// Takes the files of this stage.
    pub files: &'w StageFiles<'w>,
    /// Stamps of the stages before, by name.
    pub done: &'w BTreeMap<&'static str, Stamp>,
    /// Told how far the work is.
    pub progress: &'w dyn Progress,
}

impl Work<'_> {
    /// A file of an earlier stage, checked against what that stage wrote.
    ///
    /// # Errors
    /// [`StoreError`] when it was not made, cannot be read or was changed since.
    pub fn read(&self, stage: &'static str, path: &str) -> Result<Vec<u8>, StoreError> {
        let output = self.output(stage, path)?;
        let file = self.store.path(path);
        let bytes = std::fs::read(&file).map_err(|cause| StoreError::Read { path: file.clone(), cause })?;
        if Fingerprint::of_bytes(&bytes) == output.content {
            Ok(bytes)
        } else {
            Err(StoreError::Damaged { path: file, stage: stage.to_owned() })
        }
    }

    /// Fingerprint of the content of an earlier stage's file.
    ///
    /// # Errors
    /// [`StoreError::NoOutput`].
    pub fn content(&self, stage: &'static str, path: &str) -> Result<Fingerprint, StoreError> {
        Ok(self.output(stage, path)?.content)
    }

    /// Whether an earlier stage made a file.
    #[must_use]
    pub fn has(&self, stage: &'static str, path: &str) -> bool {
        self.output(stage, path).is_ok()
    }

    fn output(&self, stage: &'static str, path: &str) -> Result<&crate::store::Output, StoreError> {
        let outputs = self.done.get(stage).map(|stamp| &stamp.outputs);
        outputs.and_then(|o| o.get(path)).ok_or_else(|| StoreError::NoOutput { path: path.to_owned(), stage: stage.to_owned() })
    }
}
