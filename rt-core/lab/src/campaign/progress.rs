//! Progress of a campaign on the terminal: a line every few seconds, with the remaining time.

use super::CampaignError;
use super::plan::Plan;
use super::session::Store;
use std::io::{IsTerminal, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// One session within its campaign.
pub struct Progress {
    part: String,
    left_ns: u64,
    /// Time measured before this session began, and total planned time.
    before_s: f64,
    planned_s: f64,
}

impl Progress {
    pub fn new(plan: &Plan, store: &Store, number: usize, left_ns: u64) -> Result<Self, CampaignError> {
        let part = &plan.parts[number];
        let mut before_s = 0.0;
        for (i, p) in plan.parts.iter().enumerate() {
            before_s += (p.duration_ns - store.left_ns(i, p)?) as f64 / 1e9;
        }
        Ok(Self {
            part: format!(
                "part {} of {} ({}, {} Hz)",
                number + 1,
                plan.parts.len(),
                format!("{:?}", part.load).to_lowercase(),
                part.rate
            ),
            left_ns,
            before_s,
            planned_s: plan.parts.iter().map(|p| p.duration_ns as f64 / 1e9).sum(),
        })
    }

    /// Returns the line after `passed_s` of the session.
    pub fn line(&self, passed_s: f64) -> String {
        let passed_s = passed_s.min(self.left_ns as f64 / 1e9);
        let done_s = self.before_s + passed_s;
        format!(
            "{}: {} left; campaign {:.0} %, {} left",
            self.part,
            time(self.left_ns as f64 / 1e9 - passed_s),
            (100.0 * done_s / self.planned_s).floor(),
            time(self.planned_s - done_s)
        )
    }

    /// Shows it until `ended`: on a terminal one line that changes each second, else a line every ten minutes.
    pub fn show(&self, ended: &AtomicBool) {
        let begin = Instant::now();
        let terminal = std::io::stderr().is_terminal();
        let every = Duration::from_secs(if terminal { 1 } else { 600 });
        let mut next = begin;
        // SYNC: nothing but the flag is carried.
        while !ended.load(Ordering::Acquire) {
            if Instant::now() >= next {
                let line = self.line(begin.elapsed().as_secs_f64());
                if terminal {
                    eprint!("\r\x1b[Krt-core: {line}");
                    let _ = std::io::stderr().flush();
                } else {
                    eprintln!("rt-core: {line}");
                }
                next += every;
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        if terminal {
            eprintln!();
        }
    }
}

/// Formats hours, minutes and seconds: `7 h 05 min`, `4 min 10 s`, `12 s`.
pub fn time(seconds: f64) -> String {
    let s = seconds.max(0.0).round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3_600 => format!("{} min {:02} s", s / 60, s % 60),
        _ => format!("{} h {:02} min", s / 3_600, s / 60 % 60),
    }
}
