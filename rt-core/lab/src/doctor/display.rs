//! Drawing programs that may run on the force loop's core. They move whole pictures inside the kernel, and a
//! non-preemptible kernel makes the loop wait until one is done (docs/measurements.md).

use super::Finding;
use super::tunable::Tunable;
use crate::machine::{Machine, Process, core_list, cores};

pub const CHECK: &str = "display";

/// X servers, compositors and our window, by the names that the kernel keeps.
pub const DRAW: [&str; 27] = [
    "Xorg",
    "X",
    "Xwayland",
    "Xvfb",
    "Xephyr",
    "Xvnc",
    "Xtigervnc",
    "host-ui",
    "gnome-shell",
    "mutter",
    "kwin_x11",
    "kwin_wayland",
    "cinnamon",
    "muffin",
    "marco",
    "xfwm4",
    "weston",
    "sway",
    "labwc",
    "wayfire",
    "Hyprland",
    "cage",
    "cosmic-comp",
    "budgie-wm",
    "enlightenment",
    "picom",
    "compton",
];

/// Returns the drawing processes that may run on the core of the force loop.
fn drawing(machine: &Machine, core: usize) -> Vec<Process> {
    let mut found = machine.processes();
    found.retain(|process| {
        DRAW.contains(&process.name.as_str()) && machine.threads(process.id).iter().any(|t| may_run(machine, t, core))
    });
    found
}

fn may_run(machine: &Machine, thread: &str, core: usize) -> bool {
    let allowed = machine.allowed_cores(thread);
    allowed.is_some_and(|list| cores(&list).contains(&core))
}

/// Finds display servers on the core of the force loop, where they can hold it.
pub fn servers(machine: &Machine, core: usize) -> Finding {
    let found = drawing(machine, core);
    if found.is_empty() {
        return Finding::good(CHECK, format!("no display server may run on core {core}"));
    }
    let named: Vec<String> = found.iter().map(|p| format!("{} ({})", p.name, p.id)).collect();
    let named = named.join(", ");
    if machine.preemption().gives_way() {
        let what = format!("{named} may run on core {core}; this kernel lets the loop interrupt it at once");
        return Finding::good(CHECK, what);
    }
    let what = format!(
        "{named} may run on core {core}: a picture that it moves in one piece inside a kernel that does not preempt itself \
         holds the loop for a millisecond"
    );
    let elsewhere = elsewhere(machine, core);
    if elsewhere.is_empty() {
        return Finding::warning(CHECK, what, "use a PC with two cores or more");
    }
    let cure: Vec<String> = found
        .iter()
        .map(|p| format!("sudo taskset -a -cp {elsewhere} {}", p.id))
        .collect();
    Finding::warning(CHECK, what, cure.join("\n"))
}

/// Returns every other core; empty if there is none.
fn elsewhere(machine: &Machine, core: usize) -> String {
    let mut elsewhere = machine.online_cores();
    elsewhere.remove(&core);
    match elsewhere.is_empty() {
        true => String::new(),
        false => core_list(&elsewhere),
    }
}

/// Returns the cores of each of their threads that can block the loop; without the core of the loop.
pub fn settings(machine: &Machine, core: usize) -> Vec<Tunable> {
    let elsewhere = elsewhere(machine, core);
    if elsewhere.is_empty() || machine.preemption().gives_way() {
        return Vec::new();
    }
    let mut settings = Vec::new();
    for path in drawing(machine, core).iter().flat_map(|p| machine.threads(p.id)) {
        let Some(now) = machine.allowed_cores(&path) else {
            continue;
        };
        let mut wanted = cores(&now);
        wanted.remove(&core);
        settings.push(Tunable {
            check: CHECK,
            began: machine.began(&path),
            wanted: match wanted.is_empty() {
                true => elsewhere.clone(),
                false => core_list(&wanted),
            },
            path,
            now,
        });
    }
    settings
}

#[cfg(test)]
mod tests;
