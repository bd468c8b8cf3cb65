//! Which stages are done, stale or missing, and why.

use crate::config::Config;
use crate::stage::Stage;
use crate::store::{Fingerprint, Hashes, Identity, Stamp, is_unfinished, read_stamp};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::Path;

/// Where a stage stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// Made from what is there now.
    Done,
    /// Made from something else.
    Stale,
    /// Not made, or a file of it is gone.
    Missing,
}

/// A stage, where it stands and why.
#[derive(Clone, Debug)]
pub struct Planned {
    /// Name of the stage.
    pub name: &'static str,
    /// What its result is to be made from.
    pub identity: Identity,
    /// Fingerprint of that.
    pub fingerprint: Fingerprint,
    /// Where it stands.
    pub state: State,
    /// Why it is not done; empty when it is.
    pub reasons: Vec<String>,
    /// What is there.
    pub stamp: Option<Stamp>,
}

/// Looks at every stage of a recipe. Reads what is not remembered of the inputs to hash it, and changes nothing.
#[must_use]
pub fn plan(recipe: &[&Stage], config: &Config, hashes: &Hashes) -> Vec<Planned> {
    let mut fingerprints: BTreeMap<&str, Fingerprint> = BTreeMap::new();
    let mut stages = Vec::with_capacity(recipe.len());
    for stage in recipe {
        let upstream = stage.upstream.iter().filter_map(|name| Some(((*name).to_owned(), *fingerprints.get(name)?))).collect();
        let identity =
            Identity { version: stage.version, options: (stage.options)(config), inputs: (stage.inputs)(config, hashes), upstream };
        let fingerprint = identity.fingerprint(stage.name);
        fingerprints.insert(stage.name, fingerprint);
        let stamp = read_stamp(&config.output, stage.name);
        let (state, reasons) = judge(&config.output, stage.name, &identity, fingerprint, stamp.as_ref());
        stages.push(Planned { name: stage.name, identity, fingerprint, state, reasons, stamp });
    }
    stages
}

fn judge(root: &Path, stage: &str, identity: &Identity, fingerprint: Fingerprint, stamp: Option<&Stamp>) -> (State, Vec<String>) {
    let Some(stamp) = stamp else {
        let reason = if is_unfinished(root, stage) { "a run was stopped inside it; the next goes on there" } else { "not run yet" };
        return (State::Missing, vec![reason.to_owned()]);
    };
    if stamp.fingerprint != fingerprint {
        let mut reasons = identity.changes_since(&stamp.identity);
        if reasons.is_empty() {
            reasons.push("its stamp does not match".to_owned());
        }
        return (State::Stale, reasons);
    }
    if is_unfinished(root, stage) {
        return (State::Stale, vec!["a run was stopped inside it; the next goes on there".to_owned()]);
    }
    let is_there = |path: &str, bytes: u64| std::fs::metadata(root.join(path)).is_ok_and(|m| m.is_file() && m.len() == bytes);
    let gone: Vec<&String> = stamp.outputs.iter().filter(|(path, output)| !is_there(path, output.bytes)).map(|(path, _)| path).collect();
    match gone.as_slice() {
        [] => (State::Done, Vec::new()),
        [one] => (State::Missing, vec![format!("{one} is gone or cut short")]),
        [first, ..] => (State::Missing, vec![format!("{} files are gone or cut short, {first} first", gone.len())]),
    }
}
