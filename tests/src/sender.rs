//! A program that moves the hand, ended in each possible way, and the motion of the hand afterwards.

use crate::{now_ns, until};
use nalgebra::Vector3;
use std::fs::File;
use std::io::{PipeReader, PipeWriter, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::fs::OpenOptionsExt;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use stylet_host::link::Link;
use stylet_shm_schema::{EventKind, TickRecord, flags};

/// Rest means slower than 3 mm/s, as in the core: less than this over that many ticks, m. Then the spring of the hand
/// releases its last tenths of a millimetre, as after each stop.
const REST_TICKS: usize = 50;
const AT_REST_M: f64 = 1.5e-4;
/// Ticks after which a lapsed motion is given up.
const GRACE_TICKS: usize = 300;
/// Largest motion of the hand without an owner.
const FARTHEST_MM: f64 = 5.0;
const LONGEST_TICKS: usize = 400;
/// Time for which the hand is watched after its sender has ended, or should have.
const WATCHED: Duration = Duration::from_millis(900);
/// A program that closes in order writes its results first.
const ENDS_WITHIN: Duration = Duration::from_secs(5);
/// Distance within ten ticks that shows a motion under way, m.
const MOVES_M: f64 = 3e-4;
/// Distance that shows a continued motion, mm.
const GOES_ON_MM: f64 = 5.0;

/// End of a program that moves the hand, or of the reader of its output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// SIGKILL.
    Killed,
    /// SIGSTOP.
    Stopped,
    /// Both outputs are pipes that are never emptied.
    OutputFull,
    /// The readers of its outputs are gone.
    OutputClosed,
    /// Its terminal is closed: SIGHUP.
    HungUp,
}

impl Ending {
    /// All endings.
    pub const ALL: [Self; 5] = [
        Self::Killed,
        Self::Stopped,
        Self::OutputFull,
        Self::OutputClosed,
        Self::HungUp,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Killed => "killed",
            Self::Stopped => "stopped",
            Self::OutputFull => "output full",
            Self::OutputClosed => "output closed",
            Self::HungUp => "terminal closed",
        }
    }
}

/// Place of the needle when its sender ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// It touches nothing.
    Air,
    /// It has punctured the membrane.
    Tissue,
}

impl Place {
    fn name(self) -> &'static str {
        match self {
            Self::Air => "air",
            Self::Tissue => "tissue",
        }
    }

    fn has(self, record: &TickRecord) -> bool {
        match self {
            Self::Air => record.flags & (flags::IN_CONTACT | flags::PUNCTURED) == 0,
            Self::Tissue => record.flags & flags::PUNCTURED != 0 && record.depth_m > 2e-3,
        }
    }
}

/// All combinations of endings with air and tissue.
pub fn kinds() -> impl Iterator<Item = (Place, Ending)> {
    let places = [Place::Air, Place::Tissue].into_iter();
    places.flat_map(|place| Ending::ALL.map(|ending| (place, ending)))
}

enum Outputs {
    Pipe(Option<PipeReader>, PipeWriter),
    Terminal(Option<OwnedFd>),
}

/// A program of the test with a pipe or a terminal for its outputs; killed when dropped.
pub struct Sender {
    child: Child,
    outputs: Outputs,
}

impl Sender {
    /// Starts the program with the outputs that `ending` requires.
    pub fn start(mut command: Command, ending: Ending) -> Self {
        if ending != Ending::HungUp {
            let (reader, writer) = std::io::pipe().expect("a pipe");
            let clone = || Stdio::from(writer.try_clone().expect("a descriptor"));
            let child = command.stdout(clone()).stderr(clone()).spawn();
            return Self {
                child: child.expect("the program starts"),
                outputs: Outputs::Pipe(Some(reader), writer),
            };
        }
        let (mut ours, mut its) = (-1, -1);
        let nothing = std::ptr::null_mut();
        // SAFETY: both numbers are valid for writes, and nothing else is asked for.
        let opened = unsafe { libc::openpty(&raw mut ours, &raw mut its, nothing, nothing.cast(), nothing.cast()) };
        assert_eq!(opened, 0, "no terminal: {}", std::io::Error::last_os_error());
        // SAFETY: descriptors that were just opened, and are owned by no other value.
        let (ours, its) = unsafe { (OwnedFd::from_raw_fd(ours), OwnedFd::from_raw_fd(its)) };
        // SAFETY: plain numbers. No other child keeps the terminal open.
        unsafe { libc::fcntl(ours.as_raw_fd(), libc::F_SETFD, libc::FD_CLOEXEC) };
        let its_clone = || Stdio::from(its.try_clone().expect("a descriptor"));
        command.stdin(its_clone()).stdout(its_clone()).stderr(its_clone());
        // SAFETY: between fork and exec it only makes system calls.
        unsafe {
            command.pre_exec(|| {
                // A parent that ignores SIGHUP, such as `nohup`, would pass that on.
                libc::signal(libc::SIGHUP, libc::SIG_DFL);
                // The terminal of a session of its own, or closing it would signal nobody.
                match libc::setsid() >= 0 && libc::ioctl(0, libc::TIOCSCTTY, 0) == 0 {
                    true => Ok(()),
                    false => Err(std::io::Error::last_os_error()),
                }
            });
        }
        Self {
            child: command.spawn().expect("the program starts"),
            outputs: Outputs::Terminal(Some(ours)),
        }
    }

    /// Applies the ending at once.
    pub fn end(&mut self, ending: Ending) {
        match (ending, &mut self.outputs) {
            (Ending::Killed, _) => self.send(libc::SIGKILL),
            (Ending::Stopped, _) => self.send(libc::SIGSTOP),
            (Ending::OutputFull, Outputs::Pipe(_, writer)) => fill(writer),
            (Ending::OutputClosed, Outputs::Pipe(reader, _)) => *reader = None,
            (Ending::HungUp, Outputs::Terminal(ours)) => *ours = None,
            _ => panic!("started for another ending than {ending:?}"),
        }
    }

    fn send(&self, signal: libc::c_int) {
        // SAFETY: a child of ours that has not been waited for.
        assert_eq!(unsafe { libc::kill(self.child.id() as libc::pid_t, signal) }, 0);
    }

    /// True if it has not ended.
    pub fn is_running(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }
}

impl Drop for Sender {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Writes until nothing more fits. The program's own end blocks when the pipe is full.
fn fill(writer: &PipeWriter) {
    let path = format!("/proc/self/fd/{}", writer.as_raw_fd());
    let opened = File::options().write(true).custom_flags(libc::O_NONBLOCK).open(path);
    let mut end = opened.expect("the same pipe");
    while end.write(&[b'\n'; 4096]).is_ok() {}
    while end.write(b"\n").is_ok() {}
}

/// Motion of the hand as seen by another host.
#[derive(Debug)]
pub struct Trial {
    /// Speed of the tip when its sender ended.
    pub mm_per_s: f64,
    /// Path of the tip from then on; for a closed terminal, from its closing.
    pub farthest_mm: f64,
    /// Ticks until it was at rest.
    pub ticks: usize,
    /// Both from the moment at which the sender no longer owned the hand.
    alone: (f64, usize),
    /// It never reached its goal. A hand that brakes near its goal arrives, and its motion is not given up.
    pub was_on_its_way: bool,
    /// The program continued, and so did the motion.
    pub went_on: bool,
    /// Motions given up.
    pub given_up: usize,
}

fn tip(record: &TickRecord) -> Vector3<f64> {
    record.tip_in_scene_m.into()
}

fn moves(records: &[TickRecord], place: Place) -> bool {
    let [.., before, _, _, _, _, _, _, _, _, last] = records else {
        return false;
    };
    (tip(last) - tip(before)).norm() > MOVES_M && last.flags & flags::IN_MOTION != 0 && place.has(last)
}

/// Ends the sender at that time after the needle is seen to move in `place`, and watches the hand.
///
/// A killed or stopped program no longer owns the hand; any other owns it until it is gone.
pub fn trial(
    observer: &mut Link,
    sender: &mut Sender,
    (place, ending): (Place, Ending),
    after: Duration,
    begins_within: Duration,
) -> Trial {
    let mut records = Vec::new();
    let mut gone_ns = None;
    let mut watch = |sender: &mut Sender, limit, ready: &dyn Fn(&[TickRecord], bool) -> bool| {
        until(limit, || {
            observer.poll();
            records.append(&mut observer.take_records());
            gone_ns = gone_ns.or_else(|| (!sender.is_running()).then(now_ns));
            ready(&records, gone_ns.is_some())
        })
    };
    let begins = watch(sender, begins_within, &|records, _| moves(records, place));
    assert!(begins, "the needle does not move in {}", place.name());
    watch(sender, after, &|_, _| false);
    let asked_ns = now_ns();
    sender.end(ending);
    watch(sender, WATCHED, &|_, _| false);
    if ending == Ending::HungUp {
        assert!(watch(sender, ENDS_WITHIN, &|_, is_gone| is_gone), "the program goes on");
    } else if matches!(ending, Ending::OutputFull | Ending::OutputClosed) && !sender.is_running() {
        watch(sender, WATCHED, &|_, _| false);
    }
    // One that is killed may take a while to be gone.
    let went_on = !stands_still(ending) && gone_ns.is_none();
    let gone_ns = gone_ns.unwrap_or(asked_ns);
    let owned_until_ns = if stands_still(ending) { asked_ns } else { gone_ns };
    let shown_from_ns = if ending == Ending::HungUp {
        asked_ns
    } else {
        owned_until_ns
    };
    let since = |ns: u64| {
        let last = records.iter().rposition(|record| record.due_ns <= ns);
        last.expect("records")
    };
    let (shown, alone) = (since(shown_from_ns), way_and_ticks(&records[since(owned_until_ns)..]));
    let (farthest_mm, ticks) = way_and_ticks(&records[shown..]);
    Trial {
        mm_per_s: (tip(&records[shown]) - tip(&records[shown.saturating_sub(10)])).norm() * 1e5,
        farthest_mm,
        ticks,
        alone,
        was_on_its_way: records
            .get(shown + GRACE_TICKS)
            .is_some_and(|r| r.flags & flags::IN_MOTION != 0),
        went_on,
        given_up: given_up_since(observer, records[shown].tick),
    }
}

fn stands_still(ending: Ending) -> bool {
    matches!(ending, Ending::Killed | Ending::Stopped)
}

/// Path of the tip from the first record, mm, and the ticks until it is at rest.
fn way_and_ticks(records: &[TickRecord]) -> (f64, usize) {
    let at = tip(&records[0]);
    let way_mm = records.iter().map(|r| (tip(r) - at).norm()).fold(0.0, f64::max) * 1e3;
    let moves = |window: &[TickRecord]| (tip(&window[window.len() - 1]) - tip(&window[0])).norm() > AT_REST_M;
    let last = records.windows(REST_TICKS).rposition(moves);
    (way_mm, last.map_or(0, |begin| begin + 1))
}

fn given_up_since(observer: &Link, tick: u64) -> usize {
    let kind = EventKind::MotionGivenUp as u32;
    let events = observer.events().iter();
    events.filter(|event| event.kind == kind && event.tick >= tick).count()
}

impl Trial {
    /// Returns the violation, if any.
    fn fault(&self, ending: Ending) -> Option<&'static str> {
        let is_alone_too_long = self.alone.0 > FARTHEST_MM || self.alone.1 > LONGEST_TICKS;
        // A program that ends in order stops the hand itself.
        let must_be_said = stands_still(ending) && self.was_on_its_way;
        match self.went_on {
            true if self.given_up > 0 => Some("the motion lapsed although its program goes on"),
            // A hand that reaches its goal meanwhile moves on for a while.
            true if self.farthest_mm <= GOES_ON_MM && self.ticks <= LONGEST_TICKS => {
                Some("the motion ended although its program goes on")
            }
            false if is_alone_too_long => Some("the hand went on without an owner"),
            false if must_be_said && self.given_up != 1 => Some("hosts do not hear of it"),
            _ => None,
        }
    }
}

/// One line of a table for each kind of trial.
pub struct Table {
    sender: &'static str,
    faults: Vec<String>,
}

impl Table {
    /// Prints the header.
    pub fn begin(sender: &'static str) -> Self {
        println!(
            "| sender | needle in | ending | trials | went on | way, middle (mm) | way, most (mm) | at rest, middle (ticks) | at rest, most (ticks) | from at most (mm/s) |"
        );
        println!("|---|---|---|---|---|---|---|---|---|---|");
        Self {
            sender,
            faults: Vec::new(),
        }
    }

    /// Prints the results of trials of one kind.
    pub fn row(&mut self, (place, ending): (Place, Ending), trials: &[Trial]) {
        let ended: Vec<&Trial> = trials.iter().filter(|trial| !trial.went_on).collect();
        let middle_and_most = |of: &dyn Fn(&Trial) -> f64| {
            let mut sorted: Vec<f64> = ended.iter().map(|trial| of(trial)).collect();
            sorted.sort_by(f64::total_cmp);
            sorted.last().map(|most| (sorted[(sorted.len() - 1) / 2], *most))
        };
        let words = |figures: Option<(f64, f64)>, digits: usize| match figures {
            Some((middle, most)) => format!("{middle:.digits$} | {most:.digits$}"),
            None => "- | -".to_owned(),
        };
        println!(
            "| {} | {} | {} | {} | {} | {} | {} | {:.0} |",
            self.sender,
            place.name(),
            ending.name(),
            trials.len(),
            trials.len() - ended.len(),
            words(middle_and_most(&|trial| trial.farthest_mm), 2),
            words(middle_and_most(&|trial| trial.ticks as f64), 0),
            trials.iter().map(|trial| trial.mm_per_s).fold(0.0, f64::max),
        );
        let faults = trials.iter().filter_map(|trial| Some((trial.fault(ending)?, trial)));
        self.faults.extend(faults.map(|(fault, trial)| {
            let (place, ending) = (place.name(), ending.name());
            format!("{fault}: {ending} in {place}: {trial:?}")
        }));
    }

    /// Judges all rows.
    pub fn end(self) {
        assert!(
            self.faults.is_empty(),
            "{} of them: {:#?}",
            self.faults.len(),
            self.faults
        );
    }
}
