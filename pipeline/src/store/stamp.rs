//! What a stage was made from, and what it made.

use super::Fingerprint;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Everything that decides what a stage makes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Version of the stage's code: goes up whenever its results change.
    pub version: u32,
    /// Its options.
    pub options: Value,
    /// Content of the files that it reads from outside the store, by name.
    pub inputs: BTreeMap<String, String>,
    /// Fingerprints of the stages that it builds on, by name.
    pub upstream: BTreeMap<String, Fingerprint>,
}

impl Identity {
    /// The fingerprint: BLAKE3 of version, options, inputs and upstream fingerprints.
    #[must_use]
    pub fn fingerprint(&self, stage: &str) -> Fingerprint {
        let (options, version) = (self.options.to_string(), self.version.to_le_bytes());
        let head = [("stage", stage.as_bytes()), ("version", version.as_slice()), ("options", options.as_bytes())];
        let inputs = self.inputs.iter().flat_map(|(name, hash)| [("input", name.as_bytes()), ("hash", hash.as_bytes())]);
        let upstream = self.upstream.iter().flat_map(|(name, f)| [("upstream", name.as_bytes()), ("fingerprint", f.as_bytes().as_slice())]);
        Fingerprint::of_parts(head.into_iter().chain(inputs).chain(upstream))
    }

    /// What differs from an earlier identity, in words.
    #[must_use]
    pub fn changes_since(&self, before: &Self) -> Vec<String> {
        let mut changes = Vec::new();
        if self.version != before.version {
            changes.push("this version of sfm computes it differently".to_owned());
        }
        option_changes("", &before.options, &self.options, &mut changes);
        changes.extend(input_changes(&before.inputs, &self.inputs));
        for (name, fingerprint) in &self.upstream {
            if before.upstream.get(name) != Some(fingerprint) {
                changes.push(format!("`{name}` changes before it"));
            }
        }
        changes
    }
}

fn option_changes(name: &str, before: &Value, now: &Value, changes: &mut Vec<String>) {
    match (before, now) {
        _ if before == now => {}
        (Value::Object(a), Value::Object(b)) => {
            let names: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for key in names {
                let below = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                option_changes(&below, a.get(key).unwrap_or(&Value::Null), b.get(key).unwrap_or(&Value::Null), changes);
            }
        }
        (Value::Array(_), _) | (_, Value::Array(_)) => changes.push(format!("{name} is not what it was")),
        _ => changes.push(format!("{name} was {before}, is {now}")),
    }
}

fn input_changes(before: &BTreeMap<String, String>, now: &BTreeMap<String, String>) -> Vec<String> {
    let changed: Vec<&String> = now.iter().filter(|(k, v)| before.get(*k).is_some_and(|b| b != *v)).map(|(k, _)| k).collect();
    let new: Vec<&String> = now.keys().filter(|k| !before.contains_key(*k)).collect();
    let gone: Vec<&String> = before.keys().filter(|k| !now.contains_key(*k)).collect();
    [(changed, "changed"), (new, "new"), (gone, "gone")]
        .into_iter()
        .filter_map(|(names, what)| match names.as_slice() {
            [] => None,
            [one] => Some(format!("{one} is {what}")),
            [first, .., last] => Some(format!("{} inputs are {what}, {first} to {last}", names.len())),
        })
        .collect()
}

/// A file that a stage made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// Fingerprint of what it was made from.
    pub key: Fingerprint,
    /// Fingerprint of its content.
    pub content: Fingerprint,
    /// Its length.
    pub bytes: u64,
}

/// Something that a user should know, but that did not stop the run.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Warning {
    /// What it is about: an image, a camera, a file.
    pub about: String,
    /// What is the matter, and what was done about it.
    pub message: String,
}

/// Says that a stage is done, from what, and what it made. Paths are relative to the output folder, with `/`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stamp {
    /// Fingerprint of the identity.
    pub fingerprint: Fingerprint,
    /// What it was made from.
    pub identity: Identity,
    /// Its files.
    pub outputs: BTreeMap<String, Output>,
    /// Its figures.
    pub figures: Value,
    /// Its warnings.
    pub warnings: Vec<Warning>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn identity() -> Identity {
        Identity {
            version: 1,
            options: json!({"max": 5, "deep": {"a": true}}),
            inputs: [("C1/a.jpg".to_owned(), "11".to_owned()), ("C1/b.jpg".to_owned(), "22".to_owned())].into(),
            upstream: [("ingest".to_owned(), Fingerprint::of_bytes(b"x"))].into(),
        }
    }

    #[test]
    fn every_part_counts() {
        let mut others = vec![identity(); 5];
        others[0].version = 2;
        others[1].options["max"] = json!(6);
        others[2].inputs.insert("C1/a.jpg".to_owned(), "12".to_owned());
        others[3].inputs.remove("C1/b.jpg");
        others[4].upstream.insert("ingest".to_owned(), Fingerprint::of_bytes(b"y"));
        for other in &others {
            assert_ne!(other.fingerprint("mask"), identity().fingerprint("mask"));
        }
        assert_eq!(identity().fingerprint("mask"), identity().fingerprint("mask"));
        assert_ne!(identity().fingerprint("mask"), identity().fingerprint("features"));
        let told: Vec<String> = others.iter().flat_map(|o| o.changes_since(&identity())).collect();
        assert_eq!(
            told,
            [
                "this version of sfm computes it differently",
                "max was 5, is 6",
                "C1/a.jpg is changed",
                "C1/b.jpg is gone",
                "`ingest` changes before it"
            ]
        );
    }

    /// A report that is made from a stamp read back must be the one made from the stamp in memory. Without the feature
    /// `float_roundtrip` of serde_json some of these numbers come back one bit off.
    #[test]
    fn figures_survive_writing_and_reading_to_the_bit() {
        let mut state = 1u64;
        let values: Vec<f64> = std::iter::repeat_with(|| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / 9.007e15
        })
        .take(2000)
        .collect();
        let stamp = Stamp {
            fingerprint: identity().fingerprint("mask"),
            identity: identity(),
            outputs: BTreeMap::new(),
            figures: json!({ "values": values }),
            warnings: Vec::new(),
        };
        let read: Stamp = serde_json::from_slice(&serde_json::to_vec_pretty(&stamp).unwrap()).unwrap();
        assert_eq!(read, stamp);
    }
}
