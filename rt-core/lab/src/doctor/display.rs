//! Drawing programs that may run on the force loop's core. They move whole pictures inside the kernel, and a
//! non-preemptible kernel makes the loop wait until one is done (docs/measurements.md).

use super::Finding;
use crate::machine::{Machine, Process, core_list};

const CHECK: &str = "display";

/// X servers, compositors and our window, by the names that the kernel keeps.
const DRAW: [&str; 27] = [
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

/// Finds display servers on the core of the force loop, where they can hold it.
pub fn servers(machine: &Machine, core: usize) -> Finding {
    let draws = |p: &Process| DRAW.contains(&p.name.as_str()) && machine.allowed_cores(p.id).contains(&core);
    let found: Vec<Process> = machine.processes().into_iter().filter(draws).collect();
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
    let mut elsewhere = machine.online_cores();
    elsewhere.remove(&core);
    if elsewhere.is_empty() {
        return Finding::warning(CHECK, what, "use a PC with two cores or more");
    }
    let move_it = |p: &Process| format!("sudo taskset -a -cp {} {}", core_list(&elsewhere), p.id);
    Finding::warning(CHECK, what, found.iter().map(move_it).collect::<Vec<_>>().join("\n"))
}

#[cfg(test)]
mod tests;
