//! `sfm run`.

use super::args::RunArgs;
use super::dispatch::{print, start_threads};
use super::summary::summary;
use super::terminal::Terminal;
use crate::recipe::RECIPE;
use crate::run::{Done, Selection};
use crate::{config, figures};
use anyhow::Result;

/// Warnings of one stage that are shown; all are in report.json and the log.
const SHOWN: usize = 5;

pub(super) fn run(args: &RunArgs) -> Result<()> {
    let config = config::read(&args.dive)?;
    start_threads(args.threads)?;
    let selection = Selection { from: args.from.clone(), until: args.until.clone(), force: args.force.clone() };
    let terminal = Terminal::new();
    let done = crate::run::run(RECIPE, &config, &selection, &terminal);
    terminal.close();
    let done = done?;
    tell_warnings(&done);
    let report = figures::report(&config, &done.stamps);
    if args.json {
        let report = figures::with_timings(report, &done.timings);
        print(&format!("{report:#}\n"))?;
    } else {
        eprint!("{}", summary(&report, &config.output, |stage| done.stamps.contains_key(stage)));
        eprintln!("done: {}", config.output.display());
    }
    Ok(())
}

fn tell_warnings(done: &Done) {
    let total: usize = done.stamps.values().map(|s| s.warnings.len()).sum();
    if total == 0 {
        return;
    }
    eprintln!("{total} {}:", if total == 1 { "warning" } else { "warnings" });
    for stage in RECIPE {
        let Some(stamp) = done.stamps.get(stage.name) else { continue };
        for warning in stamp.warnings.iter().take(SHOWN) {
            eprintln!("  {}: {}: {}", stage.name, warning.about, warning.message);
        }
        if stamp.warnings.len() > SHOWN {
            eprintln!("  {}: and {} more; all are in report.json", stage.name, stamp.warnings.len() - SHOWN);
        }
    }
}
