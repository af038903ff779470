//! Causes of a late tick, from the intervals between its deadline and its wake-up: kind, name, microseconds.

use super::event::{Interruption, Task};
use super::timeline::{Holder, Loop, Piece};
use serde::{Deserialize, Serialize};

/// Kind of cause that delayed the loop's tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A thread of higher real-time priority.
    HigherPriority,
    /// A thread of the same real-time priority.
    SamePriority,
    /// A thread that the kernel did not preempt: it was inside the kernel.
    KernelWork,
    /// The kernel held the loop back: its share of real-time work was used up.
    Throttled,
    /// The loop itself has lost its real-time priority.
    LostPriority,
    /// The loop was stopped by a signal or a debugger.
    Stopped,
    /// The loop waited in the kernel for something other than its time.
    Blocked,
    /// Handler of a device interrupt.
    Interrupt,
    /// Softirq.
    SoftInterrupt,
    /// An interrupt of the processor itself.
    ProcessorInterrupt,
    /// Expired timers of others.
    Timers,
    /// The loop's own previous tick had not ended.
    OwnWork,
    /// The loop's own tick took long and nothing interrupted it.
    SlowWork,
    /// No event at all: hypervisor, firmware, or a deep sleep state.
    NothingRan,
}

/// One cause, with all of its intervals.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    pub kind: Kind,
    /// The thread, interrupt or function by name.
    pub who: String,
    /// Number of the thread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pid: Option<i32>,
    /// Returns the `SCHED_FIFO` priority behind the kernel's number; `None` for a normal thread.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub priority: Option<i32>,
    pub us: f64,
    pub times: u32,
    /// System call or work item in progress.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inside: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub woken_by: Option<String>,
}

/// Length from which an interval without an event is more than an ordinary wake-up.
const SILENT_NS: u64 = 20_000;
/// Smallest fraction of the lateness at which a cause is kept; see also [`LEAST_US`].
const LEAST_SHARE: f64 = 0.1;
const LEAST_US: f64 = 8.0;
/// Most causes of one tick.
const MOST: usize = 4;
/// Numbers of normal threads begin here.
const NORMAL: i32 = 100;

/// Returns the `SCHED_FIFO` priority behind the kernel's number; `None` for a normal thread.
pub fn fifo(priority: i32) -> Option<i32> {
    (0..NORMAL - 1).contains(&priority).then_some(NORMAL - 1 - priority)
}

/// Returns the causes, longest first; `woke_ns` is when the loop read its clock after its sleep.
pub fn causes(pieces: &[Piece], woke_ns: u64) -> Vec<Cause> {
    let late_us = pieces.iter().map(Piece::length_ns).sum::<u64>() as f64 / 1e3;
    let mut all: Vec<Cause> = Vec::new();
    // The loop was still running at its deadline: its previous tick had not ended.
    let mut own_before = true;
    for piece in pieces.iter().flat_map(|piece| piece.cut_at(woke_ns)) {
        let piece = &piece;
        own_before &= piece.own == Loop::Running;
        let working = piece.holder == Holder::OwnLoop && piece.from_ns >= woke_ns;
        let found = if working {
            Some(named(Kind::SlowWork, "the loop"))
        } else {
            cause(piece, own_before)
        };
        let Some(mut cause) = found else {
            continue;
        };
        cause.us = piece.length_ns() as f64 / 1e3;
        match all
            .iter_mut()
            .find(|c| c.kind == cause.kind && c.who == cause.who && c.pid == cause.pid)
        {
            Some(known) => {
                known.us += cause.us;
                known.times += 1;
                known.inside = known.inside.take().or(cause.inside);
            }
            None => all.push(cause),
        }
    }
    all.retain(|c| c.us >= LEAST_US && c.us >= LEAST_SHARE * late_us);
    all.sort_by(|a, b| b.us.total_cmp(&a.us));
    all.truncate(MOST);
    all
}

fn named(kind: Kind, who: impl Into<String>) -> Cause {
    Cause {
        kind,
        who: who.into(),
        pid: None,
        priority: None,
        us: 0.0,
        times: 1,
        inside: None,
        woken_by: None,
    }
}

fn cause(piece: &Piece, own_before: bool) -> Option<Cause> {
    let silent = piece.length_ns() > SILENT_NS;
    match &piece.holder {
        Holder::Interruption(i) => Some(interruption(i)),
        _ if piece.own == Loop::Stopped => Some(named(Kind::Stopped, "the loop")),
        _ if piece.own == Loop::Blocked => Some(named(Kind::Blocked, "the loop")),
        Holder::OwnLoop if own_before => Some(named(Kind::OwnWork, "the tick before")),
        Holder::OwnLoop => silent.then(|| named(Kind::NothingRan, "the loop")),
        Holder::Idle(state) => {
            if piece.own == Loop::Runnable && piece.passed_over {
                return Some(named(Kind::Throttled, "the core stood idle"));
            }
            let who = state.map_or("the idle core".to_owned(), |s| format!("the core in sleep state {s}"));
            silent.then(|| named(Kind::NothingRan, who))
        }
        Holder::Thread {
            task,
            call,
            work,
            woken_by,
        } => {
            let kind = of_thread(piece, task, call.is_some() || work.is_some(), silent)?;
            Some(Cause {
                pid: Some(task.pid),
                priority: fifo(task.priority),
                inside: call.clone().or_else(|| work.clone()),
                woken_by: woken_by.clone(),
                ..named(kind, &task.name)
            })
        }
    }
}

fn of_thread(piece: &Piece, task: &Task, known_in_kernel: bool, silent: bool) -> Option<Kind> {
    if piece.own != Loop::Runnable {
        // Its deadline has passed without an interrupt: interrupts are off, or nothing runs.
        return silent.then_some(if known_in_kernel {
            Kind::KernelWork
        } else {
            Kind::NothingRan
        });
    }
    Some(match task.priority.cmp(&piece.own_priority) {
        _ if piece.own_priority >= NORMAL => Kind::LostPriority,
        std::cmp::Ordering::Less => Kind::HigherPriority,
        std::cmp::Ordering::Equal => Kind::SamePriority,
        std::cmp::Ordering::Greater if piece.passed_over => Kind::Throttled,
        std::cmp::Ordering::Greater => Kind::KernelWork,
    })
}

fn interruption(i: &Interruption) -> Cause {
    match i {
        Interruption::Irq(n, name) => named(Kind::Interrupt, format!("IRQ {n} ({name})")),
        Interruption::Vector(name) => named(Kind::ProcessorInterrupt, name),
        Interruption::Softirq(name) => named(Kind::SoftInterrupt, name),
        Interruption::Timer(function) => named(Kind::Timers, function),
    }
}

impl Kind {
    /// Returns its short name for a table.
    pub fn name(self) -> &'static str {
        match self {
            Self::HigherPriority => "thread of higher priority",
            Self::SamePriority => "thread of the same priority",
            Self::KernelWork => "work inside the kernel",
            Self::Throttled => "share of real-time work used up",
            Self::LostPriority => "lost its priority",
            Self::Stopped => "stopped by a signal",
            Self::Blocked => "waited in the kernel",
            Self::Interrupt => "device interrupt",
            Self::SoftInterrupt => "softirq",
            Self::ProcessorInterrupt => "interrupt of the processor",
            Self::Timers => "timers of others",
            Self::OwnWork => "the tick before had not ended",
            Self::SlowWork => "slow work of the loop",
            Self::NothingRan => "nothing ran",
        }
    }
}
