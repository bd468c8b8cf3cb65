//! `sfm water`.

use super::args::WaterArgs;
use super::dispatch::print;
use crate::error::Misfit;
use anyhow::Result;
use calibrate::water::{IndexFormula, Water};
use serde_json::json;
use std::fmt::Write;

pub(super) fn water(args: &WaterArgs) -> Result<()> {
    let here =
        Water { depth_m: args.depth, salinity_ppt: args.salinity, temperature_degc: args.temperature, wavelength_nm: args.wavelength };
    let there = Water {
        depth_m: args.calibrated_depth,
        salinity_ppt: args.calibrated_salinity.unwrap_or(args.salinity),
        temperature_degc: args.calibrated_temperature.unwrap_or(args.temperature),
        ..here
    };
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
        let water = |w: &Water| json!({"depth_m": w.depth_m, "salinity_ppt": w.salinity_ppt, "temperature_degc": w.temperature_degc, "wavelength_nm": w.wavelength_nm});
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
