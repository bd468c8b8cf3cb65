//! Adjusts a problem in the format of *Bundle Adjustment in the Large*: `bal FILE [REPEATS]`, FILE unpacked.

use solve::adjust::{AdjustOptions, adjust};
use solve::bal::parse_bal;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("usage: bal FILE [REPEATS]")?;
    let repeats: usize = arguments.next().map_or(Ok(1), |n| n.parse())?;
    let problem = parse_bal(&std::fs::read_to_string(file)?)?;
    for _ in 0..repeats {
        let mut copy = problem.clone();
        let start = Instant::now();
        let summary = adjust(&mut copy, &AdjustOptions::default())?;
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "cost {:.6} to {:.6}, {} iterations, {:?}, {} left out, {seconds:.3} s",
            summary.initial_cost, summary.final_cost, summary.iterations, summary.termination, summary.observations_left_out
        );
    }
    Ok(())
}
