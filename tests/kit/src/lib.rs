//! Common basis of system tests: the built programs, the repository, a folder for each test, kept traces, colour
//! blindness, and a check for machine stalls.

pub mod sight;
pub mod trace;
pub mod witness;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Polls `ready` every 2 ms; false if it has not come true in time.
pub fn until(limit: Duration, mut ready: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while start.elapsed() < limit {
        if ready() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    false
}

/// Returns a file of the repository, by its path from the root.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// Returns a built program of the workspace; `make products` builds them.
pub fn program(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own file");
    let folder = test
        .parent()
        .and_then(|deps| deps.parent())
        .expect("tests live in <target>/<profile>/deps");
    let path = folder.join(name);
    assert!(
        path.exists(),
        "{} is missing: run `make products` first",
        path.display()
    );
    path
}

/// Returns an empty folder for one test's files.
pub fn scratch(name: &str) -> PathBuf {
    let folder = program("rt-core")
        .parent()
        .expect("has a folder")
        .join("test-out")
        .join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    folder
}
