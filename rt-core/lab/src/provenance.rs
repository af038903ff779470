//! Provenance of a measurement: kernel, processor, program, settings as read back, dependencies.

use crate::machine::{Machine, Throttle, core_list};
use serde::Serialize;
use sha2::{Digest, Sha256};
use stylet_hw::sim::hand::Hand;
use stylet_runtime::process::{LoopReport, Options, RunReport};
use stylet_shm_schema::{ParameterId, ParameterSet};

/// Commit of the sources, `unknown` if built without git.
pub const COMMIT: &str = env!("STYLET_COMMIT");

/// Compiler that built the program.
const TOOLCHAIN: &str = env!("STYLET_TOOLCHAIN");

/// A program of Stylet on this machine.
#[derive(Clone, Debug, Serialize)]
pub struct ProgramDigest {
    pub name: String,
    pub sha256: String,
}

/// Returns the digests of this program, and of those of the simulator in the same folder.
pub fn programs() -> Vec<ProgramDigest> {
    let Ok(own) = std::env::current_exe() else {
        return Vec::new();
    };
    let all = [
        own.clone(),
        own.with_file_name("rt-core"),
        own.with_file_name("host-ui"),
    ];
    let digest = |path: &std::path::PathBuf| {
        let bytes = std::fs::read(path).ok()?;
        Some(ProgramDigest {
            name: path.file_name()?.to_string_lossy().into_owned(),
            sha256: sha256(&bytes),
        })
    };
    all.iter().filter_map(digest).collect()
}

/// Returns SHA-256 of `bytes` as 64 lower-case hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// One property of the machine or of the program, as reported by it.
#[derive(Clone, Debug, Serialize)]
pub struct Fact {
    pub group: &'static str,
    pub name: String,
    pub value: String,
}

/// A real-time setting: the request, and the kernel's report.
#[derive(Clone, Debug, Serialize)]
pub struct Setting {
    pub name: String,
    pub asked: String,
    pub got: String,
    pub met: bool,
}

/// A package that `rt-core` is built from, as locked.
#[derive(Clone, Debug, Serialize)]
pub struct Dependency {
    pub name: String,
    pub version: String,
    pub known_anomalies: Vec<&'static str>,
}

/// Known anomalies of dependencies, with the reason why they do not matter here.
const ANOMALIES: &[(&str, &str)] = &[
    (
        "iceoryx2",
        "A blackboard entry whose writer was killed cannot be taken again (issue 2008): each run has a board with a name of its own.",
    ),
    (
        "iceoryx2",
        "send() and receive() connect and disconnect peers inside the caller, up to milliseconds: no such port is in a real-time thread.",
    ),
    (
        "iceoryx2",
        "0.10.0 allocates once for each loan and frees once for each send: loans are made ahead by the bridge thread.",
    ),
    (
        "iceoryx2",
        "Dead nodes are noticed only when somebody looks: the bridge cleans up once a second.",
    ),
];

/// Returns the known anomalies of a package.
pub fn known_anomalies(package: &str) -> Vec<&'static str> {
    let known = ANOMALIES.iter().filter(|(of, _)| *of == package);
    known.map(|(_, what)| *what).collect()
}

pub fn dependencies() -> Vec<Dependency> {
    let list = include_str!(concat!(env!("OUT_DIR"), "/dependencies.txt"));
    let read = |line: &str| {
        let (name, version) = line.split_once(' ')?;
        Some(Dependency {
            name: name.to_owned(),
            version: version.to_owned(),
            known_anomalies: known_anomalies(name),
        })
    };
    list.lines().filter_map(read).collect()
}

/// Returns the damping of the hand and of the force law that the stiffness margin assumes, N s/m.
pub fn dampings_n_s_per_m() -> (f64, f64) {
    let law = ParameterSet::default().get(ParameterId::Damping);
    (Hand::passive().damping_n_s_per_m, law)
}

/// Returns K_max = (b + B) / (T/2 + t_d), the linear stability rule for a sampled wall with delay (Gil, Hulin).
///
/// b: damping of a hand in the middle of the envelope; B: damping of the force law; t_d: due time to force written.
/// The rule is for a constant delay; with jitter the value at a percentile is that of a loop which is always so late.
pub fn stiffness_margin_n_per_m(period_ns: u64, delay_ns: f64) -> f64 {
    let (hand, law) = dampings_n_s_per_m();
    (hand + law) / ((period_ns as f64 / 2.0 + delay_ns) * 1e-9)
}

fn or_not_reported(value: Option<String>) -> String {
    value
        .filter(|v| !v.is_empty())
        .unwrap_or_else(|| "not reported".to_owned())
}

/// Fields that the firmware reports about the PC; a serial number is readable with root's rights alone.
const DMI: [(&str, &str); 6] = [
    ("maker", "sys_vendor"),
    ("model", "product_name"),
    ("serial number", "product_serial"),
    ("board", "board_name"),
    ("firmware maker", "bios_vendor"),
    ("firmware date", "bios_date"),
];

/// Properties that the machine reports about itself.
pub fn facts(machine: &Machine, options: &Options) -> Vec<Fact> {
    let mut facts = Vec::new();
    let mut add = |group, name: &str, value: String| {
        facts.push(Fact {
            group,
            name: name.to_owned(),
            value,
        });
    };
    let text = |path: &str| or_not_reported(machine.text(path));
    add("Program", "toolchain", TOOLCHAIN.to_owned());
    add("PC", "name", text("proc/sys/kernel/hostname"));
    for (what, file) in DMI {
        add("PC", what, text(&format!("sys/class/dmi/id/{file}")));
    }
    add("Kernel", "version", text("proc/version"));
    add("Kernel", "preemption", machine.preemption().name().to_owned());
    add("Kernel", "command line", text("proc/cmdline"));
    add("Kernel", "real-time share", share(machine));
    add(
        "Kernel",
        "real-time groups",
        or_not_reported(machine.build_option("RT_GROUP_SCHED")),
    );
    add(
        "Kernel",
        "timer",
        format!("CONFIG_HZ={}", or_not_reported(machine.build_option("HZ"))),
    );
    let cpu = |key| or_not_reported(machine.cpuinfo(0, key));
    add("Processor", "model", cpu("model name"));
    add("Processor", "microcode", cpu("microcode"));
    add("Processor", "cores online", core_list(&machine.online_cores()));
    add("Processor", "SMT", text("sys/devices/system/cpu/smt/control"));
    add("Processor", "isolated cores", core_list(&machine.isolated_cores()));
    add("Processor", "tickless cores", core_list(&machine.tickless_cores()));
    let governor = text("sys/devices/system/cpu/cpuidle/current_governor");
    let driver = text("sys/devices/system/cpu/cpuidle/current_driver");
    add("Processor", "idle driver", format!("{driver}, governor {governor}"));
    add("Processor", "clock source", or_not_reported(machine.clock_source()));
    let hypervisor = machine.hypervisor().unwrap_or_else(|| "none found".to_owned());
    add("Processor", "hypervisor", hypervisor);
    add("Processor", "firmware", text("sys/class/dmi/id/bios_version"));
    for (role, core) in [
        ("force loop", options.haptic_core),
        ("tissue step", options.tissue_core),
        (
            "second device's loop",
            options.second.as_ref().and_then(|second| second.core),
        ),
    ] {
        let Some(core) = core else { continue };
        add(
            "Cores in use",
            &format!("core of the {role}"),
            core_facts(machine, core),
        );
        let served = machine.interrupts_allowed_on(core);
        let said: Vec<String> = served.iter().map(|(n, who)| format!("{n} {who}")).collect();
        let said = if said.is_empty() {
            "none".to_owned()
        } else {
            said.join(", ")
        };
        add("Cores in use", &format!("interrupts allowed on core {core}"), said);
    }
    let total = machine
        .text("proc/meminfo")
        .and_then(|t| t.lines().next().map(str::to_owned));
    add(
        "Memory",
        "installed",
        or_not_reported(total.map(|l| l.trim_start_matches("MemTotal:").trim().to_owned())),
    );
    let swaps = machine
        .text("proc/swaps")
        .map_or(0, |t| t.lines().count().saturating_sub(1));
    add("Memory", "swap areas", swaps.to_string());
    add(
        "Memory",
        "huge pages",
        text("sys/kernel/mm/transparent_hugepage/enabled"),
    );
    facts
}

fn core_facts(machine: &Machine, core: usize) -> String {
    let governor = machine
        .governor(core)
        .unwrap_or_else(|| "no frequency scaling seen".to_owned());
    let states = machine.idle_states(core);
    let states: Vec<String> = states.iter().map(|(name, us)| format!("{name} {us} us")).collect();
    let states = if states.is_empty() {
        "not reported".to_owned()
    } else {
        states.join(", ")
    };
    let siblings = core_list(&machine.siblings(core));
    format!("{core}; governor: {governor}; sleep states: {states}; SMT siblings: {siblings}")
}

fn share(machine: &Machine) -> String {
    match machine.throttle() {
        None => "not reported".to_owned(),
        Some(Throttle::Off) => "all of the time (throttling off)".to_owned(),
        Some(Throttle::Share(share)) => format!("{:.0} % of the time, then throttled", share * 100.0),
    }
}

fn policy_name(policy: u32) -> &'static str {
    match policy {
        0 => "SCHED_OTHER",
        1 => "SCHED_FIFO",
        2 => "SCHED_RR",
        6 => "SCHED_DEADLINE",
        _ => "another policy",
    }
}

/// Returns every real-time setting, requested and granted.
pub fn settings(machine: &Machine, options: &Options, run: &RunReport) -> Vec<Setting> {
    let mut settings = Vec::new();
    let mut add = |name: &str, asked: String, got: String, met: bool| {
        settings.push(Setting {
            name: name.to_owned(),
            asked,
            got,
            met,
        });
    };
    let mut thread = |name: &str, report: &LoopReport| {
        let t = &report.thread;
        let asked = if t.asked_priority > 0 { 1 } else { 0 };
        let scheduling = |policy, priority| format!("{} {priority}", policy_name(policy));
        let met = (t.policy, t.priority) == (asked, t.asked_priority);
        let (wanted, got) = (scheduling(asked, t.asked_priority), scheduling(t.policy, t.priority));
        add(
            &format!("{name} thread: policy and priority"),
            wanted,
            got,
            met && asked == 1,
        );
        let core = |c: u32| if c == u32::MAX { "any".to_owned() } else { c.to_string() };
        add(
            &format!("{name} thread: core"),
            core(t.asked_core),
            core(t.core),
            t.asked_core == t.core,
        );
    };
    thread("haptic", &run.haptic);
    thread("tissue", &run.tissue);
    if let Some(second) = &run.second {
        thread("second", second);
    }
    let status = machine.text("proc/self/status").unwrap_or_default();
    let locked = status
        .lines()
        .find_map(|l| l.strip_prefix("VmLck:"))
        .unwrap_or("not reported")
        .trim();
    add(
        "memory lock",
        "all pages, present and future".to_owned(),
        format!("{locked} locked"),
        run.memory_locked,
    );
    let awake = match run.exit_latency_us {
        Some(us) => format!("{us} us"),
        None => "not granted".to_owned(),
    };
    add(
        "core wake-up (/dev/cpu_dma_latency)",
        "0 us".to_owned(),
        awake,
        run.exit_latency_us == Some(0),
    );
    for (name, ns) in [
        ("early wake-up before the deadline", options.wait.early_ns),
        ("spin before the deadline", options.wait.spin_ns),
    ] {
        let us = format!("{} us", ns / 1_000);
        add(name, us.clone(), us, true);
    }
    settings
}

/// Returns why the tail of a measurement reflects this environment rather than the program; empty if it does not.
pub fn unqualified(machine: &Machine, run: &RunReport) -> Vec<String> {
    let mut reasons = Vec::new();
    if let Some(name) = machine.hypervisor() {
        reasons.push(format!("virtual machine ({name})"));
    }
    let loops = [&run.haptic, &run.tissue].into_iter().chain(&run.second);
    if !loops.into_iter().all(|report| report.thread.is_fifo()) {
        reasons.push("the loops ran without SCHED_FIFO".to_owned());
    }
    if !run.memory_locked {
        reasons.push("memory was not locked".to_owned());
    }
    reasons
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dependencies_are_those_of_the_lock_file_with_their_anomalies() {
        let all = dependencies();
        let iceoryx2 = all
            .iter()
            .find(|d| d.name == "iceoryx2")
            .expect("rt-core is built on it");
        assert!(iceoryx2.known_anomalies.iter().any(|a| a.contains("2008")));
        assert!(
            all.iter()
                .any(|d| d.name == "stylet-hw" && d.version == env!("CARGO_PKG_VERSION"))
        );
        assert!(all.iter().all(|d| d.name != "host-ui" && d.name != "egui"));
        let lock = include_str!("../../../Cargo.lock");
        assert!(lock.contains(&format!("name = \"iceoryx2\"\nversion = \"{}\"", iceoryx2.version)));
    }

    #[test]
    fn delay_costs_stiffness_as_the_rule_says() {
        let (b, law) = dampings_n_s_per_m();
        let none = stiffness_margin_n_per_m(1_000_000, 0.0);
        assert!((none - 2.0 * (b + law) / 1e-3).abs() < 1e-6);
        // Ten half periods of delay leave an eleventh.
        let late = stiffness_margin_n_per_m(1_000_000, 5e6);
        assert!((none / late - 11.0).abs() < 1e-9);
    }

    #[test]
    fn lack_of_real_time_rights_disqualifies_the_tail() {
        let bare = Machine::at("/nowhere");
        let run = RunReport::default();
        assert_eq!(unqualified(&bare, &run).len(), 2);
    }
}
