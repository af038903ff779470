//! Cores: their number, other users of the force loop's core, and their sleep states.

use super::Finding;
use super::tunable::DEEP_US;
use crate::machine::{Machine, core_list};

pub fn count(machine: &Machine) -> Finding {
    match machine.online_cores().len() {
        0 => Finding::note("cores", "the kernel does not report its cores", ""),
        1 => Finding::blocker(
            "cores",
            "one core: force loop, tissue and everything else share it",
            "use a PC with two cores or more",
        ),
        n @ (2 | 3) => Finding::note(
            "cores",
            format!("{n} cores: the tissue step shares its core with everything else"),
            "four or more leave a core to each loop",
        ),
        n => Finding::good("cores", format!("{n} cores")),
    }
}

pub fn isolation(machine: &Machine, core: usize) -> Finding {
    let isolated = machine.isolated_cores();
    if isolated.contains(&core) {
        let tickless = machine.tickless_cores().contains(&core);
        let also = if tickless { ", and without a periodic tick" } else { "" };
        return Finding::good("isolation", format!("core {core} is kept free of other threads{also}"));
    }
    Finding::warning(
        "isolation",
        format!(
            "core {core} is open to all threads (isolated cores: {})",
            core_list(&isolated)
        ),
        format!(
            "add to GRUB_CMDLINE_LINUX in /etc/default/grub: isolcpus=managed_irq,domain,{core} nohz_full={core} rcu_nocbs={core}   \
             then: sudo update-grub, and restart"
        ),
    )
}

/// Most that are listed individually.
const NAMED: usize = 4;

pub fn interrupts(machine: &Machine, core: usize) -> Finding {
    let allowed = machine.interrupts_allowed_on(core);
    let balanced = machine.runs("irqbalance");
    if allowed.is_empty() && !balanced {
        return Finding::good("interrupts", format!("no device interrupt is served on core {core}"));
    }
    let named: Vec<String> = allowed
        .iter()
        .take(NAMED)
        .map(|(n, who)| format!("{n} {who}"))
        .collect();
    let rest = allowed.len().saturating_sub(NAMED);
    let more = if rest > 0 {
        format!(" and {rest} more")
    } else {
        String::new()
    };
    let mut what = if allowed.is_empty() {
        format!("no device interrupt is served on core {core} now")
    } else {
        format!(
            "device interrupts may be served on core {core}: {}{more}",
            named.join(", ")
        )
    };
    let mut cure = Vec::new();
    if balanced {
        what += "; irqbalance moves them about";
        cure.push("sudo systemctl disable --now irqbalance".to_owned());
    }
    let elsewhere = machine.online_cores().into_iter().find(|c| *c != core);
    if let (Some(other), false) = (elsewhere, allowed.is_empty()) {
        cure.push(format!(
            "for i in /proc/irq/*/smp_affinity_list; do echo {other} | sudo tee $i; done   (some are refused; irqaffinity={other} on \
             the kernel command line keeps it so)"
        ));
    }
    Finding::warning("interrupts", what, cure.join("\n"))
}

pub fn siblings(machine: &Machine, core: usize) -> Finding {
    let siblings = machine.siblings(core);
    if siblings.is_empty() {
        return Finding::good("SMT", format!("core {core} shares its execution units with no other"));
    }
    Finding::warning(
        "SMT",
        format!("core {core} shares its execution units with {}", core_list(&siblings)),
        "echo off | sudo tee /sys/devices/system/cpu/smt/control   (nosmt on the kernel command line keeps it so)",
    )
}

pub fn sleep_states(machine: &Machine, core: usize) -> Finding {
    let can_ask = machine.path("dev/cpu_dma_latency").exists();
    let states = machine.idle_states(core);
    let deep: Vec<String> = states
        .iter()
        .filter(|(_, us)| *us > DEEP_US)
        .map(|(name, us)| format!("{name} {us} us"))
        .collect();
    match (deep.is_empty(), can_ask) {
        (false, true) => Finding::note(
            "sleep states",
            format!(
                "core {core} may sleep deeply ({}); rt-core forbids it through /dev/cpu_dma_latency while it runs as root",
                deep.join(", ")
            ),
            "to run without root: sudo chgrp users /dev/cpu_dma_latency && sudo chmod g+rw /dev/cpu_dma_latency",
        ),
        (false, false) => Finding::warning(
            "sleep states",
            format!(
                "core {core} may sleep deeply ({}), and there is no /dev/cpu_dma_latency to forbid it",
                deep.join(", ")
            ),
            format!(
                "for s in /sys/devices/system/cpu/cpu{core}/cpuidle/state*; do [ $(cat $s/latency) -gt {DEEP_US} ] && echo 1 | sudo tee $s/disable; done"
            ),
        ),
        (true, true) => Finding::good(
            "sleep states",
            format!("no deep sleep state is seen on core {core}, and /dev/cpu_dma_latency is there to forbid one"),
        ),
        (true, false) => Finding::note(
            "sleep states",
            format!("no deep sleep state is seen on core {core}; there is no /dev/cpu_dma_latency"),
            "",
        ),
    }
}
