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
        match self.line(done) {
            Some(line) => eprintln!("{line}"),
            None if self.last.is_none() => self.bar.inc(by),
            None => {}
        }
    }

    /// The line for a file, where it is time for one.
    fn line(&self, done: u64) -> Option<String> {
        // Whoever finds it taken leaves the line to the other.
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

/// How far one piece of work is whose parts have no number: a bar in a terminal, else a line every few seconds.
pub struct ShareBar {
    bar: ProgressBar,
    last: Option<Instant>,
}

impl ShareBar {
    /// Shows nothing until the first call of [`ShareBar::show`].
    pub fn new() -> Self {
        let style = ProgressStyle::with_template("{bar:40} {percent:>3} %  {msg}");
        Self {
            bar: ProgressBar::new(100).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())),
            last: (!std::io::stderr().is_terminal()).then(Instant::now),
        }
    }

    /// `share` of `what` is done, 0 to 1.
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

    /// The line for a file, where it is time for one.
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
    fn a_share_is_reported_every_few_seconds_where_there_is_no_terminal() {
        let mut bar = ShareBar::new();
        bar.last = Instant::now().checked_sub(2 * EVERY);
        assert_eq!(
            bar.line("reading a.nrrd", 0.403).as_deref(),
            Some("reading a.nrrd: 40 %")
        );
        assert_eq!(bar.line("reading a.nrrd", 0.41), None, "the next one is not due");
    }

    /// The dose of 5,000 seeds took 35 s without a word where the output was a file.
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
