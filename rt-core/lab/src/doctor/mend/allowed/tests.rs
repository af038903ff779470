//! A list written by any user, undone by root: it used to write any file that it named, through `proc/self/root`.

use super::super::file::Changes;
use crate::machine::Machine;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::os::unix::fs::{PermissionsExt, chown, symlink};
use std::path::{Path, PathBuf};

const GOVERNOR: &str = "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor";
const INTERVAL: &str = "proc/sys/vm/stat_interval";
const IRQ: &str = "proc/irq/36/smp_affinity_list";

/// A machine of files, with other files that are not settings.
struct Fake {
    root: tempfile::TempDir,
    machine: Machine,
}

impl Fake {
    fn new() -> Self {
        let root = tempfile::tempdir().expect("a folder");
        for path in [
            GOVERNOR,
            INTERVAL,
            IRQ,
            "proc/sys/kernel/nmi_watchdog",
            "proc/sys/kernel/core_pattern",
            "proc/sysrq-trigger",
            "proc/1/task/1/status",
            "sys/devices/system/cpu/cpu1/online",
            "sys/devices/system/cpu/cpu1/cpufreq/scaling_max_freq",
            "sys/kernel/uevent_helper",
            "dev/sda",
            "etc/shadow",
            "etc/scaling_governor",
            "etc/smp_affinity_list",
        ] {
            let path = root.path().join(path);
            std::fs::create_dir_all(path.parent().expect("below the root")).expect("made");
            std::fs::write(path, "after").expect("written");
        }
        let machine = Machine::at(root.path().to_owned());
        let fake = Self { root, machine };
        fake.put(INTERVAL, "120");
        fake.put(GOVERNOR, "performance");
        fake.put(IRQ, "0");
        fake.put("proc/sys/kernel/nmi_watchdog", "0");
        std::fs::create_dir(fake.path("proc/self")).expect("made");
        symlink(fake.root.path(), fake.path("proc/self/root")).expect("linked");
        fake
    }

    fn path(&self, path: &str) -> PathBuf {
        self.root.path().join(path)
    }

    fn put(&self, path: &str, text: &str) {
        std::fs::write(self.path(path), text).expect("written");
    }

    /// Replaces a file or a folder with a link, a pipe or nothing.
    fn replace(&self, path: &str, with: impl Fn(&Path)) {
        let path = self.path(path);
        let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        with(&path);
    }

    /// Contents of every file, links not followed.
    fn contents(&self) -> BTreeMap<PathBuf, String> {
        let mut found = BTreeMap::new();
        let mut folders = vec![self.root.path().to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in std::fs::read_dir(folder).expect("ours").flatten() {
                match entry.file_type().expect("ours") {
                    kind if kind.is_dir() => folders.push(entry.path()),
                    kind if kind.is_file() => {
                        found.insert(entry.path(), std::fs::read_to_string(entry.path()).expect("text"));
                    }
                    _ => {}
                }
            }
        }
        found
    }

    /// Undoes a list of one change; returns whether anything on the machine has changed.
    fn writes(&self, change: Value, list: impl Fn(&Path)) -> bool {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("undo.json");
        let text = json!({ "schema": "stylet.settings/1", "boot": "", "changes": [change] }).to_string();
        std::fs::write(&path, text).expect("written");
        list(&path);
        let before = self.contents();
        if let Ok(mut changes) = Changes::read(&path) {
            changes.undo(&self.machine);
        }
        before != self.contents()
    }
}

fn change(check: &str, path: &str, before: &str, after: &str) -> Value {
    json!({ "check": check, "path": path, "before": before, "after": after, "state": "applied" })
}

fn own() -> [Value; 4] {
    [
        change("statistics", INTERVAL, "1", "120"),
        change("governor", GOVERNOR, "powersave", "performance"),
        change("interrupts", IRQ, "0-1", "0"),
        change("NMI watchdog", "proc/sys/kernel/nmi_watchdog", "1", "0"),
    ]
}

fn pipe(path: &Path) {
    let name = std::ffi::CString::new(path.to_str().expect("text")).expect("no zero");
    // SAFETY: `name` ends with a zero.
    assert_eq!(unsafe { libc::mkfifo(name.as_ptr(), 0o600) }, 0);
}

#[test]
fn own_settings_are_undone() {
    for own in own() {
        assert!(Fake::new().writes(own.clone(), |_| ()), "{own}");
    }
    // A core's link to its frequency policy is the kernel's.
    let fake = Fake::new();
    let policy = "sys/devices/system/cpu/cpufreq/policy1";
    std::fs::create_dir_all(fake.path(policy)).expect("made");
    fake.put(&format!("{policy}/scaling_governor"), "performance");
    fake.replace("sys/devices/system/cpu/cpu1/cpufreq", |at| {
        symlink("../cpufreq/policy1", at).expect("linked");
    });
    assert!(fake.writes(own()[1].clone(), |_| ()));
}

#[test]
fn a_forged_path_or_value_writes_nothing() {
    let mut forged = Vec::new();
    for path in [
        "proc/self/root/etc/shadow",
        "proc/self/root/proc/sys/kernel/core_pattern",
        "proc/../etc/shadow",
        "sys/devices/system/cpu/../../../../etc/shadow",
        "proc/irq/36/../../../etc/smp_affinity_list",
        "etc/shadow",
        "dev/sda",
        "proc/sys/kernel/core_pattern",
        "proc/sysrq-trigger",
        "proc/1/task/1/status",
        "sys/devices/system/cpu/cpu1/online",
        "sys/devices/system/cpu/cpu1/cpufreq/scaling_max_freq",
        "sys/kernel/uevent_helper",
        "sys/devices/system/cpu/cpu1/./cpufreq/scaling_governor",
        "proc//sys/vm/stat_interval",
        "proc/sys/vm/stat_interval\0",
        "",
        "proc/",
    ] {
        for after in ["after", "120", "performance", "0"] {
            forged.push(change("statistics", path, "1", after));
        }
    }
    let fake = Fake::new();
    let absolute = fake.path("etc/shadow").to_str().expect("text").to_owned();
    forged.push(change("statistics", &absolute, "1", "after"));
    for before in ["", "1\n2", "1\0", "$(reboot)", "0;1", "-", "12345678901", "1 2"] {
        forged.push(change("statistics", INTERVAL, before, "120"));
        forged.push(change("interrupts", IRQ, &format!(" {before}"), "0"));
    }
    forged.push(change("governor", GOVERNOR, "../x", "performance"));
    forged.push(change("\u{1b}]0;x\u{7}", INTERVAL, "1", "120"));
    forged.push(change("governor", INTERVAL, "1", "120"));
    let mut of_thread = change("statistics", INTERVAL, "1", "120");
    of_thread["began"] = json!(1);
    forged.push(of_thread);
    let mut escape = change("statistics", INTERVAL, "1", "120");
    escape["state"] = json!({ "foreign": "\u{1b}[2J" });
    forged.push(escape);
    let mut other = change("statistics", INTERVAL, "1", "9");
    other["state"] = json!("planned");
    forged.push(other);
    for change in forged {
        let fake = Fake::new();
        if change["after"] == "9" {
            fake.put(INTERVAL, "9");
        }
        assert!(!fake.writes(change.clone(), |_| ()), "{change}");
    }
}

/// The name of a setting points elsewhere.
#[test]
fn a_link_a_pipe_and_a_file_of_another_user_are_not_written() {
    let [interval, governor, irq, _] = own();
    let through = |change: &Value, path: &str, target: &str, text: &str| {
        let fake = Fake::new();
        let target = fake.path(target);
        fake.replace(path, |at| symlink(&target, at).expect("linked"));
        if target.is_file() {
            std::fs::write(&target, text).expect("written");
        }
        assert!(!fake.writes(change.clone(), |_| ()), "{path}");
    };
    through(&interval, INTERVAL, "etc/shadow", "120");
    through(&irq, IRQ, "etc/smp_affinity_list", "0");
    for folder in ["proc/irq/36", "proc/irq", "proc"] {
        let fake = Fake::new();
        let moved = fake.path("etc/moved");
        std::fs::rename(fake.path(folder), &moved).expect("moved");
        symlink(&moved, fake.path(folder)).expect("linked");
        assert!(!fake.writes(irq.clone(), |_| ()), "{folder}");
    }
    for target in ["../../../../../etc", "../cpufreq/policy1/../../../../../../etc", "/etc"] {
        let fake = Fake::new();
        fake.put("etc/scaling_governor", "performance");
        std::fs::create_dir_all(fake.path("sys/devices/system/cpu/cpufreq/policy1")).expect("made");
        fake.replace("sys/devices/system/cpu/cpu1/cpufreq", |at| {
            symlink(target, at).expect("linked")
        });
        assert!(!fake.writes(governor.clone(), |_| ()), "{target}");
    }
    let fake = Fake::new();
    fake.replace(INTERVAL, pipe);
    assert!(!fake.writes(interval.clone(), |_| ()));
    let fake = Fake::new();
    match chown(fake.path(INTERVAL), Some(1), None) {
        Ok(()) => assert!(!fake.writes(interval, |_| ())),
        Err(why) => println!("a file of another user was not tried: {why}"),
    }
}

#[test]
fn a_list_that_another_could_write_is_refused() {
    let [interval, ..] = own();
    let refused = |list: &dyn Fn(&Path)| !Fake::new().writes(interval.clone(), list);
    assert!(refused(&|list| {
        let moved = list.with_extension("moved");
        std::fs::rename(list, &moved).expect("moved");
        symlink(moved, list).expect("linked");
    }));
    assert!(refused(&|list| {
        std::fs::set_permissions(list, std::fs::Permissions::from_mode(0o666)).expect("ours");
    }));
    assert!(refused(&|list| {
        std::fs::remove_file(list).expect("ours");
        pipe(list);
    }));
    let owned = tempfile::NamedTempFile::new().expect("a file");
    match chown(owned.path(), Some(1), None) {
        Ok(()) => assert!(refused(&|list| chown(list, Some(1), None).expect("root"))),
        Err(why) => println!("a list of another user was not tried: {why}"),
    }
}
