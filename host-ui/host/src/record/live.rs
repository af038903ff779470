//! Streams a running session to viewers: the messages of a recording, given to the program `stylet-live`, which serves
//! them.
//!
//! That program is built by `make live` alone: its server crates are not part of the workspace.

use super::error::RecordError;
use super::writer::{self, Item, Totals};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc;

const PROGRAM: &str = "stylet-live";

/// The serving program, ended when this is dropped.
pub struct Server {
    child: Child,
    messages: Option<ChildStdin>,
}

/// Starts the program, which prints its own address.
pub fn start(address: &str) -> Result<Server, RecordError> {
    let mut child = Command::new(beside())
        .args(["--listen", address])
        .stdin(Stdio::piped())
        .spawn()
        .map_err(|e| {
            RecordError::Live(format!(
                "cannot be started ({e}): 'make live' builds it; it belongs beside host-ui"
            ))
        })?;
    let messages = child.stdin.take();
    Ok(Server { child, messages })
}

/// Returns the program's path: in this program's folder, or found by the shell.
fn beside() -> PathBuf {
    let here = std::env::current_exe().ok();
    let here = here.and_then(|here| here.parent().map(|folder| folder.join(PROGRAM)));
    here.filter(|program| program.exists())
        .unwrap_or_else(|| PROGRAM.into())
}

impl Server {
    /// Sends until all senders are gone.
    pub fn send(mut self, from: &mpsc::Receiver<Item>) -> Result<Totals, RecordError> {
        match self.messages.take() {
            Some(messages) => writer::send_all(messages, from),
            None => Err(RecordError::Live("it has no input".to_owned())),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Closes its input, at which it ends.
        self.messages = None;
        let _ = self.child.wait();
    }
}
