//! How far long work is: a bar in a terminal, and a line every few seconds where the output is a file.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A line is written so often where there is no terminal.
const EVERY: Duration = Duration::from_secs(3);

/// `of` of what `what` names, in the plural.
pub fn progress_bar(of: u64, what: &str) -> ProgressBar {
    let template = format!("{{bar:40}} {{pos}}/{{len}} {what}, {{eta}} left");
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(of).with_style(style)
}

/// Long work of a command, counted from any thread.
pub struct LongTask {
    bar: ProgressBar,
    done: AtomicU64,
    of: u64,
    what: String,
    /// When the last line was written; `None` in a terminal, which has the bar.
    last: Option<Mutex<Instant>>,
}

impl LongTask {
    /// `of` of what `what` names, in the plural.
    pub fn new(of: u64, what: &str) -> Self {
        Self {
            bar: progress_bar(of, what),
            done: AtomicU64::new(0),
            of,
            what: what.to_owned(),
            last: (!std::io::stderr().is_terminal()).then(|| Mutex::new(Instant::now())),
        }
    }

    /// So many more are done.
    pub fn advance(&self, by: u64) {
        // SYNC: a count alone, nothing else is published with it.
        let done = self.done.fetch_add(by, Ordering::Relaxed) + by;
        let Some(last) = &self.last else {
            self.bar.inc(by);
            return;
        };
        // Whoever finds it taken leaves the line to the other.
        let Ok(mut last) = last.try_lock() else { return };
        if last.elapsed() >= EVERY {
            *last = Instant::now();
            eprintln!("{} of {} {}", done.min(self.of), self.of, self.what);
        }
    }
}

impl Drop for LongTask {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
