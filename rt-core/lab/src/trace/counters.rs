//! Counters of the machine around a late tick: interrupts by name, firmware, throttling, sleep states.

use crate::machine::Machine;
use std::collections::BTreeMap;
use std::os::unix::fs::FileExt;

/// Counts of system management interrupts, Intel SDM volume 4: `MSR_SMI_COUNT`.
const SMI_COUNT: u64 = 0x34;
/// Most counters that are named.
const NAMED: usize = 5;

/// All counters of one core at one time.
#[derive(Clone, Debug, Default)]
pub struct Counters {
    pub at_ns: u64,
    pub smi: Option<u64>,
    named: BTreeMap<String, u64>,
}

/// Reads every counter of `core`.
pub fn read(machine: &Machine, core: usize, at_ns: u64) -> Counters {
    let mut named = machine.interrupts_served(core);
    let mut add = |name: String, path: &str, key: Option<&str>| {
        let text = machine.text(path).unwrap_or_default();
        let value = match key {
            None => text.parse().ok(),
            Some(key) => text.lines().find_map(|l| l.strip_prefix(key)?.trim().parse().ok()),
        };
        if let Some(value) = value {
            named.insert(name, value);
        }
    };
    let cpu = format!("sys/devices/system/cpu/cpu{core}");
    add(
        "throttling of the core for its heat".to_owned(),
        &format!("{cpu}/thermal_throttle/core_throttle_count"),
        None,
    );
    for state in machine.names(&format!("{cpu}/cpuidle")) {
        let name = machine
            .text(&format!("{cpu}/cpuidle/{state}/name"))
            .unwrap_or(state.clone());
        add(
            format!("sleep state {name}"),
            &format!("{cpu}/cpuidle/{state}/usage"),
            None,
        );
    }
    for path in ["sys/fs/cgroup/cpu.stat", "sys/fs/cgroup/cpu/cpu.stat"] {
        add(
            "throttling of the control group".to_owned(),
            path,
            Some("nr_throttled "),
        );
    }
    Counters {
        at_ns,
        smi: smi(machine, core),
        named,
    }
}

fn smi(machine: &Machine, core: usize) -> Option<u64> {
    let msr = std::fs::File::open(machine.path(&format!("dev/cpu/{core}/msr"))).ok()?;
    let mut bytes = [0; 8];
    msr.read_exact_at(&mut bytes, SMI_COUNT).ok()?;
    Some(u64::from_ne_bytes(bytes))
}

impl Counters {
    /// Returns the system management interrupts since `before`.
    pub fn smi_since(&self, before: &Self) -> Option<u64> {
        Some(self.smi?.saturating_sub(before.smi?))
    }

    /// Returns the counts since `before`, the most frequent first.
    pub fn since(&self, before: &Self) -> Vec<(String, u64)> {
        let counted = |name: &String, now: &u64| now.saturating_sub(before.named.get(name).copied().unwrap_or(*now));
        let mut all: Vec<(String, u64)> = self
            .named
            .iter()
            .map(|(name, now)| (name.clone(), counted(name, now)))
            .collect();
        all.retain(|(_, n)| *n > 0);
        all.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
        all.truncate(NAMED);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::interrupts;

    #[test]
    fn the_column_of_the_core_is_read_and_only_what_counted_is_named() {
        let table = |irq: u64, timer: u64| {
            format!(
                "            CPU0       CPU1       \n  36:          7       {irq}  PCI-MSIX-0000:00:02.0   1-edge      virtio1-req.0\n \
                 LOC:      94484      {timer}   Local timer interrupts\n ERR:          0\n"
            )
        };
        let at = |table: String| Counters {
            named: interrupts(&table, 1),
            ..Counters::default()
        };
        let (before, after) = (at(table(21_393, 500)), at(table(21_400, 900)));
        let expected = [("local timer interrupts", 400), ("IRQ 36 (virtio1-req.0)", 7)];
        assert_eq!(after.since(&before), expected.map(|(name, n)| (name.to_owned(), n)));
        assert_eq!(after.since(&after), []);
        assert_eq!(after.smi_since(&before), None);
    }
}
