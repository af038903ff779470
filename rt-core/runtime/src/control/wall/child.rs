//! The bridge as a process: its program, and whether it is alive.

use std::io;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use stylet_shm_schema::{Epoch, Instance};
use stylet_wall::packet::Socket;

/// Longest silence: the bridge reports twenty times a second.
pub const SILENT_AFTER: Duration = Duration::from_millis(400);
/// Time between the end of its socket and its own end.
const LAST_MOMENT: Duration = Duration::from_millis(50);
/// Longest silence while the bridge opens its ports.
const SILENT_AT_START: Duration = Duration::from_secs(2);
/// Longest silence without processor time: on a busy machine another bridge would starve too.
const SILENT_WITHOUT_PROCESSOR: Duration = Duration::from_secs(5);
/// Processor time that a bridge may use in silence; one that uses more is stuck in a loop.
const MOST_BUSY: Duration = Duration::from_millis(200);

/// The running process.
pub struct Running {
    pub child: Child,
    pub epoch: Epoch,
    pub is_ready: bool,
    heard: Instant,
    /// Processor time used by then.
    busy: Duration,
    /// Requests that it has refused.
    pub refused: u64,
}

impl Running {
    /// Wraps a process just started.
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

    /// Records its sign of life.
    pub fn hear(&mut self, refused: u64) {
        (self.heard, self.refused) = (Instant::now(), refused.max(self.refused));
        self.busy = processor_time(self.child.id()).map_or(self.busy, |(_, busy)| busy);
    }

    /// Returns how it ended, if it did. A bridge that closed its socket is about to end.
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

    /// Returns how long it has been silent, if too long.
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

/// Starts the bridge's program as a host of a measurement: one that watches (`host`) or that loads the core (`load`).
pub fn watcher(task: &str, instance: &Instance) -> io::Result<(Socket, Child)> {
    let (socket, end) = Socket::pair()?;
    let mut command = Command::new(program());
    command.args([task, instance.name()]).stdin(end).stdout(Stdio::null());
    Ok((socket, command.spawn()?))
}

/// Path of the bridge's program, installed in the folder of this one; a test runs from a folder below.
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

/// Returns whether a process wants the processor, and the time that it has used.
fn processor_time(pid: u32) -> Option<(bool, Duration)> {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name may hold anything. After it: the state, and from the 12th field on the times in hundredths of a second.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let is_runnable = fields.next()? == "R";
    let mut ticks = fields.skip(10).take(2).filter_map(|field| field.parse::<u64>().ok());
    let busy = Duration::from_millis(10 * (ticks.next()? + ticks.next()?));
    Some((is_runnable, busy))
}
