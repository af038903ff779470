//! Kernel: hypervisor, preemption, throttling, time source.

use super::Finding;
use crate::machine::{Machine, Preemption, Throttle};

pub fn hypervisor(machine: &Machine) -> Finding {
    match machine.hypervisor() {
        None => Finding::good("hypervisor", "runs on bare metal"),
        Some(name) => Finding::blocker(
            "hypervisor",
            format!(
                "this is a virtual machine ({name}): the host takes the core away for milliseconds, and steal time may not show it"
            ),
            "measure and operate on the PC itself",
        ),
    }
}

pub fn preemption(machine: &Machine) -> Finding {
    let model = machine.preemption();
    let what = format!("preemption model: {}", model.name());
    let real_time = "for a bounded tail, a PREEMPT_RT kernel: sudo apt-get install linux-image-rt-amd64, then restart";
    match model {
        Preemption::RealTime => Finding::good("preemption", what),
        Preemption::Full => Finding::warning("preemption", what, real_time),
        _ => {
            let dynamic = machine
                .text("proc/version")
                .is_some_and(|v| v.contains("PREEMPT_DYNAMIC"));
            let now = "\nuntil then: echo full | sudo tee /sys/kernel/debug/sched/preempt   (or preempt=full on the kernel command line)";
            let cure = format!("{real_time}{}", if dynamic { now } else { "" });
            Finding::warning("preemption", what, cure)
        }
    }
}

pub fn throttling(machine: &Machine) -> Finding {
    match machine.throttle() {
        Some(Throttle::Share(share)) if share >= 0.9 => Finding::good(
            "throttling",
            format!(
                "real-time threads may use {:.0} % of a core; the loops need far less",
                share * 100.0
            ),
        ),
        Some(Throttle::Share(share)) => Finding::warning(
            "throttling",
            format!(
                "real-time threads are stopped after {:.0} % of each period",
                share * 100.0
            ),
            "sudo sysctl kernel.sched_rt_runtime_us=950000 kernel.sched_rt_period_us=1000000",
        ),
        Some(Throttle::Off) => Finding::note(
            "throttling",
            "throttling is off: a real-time thread that never sleeps hangs its core",
            "sudo sysctl kernel.sched_rt_runtime_us=950000",
        ),
        None => Finding::note(
            "throttling",
            "the kernel does not report the share of real-time threads",
            "",
        ),
    }
}

/// Examines control groups: with CONFIG_RT_GROUP_SCHED one may have no real-time share at all.
pub fn groups(machine: &Machine) -> Finding {
    if machine.build_option("RT_GROUP_SCHED").as_deref() != Some("y") {
        return Finding::good(
            "control group",
            "the kernel gives no share of its own to groups of real-time threads",
        );
    }
    let own = machine.text("proc/self/cgroup").unwrap_or_default();
    let path = own.lines().find_map(|line| {
        let mut parts = line.splitn(3, ':');
        let (_, controllers, path) = (parts.next()?, parts.next()?, parts.next()?);
        controllers
            .split(',')
            .any(|c| c == "cpu")
            .then(|| path.trim_start_matches('/').to_owned())
    });
    let runtime = path.and_then(|p| {
        let folder = if p.is_empty() { String::new() } else { format!("{p}/") };
        ["cpu", "cpu,cpuacct"]
            .iter()
            .find_map(|c| machine.text(&format!("sys/fs/cgroup/{c}/{folder}cpu.rt_runtime_us")))
    });
    match runtime.as_deref() {
        Some("0") => Finding::blocker(
            "control group",
            "the control group of this shell has no share for real-time threads, so SCHED_FIFO is refused even to root",
            "echo $$ | sudo tee /sys/fs/cgroup/cpu/cgroup.procs   (moves this shell to the root group)",
        ),
        Some(us) => Finding::good(
            "control group",
            format!("the group of this shell has {us} us of real-time share a period"),
        ),
        None => Finding::good(
            "control group",
            "no control group limits the share of real-time threads",
        ),
    }
}

pub fn time_source(machine: &Machine) -> Finding {
    let source = machine.clock_source();
    match source.as_deref() {
        Some(good @ ("tsc" | "arch_sys_counter" | "kvm-clock")) => {
            Finding::good("time source", format!("{good}: read without a system call"))
        }
        Some(slow) => Finding::warning(
            "time source",
            format!("{slow}: each look at the clock costs about a microsecond or more"),
            "echo tsc | sudo tee /sys/devices/system/clocksource/clocksource0/current_clocksource   (if it is refused, the \
             kernel does not trust this processor's tsc: see dmesg | grep -i tsc)",
        ),
        None => Finding::note("time source", "the kernel does not report its time source", ""),
    }
}
