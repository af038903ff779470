//! A cause as a sentence for people.

use super::blame::{Cause, Kind};

/// The environment, which determines the meaning of an interval in which nothing ran.
#[derive(Clone, Copy, Debug, Default)]
pub struct Below {
    /// The machine is virtual.
    pub virtual_machine: bool,
    /// System management interrupts around the tick; `None` if they cannot be counted.
    pub smi: Option<u64>,
}

/// All causes of a tick, longest first.
pub fn sentence(causes: &[Cause], below: Below) -> String {
    if causes.is_empty() {
        return "no single cause: every event near it was short".to_owned();
    }
    let all: Vec<String> = causes.iter().map(|c| words(c, below)).collect();
    all.join("; ")
}

/// Formats a cause, such as `IRQ 28 (nvme0q1) 312 us`.
pub fn words(c: &Cause, below: Below) -> String {
    let us = format!("{:.0} us", c.us);
    let who = match c.pid {
        Some(pid) => format!("{} ({pid})", c.who),
        None => c.who.clone(),
    };
    let priority = c
        .priority
        .map_or("normal priority".to_owned(), |p| format!("SCHED_FIFO {p}"));
    let times = if c.times > 1 {
        format!(", {} times", c.times)
    } else {
        String::new()
    };
    let inside = c.inside.as_ref().map_or(String::new(), |i| format!(", in {i}"));
    let woken = c.woken_by.as_ref().map_or(String::new(), |w| format!(", woken by {w}"));
    match c.kind {
        Kind::HigherPriority => format!("{who} of higher priority ({priority}) ran {us}{times}{woken}"),
        Kind::SamePriority => format!("{who} of the same priority ({priority}) ran {us}{times}{woken}"),
        Kind::KernelWork => format!("{who} kept the core inside the kernel for {us}{inside}{woken}"),
        Kind::Throttled => {
            format!("the kernel held the loop back for {us}: the share of real-time work was used up ({who} meanwhile)")
        }
        Kind::LostPriority => format!("the loop has lost its real-time priority: {who} ran {us}{times}"),
        Kind::Stopped => format!("the loop was stopped by a signal or a debugger for {us}"),
        Kind::Blocked => format!("the loop waited in the kernel for {us}, for a page or a lock"),
        Kind::Interrupt => format!("{who} {us}{times}"),
        Kind::SoftInterrupt => format!("softirq {who} {us}{times}"),
        Kind::ProcessorInterrupt => format!("{who} interrupt {us}{times}"),
        Kind::Timers => format!("timers of others ({who}) {us}{times}"),
        Kind::OwnWork => format!("the tick before was still at work for {us}"),
        Kind::SlowWork => format!(
            "the tick itself worked for {us} and nothing interrupted it: memory or cache taken by others, or a slower clock"
        ),
        Kind::NothingRan => nothing_ran(&us, &who, c.pid.is_some(), below),
    }
}

/// Describes an interval without events: a thread on the core may have turned interrupts off, which no event shows.
fn nothing_ran(us: &str, who: &str, is_thread: bool, below: Below) -> String {
    match below {
        Below { smi: Some(n), .. } if n > 0 => {
            format!("firmware took the core for {us} (nothing ran; {n} system management interrupts)")
        }
        Below {
            virtual_machine: true, ..
        } if is_thread => {
            format!("nothing ran for {us} while {who} had the core: the hypervisor took it, or interrupts were off")
        }
        Below {
            virtual_machine: true, ..
        } => format!("the hypervisor took the core for {us} (nothing ran; {who} had it)"),
        _ => format!(
            "nothing ran for {us} while {who} had the core: firmware, a deep sleep state, or interrupts that were off"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cause(kind: Kind, who: &str) -> Cause {
        Cause {
            kind,
            who: who.to_owned(),
            pid: None,
            priority: None,
            us: 312.4,
            times: 1,
            inside: None,
            woken_by: None,
        }
    }

    #[test]
    fn causes_are_sentences() {
        let below = Below::default();
        assert_eq!(
            words(&cause(Kind::Interrupt, "IRQ 28 (nvme0q1)"), below),
            "IRQ 28 (nvme0q1) 312 us"
        );
        let worker = Cause {
            pid: Some(91),
            inside: Some("wb_workfn".to_owned()),
            woken_by: Some("IRQ 28 (nvme0q1)".to_owned()),
            ..cause(Kind::KernelWork, "kworker/1:2")
        };
        assert_eq!(
            words(&worker, below),
            "kworker/1:2 (91) kept the core inside the kernel for 312 us, in wb_workfn, woken by IRQ 28 (nvme0q1)"
        );
        assert!(sentence(&[], below).starts_with("no single cause"));
    }

    #[test]
    fn nothing_ran_names_the_hypervisor_the_firmware_or_neither() {
        let nothing = cause(Kind::NothingRan, "the idle core");
        let said = |virtual_machine, smi| words(&nothing, Below { virtual_machine, smi });
        assert!(said(true, None).contains("the hypervisor took the core") && said(true, None).contains("nothing ran"));
        assert!(
            said(false, Some(2)).contains("firmware took the core")
                && said(false, Some(2)).contains("2 system management")
        );
        assert!(said(false, Some(0)).starts_with("nothing ran for 312 us"));
        let thread = Cause {
            pid: Some(7),
            ..nothing.clone()
        };
        let below = Below {
            virtual_machine: true,
            smi: None,
        };
        assert!(words(&thread, below).ends_with("the hypervisor took it, or interrupts were off"));
    }
}
