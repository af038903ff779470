//! Memory: swap; free space of shared memory, and remains of dead programs.

use super::Finding;
use crate::machine::Machine;
use std::collections::BTreeSet;
use std::path::Path;

/// Shared memory of one core with six hosts and a large scene, with a margin.
const WANTED_BYTES: u64 = 256 << 20;

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
    let areas = areas.join(", ");
    let what = format!("swap is on ({areas}); rt-core locks its own pages, the window may still stall");
    Finding::note("swap", what, "sudo swapoff -a")
}

/// Returns the free space where `path` lies.
pub fn free_bytes(path: &Path) -> Option<u64> {
    let space = rustix::fs::statvfs(path).ok()?;
    Some(space.f_bavail * space.f_frsize)
}

pub fn space(machine: &Machine, free: impl Fn(&Path) -> Option<u64>) -> Finding {
    match free(&machine.path("dev/shm")) {
        Some(bytes) if bytes >= WANTED_BYTES => {
            Finding::good("shared memory", format!("{} MiB free in /dev/shm", bytes >> 20))
        }
        Some(bytes) => Finding::blocker(
            "shared memory",
            format!(
                "only {} MiB free in /dev/shm; {} MiB are wanted",
                bytes >> 20,
                WANTED_BYTES >> 20
            ),
            "look with: ls -lS /dev/shm   or make it larger: sudo mount -o remount,size=1G /dev/shm",
        ),
        None => Finding::blocker(
            "shared memory",
            "there is no /dev/shm",
            "sudo mount -t tmpfs -o size=1G tmpfs /dev/shm",
        ),
    }
}

/// Finds instances with files in shared memory that no program uses.
pub fn stale_services(machine: &Machine) -> Finding {
    let found = instances(&machine.names("dev/shm"));
    let used = maps(machine);
    let stale: Vec<&String> = found
        .iter()
        .filter(|prefix| !used.iter().any(|m| m.contains(*prefix)))
        .collect();
    if stale.is_empty() {
        return Finding::good(
            "stale services",
            format!("{} instances in /dev/shm, each used by a program", found.len()),
        );
    }
    let first: Vec<&str> = stale.iter().take(3).map(|s| s.as_str()).collect();
    let more = if stale.len() > first.len() { ", ..." } else { "" };
    let remove: Vec<String> = stale
        .iter()
        .map(|s| format!("rm -r /dev/shm/{s} /dev/shm/{s}_*"))
        .collect();
    Finding::note(
        "stale services",
        format!(
            "{} instances in /dev/shm that no program uses: {}{more}",
            stale.len(),
            first.join(", ")
        ),
        remove.join("\n"),
    )
}

/// Returns `stylet_<user>_<instance>` of each file.
fn instances(names: &[String]) -> BTreeSet<String> {
    let instance = |name: &String| {
        let mut parts = name.splitn(4, '_');
        let (first, user, instance) = (parts.next()?, parts.next()?, parts.next()?);
        (first == "stylet").then(|| format!("{first}_{user}_{instance}"))
    };
    names.iter().filter_map(instance).collect()
}

/// Returns the lines of memory maps in shared memory, for each readable process.
fn maps(machine: &Machine) -> Vec<String> {
    let processes = machine
        .names("proc")
        .into_iter()
        .filter(|n| n.bytes().all(|b| b.is_ascii_digit()));
    let texts = processes.filter_map(|p| machine.text(&format!("proc/{p}/maps")));
    let ours = |text: String| {
        let lines = text.lines().filter_map(|l| l.split_once("/dev/shm/stylet_"));
        lines
            .map(|(_, rest)| format!("stylet_{rest}_"))
            .collect::<Vec<String>>()
    };
    texts.flat_map(ours).collect()
}
