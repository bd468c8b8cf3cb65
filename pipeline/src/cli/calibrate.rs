//! `sfm calibrate`.

use super::args::CalibrateArgs;
use super::dispatch::{print, start_threads};
use super::terminal::Terminal;
use crate::calibrating::{Check, Made, Record, check, make};
use crate::config::read_calib;
use crate::store::Warning;
use anyhow::Result;
use std::fmt::Write;

pub(super) fn calibrate(args: &CalibrateArgs) -> Result<()> {
    start_threads(args.threads)?;
    let terminal = Terminal::new();
    if let Some(rig) = &args.check {
        let found = check(rig, &args.input, &terminal);
        terminal.close();
        let found = found?;
        tell(&found.warnings);
        return if args.json { print(&format!("{}\n", serde_json::to_string_pretty(&found)?)) } else { print(&check_table(&found)) };
    }
    let config = read_calib(&args.input)?;
    let made = make(&config, &terminal);
    terminal.close();
    let Made { record, files } = made?;
    tell(&record.warnings);
    if args.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&record)?))?
    } else {
        print(&table(&record))?
    }
    eprintln!("done: {}: {}", config.output.display(), files.join(", "));
    Ok(())
}

fn tell(warnings: &[Warning]) {
    for warning in warnings {
        eprintln!("warning: {}: {}", warning.about, warning.message);
    }
}

fn table(record: &Record) -> String {
    let mut text = String::new();
    let images = &record.images;
    let _ = writeln!(text, "images     {} of {} show the target, {} exposures", images.with_target, images.total, record.exposures);
    let _ = writeln!(text, "corners    {}, {} left out, RMS {:.3} px", record.observations, record.outliers, record.rms_px);
    for camera in &record.cameras {
        let _ = writeln!(text, "{}  {}, RMS {:.3} px", camera.name, camera.model, camera.rms_px);
        for p in &camera.parameters {
            let note = match (p.held, p.significant) {
                (true, _) => "  held",
                (_, Some(false)) => "  not significant",
                _ => "",
            };
            let _ = writeln!(text, "  {:<4}{:>14.6} +- {:.6}{note}", p.name, p.value, p.sigma);
        }
    }
    for b in &record.baselines {
        let _ = writeln!(text, "baseline   {} - {}: {:.6} +- {:.6} m", b.between[0], b.between[1], b.length_m, b.sigma_m);
    }
    for r in &record.rectifications {
        let _ = writeln!(
            text,
            "rectified  {} - {}: rows differ by {:.3} px RMS, {:.3} at most",
            r.between[0], r.between[1], r.rms_px, r.max_px
        );
    }
    text
}

fn check_table(check: &Check) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{:<10} {}", "verdict", check.verdict.in_words());
    let _ = writeln!(text, "images     {} of {} show the target", check.with_target, check.images);
    let _ = writeln!(text, "held       corners fit to {:.3} px, {:.2} times as in the calibration", check.held.sigma0_px, check.held.ratio);
    for c in &check.cameras {
        let probability = |t: Option<f64>| t.map_or_else(String::new, |p| format!(", by chance with probability {p:.2e}"));
        let _ = writeln!(
            text,
            "{}  image points move by {:.3} px RMS, {:.3} at most{}",
            c.name,
            c.shift_rms_px,
            c.shift_max_px,
            probability(c.interior.map(|t| t.probability))
        );
        for p in &c.parameters {
            if let Some(n) = p.normalised {
                let _ = writeln!(text, "  {:<4}{:>14.6} now {:>14.6}, {n:+.1} standard deviations", p.name, p.before, p.after);
            }
        }
        if let Some(t) = c.pose {
            let chance = probability(Some(t.probability));
            let _ = writeln!(text, "  in the rig turned by {:.4} degrees, moved by {:.2} mm{chance}", c.turned_deg, 1e3 * c.moved_m);
        }
    }
    for b in &check.baselines {
        let [from, to] = &b.between;
        let _ =
            writeln!(text, "baseline   {from} - {to}: {:.6} m, now {:.6}, {:+.1} standard deviations", b.before_m, b.after_m, b.normalised);
    }
    text
}
