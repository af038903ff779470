//! The bridge as a process: where its program is, and whether it lives.

use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::Child;
use std::time::{Duration, Instant};
use stylet_shm_schema::Epoch;

/// The bridge says that it lives twenty times a second.
pub const SILENT_AFTER: Duration = Duration::from_millis(400);
/// Between the end of its socket and its own.
const LAST_MOMENT: Duration = Duration::from_millis(50);
/// While it makes its ports it says nothing.
const SILENT_AT_START: Duration = Duration::from_secs(2);
/// One that a busy machine gives no processor is waited for: another would have none either.
const SILENT_WITHOUT_PROCESSOR: Duration = Duration::from_secs(5);
/// Processor time that a bridge may use without a word: one that uses more goes round in circles.
const MOST_BUSY: Duration = Duration::from_millis(200);

/// The process that runs now.
pub struct Running {
    pub child: Child,
    pub epoch: Epoch,
    pub is_ready: bool,
    heard: Instant,
    /// Processor time that it had used then.
    busy: Duration,
    /// Requests that it has refused.
    pub refused: u64,
}

impl Running {
    /// Started a moment ago.
    pub fn new(child: Child, epoch: Epoch) -> Self {
        Self {
            child,
            epoch,
            is_ready: false,
            heard: Instant::now(),
            busy: Duration::ZERO,
            refused: 0,
        }
    }

    /// Takes its word that it lives.
    pub fn hear(&mut self, refused: u64) {
        (self.heard, self.refused) = (Instant::now(), refused.max(self.refused));
        self.busy = processor_time(self.child.id()).map_or(self.busy, |(_, busy)| busy);
    }

    /// How it has ended, where it has; one that closed its socket is about to.
    pub fn end(&mut self, has_closed: bool) -> Option<String> {
        let begun = Instant::now();
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) if status.signal() == Some(libc::SIGBUS) => {
                    return Some("it found shared memory full: /dev/shm needs room (df -h /dev/shm)".to_owned());
                }
                Ok(Some(status)) => return Some(format!("it ended: {status}")),
                _ if !has_closed => return None,
                _ if begun.elapsed() > LAST_MOMENT => return Some("it closed its socket".to_owned()),
                _ => std::thread::sleep(Duration::from_millis(1)),
            }
        }
    }

    /// For how long it has said nothing, where that is too long.
    pub fn is_silent(&self) -> Option<Duration> {
        let silent = self.heard.elapsed();
        let patience = match self.is_ready {
            true => SILENT_AFTER,
            false => SILENT_AT_START,
        };
        let is_starved = || {
            let time = processor_time(self.child.id());
            time.is_some_and(|(is_runnable, busy)| is_runnable && busy.saturating_sub(self.busy) < MOST_BUSY)
        };
        let is_dead = silent >= patience && (silent >= SILENT_WITHOUT_PROCESSOR || !is_starved());
        is_dead.then_some(silent)
    }
}

/// The bridge's program, which is installed beside this one; a test's is a folder below.
pub fn program() -> PathBuf {
    let own = std::env::current_exe().unwrap_or_default();
    let places = own
        .ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join("stylet-bridge"));
    let mut places = places.collect::<Vec<_>>();
    let found = places.iter().position(|place| place.is_file());
    match places.is_empty() {
        true => PathBuf::from("stylet-bridge"),
        false => places.swap_remove(found.unwrap_or(0)),
    }
}

/// Whether a process wants the processor, and how much of it it has had.
fn processor_time(pid: u32) -> Option<(bool, Duration)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // Behind the name, which may hold anything: the state, and from the 12th field on the times in hundredths of a second.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let is_runnable = fields.next()? == "R";
    let mut ticks = fields.skip(10).take(2).filter_map(|field| field.parse::<u64>().ok());
    let busy = Duration::from_millis(10 * (ticks.next()? + ticks.next()?));
    Some((is_runnable, busy))
}
