//! Times, for the log and the timings only: nothing here enters an artefact.

use serde::{Deserialize, Serialize};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

/// How long a stage took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Seconds on the wall.
    pub seconds: f64,
    /// Seconds of all processors; `None` on systems that do not tell.
    pub cpu_seconds: Option<f64>,
}

/// A running stop watch.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    started: Instant,
    cpu_at_start: Option<f64>,
}

impl Watch {
    /// Starts.
    #[must_use]
    pub fn start() -> Self {
        Self { started: Instant::now(), cpu_at_start: process_cpu_seconds() }
    }

    /// The time since the start, to the millisecond.
    #[must_use]
    pub fn read(&self) -> Timing {
        let cpu = self.cpu_at_start.zip(process_cpu_seconds()).map(|(start, now)| milli(now - start));
        Timing { seconds: milli(self.started.elapsed().as_secs_f64()), cpu_seconds: cpu }
    }
}

fn milli(seconds: f64) -> f64 {
    (seconds * 1000.0).round() / 1000.0
}

/// Processor time of this process so far, seconds.
fn process_cpu_seconds() -> Option<f64> {
    cpu_time::ProcessTime::try_now().ok().map(|t| t.as_duration().as_secs_f64())
}

/// Seconds since 1970.
#[must_use]
pub fn unix_seconds() -> f64 {
    milli(SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64()))
}
