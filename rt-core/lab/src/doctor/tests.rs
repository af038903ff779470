//! Every line of the doctor, on a healthy machine and on a faulty one.

use super::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

/// A machine made of files; removed when dropped.
pub(super) struct Fake(PathBuf);

impl Fake {
    pub(super) fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let root = std::env::temp_dir().join(format!("stylet-doctor-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&root).expect("the temporary folder can be written");
        Self(root)
    }

    pub(super) fn with(self, path: &str, text: &str) -> Self {
        let path = self.0.join(path);
        std::fs::create_dir_all(path.parent().expect("below the root")).expect("made");
        std::fs::write(path, text).expect("written");
        self
    }

    pub(super) fn see(&self, check: impl Fn(&Machine) -> Finding) -> Finding {
        check(&Machine::at(&self.0))
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

const CPUINFO: &str =
    "processor\t: 0\nmodel name\t: X\nflags\t\t: fpu tsc sse2\n\nprocessor\t: 1\nflags\t\t: fpu tsc sse2\n";
const CLOCKS: &str = "sys/devices/system/clocksource/clocksource0/available_clocksource";
const CLOCK: &str = "sys/devices/system/clocksource/clocksource0/current_clocksource";
const RELEASE: &str = "proc/sys/kernel/osrelease";

/// Expects a level, and a cure exactly if there is something to do.
#[track_caller]
pub(super) fn expect(finding: &Finding, severity: FindingLevel, says: &str) {
    assert_eq!(finding.severity, severity, "{finding:?}");
    assert!(finding.what.contains(says), "{finding:?}");
    if severity >= FindingLevel::Warning {
        assert!(!finding.cure.is_empty(), "no cure: {finding:?}");
    }
    if severity == FindingLevel::Good {
        assert!(finding.cure.is_empty(), "a cure for what is well: {finding:?}");
    }
}

#[test]
fn hypervisor_is_known_by_flag_vendor_or_kernel_and_bare_metal_is_bare() {
    let bare = Fake::new().with("proc/cpuinfo", CPUINFO);
    expect(&bare.see(kernel::hypervisor), FindingLevel::Good, "bare metal");
    let flagged = CPUINFO.replace("sse2", "sse2 hypervisor");
    let kvm = Fake::new()
        .with("proc/cpuinfo", &flagged)
        .with(CLOCKS, "tsc kvm-clock\n");
    expect(&kvm.see(kernel::hypervisor), FindingLevel::Blocker, "KVM");
    let unknown = Fake::new().with("proc/cpuinfo", &flagged);
    expect(&unknown.see(kernel::hypervisor), FindingLevel::Blocker, "unknown make");
    let xen = Fake::new().with("sys/hypervisor/type", "xen\n");
    expect(&xen.see(kernel::hypervisor), FindingLevel::Blocker, "xen");
    let vendor = Fake::new()
        .with("sys/class/dmi/id/sys_vendor", "VMware, Inc.\n")
        .with("sys/class/dmi/id/product_name", "VMware7,1\n");
    expect(&vendor.see(kernel::hypervisor), FindingLevel::Blocker, "VMware");
    let laptop = Fake::new()
        .with("sys/class/dmi/id/sys_vendor", "Microsoft Corporation\n")
        .with("sys/class/dmi/id/product_name", "Surface Laptop\n");
    expect(&laptop.see(kernel::hypervisor), FindingLevel::Good, "bare metal");
    // A host that can run guests names kvm-clock nowhere, and lacks the flag.
    let host = Fake::new()
        .with("proc/cpuinfo", CPUINFO)
        .with(CLOCKS, "tsc hpet acpi_pm\n");
    expect(&host.see(kernel::hypervisor), FindingLevel::Good, "bare metal");
}

#[test]
fn preemption_model_is_read_where_the_kernel_reports_it() {
    let version = |words: &str| format!("Linux version 6.12 (x@y) #1 SMP {words} @0\n");
    let real = Fake::new().with("sys/kernel/realtime", "1\n");
    expect(&real.see(kernel::preemption), FindingLevel::Good, "PREEMPT_RT");
    let named = Fake::new().with("proc/version", &version("PREEMPT_RT"));
    expect(&named.see(kernel::preemption), FindingLevel::Good, "PREEMPT_RT");
    // The debug file takes precedence over the build options.
    let running = Fake::new()
        .with("proc/version", &version("PREEMPT_DYNAMIC"))
        .with(RELEASE, "6.12-x\n")
        .with("boot/config-6.12-x", "CONFIG_PREEMPT_NONE=y\n")
        .with("sys/kernel/debug/sched/preempt", "none voluntary (full) lazy\n");
    expect(&running.see(kernel::preemption), FindingLevel::Warning, "full");
    let built = Fake::new()
        .with("proc/version", &version("PREEMPT_DYNAMIC"))
        .with(RELEASE, "6.12-x\n")
        .with(
            "boot/config-6.12-x",
            "# CONFIG_PREEMPT is not set\nCONFIG_PREEMPT_NONE=y\n",
        );
    let finding = built.see(kernel::preemption);
    expect(&finding, FindingLevel::Warning, "PREEMPT_NONE");
    assert!(finding.cure.contains("linux-image-rt-amd64") && finding.cure.contains("echo full"));
    let asked = Fake::new()
        .with("proc/version", &version("PREEMPT_DYNAMIC"))
        .with("proc/cmdline", "quiet preempt=voluntary\n");
    expect(&asked.see(kernel::preemption), FindingLevel::Warning, "voluntary");
    let silent = Fake::new().with("proc/version", &version(""));
    let finding = silent.see(kernel::preemption);
    expect(&finding, FindingLevel::Warning, "not reported");
    assert!(
        !finding.cure.contains("echo full"),
        "a kernel that cannot be switched: {}",
        finding.cure
    );
}

#[test]
fn throttling_is_well_near_the_default_only() {
    let with = |runtime: &str| {
        Fake::new()
            .with("proc/sys/kernel/sched_rt_runtime_us", runtime)
            .with("proc/sys/kernel/sched_rt_period_us", "1000000\n")
    };
    expect(&with("950000\n").see(kernel::throttling), FindingLevel::Good, "95 %");
    expect(&with("300000\n").see(kernel::throttling), FindingLevel::Warning, "30 %");
    expect(&with("-1\n").see(kernel::throttling), FindingLevel::Note, "off");
    expect(
        &Fake::new().see(kernel::throttling),
        FindingLevel::Note,
        "does not report",
    );
}

#[test]
fn control_group_without_a_share_blocks_real_time() {
    let grouped = |share: &str| {
        Fake::new()
            .with(RELEASE, "6.12-x\n")
            .with("boot/config-6.12-x", "CONFIG_RT_GROUP_SCHED=y\n")
            .with("proc/self/cgroup", "4:memory:/\n3:cpu,cpuacct:/user.slice\n")
            .with("sys/fs/cgroup/cpu/user.slice/cpu.rt_runtime_us", share)
    };
    expect(&grouped("0\n").see(kernel::groups), FindingLevel::Blocker, "no share");
    expect(
        &grouped("950000\n").see(kernel::groups),
        FindingLevel::Good,
        "950000 us",
    );
    let plain = Fake::new()
        .with(RELEASE, "6.12-x\n")
        .with("boot/config-6.12-x", "CONFIG_SMP=y\n");
    expect(&plain.see(kernel::groups), FindingLevel::Good, "no share of its own");
    let unified = grouped("0\n").with("proc/self/cgroup", "0::/user.slice\n");
    expect(&unified.see(kernel::groups), FindingLevel::Good, "no control group");
}

#[test]
fn slow_time_source_is_named() {
    expect(
        &Fake::new().with(CLOCK, "tsc\n").see(kernel::time_source),
        FindingLevel::Good,
        "tsc",
    );
    expect(
        &Fake::new().with(CLOCK, "hpet\n").see(kernel::time_source),
        FindingLevel::Warning,
        "hpet",
    );
    expect(
        &Fake::new().see(kernel::time_source),
        FindingLevel::Note,
        "does not report",
    );
}

/// Returns `/proc/self/limits` with these values.
fn limits(priority: &str, lock: &str) -> String {
    format!(
        "Limit                     Soft Limit           Hard Limit           Units     \n\
         Max locked memory         {lock:<20} {lock:<20} bytes     \n\
         Max realtime priority     {priority:<20} {priority:<20}           \n"
    )
}

fn user(priority: &str, lock: &str, capabilities: &str) -> Fake {
    Fake::new()
        .with("proc/self/limits", &limits(priority, lock))
        .with("proc/self/status", &format!("Name:\tx\nCapEff:\t{capabilities}\n"))
}

#[test]
fn priority_comes_from_the_limit_or_the_capability() {
    let none = "0000000000000000";
    let finding = user("0", "8388608", none).see(rights::priority);
    expect(&finding, FindingLevel::Blocker, "up to 0");
    assert!(finding.cure.contains("limits.d/stylet.conf") && finding.cure.contains("setcap"));
    expect(
        &user("79", "8388608", none).see(rights::priority),
        FindingLevel::Blocker,
        "up to 79",
    );
    expect(
        &user("90", "8388608", none).see(rights::priority),
        FindingLevel::Good,
        "up to 90",
    );
    // Bit 23 alone.
    expect(
        &user("0", "0", "0000000000800000").see(rights::priority),
        FindingLevel::Good,
        "CAP_SYS_NICE",
    );
}

#[test]
fn memory_lock_comes_from_the_limit_or_the_capability() {
    let none = "0000000000000000";
    expect(
        &user("90", "8388608", none).see(rights::memory_lock),
        FindingLevel::Blocker,
        "only 8 MiB",
    );
    expect(
        &user("90", "unlimited", none).see(rights::memory_lock),
        FindingLevel::Good,
        "all memory",
    );
    expect(
        &user("90", "1073741824", none).see(rights::memory_lock),
        FindingLevel::Good,
        "1024 MiB",
    );
    // Bit 14 alone.
    expect(
        &user("0", "0", "0000000000004000").see(rights::memory_lock),
        FindingLevel::Good,
        "CAP_IPC_LOCK",
    );
}

#[test]
fn one_core_is_too_few() {
    let with = |list: &str| Fake::new().with("sys/devices/system/cpu/online", list);
    expect(&with("0\n").see(cores::count), FindingLevel::Blocker, "one core");
    expect(&with("0-1\n").see(cores::count), FindingLevel::Note, "2 cores");
    expect(&with("0-3,8-11\n").see(cores::count), FindingLevel::Good, "8 cores");
    expect(&Fake::new().see(cores::count), FindingLevel::Note, "does not report");
}

#[test]
fn isolation_names_the_core_and_the_boot_options() {
    let open = Fake::new().with("sys/devices/system/cpu/isolated", "\n");
    let finding = open.see(|m| cores::isolation(m, 3));
    expect(&finding, FindingLevel::Warning, "core 3 is open");
    assert!(finding.cure.contains("isolcpus=managed_irq,domain,3 nohz_full=3"));
    let isolated = Fake::new()
        .with("sys/devices/system/cpu/isolated", "2-3\n")
        .with("sys/devices/system/cpu/nohz_full", "3\n");
    expect(
        &isolated.see(|m| cores::isolation(m, 3)),
        FindingLevel::Good,
        "without a periodic tick",
    );
    let ticking = isolated.see(|m| cores::isolation(m, 2));
    expect(&ticking, FindingLevel::Good, "core 2");
    assert!(!ticking.what.contains("periodic"));
}

#[test]
fn interrupts_on_our_core_are_named_and_irqbalance_is_seen() {
    let table = "           CPU0       CPU1\n 24:          1          0  IO-APIC   5-edge      acpi\n 25:          0          1  PCI-MSI   6-edge      eth0\n";
    let machine = || {
        Fake::new()
            .with("proc/interrupts", table)
            .with("sys/devices/system/cpu/online", "0-1\n")
            .with("proc/irq/24/smp_affinity_list", "0\n")
            .with("proc/irq/25/smp_affinity_list", "0-1\n")
    };
    let finding = machine().see(|m| cores::interrupts(m, 1));
    expect(&finding, FindingLevel::Warning, "25 eth0");
    assert!(
        !finding.what.contains("acpi") && finding.cure.contains("echo 0 "),
        "{finding:?}"
    );
    // The effective affinity takes precedence over the permitted one.
    let moved = machine().with("proc/irq/25/effective_affinity_list", "0\n");
    expect(
        &moved.see(|m| cores::interrupts(m, 1)),
        FindingLevel::Good,
        "no device interrupt",
    );
    let balanced = machine()
        .with("proc/irq/25/effective_affinity_list", "0\n")
        .with("proc/812/comm", "irqbalance\n");
    let finding = balanced.see(|m| cores::interrupts(m, 1));
    expect(&finding, FindingLevel::Warning, "irqbalance");
    assert!(finding.cure.contains("disable --now irqbalance"));
}

#[test]
fn sibling_threads_are_named() {
    let path = "sys/devices/system/cpu/cpu1/topology/thread_siblings_list";
    let alone = Fake::new().with(path, "1\n");
    expect(&alone.see(|m| cores::siblings(m, 1)), FindingLevel::Good, "no other");
    let shared = Fake::new().with(path, "1,5\n");
    expect(&shared.see(|m| cores::siblings(m, 1)), FindingLevel::Warning, "with 5");
}

#[test]
fn deep_sleep_states_matter_where_nothing_forbids_them() {
    let state = |fake: Fake, number: u32, name: &str, us: &str, disable: &str| {
        let folder = format!("sys/devices/system/cpu/cpu1/cpuidle/state{number}");
        fake.with(&format!("{folder}/name"), name)
            .with(&format!("{folder}/latency"), us)
            .with(&format!("{folder}/disable"), disable)
    };
    let deep = || state(state(Fake::new(), 0, "POLL\n", "0\n", "0\n"), 1, "C6\n", "133\n", "0\n");
    let see = |fake: Fake| fake.see(|m| cores::sleep_states(m, 1));
    expect(&see(deep()), FindingLevel::Warning, "C6 133 us");
    let forbidden = see(deep().with("dev/cpu_dma_latency", ""));
    expect(&forbidden, FindingLevel::Note, "rt-core forbids it");
    assert!(!forbidden.what.contains("POLL"));
    let off = state(Fake::new().with("dev/cpu_dma_latency", ""), 1, "C6\n", "133\n", "1\n");
    expect(&see(off), FindingLevel::Good, "no deep sleep state");
    expect(
        &see(Fake::new()),
        FindingLevel::Note,
        "there is no /dev/cpu_dma_latency",
    );
}

#[test]
fn swap_areas_are_named() {
    let head = "Filename\t\t\t\tType\t\tSize\t\tUsed\t\tPriority\n";
    expect(
        &Fake::new().with("proc/swaps", head).see(shared::swap),
        FindingLevel::Good,
        "no swap",
    );
    let on = Fake::new().with("proc/swaps", &format!("{head}/dev/sda3  partition\t8388604\t0\t-2\n"));
    let finding = on.see(shared::swap);
    expect(&finding, FindingLevel::Note, "/dev/sda3");
    assert!(finding.cure.contains("swapoff"));
}

#[test]
fn full_shared_memory_blocks() {
    let here = Fake::new();
    let see = |free: Option<u64>| here.see(|m| shared::space(m, |_: &Path| free));
    expect(&see(Some(300 << 20)), FindingLevel::Good, "300 MiB");
    expect(&see(Some(10 << 20)), FindingLevel::Blocker, "only 10 MiB");
    expect(&see(None), FindingLevel::Blocker, "no /dev/shm");
    assert!(shared::free_bytes(&here.0).is_some_and(|bytes| bytes > 0));
    assert!(shared::free_bytes(&here.0.join("absent")).is_none());
}

#[test]
fn instance_without_a_program_is_stale() {
    let machine = || {
        Fake::new()
            .with("dev/shm/stylet_0_main/nodes/x", "")
            .with("dev/shm/stylet_0_main_9204_node.0_10_0.global_mgmt", "")
            .with("dev/shm/stylet_0_main-2_9204_node.0_10_0.global_mgmt", "")
            .with("dev/shm/other", "")
    };
    let maps = |name: &str| format!("7f0000000000-7f0000001000 rw-s 00000000 00:18 7    /dev/shm/{name}\n");
    let one = machine().with("proc/77/maps", &maps("stylet_0_main_9204_node.0_10_0.global_mgmt"));
    let finding = one.see(shared::stale_services);
    expect(
        &finding,
        FindingLevel::Note,
        "1 instances in /dev/shm that no program uses: stylet_0_main-2",
    );
    assert_eq!(
        finding.cure,
        "rm -r /dev/shm/stylet_0_main-2 /dev/shm/stylet_0_main-2_*"
    );
    let both = machine()
        .with("proc/77/maps", &maps("stylet_0_main_9204_x"))
        .with("proc/78/maps", &maps("stylet_0_main-2_9204_x"));
    expect(&both.see(shared::stale_services), FindingLevel::Good, "2 instances");
    expect(
        &Fake::new().see(shared::stale_services),
        FindingLevel::Good,
        "0 instances",
    );
}

#[test]
fn background_work_of_the_kernel_is_found_setting_by_setting() {
    let of = |fake: &Fake, check: &str| {
        let all = tunable::findings(&Machine::at(&fake.0), 1);
        all.into_iter().find(|f| f.check == check).expect("checked")
    };
    let nothing = Fake::new();
    for (path, good, bad, check, severity) in [
        (
            "proc/sys/kernel/nmi_watchdog",
            "0",
            "1",
            "NMI watchdog",
            FindingLevel::Warning,
        ),
        (
            "proc/sys/kernel/numa_balancing",
            "0",
            "1",
            "NUMA balancing",
            FindingLevel::Warning,
        ),
        (
            "proc/sys/kernel/timer_migration",
            "0",
            "1",
            "timer migration",
            FindingLevel::Note,
        ),
        (
            "proc/sys/vm/stat_interval",
            "300",
            "1",
            "statistics",
            FindingLevel::Note,
        ),
        (
            "sys/module/pcie_aspm/parameters/policy",
            "default [performance] powersave",
            "[default] performance powersave",
            "PCIe power",
            FindingLevel::Note,
        ),
        (
            "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor",
            "performance\n",
            "powersave\n",
            "governor",
            FindingLevel::Warning,
        ),
        (
            "sys/devices/system/cpu/cpu1/cpufreq/energy_performance_preference",
            "performance\n",
            "balance_power\n",
            "EPP",
            FindingLevel::Warning,
        ),
        (
            "sys/kernel/mm/transparent_hugepage/enabled",
            "always [madvise] never\n",
            "[always] madvise never\n",
            "huge pages",
            FindingLevel::Note,
        ),
    ] {
        expect(&of(&nothing, check), FindingLevel::Good, "no such setting");
        expect(&of(&Fake::new().with(path, good), check), FindingLevel::Good, "");
        let found = of(&Fake::new().with(path, bad), check);
        expect(&found, severity, "");
        assert!(found.cure.contains(&path.replace("cpu1", "cpu*")), "{found:?}");
    }
}

#[test]
fn turbo_and_tuned_are_looked_at() {
    const CPU: &str = "sys/devices/system/cpu";
    let turbo = |file: &str, text: &str| Fake::new().with(&format!("{CPU}/{file}"), text).see(tunable::turbo);
    expect(&Fake::new().see(tunable::turbo), FindingLevel::Good, "no turbo");
    expect(&turbo("intel_pstate/no_turbo", "1\n"), FindingLevel::Good, "off");
    expect(&turbo("intel_pstate/no_turbo", "0\n"), FindingLevel::Note, "on");
    expect(&turbo("cpufreq/boost", "0\n"), FindingLevel::Good, "off");
    expect(&turbo("cpufreq/boost", "1\n"), FindingLevel::Note, "on");
    let tuned = |profile: &str| {
        let fake = Fake::new().with("etc/tuned/active_profile", profile);
        fake.with("proc/77/comm", "tuned\n").see(tunable::tuned)
    };
    expect(&Fake::new().see(tunable::tuned), FindingLevel::Good, "does not run");
    expect(&tuned("realtime\n"), FindingLevel::Good, "realtime");
    expect(&tuned("balanced\n"), FindingLevel::Warning, "balanced");
}

#[test]
fn worst_finding_decides_and_every_check_has_its_own_name() {
    let nowhere = Fake::new();
    let findings = examine(&Machine::at(&nowhere.0), 1);
    for (i, f) in findings.iter().enumerate() {
        assert!(findings[i + 1..].iter().all(|g| g.check != f.check), "{}", f.check);
    }
    assert!(verdict(&findings).starts_with("not fit"));
    let well = [Finding::good("a", ""), Finding::new("b", FindingLevel::Note, "", "")];
    assert_eq!(verdict(&well), "fit");
    let text = text(&findings, 1);
    assert!(text.contains("BLOCKER  priority") && text.contains("-> "));
}
