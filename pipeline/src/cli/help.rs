//! `sfm help`.

use super::args::{Cli, HelpArgs};
use super::dispatch::print;
use super::keys::REPORT_KEYS;
use anyhow::Result;
use clap::CommandFactory;
use thiserror::Error;

/// Nothing is known of a topic.
#[derive(Debug, Error)]
#[error("there is no help on \"{topic}\"\n  hint: topics are json, {commands}")]
pub(super) struct NoTopic {
    topic: String,
    commands: String,
}

pub(super) fn help(args: &HelpArgs) -> Result<()> {
    let mut command = Cli::command();
    command.build();
    match args.topic.as_deref() {
        None => print(&command.render_long_help().to_string()),
        Some("json") => print(&json()),
        Some(topic) => match command.find_subcommand_mut(topic) {
            Some(found) => print(&found.render_long_help().to_string()),
            None => {
                let commands = command.get_subcommands().map(|c| c.get_name().to_owned()).collect::<Vec<_>>().join(", ");
                Err(NoTopic { topic: topic.to_owned(), commands }.into())
            }
        },
    }
}

fn json() -> String {
    let width = REPORT_KEYS.iter().map(|k| k.0.len()).max().unwrap_or(0);
    let mut text = String::from(
        "Keys of report.json, which `sfm run --json` prints too. [] is a list, * a name, null a figure that is not known.\n\
         The same dive gives the same bytes in every file of the output folder but log.jsonl, timings.json and .hashes.json,\n\
         which hold times and paths. So the times of the stages are in --json and timings.json, and not in report.json.\n\n",
    );
    for (key, meaning) in REPORT_KEYS {
        text.push_str(&format!("{key:<width$}  {meaning}\n"));
    }
    text
}
