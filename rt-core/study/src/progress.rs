//! Progress of a shard: a line every few seconds.

use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Insertions that are done, from any thread.
pub struct Progress {
    /// Time between two lines.
    every: Duration,
    state: Mutex<State>,
}

struct State {
    begun: Instant,
    shown: Instant,
    kept: usize,
    done: usize,
    of: usize,
    failed: usize,
}

impl Progress {
    /// Makes progress with a line each time that `every` has passed.
    pub fn new(every: Duration) -> Self {
        let now = Instant::now();
        let state = State {
            begun: now,
            shown: now,
            kept: 0,
            done: 0,
            of: 0,
            failed: 0,
        };
        Self {
            every,
            state: Mutex::new(state),
        }
    }

    /// Begins; `kept` of `of` insertions were done before.
    pub fn begin(&self, kept: usize, of: usize) {
        let mut state = self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        (state.begun, state.kept, state.done, state.of) = (Instant::now(), kept, kept, of);
    }

    /// Counts one more, and the reason if it failed.
    pub fn advance(&self, failure: Option<&String>) {
        let mut state = self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        state.done += 1;
        if let Some(why) = failure {
            state.failed += 1;
            if state.failed == 1 {
                eprintln!("first insertion that failed: {}", stylet_text::printable(why));
            }
        }
        if state.shown.elapsed() >= self.every {
            state.shown = Instant::now();
            eprintln!("{}", line(&state, state.begun.elapsed().as_secs_f64()));
        }
    }
}

fn line(state: &State, seconds: f64) -> String {
    let rate = (state.done - state.kept) as f64 / seconds.max(1e-3);
    let mut line = format!("{} of {} insertions", state.done, state.of);
    if state.done > state.kept {
        let left_min = (state.of - state.done) as f64 / rate / 60.0;
        line += &format!(", {rate:.2} a second, {left_min:.1} min left");
    }
    if state.failed > 0 {
        line += &format!(", {} failed", state.failed);
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_counts_what_this_run_did_for_the_rate() {
        let progress = Progress::new(Duration::MAX);
        progress.begin(100, 1000);
        let mut state = progress.state.lock().unwrap();
        assert_eq!(line(&state, 0.0), "100 of 1000 insertions");
        (state.done, state.failed) = (300, 2);
        assert_eq!(
            line(&state, 50.0),
            "300 of 1000 insertions, 4.00 a second, 2.9 min left, 2 failed"
        );
    }
}
