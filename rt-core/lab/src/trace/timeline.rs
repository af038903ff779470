//! Use of a core over time, from a walk over its events.

use super::event::{Event, Interruption, Task, What};
use std::collections::BTreeMap;

/// State of the loop's own thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loop {
    /// Waits for its time.
    Asleep,
    /// Ready to run, but not running.
    Runnable,
    Running,
    /// Thread stopped by a signal or a debugger.
    Stopped,
    /// Waits in the kernel for something other than its time.
    Blocked,
}

/// Holder of the core.
#[derive(Clone, Debug, PartialEq)]
pub enum Holder {
    /// No thread: the sleep state, if known.
    Idle(Option<u32>),
    OwnLoop,
    Thread {
        task: Task,
        /// Present system call, if traced.
        call: Option<String>,
        /// The work item of a kernel worker.
        work: Option<String>,
        woken_by: Option<String>,
    },
    Interruption(Interruption),
}

/// An interval between two events.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    pub from_ns: u64,
    pub to_ns: u64,
    pub holder: Holder,
    pub own: Loop,
    /// Priority of the loop at its last wake-up, the kernel's number.
    pub own_priority: i32,
    /// Another thread, or none, was given the core while the loop could run.
    pub passed_over: bool,
}

impl Piece {
    pub fn length_ns(&self) -> u64 {
        self.to_ns - self.from_ns
    }

    /// Returns its parts before and after a time.
    pub fn cut_at(&self, at_ns: u64) -> impl Iterator<Item = Self> + use<> {
        let at_ns = at_ns.clamp(self.from_ns, self.to_ns);
        let [mut before, mut after] = [self.clone(), self.clone()];
        (before.to_ns, after.from_ns) = (at_ns, at_ns);
        [before, after].into_iter().filter(|piece| piece.from_ns < piece.to_ns)
    }
}

/// The walk's state.
struct Walk {
    own_pid: i32,
    own: Loop,
    own_priority: i32,
    passed_over: bool,
    current: Task,
    interruptions: Vec<Interruption>,
    idle: Option<u32>,
    calls: BTreeMap<i32, String>,
    work: BTreeMap<i32, String>,
    wakers: BTreeMap<i32, String>,
    /// Threads as last named by the scheduler.
    known: BTreeMap<i32, Task>,
}

/// Returns the intervals of `[from_ns, to_ns]` on the core of `events`; `own_pid` is the loop's thread, `own_priority`
/// the kernel's number of its priority. `None` if the events begin later.
pub fn pieces(events: &[Event], own_pid: i32, own_priority: i32, from_ns: u64, to_ns: u64) -> Option<Vec<Piece>> {
    let first = events.first().filter(|e| e.at_ns <= from_ns)?;
    let mut walk = Walk::begin(first, events, own_pid, own_priority);
    let mut pieces: Vec<Piece> = Vec::new();
    let mut last_ns = first.at_ns;
    for e in events {
        let at_ns = e.at_ns.max(last_ns);
        walk.see(e);
        push(&mut pieces, &walk, last_ns.max(from_ns), at_ns.min(to_ns));
        walk.take(e);
        last_ns = at_ns;
        if last_ns >= to_ns {
            break;
        }
    }
    push(&mut pieces, &walk, last_ns.max(from_ns), to_ns);
    Some(pieces)
}

fn push(pieces: &mut Vec<Piece>, walk: &Walk, from_ns: u64, to_ns: u64) {
    if from_ns < to_ns {
        pieces.push(Piece {
            from_ns,
            to_ns,
            holder: walk.holder(),
            own: walk.own,
            own_priority: walk.own_priority,
            passed_over: walk.passed_over,
        });
    }
}

impl Walk {
    /// Derives the loop's initial state from the first event that names it.
    fn begin(first: &Event, events: &[Event], own_pid: i32, own_priority: i32) -> Self {
        let named = events.iter().find_map(|e| match &e.what {
            What::Switch { from, .. } if from.pid == own_pid => Some(Loop::Running),
            What::Switch { to, .. } if to.pid == own_pid => Some(Loop::Runnable),
            What::Waking(task) if task.pid == own_pid => Some(Loop::Asleep),
            _ if e.pid == own_pid => Some(Loop::Running),
            _ => None,
        });
        // The thread on the core at the start: its priority is in the switch that removes it.
        let current = events.iter().find_map(|e| match &e.what {
            What::Switch { from, .. } => Some(from.clone()),
            _ => None,
        });
        let unknown = || Task {
            name: first.name.clone(),
            pid: first.pid,
            priority: 120,
        };
        Self {
            own_pid,
            own: named.unwrap_or(Loop::Asleep),
            own_priority,
            passed_over: false,
            current: current.filter(|t| t.pid == first.pid).unwrap_or_else(unknown),
            interruptions: Vec::new(),
            idle: None,
            calls: BTreeMap::new(),
            work: BTreeMap::new(),
            wakers: BTreeMap::new(),
            known: BTreeMap::new(),
        }
    }

    /// Processes an event, which names the thread on the core. Some kernels record no switch away from the idle thread:
    /// then the thread has had the core since the previous event.
    fn see(&mut self, e: &Event) {
        if e.pid == self.current.pid {
            return;
        }
        let task = self.known.get(&e.pid).cloned().unwrap_or_else(|| Task {
            name: e.name.clone(),
            pid: e.pid,
            priority: 120,
        });
        self.give_to(&task);
    }

    fn holder(&self) -> Holder {
        if let Some(i) = self.interruptions.last() {
            return Holder::Interruption(i.clone());
        }
        let pid = self.current.pid;
        if pid == 0 {
            Holder::Idle(self.idle)
        } else if pid == self.own_pid {
            Holder::OwnLoop
        } else {
            Holder::Thread {
                task: self.current.clone(),
                call: self.calls.get(&pid).cloned(),
                work: self.work.get(&pid).cloned(),
                woken_by: self.wakers.get(&pid).cloned(),
            }
        }
    }

    fn take(&mut self, e: &Event) {
        match &e.what {
            What::Switch { from, left_as, to } => self.switch(from, *left_as, to),
            What::Waking(task) => self.waking(e, task),
            What::Begin(i) => self.interruptions.push(i.clone()),
            What::End(i) => self.end(i),
            What::Idle(state) => self.idle = *state,
            What::WorkBegin(function) => drop(self.work.insert(e.pid, function.clone())),
            What::WorkEnd => drop(self.work.remove(&e.pid)),
            What::CallBegin(name) => drop(self.calls.insert(e.pid, name.clone())),
            What::CallEnd => drop(self.calls.remove(&e.pid)),
            What::Other => {}
        }
    }

    fn switch(&mut self, from: &Task, left_as: char, to: &Task) {
        for task in [from, to] {
            self.known.insert(task.pid, task.clone());
        }
        if from.pid == self.own_pid {
            self.own = match left_as {
                'R' => Loop::Runnable,
                'T' | 't' => Loop::Stopped,
                'D' => Loop::Blocked,
                _ => Loop::Asleep,
            };
            self.passed_over = self.own == Loop::Runnable && to.priority > self.own_priority;
        }
        self.give_to(to);
    }

    fn give_to(&mut self, to: &Task) {
        if to.pid == self.own_pid {
            (self.own, self.own_priority, self.passed_over) = (Loop::Running, to.priority, false);
        } else if self.own == Loop::Runnable {
            // The idle thread has the number of the least urgent normal thread.
            self.passed_over |= to.pid == 0 || to.priority > self.own_priority;
        }
        // A switch never happens inside an interrupt: an end that the buffer lost must not persist.
        self.interruptions.clear();
        self.current = to.clone();
    }

    fn waking(&mut self, e: &Event, task: &Task) {
        self.known.insert(task.pid, task.clone());
        if task.pid == self.own_pid {
            self.own_priority = task.priority;
            if matches!(self.own, Loop::Asleep | Loop::Blocked | Loop::Stopped) {
                (self.own, self.passed_over) = (Loop::Runnable, false);
            }
            return;
        }
        let interruption = self.interruptions.first();
        let waker = interruption.map_or_else(|| e.name.clone(), ToString::to_string);
        self.wakers.insert(task.pid, waker);
    }

    /// Ends the innermost interruption of this kind, and those inside it whose end was lost.
    fn end(&mut self, i: &Interruption) {
        let same = |open: &Interruption| match (open, i) {
            (Interruption::Irq(a, _), Interruption::Irq(b, _)) => a == b,
            (Interruption::Timer(_), Interruption::Timer(_)) => true,
            (a, b) => a == b,
        };
        if let Some(place) = self.interruptions.iter().rposition(same) {
            self.interruptions.truncate(place);
        }
    }
}
