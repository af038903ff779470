//! Progress of a shard: a line that is written over in a terminal, a line every few seconds in a file.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

const IN_TERMINAL: Duration = Duration::from_millis(250);
const IN_FILE: Duration = Duration::from_secs(15);

/// Insertions that are done, from any thread.
pub struct Progress {
    state: Mutex<State>,
    terminal: bool,
    silent: bool,
}

struct State {
    begun: Instant,
    shown: Option<Instant>,
    kept: usize,
    done: usize,
    of: usize,
    failed: usize,
}

impl Progress {
    /// Makes progress on the terminal, or in the file that stands for it.
    pub fn shown() -> Self {
        Self::new(false)
    }

    /// Makes progress that prints nothing, for tests.
    #[cfg(test)]
    pub fn silent() -> Self {
        Self::new(true)
    }

    fn new(silent: bool) -> Self {
        Self {
            state: Mutex::new(State {
                begun: Instant::now(),
                shown: None,
                kept: 0,
                done: 0,
                of: 0,
                failed: 0,
            }),
            terminal: std::io::stderr().is_terminal(),
            silent,
        }
    }

    /// Begins; `kept` of `of` insertions were done before.
    pub fn begin(&self, kept: usize, of: usize) {
        self.change(|state| {
            (state.begun, state.kept, state.done, state.of) = (Instant::now(), kept, kept, of);
        });
    }

    /// Counts one more, and the reason if it failed.
    pub fn advance(&self, failure: Option<&String>) {
        let first = self.change(|state| {
            state.done += 1;
            state.failed += usize::from(failure.is_some());
            failure.is_some() && state.failed == 1
        });
        if let Some(why) = failure.filter(|_| first && !self.silent) {
            eprintln!("\nfirst insertion that failed: {}", stylet_text::printable(why));
        }
    }

    /// Ends; the last line stays.
    pub fn end(&self) {
        if !self.silent {
            self.change(|state| state.shown = None);
            if self.terminal {
                eprintln!();
            }
        }
    }

    fn change<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let mut state = self.state.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let result = change(&mut state);
        let every = if self.terminal { IN_TERMINAL } else { IN_FILE };
        if !self.silent && state.of > 0 && state.shown.is_none_or(|shown| shown.elapsed() >= every) {
            state.shown = Some(Instant::now());
            let line = line(&state, state.begun.elapsed().as_secs_f64());
            if self.terminal {
                // To the end of the line is cleared: the last one may have been longer.
                eprint!("\r{line}\x1b[K");
                let _ = std::io::stderr().flush();
            } else {
                eprintln!("{line}");
            }
        }
        result
    }
}

fn line(state: &State, seconds: f64) -> String {
    let rate = (state.done - state.kept) as f64 / seconds.max(1e-3);
    let mut line = format!("{} of {} insertions", state.done, state.of);
    if state.done > state.kept {
        let left = (state.of - state.done) as f64 / rate;
        line += &format!(", {rate:.2} a second, {} left", duration(left));
    }
    if state.failed > 0 {
        line += &format!(", {} failed", state.failed);
    }
    line
}

/// Writes a duration as `2 h 05 min`, `7 min 30 s` or `12 s`.
fn duration(seconds: f64) -> String {
    let s = seconds.round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{} min {:02} s", s / 60, s % 60),
        _ => format!("{} h {:02} min", s / 3600, s / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_counts_what_this_run_did_for_the_rate() {
        let mut state = State {
            begun: Instant::now(),
            shown: None,
            kept: 100,
            done: 100,
            of: 1000,
            failed: 0,
        };
        assert_eq!(line(&state, 0.0), "100 of 1000 insertions");
        (state.done, state.failed) = (300, 2);
        assert_eq!(
            line(&state, 50.0),
            "300 of 1000 insertions, 4.00 a second, 2 min 55 s left, 2 failed"
        );
        assert_eq!([5.0, 7500.0].map(duration), ["5 s", "2 h 05 min"]);
    }
}
