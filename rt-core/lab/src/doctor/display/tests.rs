//! An X server on the core of the force loop: named, moved and moved back; on preemptible kernels it is left alone.

use super::*;
use crate::doctor::FindingLevel;
use crate::doctor::mend::file::{Changes, State};
use crate::doctor::tests::{Fake, expect};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command};

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
        let stat = format!("{thread} (a) name) S{} {} 0 0\n", " 0".repeat(18), 1000 + thread);
        let status = format!("Name:\t{name}\nCpus_allowed:\t7\nCpus_allowed_list:\t{allowed}\nMems_allowed:\t1\n");
        fake.with(&format!("{folder}/stat"), &stat)
            .with(&format!("{folder}/status"), &status)
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
fn on_a_kernel_that_gives_way_it_is_no_fault_and_nothing_is_moved() {
    for word in ["none voluntary (full) lazy", "none voluntary full (lazy)"] {
        let fake = with(machine(word), 77, "Xorg", ["0-2", "0-2"]);
        expect(&fake.see(|m| servers(m, 2)), FindingLevel::Good, "interrupt it at once");
        assert_eq!(fake.of(|m| settings(m, 2)), []);
    }
    let fake = with(machine("none (voluntary) full"), 77, "Xorg", ["0-2", "0-2"]);
    expect(&fake.see(|m| servers(m, 2)), FindingLevel::Warning, "Xorg");
}

#[test]
fn each_thread_keeps_its_cores_but_that_of_the_loop() {
    let fake = with(machine(NONE), 77, "Xorg", ["0-2", "1-2"]);
    let fake = with(fake, 90, "sway", ["2", "2"]);
    let all = fake.of(|m| settings(m, 2));
    let moved: Vec<_> = all.iter().map(|t| (&*t.path, t.began, &*t.now, &*t.wanted)).collect();
    let expected = [
        ("proc/77/task/77/status", Some(1077), "0-2", "0-1"),
        ("proc/77/task/78/status", Some(1078), "1-2", "1"),
        ("proc/90/task/90/status", Some(1090), "2", "0-1"),
        ("proc/90/task/91/status", Some(1091), "2", "0-1"),
    ];
    assert_eq!(moved, expected);
    // On the real machine those ids belong to other processes.
    let mut changes = Changes::planned(&all);
    fake.of(|m| changes.apply(m));
    assert!(changes.changes.iter().all(|c| matches!(c.state, State::Refused(_))));
}

/// An idle process, ended when dropped.
struct Idle(Child);

impl Drop for Idle {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_process_is_moved_and_moved_back_but_never_another_of_its_number() {
    let here = Machine::this();
    let folder = tempfile::tempdir().expect("a folder");
    // An undo moves only drawing programs, by name.
    let named = folder.path().join("Xvfb");
    std::os::unix::fs::symlink("/bin/sleep", &named).expect("linked");
    let mut command = Command::new(&named);
    let idle = Idle(command.arg0("sleep").arg("100").spawn().expect("it starts"));
    let id = idle.0.id();
    let path = format!("proc/{id}/task/{id}/status");
    let now = here.allowed_cores(&path).expect("shown");
    let Some((first, true)) = cores(&now).first().map(|&first| (first, cores(&now).len() > 1)) else {
        eprintln!("skipped: one core");
        return;
    };
    let setting = Tunable {
        check: CHECK,
        began: here.began(&path),
        path: path.clone(),
        now: now.clone(),
        wanted: first.to_string(),
    };
    let mut changes = Changes::planned(&[setting]);
    changes.apply(&here);
    assert_eq!(
        here.allowed_cores(&path),
        Some(first.to_string()),
        "{}",
        changes.words()
    );
    let mut of_another = changes.clone();
    of_another.changes[0].began = of_another.changes[0].began.map(|began| began - 1);
    of_another.undo(&here);
    assert_eq!(
        here.allowed_cores(&path),
        Some(first.to_string()),
        "it is another's now"
    );
    assert!(of_another.is_undone());
    changes.undo(&here);
    assert_eq!(here.allowed_cores(&path), Some(now));
    assert_eq!(changes.changes[0].state, State::Undone);
    drop(idle);
    changes.apply(&here);
    assert!(matches!(changes.changes[0].state, State::Refused(_)), "it has ended");
}
