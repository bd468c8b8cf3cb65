//! Progress for people: a bar with rate and time left on a terminal, plain lines elsewhere.

use crate::progress::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::IsTerminal;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How often a plain line tells how far a long stage is.
const LINE_EVERY: Duration = Duration::from_secs(30);

/// How often the times of a bar move on, also when no item is done.
const TICK: Duration = Duration::from_millis(500);

/// Writes to stderr.
pub(super) struct Terminal {
    interactive: bool,
    state: Mutex<State>,
}

struct State {
    bar: ProgressBar,
    stage: String,
    what: String,
    total: usize,
    count: usize,
    last_line: Instant,
}

impl Terminal {
    pub(super) fn new() -> Self {
        let state =
            State { bar: ProgressBar::hidden(), stage: String::new(), what: String::new(), total: 0, count: 0, last_line: Instant::now() };
        Self { interactive: std::io::stderr().is_terminal(), state: Mutex::new(state) }
    }

    /// Clears the bar, so that what follows starts on a line of its own.
    pub(super) fn close(&self) {
        self.state().bar.finish_and_clear();
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Progress for Terminal {
    fn stage(&self, name: &str) {
        let mut state = self.state();
        state.stage = name.to_owned();
        state.last_line = Instant::now();
    }

    fn skipped(&self, _: &str) {}

    fn begin(&self, what: &str, total: usize) {
        let mut state = self.state();
        state.bar.finish_and_clear();
        (state.what, state.total, state.count) = (what.to_owned(), total, 0);
        if self.interactive {
            // Of some work it is not known how much there is.
            let template = if total > 0 {
                "{prefix:<10} {msg} {wide_bar} {pos}/{len} {per_sec} {eta} left"
            } else {
                "{prefix:<10} {msg} {spinner} {elapsed}"
            };
            let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
            let length = (total > 0).then_some(total as u64);
            state.bar = ProgressBar::with_draw_target(length, ProgressDrawTarget::stderr())
                .with_style(style)
                .with_prefix(state.stage.clone())
                .with_message(state.what.clone());
            state.bar.enable_steady_tick(TICK);
        }
    }

    fn advance(&self, items: usize) {
        let mut state = self.state();
        state.count += items;
        state.bar.inc(items as u64);
        if !self.interactive && state.last_line.elapsed() > LINE_EVERY {
            state.last_line = Instant::now();
            eprintln!("{:<10} {} {}/{}", state.stage, state.what, state.count, state.total);
        }
    }

    fn done(&self, name: &str, seconds: f64, note: &str) {
        self.state().bar.finish_and_clear();
        eprintln!("{name:<10} {seconds:>8.1} s  {note}");
    }
}
