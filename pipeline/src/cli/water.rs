//! `sfm water`.

use super::args::WaterArgs;
use super::dispatch::print;
use crate::error::Misfit;
use anyhow::{Context, Result};
use calibrate::water::{IndexFormula, Water};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

pub(super) fn water(args: &WaterArgs) -> Result<()> {
    if let Some(log) = &args.log {
        return print(&table(args, log)?);
    }
    let here = Water { depth_m: args.depth.unwrap_or_default(), ..without_depth(args) };
    let there = calibrated(args, &here);
    let wrong: Vec<String> = [("", here), ("where it was calibrated, ", there)]
        .iter()
        .flat_map(|(at, w)| w.out_of_range().into_iter().map(move |m| format!("{at}{m}")))
        .collect();
    if !wrong.is_empty() {
        return Err(Misfit(format!("{}: no formula was fitted there", wrong.join("; "))).into());
    }
    let of = |formula: IndexFormula| {
        let (index, calibrated) = (here.refractive_index(formula), there.refractive_index(formula));
        let change = args.principal_distance.map(|c| c * (index / calibrated - 1.0));
        (formula, index, calibrated, change)
    };
    let both = [of(IndexFormula::QuanFry), of(IndexFormula::Hoehle)];
    if args.json {
        let water = |w: &Water| {
            let (salinity, temperature) = (w.salinity_ppt, w.temperature_degc);
            json!({
                "depth_m": w.depth_m, "salinity_ppt": salinity, "temperature_degc": temperature, "wavelength_nm": w.wavelength_nm,
            })
        };
        let formulas = both.iter().map(|(formula, index, calibrated, change)| {
            json!({
                "formula": formula.name(), "index": index, "calibrated_index": calibrated, "ratio": index / calibrated,
                "principal_distance_change": change,
            })
        });
        let all = json!({
            "water": water(&here), "calibrated_water": water(&there), "principal_distance": args.principal_distance,
            "formulas": formulas.collect::<Vec<_>>(),
        });
        return print(&format!("{all:#}\n"));
    }
    let mut text = String::new();
    for (formula, index, calibrated, change) in both {
        let name = match formula {
            IndexFormula::QuanFry => "Quan & Fry 1995",
            IndexFormula::Hoehle => "Hoehle 1971",
        };
        let _ = write!(text, "{name:<16} n {index:.6}, {:+.2e} from {calibrated:.6} where it was calibrated", index - calibrated);
        if let (Some(c), Some(change)) = (args.principal_distance, change) {
            let _ = write!(text, "; principal distance {:.6}, {change:+.6}", c + change);
        }
        text.push('\n');
    }
    print(&text)
}

fn without_depth(args: &WaterArgs) -> Water {
    Water { depth_m: 0.0, salinity_ppt: args.salinity, temperature_degc: args.temperature, wavelength_nm: args.wavelength }
}

/// The water of the calibration.
fn calibrated(args: &WaterArgs, here: &Water) -> Water {
    Water {
        depth_m: args.calibrated_depth,
        salinity_ppt: args.calibrated_salinity.unwrap_or(args.salinity),
        temperature_degc: args.calibrated_temperature.unwrap_or(args.temperature),
        ..*here
    }
}

/// Index and principal distance of each line of a log, as CSV. Lines without a depth are left out, fields that are no numbers refused.
fn table(args: &WaterArgs, log: &Path) -> Result<String> {
    let name = || log.display().to_string();
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).flexible(true).from_path(log).with_context(name)?;
    let head = reader.headers().with_context(name)?.clone();
    let column = |wanted: &str| head.iter().position(|h| h == wanted);
    let Some(depth) = column("depth_m") else {
        let columns = head.iter().collect::<Vec<_>>().join(", ");
        return Err(Misfit(format!("{}: there is no column depth_m; the columns are {columns}", log.display())).into());
    };
    let (time, salinity, temperature) = (column("time_s"), column("salinity_ppt"), column("temperature_degc"));
    let there = calibrated(args, &without_depth(args));
    let there = [IndexFormula::QuanFry, IndexFormula::Hoehle].map(|f| there.refractive_index(f));
    let mut text = String::from("time_s,depth_m,salinity_ppt,temperature_degc,index_quan_fry,index_hoehle");
    text.push_str(if args.principal_distance.is_some() { ",principal_distance_quan_fry,principal_distance_hoehle\n" } else { "\n" });
    for record in reader.records() {
        let record = record.with_context(name)?;
        let line = record.position().map_or(0, csv::Position::line);
        let field = |c: Option<usize>| c.and_then(|c| record.get(c)).filter(|f| !f.is_empty());
        let number = |c: Option<usize>| -> Result<Option<f64>, Misfit> {
            let wrong = |f: &str| Misfit(format!("{}: line {line}: \"{f}\" is no number", log.display()));
            field(c).map(|f| f.parse().map_err(|_| wrong(f))).transpose()
        };
        let Some(depth_m) = number(Some(depth))? else { continue };
        let default = without_depth(args);
        let here = Water {
            depth_m,
            salinity_ppt: number(salinity)?.unwrap_or(default.salinity_ppt),
            temperature_degc: number(temperature)?.unwrap_or(default.temperature_degc),
            ..default
        };
        if let Some(wrong) = here.out_of_range().first() {
            return Err(Misfit(format!("{}: line {line}: {wrong}: no formula was fitted there", log.display())).into());
        }
        let index = [IndexFormula::QuanFry, IndexFormula::Hoehle].map(|f| here.refractive_index(f));
        let (s, t) = (here.salinity_ppt, here.temperature_degc);
        let _ = write!(text, "{},{depth_m},{s},{t},{:.8},{:.8}", field(time).unwrap_or_default(), index[0], index[1]);
        if let Some(c) = args.principal_distance {
            let _ = write!(text, ",{:.7},{:.7}", c * index[0] / there[0], c * index[1] / there[1]);
        }
        text.push('\n');
    }
    Ok(text)
}
