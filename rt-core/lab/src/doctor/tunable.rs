//! Kernel settings that are files: present value, wanted value, and the cost to the loop otherwise.

use super::{Finding, FindingLevel};
use crate::machine::{Machine, Throttle, core_list, cores};

/// A setting that can be changed while the PC runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tunable {
    /// The check that examines it.
    pub check: &'static str,
    /// Path without the leading slash.
    pub path: String,
    pub now: String,
    pub wanted: String,
}

impl Tunable {
    pub fn is_met(&self) -> bool {
        self.now == self.wanted
    }
}

/// Returns the value in force: for `a [b] c` the word in brackets.
pub fn value(machine: &Machine, path: &str) -> Option<String> {
    let text = machine.text(path)?;
    let chosen = text
        .split_once('[')
        .and_then(|(_, rest)| Some(rest.split_once(']')?.0.to_owned()));
    Some(chosen.unwrap_or(text))
}

const CPU: &str = "sys/devices/system/cpu";
/// Exit latency, in microseconds, above which a sleep state shows in the wake-up latency.
pub const DEEP_US: u64 = 20;
/// Seconds between two updates of the memory statistics; the default of 1 wakes a worker on every core each second.
const STAT_INTERVAL: &str = "120";

/// A setting with one wanted value, and its check.
struct Quiet {
    check: &'static str,
    /// With a `*` in place of the number of a core, if each core has its own.
    path: &'static str,
    wanted: &'static str,
    level: FindingLevel,
    good: &'static str,
    bad: &'static str,
}

const QUIET: [Quiet; 8] = [
    Quiet {
        check: "NMI watchdog",
        path: "proc/sys/kernel/nmi_watchdog",
        wanted: "0",
        level: FindingLevel::Warning,
        good: "the watchdog of hard lock-ups is off",
        bad: "the watchdog of hard lock-ups interrupts every core, even one whose interrupts are off",
    },
    Quiet {
        check: "NUMA balancing",
        path: "proc/sys/kernel/numa_balancing",
        wanted: "0",
        level: FindingLevel::Warning,
        good: "the kernel leaves pages where they are",
        bad: "the kernel unmaps pages to see who uses them: a loop then faults on memory that is locked",
    },
    Quiet {
        check: "timer migration",
        path: "proc/sys/kernel/timer_migration",
        wanted: "0",
        level: FindingLevel::Note,
        good: "timers stay on the core that set them",
        bad: "timers of idle cores move to busy ones, such as the core of the loop",
    },
    Quiet {
        check: "statistics",
        path: "proc/sys/vm/stat_interval",
        wanted: STAT_INTERVAL,
        level: FindingLevel::Note,
        good: "memory statistics are seldom updated",
        bad: "a worker updates memory statistics on every core each few seconds",
    },
    Quiet {
        check: "PCIe power",
        path: "sys/module/pcie_aspm/parameters/policy",
        wanted: "performance",
        level: FindingLevel::Note,
        good: "PCIe links stay awake (ASPM performance)",
        bad: "PCIe links may sleep (ASPM): a FireWire or USB device on them answers later",
    },
    Quiet {
        check: "governor",
        path: "sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
        wanted: "performance",
        level: FindingLevel::Warning,
        good: "the core of the loop runs at full speed (performance)",
        bad: "the core of the loop changes its speed",
    },
    Quiet {
        check: "EPP",
        path: "sys/devices/system/cpu/cpu*/cpufreq/energy_performance_preference",
        wanted: "performance",
        level: FindingLevel::Warning,
        good: "the core of the loop prefers speed to energy",
        bad: "the core of the loop weighs energy against speed",
    },
    Quiet {
        check: "huge pages",
        path: "sys/kernel/mm/transparent_hugepage/enabled",
        wanted: "madvise",
        level: FindingLevel::Note,
        good: "pages are joined only where a program asks for it",
        bad: "the kernel joins pages into huge ones by itself, and stops threads for it",
    },
];

/// Returns check and wanted value of a setting of the table.
pub fn quiet(path: &str) -> Option<(&'static str, &'static str)> {
    let is_its_path = |q: &&Quiet| match q.path.split_once('*') {
        None => q.path == path,
        Some((begin, end)) => {
            let core = path.strip_prefix(begin).and_then(|rest| rest.strip_suffix(end));
            core.is_some_and(|core| (1..=10).contains(&core.len()) && core.bytes().all(|b| b.is_ascii_digit()))
        }
    };
    let found = QUIET.iter().find(is_its_path)?;
    Some((found.check, found.wanted))
}

/// Returns the findings on the settings of the table, for the loop's core.
pub fn findings(machine: &Machine, core: usize) -> Vec<Finding> {
    let finding = |q: &Quiet| match value(machine, &q.path.replace('*', &core.to_string())) {
        None => Finding::good(q.check, "this kernel has no such setting"),
        Some(now) if met(q, &now) => Finding::good(q.check, q.good),
        Some(now) => Finding::new(
            q.check,
            q.level,
            format!("{} ({now})", q.bad),
            format!("echo {} | sudo tee /{}", q.wanted, q.path),
        ),
    };
    QUIET.iter().map(finding).collect()
}

/// True if a value is the wanted one, or a better one.
fn met(q: &Quiet, now: &str) -> bool {
    match q.check {
        "statistics" => now.parse::<u64>().is_ok_and(|now| now >= 120),
        "huge pages" => now != "always",
        _ => now == q.wanted,
    }
}

/// Returns every setting of this PC that `rt-core doctor --apply` may change, met or not, in the order of its change.
pub fn all(machine: &Machine, core: usize) -> Vec<Tunable> {
    let mut all = Vec::new();
    let mut add = |check: &'static str, path: String, wanted: &str| {
        if let Some(now) = value(machine, &path) {
            all.push(Tunable {
                check,
                path,
                now,
                wanted: wanted.to_owned(),
            });
        }
    };
    for q in &QUIET {
        let cores: Vec<usize> = if q.path.contains('*') {
            machine.online_cores().into_iter().collect()
        } else {
            vec![core]
        };
        for core in cores {
            let path = q.path.replace('*', &core.to_string());
            // A value better than wanted stays.
            let now = value(machine, &path).filter(|now| met(q, now));
            add(q.check, path, now.as_deref().unwrap_or(q.wanted));
        }
    }
    for state in machine.names(&format!("{CPU}/cpu{core}/cpuidle")) {
        let folder = format!("{CPU}/cpu{core}/cpuidle/{state}");
        let us = machine
            .text(&format!("{folder}/latency"))
            .and_then(|t| t.parse::<u64>().ok());
        if us.is_some_and(|us| us > DEEP_US) {
            add("sleep states", format!("{folder}/disable"), "1");
        }
    }
    if matches!(machine.throttle(), Some(Throttle::Share(share)) if share < 0.9) {
        add("throttling", "proc/sys/kernel/sched_rt_runtime_us".to_owned(), "950000");
    }
    let mut elsewhere = machine.online_cores();
    elsewhere.remove(&core);
    if !elsewhere.is_empty() {
        for (number, _) in machine.interrupts_allowed_on(core) {
            let path = format!("proc/irq/{number}/smp_affinity_list");
            let mut wanted = cores(&machine.text(&path).unwrap_or_default());
            wanted.remove(&core);
            let wanted = if wanted.is_empty() { &elsewhere } else { &wanted };
            add("interrupts", path, &core_list(wanted));
        }
    }
    all
}

/// Examines turbo: fast, but its speed depends on heat and on other cores.
pub fn turbo(machine: &Machine) -> Finding {
    let off = "p50 is best with it, the same times again and again are had without it:";
    let no_turbo = machine.text(&format!("{CPU}/intel_pstate/no_turbo"));
    let boost = machine.text(&format!("{CPU}/cpufreq/boost"));
    let off_by = match (no_turbo.as_deref(), boost.as_deref()) {
        (None, None) => return Finding::good("turbo", "the kernel shows no turbo"),
        (Some("1"), _) | (None, Some("0")) => {
            return Finding::good("turbo", "turbo is off: the speed does not depend on the heat");
        }
        (Some(_), _) => format!("echo 1 | sudo tee /{CPU}/intel_pstate/no_turbo"),
        (None, Some(_)) => format!("echo 0 | sudo tee /{CPU}/cpufreq/boost"),
    };
    let what = "turbo is on: the speed changes with heat and with other cores";
    Finding::note("turbo", what, format!("{off} {off_by}"))
}

/// Profiles of tuned that do not save energy.
const FAST: [&str; 6] = [
    "realtime",
    "realtime-virtual-host",
    "realtime-virtual-guest",
    "cpu-partitioning",
    "latency-performance",
    "network-latency",
];

/// Returns a daemon that makes the same settings by a profile.
pub fn tuned(machine: &Machine) -> Finding {
    let profile = machine.text("etc/tuned/active_profile").unwrap_or_default();
    let fast = profile.split_whitespace().any(|p| FAST.contains(&p));
    if !machine.runs("tuned") {
        return Finding::good("tuned", "tuned does not run: no profile changes these settings");
    }
    if fast {
        return Finding::good("tuned", format!("the profile of tuned is {profile}"));
    }
    Finding::warning(
        "tuned",
        format!("tuned sets this PC by its profile {profile:?}, which is not one for low latency"),
        "sudo tuned-adm profile realtime   (package tuned-profiles-realtime; else latency-performance)",
    )
}
