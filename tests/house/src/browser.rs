//! Checks that the loops and the control thread need no operating system in a browser.

use std::process::Command;

/// What only a process with threads, shared memory and drivers needs.
const SYSTEM: [&str; 9] = [
    "clap",
    "core_affinity",
    "iceoryx2",
    "libc",
    "libloading",
    "rustix",
    "signal-hook",
    "stylet-heap",
    "tungstenite",
];

/// Returns the packages that the runtime is built of on this target.
fn packages(target: &str) -> Vec<String> {
    let arguments = "tree --locked --package stylet-runtime --edges normal --prefix none --format {p} --target";
    let found = Command::new(env!("CARGO"))
        .args(arguments.split(' '))
        .arg(target)
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .output()
        .expect("cargo runs");
    assert!(found.status.success(), "{}", String::from_utf8_lossy(&found.stderr));
    let lines = String::from_utf8(found.stdout).expect("names");
    let name = |line: &str| line.split(' ').next().map(str::to_owned);
    lines.lines().filter_map(name).collect()
}

#[test]
fn the_loops_need_no_operating_system_in_a_browser() {
    let of_system = |target| {
        let packages = packages(target);
        SYSTEM.iter().filter(|name| packages.iter().any(|p| p == *name)).count()
    };
    assert_eq!(of_system("wasm32-unknown-unknown"), 0);
    assert!(
        of_system("x86_64-unknown-linux-gnu") > 5,
        "the test looks for the wrong names"
    );
}
