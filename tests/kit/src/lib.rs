//! What every test of the system starts from: the built programs, the repository, a folder of its own.

use std::path::{Path, PathBuf};

/// A file of the repository, by its path from the root.
pub fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// A built program of the workspace; `make test` builds them first.
pub fn program(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("a test knows its own file");
    let folder = test
        .parent()
        .and_then(|deps| deps.parent())
        .expect("tests live in <target>/<profile>/deps");
    let path = folder.join(name);
    assert!(
        path.exists(),
        "{} is missing: run `cargo build --release --workspace` first",
        path.display()
    );
    path
}

/// A folder for one test's files, emptied first.
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
