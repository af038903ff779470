//! Collects the tapes of both loops, returns them, and writes the recording to disk on a separate thread.

use super::line_archive::LineArchive;
use crate::background;
use crate::replay::file::{Flight, FlightError};
use crate::rt::exchange::Ticket;
use crate::rt::haptic_tape::HapticTape;
use crate::rt::recorder::{Tape, TapePort};
use crate::rt::second::SecondTape;
use crate::rt::tissue_tape::TissueTape;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc;
use std::time::{Duration, Instant};

/// Time recorded after a fault, to show how the force ramps out.
const AFTER_FAULT_NS: u64 = 300_000_000;
/// A loop that hands over no tape within this time is left out.
const GATHER_LIMIT_NS: u64 = 1_000_000_000;
/// Most requests queued at once; more are refused.
const QUEUE: usize = 4;
/// Newest recordings of each kind kept in the folder.
const KEPT_EXITS: usize = 20;
const KEPT_OTHERS: usize = 100;

/// Failure to save a recording; the text says what to do.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// The folder cannot be made.
    #[error("{}: {why}; choose another folder with --flight-dir", folder.display())]
    Folder {
        /// The folder of the recordings.
        folder: PathBuf,
        /// Error of the operating system.
        why: std::io::Error,
    },
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] FlightError),
    /// The writer thread could not be started.
    #[error("no thread could be started to write it: {0}")]
    Thread(std::io::Error),
    /// The force loop handed over no tape.
    #[error("the force loop left no recording")]
    NothingRecorded,
}

/// Result of one request.
pub struct Saved {
    /// Ticket of the host's request, if a host asked.
    pub ticket: Option<Ticket>,
    /// The written file.
    pub result: Result<PathBuf, SaveError>,
}

struct Wanted {
    /// Kind of recording, part of the file name.
    kind: &'static str,
    reason: String,
    due_ns: u64,
    ticket: Option<Ticket>,
}

struct Gathering {
    kind: &'static str,
    ticket: Option<Ticket>,
    since_ns: u64,
    /// Tapes of the force loop, the tissue loop and the second device's loop that have come or need not come.
    has: [bool; 3],
    flight: Flight,
}

/// The control thread's side of flight recordings.
pub struct FlightKeeper {
    haptic: TapePort<HapticTape>,
    tissue: TapePort<TissueTape>,
    second: Option<TapePort<SecondTape>>,
    folder: PathBuf,
    /// Part common to every recording of this run.
    common: Flight,
    queue: VecDeque<Wanted>,
    gathering: Option<Gathering>,
    written: (mpsc::Sender<Saved>, mpsc::Receiver<Saved>),
    files: u32,
}

impl FlightKeeper {
    pub fn new(
        (haptic, tissue, second): (TapePort<HapticTape>, TapePort<TissueTape>, Option<TapePort<SecondTape>>),
        folder: PathBuf,
        common: Flight,
    ) -> Self {
        Self {
            haptic,
            tissue,
            second,
            folder,
            common,
            queue: VecDeque::new(),
            gathering: None,
            written: mpsc::channel(),
            files: 0,
        }
    }

    /// Queues a host's request; false when the queue is full.
    pub fn request(&mut self, ticket: Ticket) -> bool {
        self.want("request", "a host asked for it".to_owned(), 0, Some(ticket))
    }

    /// Queues a recording of a fault.
    pub fn fault(&mut self, message: &str, now_ns: u64) {
        // A recording already queued covers this fault as well.
        if !self.queue.iter().any(|w| w.kind == "fault") {
            self.want("fault", message.to_owned(), now_ns + AFTER_FAULT_NS, None);
        }
    }

    fn want(&mut self, kind: &'static str, reason: String, due_ns: u64, ticket: Option<Ticket>) -> bool {
        let room = self.queue.len() < QUEUE;
        if room {
            self.queue.push_back(Wanted {
                kind,
                reason,
                due_ns,
                ticket,
            });
        }
        room
    }

    /// Runs one pass of the control thread; returns a recording written since the last. `hand_over` orders the tapes of
    /// all loops.
    pub fn pass(
        &mut self,
        now_ns: u64,
        scene_generation: u64,
        lines: &LineArchive,
        hand_over: impl FnOnce(),
    ) -> Option<Saved> {
        self.take_tapes(scene_generation);
        let is_over = |g: &mut Gathering| g.is_whole() || now_ns - g.since_ns > GATHER_LIMIT_NS;
        if let Some(gathering) = self.gathering.take_if(is_over) {
            self.write(gathering, lines);
        }
        if self.gathering.is_none()
            && let Some(at) = self.queue.iter().position(|w| w.due_ns <= now_ns)
            && let Some(wanted) = self.queue.remove(at)
        {
            hand_over();
            self.gather(wanted.kind, wanted.reason, wanted.ticket, now_ns);
        }
        self.written.1.try_recv().ok()
    }

    fn gather(&mut self, kind: &'static str, reason: String, ticket: Option<Ticket>, since_ns: u64) {
        self.gathering = Some(Gathering {
            kind,
            ticket,
            since_ns,
            has: [false, false, self.second.is_none()],
            flight: Flight {
                reason,
                ..self.common.clone()
            },
        });
    }

    fn take_tapes(&mut self, scene_generation: u64) {
        let mut gathering = self.gathering.as_mut();
        while let Ok(tape) = self.haptic.taken.pop() {
            if let Some(gathering) = &mut gathering {
                (gathering.flight.haptic, gathering.has[0]) = (tape.flight(), true);
            }
            let _ = self.haptic.back.push(tape);
        }
        while let Ok(tape) = self.tissue.taken.pop() {
            // A tape of an earlier scene is dropped here.
            if tape.is_for(scene_generation) {
                if let Some(gathering) = &mut gathering {
                    (gathering.flight.tissue, gathering.has[1]) = (tape.flight(), true);
                }
                let _ = self.tissue.back.push(tape);
            }
        }
        let Some(second) = &mut self.second else { return };
        while let Ok(tape) = second.taken.pop() {
            if let Some(gathering) = &mut gathering {
                (gathering.flight.second, gathering.has[2]) = (tape.longest(), true);
            }
            let _ = second.back.push(tape);
        }
    }

    fn write(&mut self, gathering: Gathering, lines: &LineArchive) {
        let (path, ticket, sender) = (self.next_path(gathering.kind), gathering.ticket, self.written.0.clone());
        let flight = gathering.into_flight(lines);
        let spawned = background::spawn("flight-writer", move || {
            let result = save(&flight, &path);
            // The receiver is gone once the control thread has ended.
            let _ = sender.send(Saved { ticket, result });
        });
        if let Err(why) = spawned {
            let result = Err(SaveError::Thread(why));
            let _ = self.written.0.send(Saved { ticket, result });
        }
    }

    /// Saves the last recording, after all loops have ended and handed over their tapes.
    pub fn save_at_end(&mut self, scene_generation: u64, lines: &LineArchive) -> Result<PathBuf, SaveError> {
        self.gather("exit", "rt-core ended".to_owned(), None, 0);
        self.take_tapes(scene_generation);
        match self.gathering.take() {
            Some(gathering) if gathering.has[0] => self.save_now(gathering, lines),
            _ => Err(SaveError::NothingRecorded),
        }
    }

    /// Saves a recording while the force loop is stopped: the tapes that the other loops hand over within `limit`, and
    /// the force loop's own if it resumes.
    pub fn save_stopped(
        &mut self,
        scene_generation: u64,
        lines: &LineArchive,
        reason: &str,
        limit: Duration,
    ) -> Result<PathBuf, SaveError> {
        self.gather("fault", reason.to_owned(), None, 0);
        let begun = Instant::now();
        let is_over = |g: &mut Gathering| g.is_whole() || begun.elapsed() >= limit;
        loop {
            if let Some(gathering) = self.gathering.take_if(is_over) {
                return self.save_now(gathering, lines);
            }
            std::thread::sleep(Duration::from_millis(2));
            self.take_tapes(scene_generation);
        }
    }

    fn save_now(&mut self, gathering: Gathering, lines: &LineArchive) -> Result<PathBuf, SaveError> {
        let path = self.next_path(gathering.kind);
        save(&gathering.into_flight(lines), &path)
    }

    fn next_path(&mut self, kind: &str) -> PathBuf {
        self.files += 1;
        let now = jiff::Timestamp::now().strftime("%Y%m%dT%H%M%SZ");
        self.folder.join(format!(
            "flight-{now}-{}-{}-{kind}.flight",
            std::process::id(),
            self.files
        ))
    }
}

impl Gathering {
    fn is_whole(&self) -> bool {
        self.has == [true; 3]
    }

    fn into_flight(mut self, lines: &LineArchive) -> Flight {
        self.flight.lines = lines.of(self.flight.haptic.as_ref(), self.flight.tissue.as_ref());
        self.flight
    }
}

fn save(flight: &Flight, path: &Path) -> Result<PathBuf, SaveError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|why| SaveError::Folder {
        folder: folder.to_owned(),
        why,
    })?;
    flight.write(path)?;
    remove_oldest(folder, |name| name.ends_with("-exit.flight"), KEPT_EXITS);
    remove_oldest(
        folder,
        |name| name.ends_with(".flight") && !name.ends_with("-exit.flight"),
        KEPT_OTHERS,
    );
    Ok(path.to_owned())
}

/// Names begin with the time, so they sort by age.
fn remove_oldest(folder: &Path, of_kind: impl Fn(&str) -> bool, kept: usize) {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|n| n.starts_with("flight-") && of_kind(n)).collect();
    names.sort();
    for name in names.iter().rev().skip(kept) {
        // Another core may have removed it at the same time.
        let _ = std::fs::remove_file(folder.join(name));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_oldest_of_its_kind_are_removed() {
        let folder = std::env::temp_dir().join(format!("stylet-remove-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let names = [
            "flight-1-exit.flight",
            "flight-2-exit.flight",
            "flight-3-exit.flight",
            "flight-0-fault.flight",
            "other",
        ];
        for name in names {
            std::fs::write(folder.join(name), "").unwrap();
        }
        remove_oldest(&folder, |name| name.ends_with("-exit.flight"), 2);
        let left = names.map(|name| folder.join(name).exists());
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(left, [false, true, true, true, true]);
    }
}
