//! A session for viewers while it runs: the messages of a recording, given to the program `stylet-live`, which serves them.
//!
//! That program is built by `make live` alone: the crates that it serves with are no part of the workspace.

use super::error::RecordError;
use super::writer::{self, Item, Totals};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc;

const PROGRAM: &str = "stylet-live";

/// The program that serves, ended with this.
pub struct Server {
    child: Child,
    messages: Option<ChildStdin>,
}

/// Starts it; it says itself where it listens.
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

/// Beside this program, or wherever the shell finds it.
fn beside() -> PathBuf {
    let here = std::env::current_exe().ok();
    let here = here.and_then(|here| here.parent().map(|folder| folder.join(PROGRAM)));
    here.filter(|program| program.exists())
        .unwrap_or_else(|| PROGRAM.into())
}

impl Server {
    /// Until nobody sends any more.
    pub fn send(mut self, from: &mpsc::Receiver<Item>) -> Result<Totals, RecordError> {
        match self.messages.take() {
            Some(messages) => writer::send_all(messages, from),
            None => Err(RecordError::Live("it has no input".to_owned())),
        }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // Its input is closed, at which it ends.
        self.messages = None;
        let _ = self.child.wait();
    }
}
