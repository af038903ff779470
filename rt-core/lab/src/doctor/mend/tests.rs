//! Settings of a machine made of files: changed, undone, refused, changed by others.

use super::file::{Changes, State};
use super::{dry_run, tunable};
use crate::machine::Machine;
use std::path::PathBuf;

/// Returns the folders of a machine with two cores.
fn machine(name: &str, files: &[(&str, &str)]) -> (PathBuf, Machine) {
    let root = std::env::temp_dir().join(format!("stylet-mend-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&root);
    for (path, text) in files {
        let path = root.join(path);
        std::fs::create_dir_all(path.parent().expect("below the root")).expect("made");
        std::fs::write(path, text).expect("written");
    }
    (root.clone(), Machine::at(root))
}

const FILES: &[(&str, &str)] = &[
    ("sys/devices/system/cpu/online", "0-1\n"),
    ("proc/sys/kernel/nmi_watchdog", "1\n"),
    ("proc/sys/kernel/numa_balancing", "0\n"),
    ("proc/sys/vm/stat_interval", "1\n"),
    ("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state0/latency", "2\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state0/disable", "0\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state3/latency", "200\n"),
    ("sys/devices/system/cpu/cpu1/cpuidle/state3/disable", "0\n"),
    ("proc/irq/36/smp_affinity_list", "0-1\n"),
    ("proc/irq/37/smp_affinity_list", "0\n"),
    (
        "proc/interrupts",
        "           CPU0       CPU1\n 36:  1  1  x  eth0\n 37:  1 1  x  disk\n",
    ),
];

#[test]
fn settings_are_changed_read_back_and_undone() {
    let (root, machine) = machine("all", FILES);
    let all = tunable::all(&machine, 1);
    let said = dry_run(&all);
    let expected = [
        "NMI watchdog     /proc/sys/kernel/nmi_watchdog: 1 -> 0",
        "statistics       /proc/sys/vm/stat_interval: 1 -> 120",
        "governor         /sys/devices/system/cpu/cpu1/cpufreq/scaling_governor: powersave -> performance",
        "sleep states     /sys/devices/system/cpu/cpu1/cpuidle/state3/disable: 0 -> 1",
        "interrupts       /proc/irq/36/smp_affinity_list: 0-1 -> 0",
    ];
    let lines: Vec<&str> = said.lines().take_while(|l| !l.is_empty()).collect();
    assert_eq!(lines, expected);
    // A dry run changes nothing.
    assert_eq!(tunable::all(&machine, 1), all);
    let mut changes = Changes::planned(&all);
    changes.apply(&machine);
    assert!(!changes.any_refused() && !changes.is_undone(), "{}", changes.words());
    assert!(tunable::all(&machine, 1).iter().all(tunable::Tunable::is_met));
    assert!(dry_run(&tunable::all(&machine, 1)).starts_with("nothing to change"));
    // Read again from its file, as after the end of the program.
    let file = root.join("undo.json");
    std::fs::write(&file, changes.text()).expect("written");
    let mut changes = Changes::read(&file).expect("valid");
    changes.undo(&machine);
    assert!(changes.is_undone(), "{}", changes.words());
    assert_eq!(tunable::all(&machine, 1), all);
    std::fs::remove_dir_all(root).expect("ours");
}

#[test]
fn undo_keeps_foreign_edits_and_reports_refusals() {
    let (root, machine) = machine("foreign", FILES);
    let mut changes = Changes::planned(&tunable::all(&machine, 1));
    // A folder cannot be written, like a setting that the kernel refuses.
    changes.changes[0].path = "proc/irq".to_owned();
    changes.apply(&machine);
    assert!(matches!(changes.changes[0].state, State::Refused(_)));
    std::fs::write(root.join("proc/sys/vm/stat_interval"), "60").expect("written");
    changes.undo(&machine);
    assert_eq!(changes.changes[1].state, State::Foreign("60".to_owned()));
    assert!(changes.words().contains("LEFT ALONE: is 60 now") && changes.any_refused());
    std::fs::remove_dir_all(root).expect("ours");
}

#[test]
fn a_file_that_names_anything_but_a_setting_is_refused() {
    let (root, _) = machine("path", FILES);
    let file = root.join("undo.json");
    let with = |path: &str, schema: &str| {
        let change = format!(
            "{{\"check\":\"statistics\",\"path\":{path:?},\"before\":\"1\",\"after\":\"120\",\"state\":\"applied\"}}"
        );
        std::fs::write(
            &file,
            format!("{{\"schema\":{schema:?},\"boot\":\"\",\"changes\":[{change}]}}"),
        )
        .expect("written");
        Changes::read(&file).is_ok()
    };
    assert!(with("proc/sys/vm/stat_interval", "stylet.settings/1"));
    assert!(!with("etc/shadow", "stylet.settings/1"));
    assert!(!with("proc/../etc/shadow", "stylet.settings/1"));
    assert!(!with("proc/sys/vm/stat_interval", "stylet.settings/2"));
    std::fs::remove_dir_all(root).expect("ours");
}
