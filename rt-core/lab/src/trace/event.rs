//! Parses lines of the kernel's trace into events about the use of a core. Pure: text in, values out.

use std::fmt;

/// Something that interrupts threads.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Interruption {
    /// A device interrupt: number and name of its handler.
    Irq(u32, String),
    /// An interrupt of the processor itself: local timer, call from another core, rescheduling.
    Vector(String),
    /// A soft interrupt by its name.
    Softirq(String),
    /// The function of a timer that expired.
    Timer(String),
}

impl fmt::Display for Interruption {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Irq(n, name) => write!(f, "IRQ {n} ({name})"),
            Self::Vector(name) => write!(f, "{name} interrupt"),
            Self::Softirq(name) => write!(f, "softirq {name}"),
            Self::Timer(function) => write!(f, "timer {function}"),
        }
    }
}

/// Part of an event used by the decoder.
#[derive(Clone, Debug, PartialEq)]
pub enum What {
    Switch {
        from: Task,
        /// First letter of the state in which it left: R, S, D, T.
        left_as: char,
        to: Task,
    },
    Waking(Task),
    Begin(Interruption),
    End(Interruption),
    /// A sleep state of the core, or its end.
    Idle(Option<u32>),
    WorkBegin(String),
    WorkEnd,
    CallBegin(String),
    CallEnd,
    Other,
}

/// A thread as the scheduler names it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Task {
    pub name: String,
    pub pid: i32,
    /// The kernel's number: 0 to 98 are `SCHED_FIFO` 99 to 1, 100 and more are normal.
    pub priority: i32,
}

/// One line of the trace.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// `CLOCK_MONOTONIC`, to a microsecond.
    pub at_ns: u64,
    /// The thread on the core: its name and number.
    pub name: String,
    pub pid: i32,
    pub what: What,
}

/// Returns all events at or after `from_ns`, in the order of the text. Other lines are left out.
pub fn events(text: &str, from_ns: u64) -> Vec<Event> {
    text.lines().filter_map(|line| event(line, from_ns)).collect()
}

/// Number of events lost by the buffer, according to its text.
pub fn lost(text: &str) -> u64 {
    let lines = text.lines().filter_map(|l| l.split_once("[LOST ")?.1.split_once(' '));
    lines.filter_map(|(n, _)| n.parse::<u64>().ok()).sum()
}

fn event(line: &str, from_ns: u64) -> Option<Event> {
    if line.starts_with('#') {
        return None;
    }
    let (thread, rest) = line.split_once("] ").filter(|(left, _)| left.contains('['))?;
    let (thread, _) = thread.rsplit_once('[')?;
    let rest = rest.trim_start();
    let (_, rest) = rest.split_once(' ')?;
    let (time, rest) = rest.trim_start().split_once(": ")?;
    let at_ns = nanoseconds(time)?;
    if at_ns < from_ns {
        return None;
    }
    let (name, pid) = thread.trim().rsplit_once('-')?;
    let (kind, fields) = rest.split_once(':').unwrap_or((rest, ""));
    Some(Event {
        at_ns,
        name: name.to_owned(),
        pid: pid.trim().parse().ok()?,
        what: what(kind.trim(), fields.trim()),
    })
}

/// `566.121302` in nanoseconds.
fn nanoseconds(time: &str) -> Option<u64> {
    let (seconds, fraction) = time.split_once('.')?;
    let digits = u32::try_from(fraction.len()).ok().filter(|n| *n <= 9)?;
    let part = fraction.parse::<u64>().ok()? * 10_u64.pow(9 - digits);
    seconds
        .parse::<u64>()
        .ok()?
        .checked_mul(1_000_000_000)?
        .checked_add(part)
}

fn what(kind: &str, fields: &str) -> What {
    let number = |key| field(fields, key).and_then(|v| v.parse::<i64>().ok());
    let action = || bracketed(fields).unwrap_or("?").to_owned();
    let known = match kind {
        "sched_switch" => switch(fields),
        "sched_waking" | "sched_wakeup" => task(fields, "").map(What::Waking),
        "irq_handler_entry" => number("irq").map(|n| {
            let name = fields.split_once("name=").map_or("?", |(_, name)| name);
            What::Begin(Interruption::Irq(n as u32, name.to_owned()))
        }),
        "irq_handler_exit" => number("irq").map(|n| What::End(Interruption::Irq(n as u32, String::new()))),
        "softirq_entry" => Some(What::Begin(Interruption::Softirq(action()))),
        "softirq_exit" => Some(What::End(Interruption::Softirq(action()))),
        "hrtimer_expire_entry" | "timer_expire_entry" => {
            let function = field(fields, "function").unwrap_or("?");
            Some(What::Begin(Interruption::Timer(function.to_owned())))
        }
        "hrtimer_expire_exit" | "timer_expire_exit" => Some(What::End(Interruption::Timer(String::new()))),
        "cpu_idle" => number("state").map(|state| What::Idle(u32::try_from(state).ok().filter(|s| *s != u32::MAX))),
        "workqueue_execute_start" => {
            let function = fields.rsplit_once("function ").map_or("?", |(_, f)| f);
            Some(What::WorkBegin(function.to_owned()))
        }
        "workqueue_execute_end" => Some(What::WorkEnd),
        _ => None,
    };
    known.unwrap_or_else(|| by_ending(kind))
}

/// Decodes kinds by suffix: vectors are `<name>_entry` and `<name>_exit`; system calls `sys_<name>(` and `sys_<name> ->
/// 0x0`, printed in two ways.
fn by_ending(kind: &str) -> What {
    if let Some(call) = kind.strip_prefix("sys_enter_").or_else(|| kind.strip_prefix("sys_")) {
        return if let Some((name, _)) = call.split_once('(') {
            What::CallBegin(name.to_owned())
        } else if call.contains("->") || kind.starts_with("sys_exit") {
            What::CallEnd
        } else {
            What::CallBegin(call.to_owned())
        };
    }
    let vector = |name: &str| Interruption::Vector(name.trim_end_matches("_apic").replace('_', " "));
    if let Some(name) = kind.strip_suffix("_entry") {
        What::Begin(vector(name))
    } else if let Some(name) = kind.strip_suffix("_exit") {
        What::End(vector(name))
    } else {
        What::Other
    }
}

fn switch(fields: &str) -> Option<What> {
    let (from, to) = fields.split_once(" ==> ")?;
    let left_as = field(from, "prev_state").and_then(|s| s.chars().next()).unwrap_or('?');
    Some(What::Switch {
        from: task(from, "prev_")?,
        left_as,
        to: task(to, "next_")?,
    })
}

/// Parses a thread, whose name may contain spaces: it ends where its number begins.
fn task(fields: &str, prefix: &str) -> Option<Task> {
    let (begin, end) = (format!("{prefix}comm="), format!(" {prefix}pid="));
    let (name, _) = fields.split_once(&begin)?.1.split_once(&end)?;
    let number = |key: &str| field(fields, &format!("{prefix}{key}")).and_then(|v| v.parse::<i32>().ok());
    Some(Task {
        name: name.to_owned(),
        pid: number("pid")?,
        priority: number("prio")?,
    })
}

/// Returns the value of ` key=value`.
fn field<'a>(fields: &'a str, key: &str) -> Option<&'a str> {
    let words = fields.split_whitespace().filter_map(|w| w.split_once('='));
    let mut values = words.filter(|(k, _)| *k == key).map(|(_, v)| v);
    values.next_back()
}

/// Returns the word behind `action=` in `vec=3 [action=NET_RX]`.
fn bracketed(fields: &str) -> Option<&str> {
    fields.split_once("[action=")?.1.split_once(']').map(|(a, _)| a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(line: &str) -> Event {
        event(line, 0).expect("an event")
    }

    #[test]
    fn names_with_spaces_brackets_and_dashes_are_read() {
        let e = one(
            " opt 64cpks5hqfa-22508   [001] d..2.   566.121770: sched_switch: prev_comm=opt 64cpks5hqfa prev_pid=22508 prev_prio=120 \
             prev_state=R+ ==> next_comm=tokio-rt wor-k next_pid=22917 next_prio=19",
        );
        assert_eq!(
            (e.at_ns, e.name.as_str(), e.pid),
            (566_121_770_000, "opt 64cpks5hqfa", 22_508)
        );
        let task = |name: &str, pid, priority| Task {
            name: name.to_owned(),
            pid,
            priority,
        };
        let switch = What::Switch {
            from: task("opt 64cpks5hqfa", 22_508, 120),
            left_as: 'R',
            to: task("tokio-rt wor-k", 22_917, 19),
        };
        assert_eq!(e.what, switch);
    }

    #[test]
    fn each_kind_of_event_is_read_and_what_is_none_is_left_out() {
        let begin = |line: &str| match one(&format!("  <idle>-0       [001] d.h..   1.000001: {line}")).what {
            What::Begin(i) => i,
            other => panic!("{other:?}"),
        };
        assert_eq!(
            begin("irq_handler_entry: irq=28 name=nvme0q1"),
            Interruption::Irq(28, "nvme0q1".to_owned())
        );
        assert_eq!(
            begin("softirq_entry: vec=3 [action=NET_RX]"),
            Interruption::Softirq("NET_RX".to_owned())
        );
        assert_eq!(
            begin("call_function_single_entry: vector=251"),
            Interruption::Vector("call function single".to_owned())
        );
        assert_eq!(
            begin("hrtimer_expire_entry: hrtimer=00000000b3 function=hrtimer_wakeup now=566121000000"),
            Interruption::Timer("hrtimer_wakeup".to_owned())
        );
        let what = |line: &str| one(&format!("  a-1  [000] .....   1.5: {line}")).what;
        assert_eq!(what("sys_fsync(fd: 3)"), What::CallBegin("fsync".to_owned()));
        assert_eq!(what("sys_fsync -> 0x0"), What::CallEnd);
        assert_eq!(what("cpu_idle: state=1 cpu_id=1"), What::Idle(Some(1)));
        assert_eq!(what("cpu_idle: state=4294967295 cpu_id=1"), What::Idle(None));
        assert_eq!(
            what("workqueue_execute_start: work struct 00000000bcf7fc49: function flush_to_ldisc"),
            What::WorkBegin("flush_to_ldisc".to_owned())
        );
        for none in [
            "",
            "# tracer: nop",
            "CPU:1 [LOST 12 EVENTS]",
            "  a-1 [000] ..... word",
            "a [0] b c: d",
        ] {
            assert!(event(none, 0).is_none(), "{none}");
        }
        assert_eq!(lost("CPU:1 [LOST 12 EVENTS]\nCPU:0 [LOST 3 EVENTS]\n"), 15);
        assert_eq!(
            events("  a-1  [000] .....   1.5: sched_process_exit: x\n", 1_600_000_000),
            []
        );
    }
}
