//! Provenance of a measurement: kernel, processor, program, settings as read back, dependencies.

use crate::machine::{Machine, Throttle, core_list};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use stylet_hw::sim::hand::Hand;
use stylet_runtime::process::{LoopReport, Options, RunReport};
use stylet_shm_schema::{ParameterId, ParameterSet};

/// Commit of the sources, `unknown` if built without git.
pub const COMMIT: &str = env!("STYLET_COMMIT");

/// Compiler that built the program.
const TOOLCHAIN: &str = env!("STYLET_TOOLCHAIN");

/// A program of Stylet on this machine.
#[derive(Clone, Debug, Serialize, Deserialize)]
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

/// Returns the present time, as every report writes it.
pub fn now() -> String {
    jiff::Timestamp::now().strftime("%Y-%m-%d %H:%M:%S UTC").to_string()
}

/// Returns name and version of this program.
pub fn program() -> String {
    format!("rt-core {}", env!("CARGO_PKG_VERSION"))
}

/// One property of the machine or of the program, as reported by it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fact {
    pub group: String,
    pub name: String,
    pub value: String,
}

/// A real-time setting: the request, and the kernel's report.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Setting {
    pub name: String,
    pub asked: String,
    pub got: String,
    pub met: bool,
}

/// A foreign package of the programs, as locked; software of unknown provenance in the words of IEC 62304.
#[derive(Clone, Debug, Serialize)]
pub struct Package {
    pub name: &'static str,
    pub version: &'static str,
    /// Licence as declared by its author; `not known` if its sources were missing when this program was built.
    pub licence: &'static str,
    /// `rt-core`, `host-ui` or `both`.
    pub of: &'static str,
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

/// Returns all foreign packages of `rt-core` and `host-ui`.
pub fn packages() -> Vec<Package> {
    let read = |line: &'static str| {
        let mut words = line.splitn(4, ' ');
        let name = words.next()?;
        let known = ANOMALIES.iter().filter(|(of, _)| *of == name);
        Some(Package {
            name,
            version: words.next()?,
            of: words.next()?,
            licence: words.next()?,
            known_anomalies: known.map(|(_, what)| *what).collect(),
        })
    };
    let list = include_str!(concat!(env!("OUT_DIR"), "/packages.txt"));
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

/// Properties that the machine reports about itself; a serial number is readable with root's rights alone.
pub fn facts(machine: &Machine, options: &Options) -> Vec<Fact> {
    let text = |path: &str| machine.text(path);
    let dmi = |file: &str| text(&format!("sys/class/dmi/id/{file}"));
    let reported = |value: Option<String>| {
        value
            .filter(|v| !v.is_empty())
            .unwrap_or_else(|| "not reported".to_owned())
    };
    let hz = reported(machine.build_option("HZ"));
    let idle = ["driver", "governor"].map(|of| reported(text(&format!("sys/devices/system/cpu/cpuidle/current_{of}"))));
    let hypervisor = machine.hypervisor().unwrap_or_else(|| NO_HYPERVISOR.to_owned());
    let swaps = text("proc/swaps").map_or(0, |t| t.lines().count().saturating_sub(1));
    let memory =
        text("proc/meminfo").and_then(|t| Some(t.lines().next()?.trim_start_matches("MemTotal:").trim().to_owned()));
    let of_machine = [
        ("Program", "toolchain", Some(TOOLCHAIN.to_owned())),
        ("PC", "name", text("proc/sys/kernel/hostname")),
        ("PC", "maker", dmi("sys_vendor")),
        ("PC", "model", dmi("product_name")),
        ("PC", "serial number", dmi("product_serial")),
        ("PC", "board", dmi("board_name")),
        ("PC", "firmware maker", dmi("bios_vendor")),
        ("PC", "firmware date", dmi("bios_date")),
        ("Kernel", "version", text("proc/version")),
        ("Kernel", "preemption", Some(machine.preemption().name().to_owned())),
        ("Kernel", "command line", text("proc/cmdline")),
        ("Kernel", "real-time share", Some(share(machine))),
        ("Kernel", "real-time groups", machine.build_option("RT_GROUP_SCHED")),
        ("Kernel", "timer", Some(format!("CONFIG_HZ={hz}"))),
        ("Processor", "model", machine.cpuinfo(0, "model name")),
        ("Processor", "microcode", machine.cpuinfo(0, "microcode")),
        ("Processor", "cores online", Some(core_list(&machine.online_cores()))),
        ("Processor", "SMT", text("sys/devices/system/cpu/smt/control")),
        (
            "Processor",
            "isolated cores",
            Some(core_list(&machine.isolated_cores())),
        ),
        (
            "Processor",
            "tickless cores",
            Some(core_list(&machine.tickless_cores())),
        ),
        (
            "Processor",
            "idle driver",
            Some(format!("{}, governor {}", idle[0], idle[1])),
        ),
        ("Processor", "clock source", machine.clock_source()),
        ("Processor", "hypervisor", Some(hypervisor)),
        ("Processor", "firmware", dmi("bios_version")),
        ("Memory", "installed", memory),
        ("Memory", "swap areas", Some(swaps.to_string())),
        (
            "Memory",
            "huge pages",
            text("sys/kernel/mm/transparent_hugepage/enabled"),
        ),
    ];
    let fact = |group: &str, name: &str, value: String| Fact {
        group: group.to_owned(),
        name: name.to_owned(),
        value,
    };
    let of_machine = of_machine.map(|(group, name, value)| fact(group, name, reported(value)));
    let loops = [
        ("force loop", options.haptic_core),
        ("tissue step", options.tissue_core),
        (
            "second device's loop",
            options.second.as_ref().and_then(|second| second.core),
        ),
    ];
    let of_cores = loops
        .into_iter()
        .filter_map(|(role, core)| Some((role, core?)))
        .flat_map(|(role, core)| {
            let served = machine.interrupts_allowed_on(core);
            let served = list_or(served.iter().map(|(n, who)| format!("{n} {who}")), "none");
            [
                fact(
                    "Cores in use",
                    &format!("core of the {role}"),
                    core_facts(machine, core),
                ),
                fact("Cores in use", &format!("interrupts allowed on core {core}"), served),
            ]
        });
    of_machine.into_iter().chain(of_cores).collect()
}

fn list_or(all: impl Iterator<Item = String>, none: &str) -> String {
    let all: Vec<String> = all.collect();
    if all.is_empty() {
        none.to_owned()
    } else {
        all.join(", ")
    }
}

fn core_facts(machine: &Machine, core: usize) -> String {
    let governor = machine
        .governor(core)
        .unwrap_or_else(|| "no frequency scaling seen".to_owned());
    let states = machine.idle_states(core);
    let states = list_or(
        states.iter().map(|(name, us)| format!("{name} {us} us")),
        "not reported",
    );
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
        add(&format!("{name} {POLICY}"), wanted, got, met && asked == 1);
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
        MEMORY_LOCK,
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

/// Value of the fact `hypervisor` on a bare machine.
pub const NO_HYPERVISOR: &str = "none found";
/// End of the names of the settings of threads, and name of that of memory.
pub const POLICY: &str = "thread: policy and priority";
pub const MEMORY_LOCK: &str = "memory lock";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packages_are_those_of_the_lock_file_with_their_anomalies() {
        let all = packages();
        assert!(all.len() > 100, "{}", all.len());
        let of = |name: &str| {
            all.iter()
                .find(|p| p.name == name)
                .unwrap_or_else(|| panic!("no {name}"))
        };
        let iceoryx2 = of("iceoryx2");
        assert!(iceoryx2.known_anomalies.iter().any(|a| a.contains("2008")));
        assert_eq!((iceoryx2.of, iceoryx2.licence), ("both", "MIT OR Apache-2.0"));
        assert_eq!(of("egui").of, "host-ui");
        assert!(
            all.iter()
                .all(|p| !p.name.starts_with("stylet-") && p.name != "host-ui")
        );
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
}
