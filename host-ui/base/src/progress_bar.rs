//! Progress of long work: a bar in a terminal, and a line every few seconds if the output is a
//! file.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use web_time::{Duration, Instant};

/// Time between lines without a terminal.
const EVERY: Duration = Duration::from_secs(3);

/// Creates a bar for `of` items, named by `what` in the plural.
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
    /// Time of the last line; `None` in a terminal, which has the bar.
    last: Option<Mutex<Instant>>,
}

impl LongTask {
    /// Creates a task of `of` items, named by `what` in the plural.
    pub fn new(of: u64, what: &str) -> Self {
        Self {
            bar: progress_bar(of, what),
            done: AtomicU64::new(0),
            of,
            what: what.to_owned(),
            last: (!std::io::stderr().is_terminal()).then(|| Mutex::new(Instant::now())),
        }
    }

    /// Counts more finished items.
    pub fn advance(&self, by: u64) {
        // SYNC: a count alone, nothing else is published with it.
        let done = self.done.fetch_add(by, Ordering::Relaxed) + by;
        match self.line(done) {
            Some(line) => eprintln!("{line}"),
            None if self.last.is_none() => self.bar.inc(by),
            None => {}
        }
    }

    /// Returns the line for a file, when one is due.
    fn line(&self, done: u64) -> Option<String> {
        // If another thread holds the lock, it writes the line.
        let mut last = self.last.as_ref()?.try_lock().ok()?;
        if last.elapsed() < EVERY {
            return None;
        }
        *last = Instant::now();
        Some(format!("{} of {} {}", done.min(self.of), self.of, self.what))
    }
}

impl Drop for LongTask {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Progress of one piece of work without countable parts: a bar in a terminal, else a line every
/// few seconds.
pub struct ShareBar {
    bar: ProgressBar,
    last: Option<Instant>,
}

impl ShareBar {
    /// Creates a bar that shows nothing until the first call of [`ShareBar::show`].
    pub fn new() -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}");
        Self {
            bar: ProgressBar::new(100).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())),
            last: (!std::io::stderr().is_terminal()).then(Instant::now),
        }
    }

    /// Shows `share` of `what`, 0 to 1.
    pub fn show(&mut self, what: &str, share: f32) {
        match (self.line(what, share), self.last) {
            (Some(line), _) => eprintln!("{line}"),
            (None, None) => {
                self.bar.set_message(what.to_owned());
                self.bar.set_position((share * 100.0) as u64);
            }
            (None, Some(_)) => {}
        }
    }

    /// Returns the line for a file, when one is due.
    fn line(&mut self, what: &str, share: f32) -> Option<String> {
        let last = self.last.as_mut().filter(|last| last.elapsed() >= EVERY)?;
        *last = Instant::now();
        Some(format!("{what}: {:.0} %", share * 100.0))
    }
}

impl Default for ShareBar {
    fn default() -> Self {
        Self::new()
    }
}

impl Drop for ShareBar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_terminal_a_share_is_reported_periodically() {
        let mut bar = ShareBar::new();
        bar.last = Instant::now().checked_sub(2 * EVERY);
        assert_eq!(
            bar.line("reading a.nrrd", 0.403).as_deref(),
            Some("reading a.nrrd: 40 %")
        );
        assert_eq!(bar.line("reading a.nrrd", 0.41), None, "the next one is not due");
    }

    /// Guards against silence: the dose of 5,000 seeds took 35 s without output to a file.
    #[test]
    fn long_work_reports_every_few_seconds_where_there_is_no_terminal() {
        let begun = Instant::now().checked_sub(2 * EVERY);
        let mut task = LongTask::new(5000, "seeds");
        task.last = begun.map(Mutex::new);
        assert_eq!(task.line(1200).as_deref(), Some("1200 of 5000 seeds"));
        // The next one is not due.
        assert_eq!(task.line(1201), None);
    }
}
