//! `sfm status`.

use super::args::StatusArgs;
use super::dispatch::print;
use crate::config;
use crate::plan::{State, plan};
use crate::recipe::RECIPE;
use crate::store::Hashes;
use anyhow::Result;
use serde_json::{Value, json};
use std::fmt::Write;

pub(super) fn status(args: &StatusArgs) -> Result<()> {
    let config = config::read(&args.dive)?;
    let planned = plan(RECIPE, &config, &Hashes::load(&config.output));
    if args.json {
        let stages: Vec<Value> = planned
            .iter()
            .map(|p| json!({"stage": p.name, "state": p.state, "reasons": p.reasons, "fingerprint": p.fingerprint}))
            .collect();
        return print(&format!("{:#}\n", json!({ "stages": stages })));
    }
    let mut text = String::new();
    for plan in &planned {
        let state = match plan.state {
            State::Done => "done",
            State::Stale => "stale",
            State::Missing => "missing",
        };
        let line = format!("{:<10} {state:<8} {}", plan.name, plan.reasons.join("; "));
        let _ = writeln!(text, "{}", line.trim_end());
    }
    print(&text)
}
