//! Output of the window on the terminal that started it.

use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use stylet_tests::{Alone, Display, fresh_instance, program, until};

fn started(alone: &Alone, display: &str) -> Child {
    let child = Command::new(program("host-ui"))
        .args(["--instance", alone.0.name(), "--no-controllers"])
        .env("DISPLAY", display)
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("XDG_RUNTIME_DIR")
        .stderr(Stdio::piped())
        .spawn();
    child.expect("host-ui starts")
}

fn written(window: &mut Child) -> String {
    let mut text = String::new();
    let mut errors = window.stderr.take().expect("piped");
    errors.read_to_string(&mut text).expect("UTF-8");
    text
}

/// Guards against four lines "error: XDG_RUNTIME_DIR is invalid or not set in the environment."
/// from the graphics driver, in a shell without a desktop session.
#[test]
fn without_a_session_no_library_errors_are_printed() {
    let alone = Alone(fresh_instance());
    let display = Display::open();
    let mut window = started(&alone, &display.name());
    let maps = format!("/proc/{}/maps", window.id());
    let drives = || std::fs::read_to_string(&maps).is_ok_and(|maps| maps.contains("libvulkan_"));
    assert!(until(Duration::from_secs(60), drives), "no graphics driver was loaded");
    // The driver lists its devices, and draws.
    std::thread::sleep(Duration::from_secs(5));
    assert!(matches!(window.try_wait(), Ok(None)), "it is open");
    window.kill().expect("ours");
    let written = written(&mut window);
    window.wait().expect("ours");
    assert_eq!(written, "");
}

/// Guards against a message with a source file of the library and a folder of the machine that had
/// built it.
#[test]
fn without_a_display_the_error_is_readable() {
    let alone = Alone(fresh_instance());
    let mut window = started(&alone, ":4711");
    let written = written(&mut window);
    assert!(!window.wait().expect("ours").success());
    assert!(
        written.starts_with("host-ui: no display answers (DISPLAY=:4711)"),
        "{written}"
    );
    assert!(
        written.contains("host-ui procedure") && !written.contains(".rs"),
        "{written}"
    );
}
