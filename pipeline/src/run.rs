//! Follows the recipe: skips what is done, does the rest, and keeps the log.

use crate::clock::{Timing, Watch, unix_seconds};
use crate::config::Config;
use crate::plan::{Planned, State, plan};
use crate::progress::Progress;
use crate::stage::{Stage, Work};
use crate::store::{Hashes, StageFiles, Stamp, Store};
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Write;

/// Which stages are done.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// This stage and all after it are made anew.
    pub from: Option<String>,
    /// No stage after this one is done.
    pub until: Option<String>,
    /// This stage is made anew.
    pub force: Option<String>,
}

/// What a run leaves behind besides its files.
#[derive(Clone, Debug)]
pub struct Done {
    /// Stamps of the stages that are done, by name.
    pub stamps: BTreeMap<&'static str, Stamp>,
    /// How long each stage took when it was last done, by name.
    pub timings: BTreeMap<String, Timing>,
}

/// Follows a recipe.
///
/// # Errors
/// What a stage gives, with the stage's name; what the earlier stages made stays.
pub fn run(recipe: &[&'static Stage], config: &Config, selection: &Selection, progress: &dyn Progress) -> Result<Done> {
    let store = Store::open(&config.output)?;
    let mut log = Log::open(&store);
    log.event("run", json!({"version": env!("CARGO_PKG_VERSION"), "dive": config.file.display().to_string()}));
    let place = |name: &Option<String>| name.as_ref().and_then(|n| recipe.iter().position(|s| s.name == n));
    let until = place(&selection.until).unwrap_or(recipe.len().saturating_sub(1));
    let from = place(&selection.from).unwrap_or(recipe.len());
    let force = place(&selection.force);
    let mut done = Done { stamps: BTreeMap::new(), timings: read_timings(&store) };
    let hashes = Hashes::load(&config.output);
    let planned = plan(recipe, config, &hashes);
    hashes.save(&store)?;
    for (i, (stage, plan)) in recipe.iter().zip(&planned).enumerate().take(until + 1) {
        let anew = i >= from || force == Some(i);
        let stamp = match &plan.stamp {
            Some(stamp) if plan.state == State::Done && !anew => {
                progress.skipped(stage.name);
                log.event("skipped", json!({"stage": stage.name}));
                stamp.clone()
            }
            _ => {
                let (stamp, timing) = do_stage(stage, plan, config, &store, &done.stamps, anew, progress, &mut log)
                    .with_context(|| format!("stage `{}`", stage.name))?;
                done.timings.insert(stage.name.to_owned(), timing);
                store.write("timings.json", &serde_json::to_vec_pretty(&done.timings)?)?;
                stamp
            }
        };
        done.stamps.insert(stage.name, stamp);
    }
    store.write("run.toml", run_toml(config, &planned[..=until]).as_bytes())?;
    store.clear_temporary()?;
    log.event("end", Value::Null);
    Ok(done)
}

#[expect(clippy::too_many_arguments, reason = "the parts of a run, used together only here")]
fn do_stage(
    stage: &Stage,
    plan: &Planned,
    config: &Config,
    store: &Store,
    done: &BTreeMap<&'static str, Stamp>,
    anew: bool,
    progress: &dyn Progress,
    log: &mut Log,
) -> Result<(Stamp, Timing)> {
    progress.stage(stage.name);
    log.event("start", json!({"stage": stage.name, "why": plan.reasons, "anew": anew}));
    let watch = Watch::start();
    let files = StageFiles::begin(store, stage.name, anew)?;
    let outcome = (stage.work)(&Work { config, store, files: &files, done, progress });
    let outcome = match outcome {
        Ok(outcome) => outcome,
        Err(error) => {
            log.event("failed", json!({"stage": stage.name, "error": format!("{error:#}")}));
            return Err(error);
        }
    };
    let stamp = files.finish(plan.identity.clone(), outcome.figures, outcome.warnings)?;
    let timing = watch.read();
    log.event("done", json!({"stage": stage.name, "seconds": timing.seconds, "cpu_seconds": timing.cpu_seconds}));
    for warning in &stamp.warnings {
        log.event("warning", json!({"stage": stage.name, "about": warning.about, "message": warning.message}));
    }
    progress.done(stage.name, timing.seconds, &note(&stamp));
    Ok((stamp, timing))
}

/// What a stage says about itself in one line: the figure `note` of its figures.
fn note(stamp: &Stamp) -> String {
    stamp.figures.get("note").and_then(Value::as_str).unwrap_or_default().to_owned()
}

fn read_timings(store: &Store) -> BTreeMap<String, Timing> {
    std::fs::read(store.path("timings.json")).ok().and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
}

/// The configuration as resolved, versions and fingerprints. Where files lie, and the name of the output folder, are not
/// in it: the same dive gives the same bytes anywhere.
fn run_toml(config: &Config, planned: &[Planned]) -> String {
    let mut text = format!(
        "# What made the files in this folder. Written by sfm.\nversion = {:?}\ndive = {}\n",
        env!("CARGO_PKG_VERSION"),
        toml::Value::from(config.name.as_str())
    );
    for plan in planned {
        let mut table = toml::Table::new();
        table.insert("version".to_owned(), i64::from(plan.identity.version).into());
        table.insert("fingerprint".to_owned(), plan.fingerprint.to_string().into());
        table.insert("inputs".to_owned(), (plan.identity.inputs.len() as i64).into());
        if let Some(options) = toml_value(&plan.identity.options) {
            table.insert("options".to_owned(), options);
        }
        let stages = toml::Table::from_iter(
            [("stage".to_owned(), toml::Table::from_iter([(plan.name.to_owned(), table.into())]).into())] as [(String, toml::Value); 1]
        );
        text.push('\n');
        text.push_str(&stages.to_string());
    }
    text
}

/// TOML has no null: what is not given is left out.
fn toml_value(value: &Value) -> Option<toml::Value> {
    Some(match value {
        Value::Null => return None,
        Value::Bool(b) => (*b).into(),
        Value::Number(n) => n.as_i64().map_or_else(|| n.as_f64().map(toml::Value::from), |i| Some(i.into()))?,
        Value::String(s) => s.as_str().into(),
        Value::Array(values) => values.iter().filter_map(toml_value).collect::<Vec<_>>().into(),
        Value::Object(map) => map.iter().filter_map(|(k, v)| Some((k.clone(), toml_value(v)?))).collect::<toml::Table>().into(),
    })
}

/// `log.jsonl`: times, paths and the host go there and nowhere else. A log that cannot be written stops no run.
struct Log {
    file: Option<std::fs::File>,
}

impl Log {
    fn open(store: &Store) -> Self {
        Self { file: OpenOptions::new().create(true).append(true).open(store.path("log.jsonl")).ok() }
    }

    fn event(&mut self, event: &str, what: Value) {
        let mut line = json!({"time": unix_seconds(), "event": event});
        if let (Some(line), Value::Object(what)) = (line.as_object_mut(), what) {
            line.extend(what);
        }
        if let Some(file) = &mut self.file {
            let _ = file.write_all(format!("{line}\n").as_bytes());
        }
    }
}
