//! Memory: swap, and huge pages created while a loop runs.

use super::{Finding, FindingLevel};
use crate::machine::Machine;

pub fn swap(machine: &Machine) -> Finding {
    let table = machine.text("proc/swaps").unwrap_or_default();
    let areas: Vec<&str> = table
        .lines()
        .skip(1)
        .filter_map(|l| l.split_whitespace().next())
        .collect();
    if areas.is_empty() {
        return Finding::good("swap", "no swap area is in use");
    }
    Finding::new(
        "swap",
        FindingLevel::Note,
        format!(
            "swap is on ({}); rt-core locks its own pages, the window may still stall",
            areas.join(", ")
        ),
        "sudo swapoff -a",
    )
}

pub fn huge_pages(machine: &Machine) -> Finding {
    let mode = machine
        .text("sys/kernel/mm/transparent_hugepage/enabled")
        .unwrap_or_default();
    if mode.contains("[always]") {
        return Finding::new(
            "huge pages",
            FindingLevel::Note,
            "the kernel joins pages into huge ones by itself, and stops threads for it",
            "echo madvise | sudo tee /sys/kernel/mm/transparent_hugepage/enabled",
        );
    }
    Finding::good("huge pages", "pages are joined only where a program asks for it")
}
