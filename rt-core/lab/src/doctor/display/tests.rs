//! An X server on the core of the force loop is named; on preemptible kernels it is no fault.

use super::*;
use crate::doctor::FindingLevel;
use crate::doctor::tests::{Fake, expect};

/// Returns a machine of three cores with this preemption model.
fn machine(preemption: &str) -> Fake {
    Fake::new()
        .with("sys/devices/system/cpu/online", "0-2\n")
        .with("sys/kernel/debug/sched/preempt", preemption)
}

/// Adds a process with one more thread, and the cores that each may run on.
fn with(fake: Fake, id: u32, name: &str, allowed: [&str; 2]) -> Fake {
    let fake = fake.with(&format!("proc/{id}/comm"), &format!("{name}\n"));
    let thread = |fake: Fake, thread: u32, allowed: &str| {
        let folder = format!("proc/{id}/task/{thread}");
        let status = format!("Name:\t{name}\nCpus_allowed:\t7\nCpus_allowed_list:\t{allowed}\nMems_allowed:\t1\n");
        fake.with(&format!("{folder}/status"), &status)
    };
    thread(thread(fake, id, allowed[0]), id + 1, allowed[1])
}

const NONE: &str = "(none) voluntary full lazy\n";

#[test]
fn a_renderer_on_the_loop_core_is_named_with_the_command_to_move_it() {
    let fake = with(machine(NONE), 77, "Xorg", ["0-2", "0-2"]);
    // One thread of it is enough; other programs may run anywhere.
    let fake = with(fake, 300, "host-ui", ["0-1", "2"]);
    let fake = with(fake, 500, "bash", ["0-2", "0-2"]);
    let finding = fake.see(|m| servers(m, 2));
    expect(
        &finding,
        FindingLevel::Warning,
        "Xorg (77), host-ui (300) may run on core 2",
    );
    assert_eq!(finding.cure, "sudo taskset -a -cp 0-1 77\nsudo taskset -a -cp 0-1 300");
    expect(
        &machine(NONE).see(|m| servers(m, 2)),
        FindingLevel::Good,
        "no display server",
    );
    let away = with(machine(NONE), 77, "Xorg", ["0-1", "0"]);
    expect(&away.see(|m| servers(m, 2)), FindingLevel::Good, "no display server");
}

/// On such kernels the loop preempts work inside the kernel.
#[test]
fn on_a_kernel_that_gives_way_it_is_no_fault() {
    for word in ["none voluntary (full) lazy", "none voluntary full (lazy)"] {
        let fake = with(machine(word), 77, "Xorg", ["0-2", "0-2"]);
        expect(&fake.see(|m| servers(m, 2)), FindingLevel::Good, "interrupt it at once");
    }
    let fake = with(machine("none (voluntary) full"), 77, "Xorg", ["0-2", "0-2"]);
    expect(&fake.see(|m| servers(m, 2)), FindingLevel::Warning, "Xorg");
}
