//! `docs/tools/run`, which `make run` calls, on programs that stand for core and window.

use std::os::unix::fs::PermissionsExt;
use std::process::Command;
use stylet_test_kit::{repository, scratch};

#[test]
fn a_window_that_crashes_is_opened_again_on_the_same_core() {
    let folder = scratch("run-script");
    let programs = [
        (
            "rt-core",
            "echo begun >> cores; trap 'echo ended >> cores; exit' TERM; while true; do sleep 0.1; done",
        ),
        (
            "host-ui",
            "echo opened >> windows; if [ $(wc -l < windows) -lt 2 ]; then sleep 5.5; kill -SEGV $$; fi",
        ),
    ];
    for (name, lines) in programs {
        let file = folder.join(name);
        std::fs::write(&file, format!("#!/bin/sh\n{lines}\n")).expect("written");
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755)).expect("executable");
    }
    let done = Command::new(repository("docs/tools/run"))
        .arg(".")
        .current_dir(&folder)
        .env("DISPLAY", ":0")
        .output()
        .expect("it starts");
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    assert!(said.contains("the window crashed (status 139)"), "{said}");
    let lines = |name: &str| std::fs::read_to_string(folder.join(name)).expect("written");
    assert_eq!(lines("windows"), "opened\nopened\n");
    assert_eq!(
        lines("cores"),
        "begun\nended\n",
        "one core, to the end of the second window"
    );
}
