//! Streams a running session to viewers: the messages of a recording, given to the program `stylet-live`, which serves
//! them.
//!
//! That program is built by `make live` alone: its server crates are not part of the workspace.

use super::error::RecordError;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

const PROGRAM: &str = "stylet-live";

/// Starts the program, which prints its own address, and ends at the end of its input.
pub fn start(address: &str) -> Result<Child, RecordError> {
    let started = Command::new(beside())
        .args(["--listen", address])
        .stdin(Stdio::piped())
        .spawn();
    started.map_err(RecordError::NoLive)
}

/// Returns the program's path: in this program's folder, or found by the shell.
fn beside() -> PathBuf {
    let here = std::env::current_exe().ok();
    let here = here.and_then(|here| here.parent().map(|folder| folder.join(PROGRAM)));
    here.filter(|program| program.exists())
        .unwrap_or_else(|| PROGRAM.into())
}
